"""Numbers as they are written on a command line."""

from __future__ import annotations


def numbers_by_name(text: str) -> dict[str, float]:
    """Values of `NAME=NUMBER,…`; empty for an empty text. Raises ValueError with what is wrong."""
    values: dict[str, float] = {}
    for part in filter(None, text.split(",")):
        written, _, number = part.partition("=")
        name = written.strip()
        if name in values:
            raise ValueError(f"{name} is given twice; give it once")
        try:
            values[name] = float(number)
        except ValueError:
            raise ValueError(f"the value of {name} is not a number") from None
    return values
