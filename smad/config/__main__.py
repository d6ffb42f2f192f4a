"""`python -m smad.config` prints a configuration file: every key, its default and its limits.

With `--guide` it prints the tables of docs/guide/configuration.md.
"""

import sys

from smad.config.template import default_toml, markdown_tables

print(markdown_tables() if sys.argv[1:] == ["--guide"] else default_toml(), end="")
