"""What a long computation reports its progress to."""

from collections.abc import Callable

Say = Callable[[str], None]
"""Takes a sentence on what is going on now."""

Share = Callable[[float], None]
"""Takes the share that is done, 0 to 1."""


def silent(news: str | float) -> None:
    """Say nothing: the default of what reports."""
