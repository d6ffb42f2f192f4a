"""The latest things that were made of an object, kept for as long as they are likely asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

_Source = TypeVar("_Source")
_Made = TypeVar("_Made")


class Recent(Generic[_Source, _Made]):
    """What was made of the latest `most` sources, found by the identity of the source.

    A source is kept beside what was made of it, so that no other object takes its identity. It must
    not change. Several threads may ask: at worst two make the same thing. A copy sent elsewhere
    begins empty.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._made: dict[int, tuple[_Source, _Made]] = {}

    def __len__(self) -> int:
        return len(self._made)

    def __reduce__(self) -> tuple[type[Recent[_Source, _Made]], tuple[int]]:
        return type(self), (self._most,)

    def of(self, source: _Source, make: Callable[[], _Made]) -> _Made:
        """What was made of `source`; made now if it is not kept."""
        known = self._made.get(id(source))
        if known is not None and known[0] is source:
            return known[1]
        made = make()
        # A list at once: another thread may add to the dictionary meanwhile.
        for old in list(self._made)[: len(self._made) - self._most + 1]:
            self._made.pop(old, None)
        self._made[id(source)] = source, made
        return made
