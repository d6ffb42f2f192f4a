"""Where a bench and its reference disagree, which law is missing there, and what it is called.

`docs/where.md` has the types and the data flow.
"""
