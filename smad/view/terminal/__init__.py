"""What is shown on a terminal: tables and progress as wide as it is, and the live bench.

Of that `screen` makes the lines, `watch` shows them and takes the keys.
"""
