"""Reading a key: what is true of each case of a bank. Only scoring opens one."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Literal

import msgspec

from smad.diagnosis.bank.errors import KeyMismatchError

FORMAT = "smad-key-1"
SEALED = "sealed"
"""Bank whose key the repository guards: see evaluation/README.md."""

STRENGTHS = (1.0, 3.0, 10.0)
Kind = Literal[
    "none", "parameters", "single", "unknown", "pair", "triple", "differs",
    "room", "preload", "drift",
]  # fmt: skip
"""The last three have no effect: the day is unlike the good ones."""


class TrueEffect(msgspec.Struct, frozen=True):
    """An effect that was at work; `quantity` is its comparable magnitude where it has one."""

    name: str
    subsystem: str
    quantity: float | None = None


class CaseKey(msgspec.Struct, frozen=True):
    """What is true of one case.

    `gap` is that of each channel, in the `floor` of that channel, which is in its unit; `gap_worst`
    is the largest of them. A key of check-ups has `gap_paired` instead, over two good days.
    """

    kind: Kind
    effects: list[TrueEffect] = []
    gap_worst: float = 0.0
    gap: dict[str, float] = {}
    gap_paired: dict[str, float] = {}
    floor: dict[str, float] = {}
    shrink_exact_law: float | None = None

    @property
    def names(self) -> frozenset[str]:
        """The effects at work."""
        return frozenset(e.name for e in self.effects)

    @property
    def subsystems(self) -> frozenset[str]:
        """The subsystems they sit in."""
        return frozenset(e.subsystem for e in self.effects)

    @property
    def strength(self) -> float:
        """The nearest of 1, 3, 10 floors to the gap really reached; 0 without an effect."""
        if not self.effects:
            return 0.0
        return min(STRENGTHS, key=lambda s: abs(math.log(max(self.gap_worst, 1e-3) / s)))

    @property
    def right_answer(self) -> frozenset[str]:
        """What the first hypothesis should say, the answers that name no cause included."""
        if self.kind in ("parameters", "unknown"):
            return frozenset((self.kind,))
        return self.names or frozenset(("none",))


class Key(msgspec.Struct, frozen=True):
    """A whole key."""

    format: Literal["smad-key-1"]
    bank: str
    cases: dict[str, CaseKey]


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_key(path: Path) -> tuple[Key, str]:
    """A key and its SHA-256. Raises KeyMismatchError when the file is not a key."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Key), file_digest(path)
    except OSError as error:
        raise KeyMismatchError(
            f"{path} cannot be read", value=error.strerror, action="give the key of the bank"
        ) from error
    except msgspec.DecodeError as error:
        raise KeyMismatchError(
            f"{path} is not a key",
            value=str(error),
            limit=FORMAT,
            action="see “The key” in smad docs guide/check-your-own-bank",
        ) from error
