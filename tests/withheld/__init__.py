"""The withheld check: an independent plant, banks of runs with sealed answers, and a quiz.

Nothing that makes a bank may import the product's plant or its diagnosis; a test enforces that.
Start with `docs/withheld.md`.
"""
