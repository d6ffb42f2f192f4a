"""Verdict files: what a diagnosis hands in for each case (docs/withheld.md describes the form)."""

from pathlib import Path
from typing import Any, Literal

import msgspec

from tests.withheld.errors import VerdictError
from tests.withheld.vocabulary import OUTCOMES, canonical, canonical_subsystem, subsystem_of

FORMAT = "smad-verdicts-1"
NOT_CAUSES = frozenset(("none", "parameters", "unknown"))


class Hypothesis(msgspec.Struct, frozen=True):
    """One ranked answer: effects that act together, or ["none"], ["parameters"], ["unknown"]."""

    names: list[str]
    probability: float


class Estimate(msgspec.Struct, frozen=True):
    """A comparable quantity of an effect with its 95 % interval (docs/withheld.md lists them)."""

    value: float
    low: float
    high: float


class HeldOut(msgspec.Struct, frozen=True):
    """RMS of one signal on the held-out runs, in the signal's unit."""

    raw: float
    refit: float
    effect: float
    floor: float


class NextExperiment(msgspec.Struct, frozen=True):
    """The recommended experiment, and what the verdict was after it was run (if it was)."""

    name: str
    separates: list[str] = []
    names_after: list[str] | None = None


class Short(msgspec.Struct, frozen=True):
    """A verdict reduced to outcome and names: baselines, and with one effect left out."""

    outcome: str
    names: list[str] = []


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """All that is said about one case."""

    outcome: str
    causes: list[Hypothesis] = []
    group: list[str] = []
    subsystem: str = ""
    regime: str = ""
    held_out: dict[str, HeldOut] = {}
    shrink: float | None = None
    shrink_best_entry: float | None = None
    quantities: dict[str, Estimate] = {}
    next_experiment: NextExperiment | None = None
    left_out: dict[str, Short] = {}
    baselines: dict[str, Short] = {}
    seconds: float | None = None

    @property
    def first(self) -> tuple[str, ...]:
        """Names of the first hypothesis, without the answers that name no cause."""
        names = self.causes[0].names if self.causes else []
        return tuple(sorted(n for n in names if n not in NOT_CAUSES))


class VerdictFile(msgspec.Struct, frozen=True, kw_only=True):
    """A whole verdict file."""

    format: Literal["smad-verdicts-1"]
    bank: str
    key_sha256: str
    verdicts: dict[str, Verdict]
    tool: dict[str, Any] = {}
    aliases: dict[str, str] = {}


def _checked(case: str, verdict: Verdict) -> None:
    if verdict.outcome not in OUTCOMES:
        raise VerdictError(
            f"{case}: outcome {verdict.outcome!r} is none of {', '.join(OUTCOMES)}; correct it"
        )
    total = sum(h.probability for h in verdict.causes)
    wrong = [h.probability for h in verdict.causes if not 0.0 <= h.probability <= 1.0]
    if wrong or total > 1.0 + 1e-6:
        raise VerdictError(
            f"{case}: probabilities must lie in 0…1 and sum to at most 1, "
            f"not {wrong or round(total, 4)}; normalise them"
        )
    order = [h.probability for h in verdict.causes]
    if order != sorted(order, reverse=True):
        raise VerdictError(f"{case}: causes must be ranked, most probable first; sort them")


def _short(short: Short, extra: dict[str, str]) -> Short:
    return Short(short.outcome, [canonical(n, extra) for n in short.names])


def in_bank_names(verdict: Verdict, extra: dict[str, str]) -> Verdict:
    """The verdict in the bank's names; without a subsystem, that of the first cause."""
    causes = [
        Hypothesis([canonical(n, extra) for n in h.names], h.probability) for h in verdict.causes
    ]
    subsystem = canonical_subsystem(verdict.subsystem)
    if not subsystem and causes and causes[0].names:
        subsystem = subsystem_of(causes[0].names[0])
    after = verdict.next_experiment
    if after is not None:
        seen = after.names_after
        after = NextExperiment(
            after.name,
            [canonical(n, extra) for n in after.separates],
            None if seen is None else [canonical(n, extra) for n in seen],
        )
    return msgspec.structs.replace(
        verdict,
        causes=causes,
        group=[canonical(n, extra) for n in verdict.group],
        subsystem=subsystem,
        quantities={canonical(n, extra): q for n, q in verdict.quantities.items()},
        left_out={canonical(n, extra): _short(s, extra) for n, s in verdict.left_out.items()},
        baselines={n: _short(s, extra) for n, s in verdict.baselines.items()},
        next_experiment=after,
    )


def read_verdicts(path: Path) -> VerdictFile:
    """A checked verdict file in the bank's names; VerdictError says what is wrong where."""
    try:
        file = msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    except FileNotFoundError:
        raise VerdictError(f"{path} does not exist: check the path") from None
    except (msgspec.ValidationError, msgspec.DecodeError) as error:
        raise VerdictError(f"{path}: {error}; see docs/withheld.md for the form") from None
    for case, verdict in file.verdicts.items():
        _checked(case, verdict)
    extra = {k.lower(): v for k, v in file.aliases.items()}
    named = {case: in_bank_names(v, extra) for case, v in file.verdicts.items()}
    return msgspec.structs.replace(file, verdicts=named)
