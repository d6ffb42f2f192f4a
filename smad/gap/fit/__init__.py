"""Fits, and how well a fit predicts runs that it has not seen."""
