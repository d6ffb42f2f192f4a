"""Rivals: models of the bench, each fitted as a whole, judged by what it leaves of other runs."""
