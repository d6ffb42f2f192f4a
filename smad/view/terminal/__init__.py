"""The live bench on a terminal: `screen` makes the lines, `watch` shows them and takes the keys."""
