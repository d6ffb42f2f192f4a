"""Verdict files: what a diagnosis hands in for each case (docs/guide/check-your-own-bank.md)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from smad.diagnosis.bank.errors import VerdictError
from smad.diagnosis.bank.names import OUTCOMES, SUBSYSTEM_ALIASES, canonical, subsystem_of

FORMAT = "smad-verdicts-1"
NOT_CAUSES = frozenset(("none", "parameters", "unknown"))
NO_CAUSES = ("parameters", "rest")
"""What a budget holds besides causes."""


class Hypothesis(msgspec.Struct, frozen=True):
    """One ranked answer: effects that act together, or ["none"], ["parameters"], ["unknown"]."""

    names: list[str]
    probability: float


class Estimate(msgspec.Struct, frozen=True):
    """A comparable quantity of an effect with its 95 % interval.

    evaluation/bank/quantities.py says what each is.
    """

    value: float
    low: float
    high: float


class HeldOut(msgspec.Struct, frozen=True):
    """RMS of one signal's residual on the held-out runs, in the signal's unit."""

    raw: float
    refit: float
    effect: float
    floor: float


class NextExperiment(msgspec.Struct, frozen=True):
    """The recommended experiment, and which names it tells apart."""

    name: str
    separates: list[str] = []


class Short(msgspec.Struct, frozen=True):
    """A verdict reduced to outcome and names, with one effect left out."""

    outcome: str
    names: list[str] = []


class CaseVerdict(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """All that is said about one case.

    `budget` is the share of the raw gap on the held-out runs, all signals together, that goes to
    the parameters, to each cause in turn and to the rest.
    """

    outcome: str
    causes: list[Hypothesis] = []
    group: list[str] = []
    subsystem: str = ""
    regime: str = ""
    held_out: dict[str, HeldOut] = {}
    budget: dict[str, float] = {}
    shrink: float | None = None
    quantities: dict[str, Estimate] = {}
    next_experiment: NextExperiment | None = None
    left_out: dict[str, Short] = {}
    seconds: float | None = None

    @property
    def first(self) -> tuple[str, ...]:
        """Names of the first hypothesis, without the answers that name no cause."""
        names = self.causes[0].names if self.causes else []
        return tuple(sorted(n for n in names if n not in NOT_CAUSES))


class VerdictFile(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A whole verdict file. `notes` says of a case why it has no verdict, or what to know of it."""

    format: Literal["smad-verdicts-1"]
    bank: str
    key_sha256: str
    verdicts: dict[str, CaseVerdict]
    tool: dict[str, Any] = {}
    notes: dict[str, str] = {}


def _checked(case: str, verdict: CaseVerdict) -> None:
    allowed = sorted(set(OUTCOMES.values()))
    if verdict.outcome not in allowed:
        raise VerdictError(
            f"{case} has an unknown outcome",
            value=verdict.outcome,
            limit=", ".join(allowed),
            action="correct it",
        )
    order = [h.probability for h in verdict.causes]
    if any(not 0.0 <= p <= 1.0 for p in order) or sum(order) > 1.0 + 1e-6:
        raise VerdictError(
            f"{case}: probabilities of the causes",
            value=order,
            limit="each in 0…1, together at most 1",
            action="normalise them",
        )
    if order != sorted(order, reverse=True):
        raise VerdictError(
            f"{case}: causes must be ranked, most probable first", value=order, action="sort them"
        )


def _merged(causes: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Hypotheses in the bank's names; several that then say the same become one."""
    together: dict[tuple[str, ...], float] = {}
    for h in causes:
        names = tuple(dict.fromkeys(_named(h.names)))
        known = next((k for k in together if set(k) == set(names)), names)
        together[known] = together.get(known, 0.0) + h.probability
    ranked = sorted(together.items(), key=lambda pair: -pair[1])
    return [Hypothesis(list(names), p) for names, p in ranked]


def _named(names: Sequence[str]) -> list[str]:
    return [canonical(n) for n in names]


def in_bank_names(verdict: CaseVerdict) -> CaseVerdict:
    """The verdict in the bank's names; without a subsystem, that of the first cause."""
    causes = _merged(verdict.causes)
    subsystem = SUBSYSTEM_ALIASES.get(verdict.subsystem, verdict.subsystem)
    if not subsystem and causes and causes[0].names:
        subsystem = subsystem_of(causes[0].names[0])
    budget: dict[str, float] = {}
    for name, part in verdict.budget.items():
        budget[canonical(name)] = budget.get(canonical(name), 0.0) + part
    if (after := verdict.next_experiment) is not None:
        after = NextExperiment(after.name, _named(after.separates))
    return msgspec.structs.replace(
        verdict,
        causes=causes,
        group=_named(verdict.group),
        subsystem=subsystem,
        budget=budget,
        quantities={canonical(n): q for n, q in verdict.quantities.items()},
        left_out={
            canonical(n): Short(s.outcome, _named(s.names)) for n, s in verdict.left_out.items()
        },
        next_experiment=after,
    )


def read_verdict_file(path: Path) -> VerdictFile:
    """A checked verdict file as it stands. Raises VerdictError, which says what is wrong where."""
    try:
        file = msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    except OSError as error:
        raise VerdictError(
            f"{path} cannot be read", value=error.strerror, action="check the path"
        ) from error
    except msgspec.DecodeError as error:
        raise VerdictError(
            f"{path} is not a verdict file",
            value=str(error),
            limit=FORMAT,
            action="see “Verdicts” in smad docs guide/check-your-own-bank",
        ) from error
    for case, verdict in file.verdicts.items():
        _checked(case, verdict)
    return file


def read_verdicts(path: Path) -> VerdictFile:
    """A checked verdict file in the bank's names. Raises VerdictError as `read_verdict_file`."""
    file = read_verdict_file(path)
    named = {case: in_bank_names(v) for case, v in file.verdicts.items()}
    return msgspec.structs.replace(file, verdicts=named)


def write_verdicts(path: Path, file: VerdictFile) -> None:
    """Writes a verdict file as indented JSON; a reader never sees half of one."""
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(msgspec.json.format(msgspec.json.encode(file), indent=1) + b"\n")
    partial.replace(path)
