"""Keys and answers as they are read for scoring, and a case with both.

Only what is scored is read; the form of answers is in evaluation/run/running.py.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import msgspec

from evaluation.errors import KeyMismatchError, WithheldError
from evaluation.names import canonical

CHECK_UP, CHANGED, DIFFERS = "check-up", "changed", "differs"
STRENGTHS = (1.0, 3.0, 10.0)
_LITTLE = 0.2
SILENT = frozenset(("quiet", "parameters", "refused", "contradicting"))
"""Outcomes that do not say where the bench has changed."""


class TrueEffect(msgspec.Struct, frozen=True):
    """An effect that was at work: where the model can hold it, and the states of its law."""

    name: str
    places: list[str]
    states: list[str]
    side: Literal["x", "y", "both"]
    known: bool = True


class Difference(msgspec.Struct, frozen=True):
    """One difference between the plant and the nominal model, and the places that can hold it."""

    places: list[str]


class CaseKey(msgspec.Struct, frozen=True):
    """What is true of a case; `gap_worst` in floors."""

    kind: str
    question: str = CHECK_UP
    effects: list[TrueEffect] = []
    gap_worst: float = 0.0
    own: list[Difference] = []


class Key(msgspec.Struct, frozen=True):
    """A whole key."""

    format: Literal["smad-key-1"]
    bank: str
    cases: dict[str, CaseKey]


class Term(msgspec.Struct, frozen=True):
    """A term of a law; `name` begins with its state, empty for a constant."""

    name: str = ""
    state: str | None = None

    @property
    def of(self) -> str:
        """Its state, as keys call it."""
        said = self.state if self.state is not None else self.name.split(" ")[0]
        return said or "constant"


class Place(msgspec.Struct, frozen=True):
    """A place that was told, with its law and its name (empty for none).

    `probabilities` are those of `near_places`, `names` those of effects.
    """

    place: str
    side: str = "both"
    near_places: list[str] = []
    terms: list[Term] = []
    name: str = ""
    probabilities: list[float] = []
    names: dict[str, float] = {}

    @property
    def probability(self) -> float | None:
        """The place's own probability; None where none was told."""
        return self.probabilities[0] if self.probabilities else None

    @property
    def name_probability(self) -> float:
        """That of the likeliest effect at the place."""
        return max(self.names.values(), default=0.0)

    @property
    def near(self) -> set[str]:
        """Places that are told as nearly as likely, itself among them."""
        return {self.place, *self.near_places}


class Whole(msgspec.Struct, frozen=True):
    """The gap of all signals in floors: with other parameters, and with laws beside."""

    parameters: float
    places: list[float] = []

    @property
    def gone(self) -> float | None:
        """Share of what is above the floor that goes with the laws; None where little is above."""
        after = (self.places or [self.parameters])[-1]
        above = self.parameters**2 - 1.0
        if above < _LITTLE:
            return None
        return min(max((self.parameters**2 - after**2) / above, -1.0), 1.0)


class Short(msgspec.Struct, frozen=True):
    """What a simpler rule says, or a library that lacks the right entry."""

    outcome: str
    names: list[str] = []
    places: list[str] = []


class Answer(msgspec.Struct, frozen=True):
    """What was said of a case."""

    outcome: str
    places: list[Place] = []
    whole: Whole | None = None
    seconds: float = 0.0
    baselines: dict[str, Short] = {}
    left_out: dict[str, Short] = {}


class Tool(msgspec.Struct, frozen=True):
    """What answered; `cpu_s` is the processor time of each case, where it was measured."""

    cpu_s: dict[str, float] = {}


class AnswerFile(msgspec.Struct, frozen=True):
    """All answers to a bank."""

    key_sha256: str
    verdicts: dict[str, Answer]
    tool: Tool = Tool()

    def answer(self, case: str) -> Answer:
        """The answer to a case with its processor time; a refusal where there is none."""
        if case not in self.verdicts:
            return Answer("refused")
        said = self.verdicts[case]
        return msgspec.structs.replace(said, seconds=self.tool.cpu_s.get(case, said.seconds))


@dataclass(frozen=True)
class Pair:
    """A case: what is true of it, and what was said."""

    case: str
    truth: CaseKey
    said: Answer

    @property
    def noticed(self) -> bool:
        """Whether something was said to have changed, other than parameters."""
        return self.said.outcome not in SILENT

    @property
    def strength(self) -> float:
        """The nearest of 1, 3, 10 floors to the gap that was reached."""
        return min(STRENGTHS, key=lambda s: abs(math.log(max(self.truth.gap_worst, 1e-3) / s)))

    @property
    def first(self) -> Place:
        """The first place told; an empty one where none was."""
        return self.said.places[0] if self.said.places else Place("")

    @property
    def true_places(self) -> set[str]:
        """Where the model can hold its effects."""
        return {p for e in self.truth.effects for p in e.places}

    @property
    def placed(self) -> bool:
        """Whether the first place is right."""
        return self.first.place in self.true_places

    @property
    def given(self) -> list[str]:
        """The names given, in the order of their places, as keys call them."""
        return [canonical(p.name) for p in self.said.places if p.name]

    @property
    def named(self) -> bool:
        """Whether the first place has a name, and it is right."""
        return canonical(self.first.name) in {e.name for e in self.truth.effects}


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


_Form = TypeVar("_Form", Key, AnswerFile)


def _read(path: Path, form: type[_Form], what: str) -> _Form:
    try:
        return msgspec.json.decode(path.read_bytes(), type=form)
    except OSError as error:
        raise WithheldError(f"{path} cannot be read ({error.strerror}): check the path") from None
    except msgspec.DecodeError as error:
        raise WithheldError(f"{path} is no {what} ({error}): give another file") from None


def read_pairs(verdicts: Path, key: Path, *, answered_only: bool = False) -> tuple[Key, list[Pair]]:
    """The key, and its cases with what was said of them; a case without an answer is refused.

    With `answered_only` it is left out instead. Raises WithheldError for a file that is neither,
    KeyMismatchError when the two do not belong together.
    """
    file, truth = _read(verdicts, AnswerFile, "file of answers"), _read(key, Key, "key")
    if file.key_sha256 != digest(key):
        raise KeyMismatchError(
            f"the answers are on a bank with the key {file.key_sha256[:12] or 'none'}…, not "
            f"{digest(key)[:12]}…: score them with the key of their own bank"
        )
    strangers = sorted(set(file.verdicts) - set(truth.cases))
    if strangers:
        raise KeyMismatchError(f"the key has no {', '.join(strangers[:3])}: remove the answers")
    return truth, [
        Pair(c, entry, file.answer(c))
        for c, entry in truth.cases.items()
        if c in file.verdicts or not answered_only
    ]
