"""Reports as one self-contained HTML file: plots as SVG, tables and text, nothing from outside.

`page` puts a page together, `plots` draws; experiments, diagnosis and demo use both.
"""
