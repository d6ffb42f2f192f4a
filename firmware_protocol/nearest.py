"""What to say of a name that is not known: the nearest that is, or where all of them are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_FEW = 9
"""So many names are told whole; more are a wall of text in which nobody finds one."""
_LIKE = 0.5
_NEAR = 0.15
"""A second name is told where it is about as like; beside a plain slip it would only confuse."""


def nearest(name: str, known: Iterable[str], at_most: int = 2) -> list[str]:
    """Return the known names that are spelt like `name`, the likest first; case does not count."""
    by_lower = {spelling.lower().replace("-", "_"): spelling for spelling in known}
    typed = name.lower().replace("-", "_")
    matches = difflib.get_close_matches(typed, by_lower, n=at_most, cutoff=_LIKE)
    likeness = [difflib.SequenceMatcher(None, spelling, typed).ratio() for spelling in matches]
    return [
        by_lower[spelling]
        for spelling, like in zip(matches, likeness, strict=True)
        if like > likeness[0] - _NEAR
    ]


def instead(name: str, known: Iterable[str], where: str = "") -> str:
    """Return what to say after "there is no `name`": did you mean, or which there are.

    `where` says what lists all of them, such as "smad gap effects lists them"; it is told where
    nothing is spelt like `name` and there are too many to name.
    """
    names = list(known)
    if near := nearest(name, names):
        return f"did you mean {' or '.join(near)}?"
    if len(names) <= _FEW or not where:
        return f"there are {', '.join(names)}" if names else "there are none"
    return f"there are {len(names)}; {where}"
