"""Runs with equal inputs on two days: their difference, and the floor of repeats."""
