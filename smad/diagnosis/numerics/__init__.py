"""Numerical methods: bounded steps, forward selection, lags, white rows, threads."""
