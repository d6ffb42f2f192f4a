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
from smad.diagnosis.verdict import CHECK_UP

STRENGTHS = (1.0, 3.0, 10.0)
_LITTLE = 0.2
SILENT = frozenset(("quiet", "parameters", "refused"))
"""Outcomes that claim no more than other values of the parameters."""
NAMED = 0.5
"""An effect is named from so much probability on, that of no effect of the library included."""


class TrueEffect(msgspec.Struct, frozen=True):
    """An effect that was at work, and where the model can hold it.

    `gap_alone` is what it changes without the other one of a pair, in floors; 0 in older keys.
    """

    name: str
    places: list[str]
    known: bool = True
    gap_alone: float = 0.0


class Difference(msgspec.Struct, frozen=True):
    """One difference between the plant and the nominal model, and the places that can hold it."""

    places: list[str]


class CaseKey(msgspec.Struct, frozen=True):
    """What is true of a case; `gap_worst` in floors, `bench` the number of a check-up's bench."""

    kind: str
    question: str = CHECK_UP
    effects: list[TrueEffect] = []
    gap_worst: float = 0.0
    bench: int = 0
    differences: list[Difference] = msgspec.field(default_factory=list, name="own")


class Key(msgspec.Struct, frozen=True):
    """A whole key."""

    format: Literal["smad-key-1"]
    bank: str
    cases: dict[str, CaseKey]


class Cause(msgspec.Struct, frozen=True):
    """A cause that was reported: its place, and the effects of the library that it may be.

    `probability` is that of the place, `names` are effects with their probabilities if it is one of
    the library, `outside` the probability that it is none. `credible_places` are
    reported with it.
    """

    place: str
    name: str = ""
    probability: float = 0.0
    names: dict[str, float] = {}
    outside: float = 0.0
    credible_places: list[str] = []

    @property
    def likeliest(self) -> str:
        """The likeliest effect; empty where none was asked."""
        return max(self.names, key=lambda n: self.names[n], default="")

    @property
    def name_probability(self) -> float:
        """That of the likeliest effect, with what is none of the library counted."""
        return (1.0 - self.outside) * max(self.names.values(), default=0.0)

    @property
    def reported_name(self) -> str:
        """The likeliest effect where it is reported; else empty."""
        return self.likeliest if self.name_probability >= NAMED else ""

    @property
    def reported_places(self) -> set[str]:
        """Places that are reported, its own among them."""
        return {self.place, *self.credible_places} - {""}


class Whole(msgspec.Struct, frozen=True):
    """The gap of all signals in floors: with other parameters, and with causes beside."""

    parameters: float
    causes: list[float] = []

    @property
    def final(self) -> float:
        """With everything that is reported."""
        return (self.causes or [self.parameters])[-1]

    @property
    def gone(self) -> float | None:
        """Share of what is above the floor that goes; None where little is above."""
        above = self.parameters**2 - 1.0
        if above < _LITTLE:
            return None
        return min(max((self.parameters**2 - self.final**2) / above, -1.0), 1.0)


class LeftOut(msgspec.Struct, frozen=True):
    """The answer of a library that lacks the right entry: places and name."""

    outcome: str
    places: list[str] = []
    name: str = ""


class Scored(msgspec.Struct, frozen=True):
    """A rival of the first step: its kind, and how well it predicts each judged run."""

    kind: str
    name: str
    scores: list[float]


class Answer(msgspec.Struct, frozen=True):
    """What was said of a case."""

    outcome: str
    causes: list[Cause] = []
    whole: Whole | None = None
    seconds: float = 0.0
    first_step: list[Scored] = []
    left_out: dict[str, LeftOut] = {}

    @property
    def least_misfit(self) -> str:
        """The effect that leaves least, whatever its probability; empty where none was asked."""
        effects = [r for r in self.first_step if r.kind == "effect"]
        return max(effects, key=lambda r: sum(r.scores)).name if effects else ""


class Tool(msgspec.Struct, frozen=True):
    """What answered: the digest of its code, and the processor time of each case where measured."""

    source_sha256: str = ""
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
        raw = self.verdicts[case]
        return msgspec.structs.replace(raw, seconds=self.tool.cpu_s.get(case, raw.seconds))


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
    def first(self) -> Cause:
        """The first cause reported; an empty one where none was."""
        return self.said.causes[0] if self.said.causes else Cause("")

    @property
    def true_places(self) -> set[str]:
        """Where the model can hold its effects."""
        return {p for e in self.truth.effects for p in e.places}

    @property
    def true_names(self) -> set[str]:
        """Its effects, as keys call them."""
        return {e.name for e in self.truth.effects}

    @property
    def placed(self) -> bool:
        """Whether the first place is right."""
        return self.first.place in self.true_places

    @property
    def likeliest_right(self) -> bool:
        """Whether the likeliest effect of the first cause is right, reported or not."""
        return canonical(self.first.likeliest) in self.true_names

    @property
    def named(self) -> bool:
        """Whether the first cause is reported by name, and the name is right."""
        return bool(self.first.reported_name) and self.likeliest_right


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


def read_key(path: Path) -> Key:
    """A key. Raises WithheldError for a file that is none."""
    return _read(path, Key, "key")


def read_pairs(verdicts: Path, key: Path, *, answered_only: bool = False) -> tuple[Key, list[Pair]]:
    """The key, and its cases with what was said of them; a case without an answer is refused.

    With `answered_only` it is left out instead. Raises WithheldError for a file that is neither,
    KeyMismatchError when the two do not belong together.
    """
    file, truth = _read(verdicts, AnswerFile, "file of answers"), read_key(key)
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


def source_of(verdicts: Path) -> str:
    """SHA-256 of the code that answered (`checkout.source_digest`); empty where it was not kept."""
    return _read(verdicts, AnswerFile, "file of answers").tool.source_sha256
