"""From numbers to one of seven verdicts, with its probability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.gap.compare.assess import Worth
from smad.gap.records import NAMED, Outcome
from smad.gap.settings import Settings


@dataclass(frozen=True)
class Unexplained:
    """What runs score worse than known-good ones do, nats a cell, where no effect is added.

    By the better of the tied and the free parameters: `deficit` over all outputs, `spreads` the
    most that one output differs by, in what good runs differ in it, `run_deficit` the most on one
    output in one run. `output` is the one that stands out by that, empty if none does, `channel`
    what it predicts; `run` is empty if it does so in all of them together.
    """

    deficit: float
    spreads: float
    run_deficit: float
    output: str = ""
    channel: str = ""
    run: str = ""


@dataclass(frozen=True)
class Evidenced:
    """The numbers a verdict rests on.

    `threshold` is the gap over the floor that is significant. `touched` is the worth over the
    outputs the effects show in, `whole` that over all outputs. `visible` is the share of effects
    that these runs would show at all at their typical strength. `chance` is how often chance alone
    would make a single effect stand out so. `tied`: the parameters were held to what the known-good
    runs say; `gap_free` is what a refit of all of them would leave. `taken` is the part that the
    effects take of what these runs score worse than known-good runs left out do. `imitated`: other
    values of the parameters predict as well as the effects or better, and these do not help there.
    `strongest` is the largest gain of an effect that entered, nats for each cell judged.
    `unexplained` is None without good runs that could be left out.
    `instead`: effects that parameters held to what the known-good runs say ask for, which would
    bring the gap to `gap_instead`, but whose place other values of the parameters have taken:
    clearly better ones (`instead_better`), or as good where the effects gain little.
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
    taken: float = 0.0
    strongest: float = 0.0
    unexplained: Unexplained | None = None
    imitated: bool = False
    instead: tuple[str, ...] = ()
    gap_instead: float = 0.0
    instead_better: bool = True


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
        if e.visible < settings.least_visible:
            return Outcome.NO_EXCITATION, 1.0 - e.visible
        nothing = 1.0 - _present(e)
        gone = e.whole.gap_refit < settings.vanished_share * e.gap_raw
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
    if rest > settings.rest_margin and e.whole.gap_final > max(1.0, e.threshold):
        return Outcome.PLUS_REST, p
    return Outcome.EFFECT, p


def _structural(e: Evidenced, settings: Settings) -> bool:
    """Whether the refitted gap is more than background that these runs happen to have more of.

    A cause makes an error that depends on state, which a flexible correction finds on other runs;
    beside a background learnt from good runs, a gap of which it finds nothing must be far beyond
    the threshold. And runs that are large in a few places only, but score hardly worse than good
    ones left out do, have more of what good ones have, too. What no excess over all outputs shows
    is an output in which good runs hardly differ, and these do.
    """
    over = e.whole.gap_refit / max(e.threshold, 1e-9)
    if not e.since_good:
        return over > 1.0
    seen = over > settings.structural_excess and e.whole.ceiling > settings.found_share
    large = e.whole.gap_refit > settings.blind_excess and over > settings.blind_ratio
    if e.unexplained is None:
        return large or seen
    worse = e.unexplained.deficit > settings.since_deficit
    return ((large or seen) and worse) or bool(stands_out(e))


def stands_out(e: Evidenced) -> str:
    """The output that differs far more from the good runs than these do among themselves, if any.

    Or, in one run, by a factor that no background of another family of inputs comes to.
    """
    return "" if e.unexplained is None else e.unexplained.output


def _present(e: Evidenced) -> float:
    """Probability that some effect is there although none was accepted.

    From 0.03, where chance alone explains the best candidate, to one half where it hardly does.
    """
    doubt = np.log(0.05 / max(e.chance, 1e-6)) / np.log(5.0)
    return float(0.03 + 0.47 * np.clip(doubt, 0.0, 1.0))


def _certainty(e: Evidenced, settings: Settings) -> float:
    """How far beyond the threshold the gap is; one half at the threshold."""
    ratio = e.whole.gap_refit / max(e.threshold, 1e-9)
    if e.unexplained is not None:
        ratio = max(
            ratio,
            e.unexplained.spreads / settings.since_spreads,
            e.unexplained.run_deficit / settings.since_run_deficit,
        )
    return float(1.0 - 0.5 / max(1.0, ratio) ** 2)


def p_unknown(e: Evidenced, settings: Settings) -> float:
    """Probability that the cause is none of the library: by shrink and ceiling, or by the scores.

    Beside tied parameters a gap contains what the form of the bench's laws leaves, of which no
    effect takes anything and a few blocks of time may be most. A cause that takes a good part of
    what the runs score worse than good ones is known all the same, and so is one that gains more
    than a wrong one was ever seen to.
    """
    if e.tied and (e.taken > settings.since_taken or e.strongest > settings.since_sure):
        return 0.0
    too_little = _too_little(e.touched, settings, tied=e.tied)
    return too_little if e.tied else max(too_little, _nothing_in_all(e.whole, settings))


def _nothing_in_all(whole: Worth, settings: Settings) -> float:
    """Share of bootstrap draws in which causes that help on their own signals do not in all."""
    if whole.gap_refit < settings.min_excess:
        return 0.0
    return float(np.mean(whole.draws[:, 0] < settings.min_shrink_gain))


def _too_little(worth: Worth, settings: Settings, *, tied: bool) -> float:
    """Share of bootstrap draws in which the shrink is too small, alone or against the ceiling.

    Beside tied parameters a cause must also bring a large gap down to the background's size, or
    take most of it: a neighbour of the true cause leaves more.
    """
    if worth.gap_refit < (settings.since_min_excess if tied else settings.min_excess):
        # A gap of the floor's size has no shrink to speak of; what its scores gain tells.
        return float(np.mean(worth.score_share < settings.unknown_ratio))
    s, ceiling = worth.draws[:, 0], worth.draws[:, 1]
    poor = s < settings.unknown_ratio * np.maximum(ceiling, 1e-9)
    if tied:
        left = (1.0 - s) * worth.gap_refit > settings.unknown_left
        poor |= left & (s < settings.since_clear_shrink)
    else:
        poor |= s < settings.unknown_shrink
    return float(np.mean(poor))
