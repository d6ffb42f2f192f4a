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

from smad.gap.contrast import is_new
from smad.gap.fit import JointFit
from smad.gap.judge import Judged
from smad.gap.lsq import Fitted
from smad.gap.plant import Effect
from smad.gap.select import Candidate, Selection, Selector, cluster_gain
from smad.gap.stages import Prepared

_SAME = 1.1


@dataclass(frozen=True)
class Track:
    """A selection, whether its parameters were tied, and the free refit it was compared with.

    `asked` is the selection among effects, beside tied parameters where there are known-good runs;
    `selection` is that one, or the free refit that stands in its place. `free_gain` is what the
    free refit's held-out score is above that of the best model asked for, `free_gain_se` its
    standard error; both are 0 where nothing was tied.
    """

    selection: Selection
    tied: bool
    free: Judged
    asked: Selection
    free_gain: float = 0.0
    free_gain_se: float = 0.0


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
    rise = cluster_gain(
        prepared.problem, prepared.hold, free.scores() - selection.best.judged.scores()
    )
    if _holds(prepared, selection.best, free, *rise):
        return Track(selection, True, free, selection, *rise)
    refit = Candidate(JointFit(prepared.fit, ()), free)
    return Track(Selection.without_effects(refit, selection), False, free, selection, *rise)


def _is_new(prepared: Prepared, candidate: Candidate) -> bool:
    if prepared.background is None:
        return True
    errors = prepared.settings.clear_standard_errors
    return is_new(prepared.background.fit, candidate, prepared.hold, errors)


def _holds(prepared: Prepared, best: Candidate, free: Judged, rise: float, error: float) -> bool:
    """Whether the tied answer stands beside the free refit, whose score is higher by `rise`.

    A cause must predict runs not fitted to better than free parameters do, which overfit if it is
    the truth. Without a cause: if nothing of note is left, or free parameters would not help.
    """
    if best.names:
        return rise < 0.0
    better = rise > prepared.settings.free_standard_errors * error
    return not better and best.judged.excess() <= max(prepared.threshold, _SAME * free.excess())
