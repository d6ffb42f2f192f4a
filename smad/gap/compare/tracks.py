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
from smad.gap.fit.hypothesis import Hypothesis, cluster_gain
from smad.gap.fit.joint import JointFit
from smad.gap.fit.judge import Judged
from smad.gap.fit.lsq import FitResult
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Effect


@dataclass(frozen=True)
class Track:
    """A selection, whether its parameters were tied, and the free refit it was compared with.

    `asked` is the selection among effects, beside tied parameters where there are known-good runs;
    `selection` is that one, or the free refit that stands in its place. `free_gain` is what the
    free refit's held-out score is above that of the best model asked for, `free_gain_se` its
    standard error; both are 0 where nothing was tied. `imitated`: the answer is a cause, but the
    free refit predicts as well.
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
    or the free refit alone: where that predicts clearly better runs that neither has seen, or where
    none entered and something of note is left. `unscreened` as in `Selector`.
    """

    def selected(refit: FitResult) -> Selection:
        return Selector(
            refit,
            prepared.hold,
            effects,
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
    imitated = bool(best.names) and rise > -clear
    gain, _ = _gain(prepared, best.judged, selection.base.judged)
    beaten = rise > clear and not _nearly_all(prepared, gain, rise)
    if beaten or not (best.names or best.judged.excess() <= prepared.threshold):
        refit = Hypothesis(JointFit(prepared.fit, ()), free)
        without = Selection.without_effects(refit, selection)
        return Track(without, False, free, selection, rise, error)
    return Track(selection, True, free, selection, rise, error, imitated)


def _nearly_all(prepared: Prepared, gain: float, rise: float) -> bool:
    """Whether causes gain nearly all that the free refit gains, which is `rise` more.

    Then a handful of numbers does what dozens that are free to move by a third do: what these gain
    on top is the form of the bench's laws.
    """
    return gain > prepared.settings.nearly_all * (gain + rise)


def _gain(prepared: Prepared, one: Judged, other: Judged) -> tuple[float, float]:
    """By how much the held-out score of `one` is higher, and its standard error."""
    return cluster_gain(prepared.problem, prepared.hold, one.scores() - other.scores())


def _is_new(prepared: Prepared, candidate: Hypothesis) -> bool:
    if prepared.reference is None:
        return True
    errors = prepared.settings.standard_errors
    return is_new(prepared.reference.fit, candidate, prepared.hold, errors)
