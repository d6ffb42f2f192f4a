"""How a bench ages: a record with a row for each run and check-up, its trends, and a page.

`record` is the file, `measure`, `cycles` and `collect` make rows, `trends` is the statistics,
`report` shows.
"""
