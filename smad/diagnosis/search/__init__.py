"""Decides where, which law and what name; reads products, never fits or files."""
