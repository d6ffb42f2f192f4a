"""From numbers to one of seven verdicts, with its probability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.gap.compare.assess import Worth
from smad.gap.records import NAMED, Outcome
from smad.gap.settings import Settings


@dataclass(frozen=True)
class StandsOut:
    """The output in which runs differ most from known-good ones, where no effect is added.

    By how many of the `spreads` that good runs differ in it, whether their parameters are kept or
    all are refitted. `channel` is what it predicts.
    """

    output: str
    channel: str
    spreads: float


@dataclass(frozen=True)
class Evidenced:
    """The numbers a verdict rests on.

    `threshold` is the gap over the floor that is significant. `touched` is the worth over the
    outputs the effects show in, `whole` that over all outputs. `visible` is the share of effects
    that these runs would show at all at their typical strength. `chance` is how often chance alone
    would make a single effect stand out so. `tied`: the parameters were held to what the known-good
    runs say; `gap_free` is what a refit of all of them would leave. `imitated`: other values of the
    parameters predict as well as the effects. `stands_out` is None without good runs that could be
    left out.
    `instead`: effects that parameters held to what the known-good runs say ask for, which would
    bring the gap to `gap_instead`, but whose place clearly better values of the parameters took.
    """

    effects: tuple[str, ...]
    groups: Mapping[str, Sequence[str]]
    probability: Mapping[str, float]
    gap_raw: float
    threshold: float
    touched: Worth
    whole: Worth
    moved: bool
    visible: float
    chance: float
    since_good: bool = False
    tied: bool = False
    gap_free: float = 0.0
    stands_out: StandsOut | None = None
    imitated: bool = False
    instead: tuple[str, ...] = ()
    gap_instead: float = 0.0


def decide(e: Evidenced, settings: Settings) -> tuple[Outcome, float]:
    """The outcome and its probability.

    Since known-good runs the probability is what the evidence says times the share of such answers
    that were right on the development bank; without them nothing has been calibrated.
    """
    outcome, p = _decided(e, settings)
    if not e.since_good:
        return outcome, p
    right = {
        Outcome.NO_GAP: settings.quiet_right,
        Outcome.PARAMETERS: settings.quiet_right,
        Outcome.UNKNOWN: settings.unsure_right,
    } | dict.fromkeys(NAMED, settings.unsure_right if e.imitated else settings.named_right)
    return outcome, p * right.get(outcome, 1.0)


def _decided(e: Evidenced, settings: Settings) -> tuple[Outcome, float]:
    if not e.effects and not _structural(e, settings):
        if e.visible < settings.least_share:
            return Outcome.NO_EXCITATION, 1.0 - e.visible
        nothing = 1.0 - _present(e)
        gone = e.whole.gap_refit < (1.0 - settings.most_share) * e.gap_raw
        large = e.gap_raw > e.threshold
        if large and gone if e.since_good else (e.moved or large):
            return Outcome.PARAMETERS, nothing
        return Outcome.NO_GAP, nothing
    if not e.effects:
        return Outcome.UNKNOWN, _certainty(e, settings)
    unknown = p_unknown(e, settings)
    if unknown > 0.5:
        return Outcome.UNKNOWN, unknown
    first = e.effects[0]
    group = list(e.groups.get(first, ()))
    named = sum(e.probability.get(n, 0.0) for n in [first, *group])
    p = float(min(1.0, named) * (1.0 - unknown))
    if any(e.groups.get(n) for n in e.effects):
        return Outcome.AMBIGUOUS, p
    rest = e.whole.ceiling - e.whole.shrink
    if rest > settings.least_share and e.whole.gap_final > max(1.0, e.threshold):
        return Outcome.PLUS_REST, p
    return Outcome.EFFECT, p


def _structural(e: Evidenced, settings: Settings) -> bool:
    """Whether the refitted gap is more than background that these runs happen to have more of.

    Since known-good runs it is where one output differs far more from them than they do among
    themselves, which is not known of a single one.
    """
    if e.stands_out is not None:
        return bool(standing_out(e, settings))
    return e.whole.gap_refit > e.threshold


def standing_out(e: Evidenced, settings: Settings) -> str:
    """The output that differs far more from good runs than these do among themselves, if any."""
    found = e.stands_out
    return found.output if found is not None and found.spreads > settings.since_spreads else ""


def _present(e: Evidenced) -> float:
    """Probability that some effect is there although none was accepted.

    From 0.03, where chance alone explains the best candidate, to one half where it hardly does.
    """
    doubt = np.log(0.05 / max(e.chance, 1e-6)) / np.log(5.0)
    return float(0.03 + 0.47 * np.clip(doubt, 0.0, 1.0))


def _certainty(e: Evidenced, settings: Settings) -> float:
    """How far beyond the threshold the gap is; one half at the threshold."""
    ratio = e.whole.gap_refit / max(e.threshold, 1e-9)
    if e.stands_out is not None:
        ratio = max(ratio, e.stands_out.spreads / settings.since_spreads)
    return float(1.0 - 0.5 / max(1.0, ratio) ** 2)


def p_unknown(e: Evidenced, settings: Settings) -> float:
    """Probability that the cause is none of the library: by shrink and ceiling.

    Beside tied parameters a gap contains what the form of the bench's laws leaves, so that no share
    of it is asked of a cause, but one of what a flexible correction takes.
    """
    too_little = _too_little(e.touched, settings, tied=e.tied)
    return too_little if e.tied else max(too_little, _nothing_in_all(e.whole, settings))


def _nothing_in_all(whole: Worth, settings: Settings) -> float:
    """Share of bootstrap draws in which causes that help on their own signals do not in all."""
    if whole.gap_refit < settings.min_excess:
        return 0.0
    return float(np.mean(whole.draws[:, 0] < settings.least_share))


def _too_little(worth: Worth, settings: Settings, *, tied: bool) -> float:
    """Share of bootstrap draws in which the shrink is too small, alone or against the ceiling."""
    if worth.gap_refit < settings.min_excess:
        # A gap of the floor's size has no shrink to speak of; what its scores gain tells.
        return float(np.mean(worth.score_share < settings.most_share))
    s, ceiling = worth.draws[:, 0], worth.draws[:, 1]
    poor = s < settings.most_share * np.maximum(ceiling, 1e-9)
    if not tied:
        poor |= s < settings.least_share
    return float(np.mean(poor))
