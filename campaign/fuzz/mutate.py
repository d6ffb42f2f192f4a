"""Mutations that know lines, values and words; atheris mixes them with its own.

By themselves, from a seed, they are the bounded run where atheris is not there.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Sequence

from campaign.fuzz.targets import Target
from campaign.fuzz.words import dictionary

_WORD = re.compile(r'^"(.*)"$', re.MULTILINE)
_MOST_CHANGES = 6
_VALUE = re.compile(rb"^([^=\n]*[=:])([^\n]*)$", re.MULTILINE)
_VALUES = (
    *(b"0", b"-1", b"1e999", b"1e300", b"nan", b"-inf", b"1e-320", b"9" * 400, b"1" + b"0" * 5000),
    *(
        b'""',
        b'"\\u0000"',
        b'"\\n"',
        b'"\\U0001F600"',
        b"'\\'",
        b"true",
        b"null",
        b'"' + b"x" * 200 + b'"',
    ),
    *(b"[]", b"{}", b"[[1]]", b"{a = {}}", b'{"a": {}}', b"[" * 900, b"2026-01-01", b"[1, 0]"),
    *(b'"/"', b'"."', b'"A"', b'"set_a.toml"'),
)
_NUMBERS = (
    b"\0",
    b"\xff",
    b"\x7f",
    b"\x80",
    b"\0\0\0\0",
    b"\xff" * 8,
    b"-1",
    b"1e999",
    b"1e300",
    b"0",
)


class Mutator:
    """Changes inputs of one target; `others` are what it may splice in."""

    def __init__(self, target: Target, others: Sequence[bytes], rng: random.Random) -> None:
        self._rng = rng
        self._changes = _changes(rng, [*_NUMBERS, *_words(target)], others)

    def change(self, data: bytes) -> bytes:
        """Return the input with a few changes."""
        for _ in range(self._rng.randint(1, _MOST_CHANGES)):
            data = self._rng.choice(self._changes)(data)
        return data


def mutations(target: Target, corpus: Sequence[bytes], count: int, seed: int) -> Iterator[bytes]:
    """Yield `count` inputs, each made from one of the corpus by a few changes."""
    rng = random.Random(f"{target.name} {seed}")
    mutator = Mutator(target, corpus, rng)
    for _ in range(count):
        yield mutator.change(rng.choice(corpus))[: target.longest]


def _words(target: Target) -> list[bytes]:
    return [
        word.encode("latin-1").decode("unicode_escape").encode("latin-1")
        for word in _WORD.findall(dictionary(target))
    ]


def _changes(
    rng: random.Random, words: Sequence[bytes], corpus: Sequence[bytes]
) -> tuple[Callable[[bytes], bytes], ...]:
    def position(data: bytes) -> int:
        return rng.randint(0, len(data))

    def flip(data: bytes) -> bytes:
        if not data:
            return data
        changed = bytearray(data)
        changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        return bytes(changed)

    def drop(data: bytes) -> bytes:
        start = position(data)
        return data[:start] + data[start + rng.randint(1, 16) :]

    def insert(data: bytes) -> bytes:
        start = position(data)
        return data[:start] + rng.choice(words) + data[start:]

    def replace(data: bytes) -> bytes:
        start, word = position(data), rng.choice(words)
        return data[:start] + word + data[start + len(word) :]

    def repeat(data: bytes) -> bytes:
        start = position(data)
        piece = data[start : start + rng.randint(1, 32)]
        return data[:start] + piece * rng.randint(2, 8) + data[start:]

    def splice(data: bytes) -> bytes:
        other = rng.choice(corpus)
        return data[: position(data)] + other[position(other) :]

    def set_value(data: bytes) -> bytes:
        places = list(_VALUE.finditer(data))
        if not places:
            return insert(data)
        place = rng.choice(places)
        value = rng.choice(_VALUES if rng.random() < 0.7 else words)
        return data[: place.start(2)] + b" " + value + data[place.end(2) :]

    def move_line(data: bytes) -> bytes:
        lines = data.split(b"\n")
        line = lines.pop(rng.randrange(len(lines)))
        for _ in range(rng.randrange(3)):
            lines.insert(rng.randint(0, len(lines)), line)
        return b"\n".join(lines)

    return flip, drop, insert, replace, repeat, splice, set_value, move_line
