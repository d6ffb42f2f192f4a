"""How a bench ages: a record with a row for each run and check-up, its trends, and a page.

`record` is the file, `measure` and `verdicts` make rows, `trends` is the statistics, `page` shows.
"""
