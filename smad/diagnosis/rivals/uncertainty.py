"""The covariance of a fit's coordinates.

A fit may use slopes that are 2 % off. Where parameters are nearly collinear, such an error looks
like information that tells them apart. So slopes are computed again as central differences of exact
replays, and of the two estimates the larger variance counts. No variance is below that of the
jackknife over the folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from smad.diagnosis.numerics.bounded import RIDGE
from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence, weights
from smad.diagnosis.rivals.fit import Fit, leave_out, replayed

_STEPS = (0.3, -0.3, 0.6, -0.6)
"""Shares of a finite-difference step; the first two within bounds are used. With whole steps the
tube diameter of a simulated bench was 3.7 standard deviations off, with these 2.1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Precision:
    """Covariances of fits near the point where the `parameter_slopes` (p, n) were computed.

    `covariances` holds those of the fits asked for so far.
    """

    evidence: Evidence
    parameter_slopes: Array
    covariances: dict[Fit, Array] = field(default_factory=dict)

    @classmethod
    def at_fit(cls, evidence: Evidence, fitted: Fit, *, tied: bool = False) -> Precision:
        """With slopes computed at the coordinates of a fit.

        Those of the fit serve if good runs have `tied` the parameters: the prior, too, tells
        nearly collinear ones apart.
        """
        p = fitted.model.parameters
        slopes = fitted.slopes[:p] if tied else _central_slopes(evidence, fitted, range(p))
        return cls(evidence=evidence, parameter_slopes=slopes)

    def covariance(self, fitted: Fit) -> Array:
        """Covariance (k, k) of a fit's coordinates.

        Rows are weighted as in the fit, or less where its residual is correlated for longer. No
        variance is below that by the slopes of the fit, or of the jackknife.
        """
        if fitted not in self.covariances:
            self.covariances[fitted] = self._covariance(fitted)
        return self.covariances[fitted]

    def _covariance(self, fitted: Fit) -> Array:
        e, p = self.evidence, fitted.model.parameters
        of_part = _central_slopes(e, fitted, range(p, len(fitted.x)))
        slopes = np.concatenate([self.parameter_slopes, of_part])
        matrix = _inverse_curvature(e, fitted, slopes)
        without_one = np.array(leave_out(e, replace(fitted, slopes=slopes)))
        scatter = (len(without_one) - 1) * without_one.var(axis=0)
        least = np.maximum(scatter, np.diag(_inverse_curvature(e, fitted, fitted.slopes)))
        wider = np.sqrt(np.maximum(least / np.diag(matrix), 1.0))
        return np.asarray(wider[:, None] * matrix * wider)


def _inverse_curvature(evidence: Evidence, fitted: Fit, slopes: Array) -> Array:
    """Inverse of half the second derivatives of F, (k, k), with these slopes (k, n)."""
    tau = np.maximum(CORRELATED, evidence.correlation_rows(fitted.residual))
    J = evidence.whitening(weights(evidence, fitted.residual, tau=tau))(slopes)
    _, precision = replace(fitted.model, prior_weight=1.0).prior
    return np.asarray(np.linalg.inv(J @ J.T + precision + RIDGE * np.eye(len(precision))))


def _central_slopes(evidence: Evidence, fitted: Fit, which: Sequence[int]) -> Array:
    """Derivatives of the rows by the coordinates `which`, (len(which), n), extrapolated from two
    steps to step 0; zeros where the model fails at either."""
    model, x = fitted.model, fitted.x
    (low, high), steps = model.bounds, model.steps(x)
    out = np.zeros((len(which), len(evidence.run_of_row)))
    base = replayed(evidence, fitted.point, model, exact=True) if which else None
    if base is None:
        return out
    for row, i in enumerate(which):
        slopes: list[tuple[float, Array]] = []
        for step in steps[i] * np.array(_STEPS):
            moved = x.copy()
            moved[i] += step
            if len(slopes) == 2 or not low[i] <= moved[i] <= high[i]:
                continue
            predicted = replayed(evidence, model.point(moved), model, exact=True)
            if predicted is not None:
                slopes.append((step, evidence.change(predicted, base) / step))
        if len(slopes) == 2:
            (a, slope_a), (b, slope_b) = slopes
            out[row] = (b * slope_a - a * slope_b) / (b - a)
    return out
