"""Out-of-sample predictions: each fold by the coordinates of a fit to the other folds.

A fold is a run, replayed as in the fit. With fewer than four runs it is a quarter of the stretches,
predicted by a replay of the whole runs, to which the drifts are fitted: they would else follow the
steps between stretches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.data.played import predictions
from smad.diagnosis.plant import Array, Mask
from smad.diagnosis.rivals.evidence import Evidence, without_drifts
from smad.diagnosis.rivals.fit import Fit, leave_out

_STEP_SHARES = (1.0, 0.5, 0.25)
"""Shares of the step that leaves a run out, the longest first."""
_ROUGH = 0.3
"""Floors by which a replay may differ from its linear prediction: it is rough where springs turn.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Predicted:
    """A prediction of all judged runs, (bins, channels) each, and the rows (n,) judged by it."""

    values: Sequence[Array]
    rows: Mask

    @classmethod
    def of_all(cls, evidence: Evidence, values: Sequence[Array]) -> Predicted:
        """A prediction by which every row is judged."""
        return cls(values=values, rows=np.ones(len(evidence.run_of_row), dtype=bool))


def left_out_predictions(evidence: Evidence, fitted: Fit) -> list[Predicted] | None:
    """Predictions of all runs, each fold by a fit to the others; None where the model fails."""
    trials = range(len(evidence.trials))
    whole, out = [np.zeros_like(t.target) for t in evidence.trials], []
    for f, x in enumerate(leave_out(evidence, fitted)):
        rows = evidence.fold == f
        left_out = np.unique(evidence.run_of_row[rows]) if evidence.by_runs else trials
        for k in left_out:
            predicted = _predicted_at(evidence, fitted, x - fitted.x, int(k))
            if predicted is None:
                return None
            whole[k] = predicted
        out.append(Predicted(values=tuple(whole), rows=rows))
    return [Predicted.of_all(evidence, whole)] if evidence.by_runs else out


def _predicted_at(evidence: Evidence, fitted: Fit, step: Array, k: int) -> Array | None:
    """Prediction of run `k` at a `step` from a fit's coordinates, (bins, channels).

    The step is shortened while the replay differs from its linear prediction by more than the
    predicted change, and left out where the model fails; None where it fails even then.
    """
    trial, span = evidence.trials[k], evidence.spans[k]
    exact, shift = fitted.shift is None, 0.0 if fitted.shift is None else fitted.shift[k]
    out = None
    for share in (*_STEP_SHARES, 0.0):
        point = fitted.model.point(fitted.x + share * step)
        (predicted,) = predictions(fitted.model.plant, point, [trial.played], exact=exact)
        if not np.isfinite(predicted).all():
            continue
        out = predicted + shift
        change = share * step @ fitted.slopes[:, span]
        off = trial.rows.independent((trial.target - out)[None])[0]
        off -= fitted.residual[span] - change
        like = off @ off <= max(change @ change, _ROUGH**2 * len(off))
        if like or share == _STEP_SHARES[-1]:
            break
    return out


def stitched(evidence: Evidence, predicted: Sequence[Predicted]) -> list[Array]:
    """The out-of-sample prediction of every row in one array (bins, channels) for each run."""
    out = list(predicted[0].values)
    for fold in predicted[1:]:
        for k, span in enumerate(evidence.spans):
            out[k] = np.where(fold.rows[span].reshape(out[k].shape), fold.values[k], out[k])
    return out


def squares_left(evidence: Evidence, predicted: Sequence[Predicted]) -> Array:
    """Sums of squares of the residual less the drifts, (runs, channels)."""
    judged = (
        np.where(p.rows, without_drifts(evidence, evidence.residual(p.values)), 0.0)
        for p in predicted
    )
    return evidence.squares(sum(judged, start=np.zeros(len(evidence.run_of_row))))
