"""From a finished selection to the numbers that a verdict rests on."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from smad.gap.compare.assess import Standing, group_of
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import Track
from smad.gap.compare.verdict import Evidenced, StandsOut
from smad.gap.fit.deficit import clearest, deficit_of
from smad.gap.fit.hypothesis import touched_outputs
from smad.gap.fit.stages import Prepared

_VISIBLE_FLOORS = 4.0
"""By which an effect shows at its typical strength."""


def weigh(prepared: Prepared, track: Track) -> Evidenced:
    """Gaps, shrink, groups and chances of the answer that `track` gave."""
    selection = track.selection
    standing = Standing.of(selection, None if track.tied else prepared.gentle)
    whole = standing.worth(selection.best.judged.bench.dataset.keys)
    outputs = touched_outputs(selection.base.judged, selection.best.judged)
    touched = standing.worth(outputs) if outputs else whole
    return Evidenced(
        effects=_by_importance(selection),
        groups=_groups(prepared, selection),
        probability={k: v for table in selection.probability.values() for k, v in table.items()},
        gap_raw=prepared.raw.excess(),
        threshold=prepared.threshold,
        touched=touched,
        whole=whole,
        since_good=prepared.reference is not None,
        gap_free=track.free.excess(),
        tied=track.tied,
        imitated=track.imitated,
        instead=track.displaced,
        gap_instead=track.asked.best.judged.excess(),
        moved=bool(np.max(np.abs(prepared.fit.p)) > 1.0),
        chance=_chance(selection),
        stands_out=_stands_out(prepared, track),
        visible=_visible(selection),
    )


def _visible(selection: Selection) -> float:
    """Share of the effects screened that would show at their typical strength."""
    shown = [s.size > _VISIBLE_FLOORS for s in selection.screened]
    return float(np.mean(shown)) if shown else 1.0


def _stands_out(prepared: Prepared, track: Track) -> StandsOut | None:
    """What stands beyond known-good runs whether their parameters are kept or all are refitted."""
    usual = None if prepared.reference is None else prepared.reference.usual
    if usual is None:
        return None
    models = [deficit_of(usual, j) for j in (track.asked.base.judged, track.free)]
    output, spreads = clearest(usual, models)
    return StandsOut(output, prepared.outputs[output].channel, spreads) if output else None


def _chance(selection: Selection) -> float:
    """How often the best of the single effects tried would stand out as it does by chance."""
    single = [c for c in selection.tried if len(c.names) == 1 and c.gain_se > 0]
    if not single:
        return 1.0
    strongest = max(c.gain / c.gain_se for c in single)
    return float(min(1.0, len(single) * norm.sf(strongest)))


def _groups(prepared: Prepared, s: Selection) -> dict[str, list[str]]:
    settings = prepared.settings
    return {
        name: group_of(s.best, rivals, s.probability[name], settings.odds)
        for name, rivals in s.rivals.items()
    }


def _by_importance(selection: Selection) -> tuple[str, ...]:
    """Effects of the best model, by what leaving each out would change of its predictions."""
    best = selection.best
    if len(best.names) < 2:
        return best.names
    ev = best.fit.problem.dataset
    cost = {}
    for name in best.names:
        change = ev.predict([best.fit.without(name)])[0] - best.fit.predicted
        cost[name] = float(np.sum(np.square(best.fit.problem.whitening.scale(change))))
    return tuple(sorted(cost, key=lambda n: (-cost[n], n)))
