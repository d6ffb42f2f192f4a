"""Causes against each other: which are taken, what each is worth, which verdict follows."""
