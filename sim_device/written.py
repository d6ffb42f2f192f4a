"""Numbers as they are written on a command line."""

from __future__ import annotations


def numbers_by_name(text: str) -> dict[str, float]:
    """Values of `NAME=NUMBER,…`; empty for an empty text. Raises ValueError with the wrong part."""
    values = {}
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            raise ValueError(part) from None
    return values
