"""Benchmarks: `make bench` or `python -m bench` runs them all, `python -m bench.NAME` one.

They are not part of the package: they start processes, read clocks and print figures.
"""
