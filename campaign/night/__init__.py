"""A night of the queue: items, troubles, a person who comes after each pause, and what is left.

`draws` says what goes wrong and when, `run` carries the night out on real processes whose bench
goes faster than the wall clock, `report` says what came of it and what a week would take.
"""
