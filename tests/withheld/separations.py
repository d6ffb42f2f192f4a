"""How far apart fitted models are, in floors: what is said of an entry and its rivals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.gap.fit.joint import independent_share
from smad.gap.fit.lsq import FitResult
from smad.gap.plant import Array


def confusability(fits: Sequence[FitResult]) -> Array:
    """d²_ij = min over the parameters of j of ‖y_i − y_j‖², in floors; shape (fits, fits).

    Rows weigh as in the fit of i; correlated rows count by their effective number.
    """
    n = len(fits)
    out = np.zeros((n, n))
    for i, a in enumerate(fits):
        w, share = _row_weights(a)
        for j, b in enumerate(fits):
            if i == j:
                continue
            s = b.z - a.z
            A = b.A.astype(np.float64)
            _, precision = b.space.prior()
            WA = A * w[:, None]
            H = WA.T @ A + precision
            m = WA.T @ s
            out[i, j] = max(0.0, share * float((w * s) @ s - m @ np.linalg.solve(H, m)))
    return out


def separation(fit: FitResult, z: Array) -> float:
    """d² of `fit` from a model that leaves the white residual z, no parameter of which may move."""
    w, share = _row_weights(fit)
    s = z - fit.z
    return share * float((w * s) @ s)


def _row_weights(fit: FitResult) -> tuple[Array, float]:
    """How much each row weighs in a fit, and the effective share of independent rows."""
    return fit.problem.row_weight(fit.z), independent_share(fit)
