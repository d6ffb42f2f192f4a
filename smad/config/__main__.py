"""`python -m smad.config` prints the tables of docs/guide/configuration.md."""

from smad.config.template import markdown_tables

print(markdown_tables(), end="")
