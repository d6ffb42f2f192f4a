"""Which question the selection is asked: what was added to the bench, or what is left of it.

Known-good runs say what the parameters are. A selection with the parameters tied to them asks for
the few effects that have come since; a refit with every parameter free asks whether the bench has
simply changed its values. Free parameters imitate many effects (a force that is off looks like
another preload), so that effects are sought beside tied ones only, and the free refit stands, with
no effect in it, where it answers better on runs that neither has seen.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial

from smad.gap.compare.contrast import is_new
from smad.gap.compare.select import Selection, Selector
from smad.gap.fit.baseline import unbound
from smad.gap.fit.candidate import Candidate, cluster_gain
from smad.gap.fit.joint import JointFit
from smad.gap.fit.judge import Judged, judge
from smad.gap.fit.lsq import Fitted
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Effect


@dataclass(frozen=True)
class Track:
    """A selection, whether its parameters were tied, and the free refit it was compared with.

    `asked` is the selection among effects, beside tied parameters where there are known-good runs;
    `selection` is that one, or the free refit that stands in its place. `free_gain` is what the
    free refit's held-out score is above that of the best model asked for, `free_gain_se` its
    standard error; both are 0 where nothing was tied. `imitated`: the answer is a cause, but the
    free refit predicts as well or better, and the cause does not help beside it.
    """

    selection: Selection
    tied: bool
    free: Judged
    asked: Selection
    free_gain: float = 0.0
    free_gain_se: float = 0.0
    imitated: bool = False

    @property
    def displaced(self) -> tuple[str, ...]:
        """Effects that were asked for, whose place the free refit has taken."""
        return () if self.selection is self.asked else self.asked.best.names


def follow_tracks(
    prepared: Prepared,
    effects: Sequence[Effect],
    progress: Callable[[str], None] = lambda text: None,
    *,
    unscreened: Collection[str] = (),
) -> Track:
    """The selection that answers.

    Without known-good runs, effects beside free parameters. With them, effects beside tied ones,
    or, where that does not hold, the free refit alone. `unscreened` as in `Selector`.
    """

    def selected(refit: Fitted) -> Selection:
        return Selector(
            refit,
            prepared.hold,
            effects,
            prepared.null,
            progress,
            is_new=partial(_is_new, prepared),
            unscreened=unscreened,
        ).run()

    if prepared.tied is None:
        selection = selected(prepared.fit)
        return Track(selection, False, selection.base.judged, selection)
    free = prepared.free
    progress("what has been added, parameters as the known-good runs say")
    selection = selected(prepared.tied)
    best = selection.best
    rise, error = _gain(prepared, free, best.judged)
    clear = prepared.settings.standard_errors * error
    close = bool(best.names) and rise > -clear
    helps = close and _helps(prepared, best, free)
    slight = close and not helps and _slight(prepared, selection)
    beaten = slight or (rise > clear and not _nearly_all(prepared, selection, rise))
    if _stands(prepared, best, free, beaten=beaten, helps=helps):
        return Track(selection, True, free, selection, rise, error, close and not helps)
    refit = Candidate(JointFit(prepared.fit, ()), free)
    return Track(Selection.without_effects(refit, selection), False, free, selection, rise, error)


def _is_new(prepared: Prepared, candidate: Candidate) -> bool:
    if prepared.background is None:
        return True
    errors = prepared.settings.standard_errors
    return is_new(prepared.background.fit, candidate, prepared.hold, errors)


def _nearly_all(prepared: Prepared, selection: Selection, rise: float) -> bool:
    """Whether causes gain nearly all that the free refit gains over the tied one.

    Then a handful of numbers does what dozens that are free to move by a third do: what these
    gain on top is the form of the bench's laws.
    """
    if not selection.best.names:
        return False
    gain = _gain_of_causes(prepared, selection)
    return gain > prepared.settings.imitated_share * (gain + rise)


def _slight(prepared: Prepared, selection: Selection) -> bool:
    """Whether causes that other parameters imitate gain no more than the form of laws may bring.

    Where either would do, the question is which is more likely, and benches whose parameters have
    moved since their good runs make some cause gain that much.
    """
    least = prepared.settings.imitated_gain * len(selection.best.judged.scores())
    return _gain_of_causes(prepared, selection) < least


def _gain_of_causes(prepared: Prepared, selection: Selection) -> float:
    """What all causes together gain over the model without any."""
    gain, _ = _gain(prepared, selection.best.judged, selection.base.judged)
    return gain


def _stands(
    prepared: Prepared, best: Candidate, free: Judged, *, beaten: bool, helps: bool
) -> bool:
    """Whether the tied answer stands beside the free refit.

    Not if it is `beaten`: if the free refit predicts runs not fitted to clearly better, of which
    the cause does not gain nearly all, or as well as a cause that gains little. Parameters and laws
    that are free follow a bench that obeys other laws than the model, whatever else it does: a
    cause stands all the same if it `helps` beside them as clearly as a cause must. Without a cause
    the tied answer stands only if nothing of note is left, or if the free refit would not help.
    """
    if best.names:
        return helps or not beaten
    little = max(prepared.threshold, prepared.settings.same_excess * free.excess())
    return not beaten and best.judged.excess() <= little


def _helps(prepared: Prepared, best: Candidate, free: Judged) -> bool:
    """Whether the causes still predict clearly better where parameters and laws are free, too.

    A cause that is a law itself is compared with a refit in which all laws but that are free.
    """
    (beside,) = judge([unbound(best.fit)], prepared.hold)
    if prepared.tied is not None and any(n in prepared.fixed for n in best.names):
        (free,) = judge([unbound(prepared.tied, best.names)], prepared.hold)
    gain, error = _gain(prepared, beside, free)
    return gain > prepared.settings.beside_standard_errors * error


def _gain(prepared: Prepared, one: Judged, other: Judged) -> tuple[float, float]:
    """By how much the held-out score of `one` is higher, and its standard error."""
    return cluster_gain(prepared.problem, prepared.hold, one.scores() - other.scores())
