"""Reports as one self-contained HTML file: plots, tables and text, nothing from outside.

`page` puts a page together, `plots` draws what is printed, `panels` what the page itself draws and
zooms; `runs` makes panels of run logs. Experiments, diagnosis and demo use them.
"""
