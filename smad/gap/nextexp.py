"""The experiment that would best separate what is still confused.

Each hypothesis is a fitted model. For an experiment of the catalogue, both predict what would be
measured; the second may still adapt its parameters, as far as the data so far allow. What is left
between them, in floors, is the separation d²: 16 is four standard errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.gap.fit import dispersion
from smad.gap.lsq import Fitted
from smad.gap.plant import Array, Experiment, ModelPoint
from smad.gap.replay import Detail, Evidence
from smad.gap.whiten import OutputNoise, Whitening

_STEP = 0.2


@dataclass(frozen=True)
class Proposal:
    """An experiment with its predicted separation of the hypotheses, weighted by probability."""

    experiment: Experiment
    separation: float

    @property
    def rate(self) -> float:
        """Separation for each second of bench time."""
        return self.separation / max(self.experiment.duration_s, 1.0)


def separation(
    fits: Sequence[Fitted],
    weights: Sequence[float],
    experiment: Experiment,
    noise: Mapping[str, OutputNoise],
) -> float:
    """Σ w_i w_j d²_ij of one experiment over the pairs of hypotheses, normalised by Σ w_i w_j.

    d²_ij = min_Δ ‖y_i − y_j − J_j Δ‖²_Σ⁻¹ + Δᵀ H_j Δ, with H_j what the data so far say of the
    parameters of j.
    """
    first = fits[0].problem.evidence
    plant = first.plant
    run = plant.perform(experiment.name, fits[0].point, first.settings.seed)
    ev = Evidence(
        plant,
        [run],
        first.views,
        first.settings,
        first.executor,
        fast=first.detail is not Detail.FINE,
    )
    whitening = Whitening(ev, noise)
    points: list[ModelPoint] = []
    for fit in fits:
        points.append(fit.point)
        points += [fit.space.point(q) for q in _moved(fit)]
    predicted = ev.predict(points)
    total = weight = 0.0
    at = 0
    blocks = []
    for fit in fits:
        k = fit.space.size
        y = predicted[at]
        moved = predicted[at + 1 : at + 1 + k]
        signed = np.array([q[i] - fit.p[i] for i, q in enumerate(_moved(fit))])
        J = whitening.white(np.ascontiguousarray(((moved - y) / signed[:, None]).T))
        blocks.append((y, J, _information(fit)))
        at += 1 + k
    share = float(np.mean(list(dispersion(fits[0].problem, fits[0].z).values())))
    for i, (yi, _, _) in enumerate(blocks):
        for j, (yj, J, H) in enumerate(blocks):
            if i == j:
                continue
            s = whitening.white(yi - yj)
            step = np.linalg.solve(J.T @ J + H, J.T @ s)
            left = s - J @ step
            d2 = share * float(left @ left + step @ H @ step)
            total += weights[i] * weights[j] * d2
            weight += weights[i] * weights[j]
    return total / weight if weight > 0 else 0.0


def _moved(fit: Fitted) -> list[Array]:
    lo, hi = fit.space.bounds()
    out = []
    for i in range(fit.space.size):
        q = fit.p.copy()
        q[i] += _STEP if q[i] + _STEP <= hi[i] else -min(_STEP, q[i] - lo[i])
        out.append(q)
    return out


def _information(fit: Fitted) -> Array:
    H, _ = fit.normal_equations()
    _, precision = fit.space.prior()
    share = float(np.mean(list(dispersion(fit.problem, fit.z).values())))
    return np.asarray(share * H.sum(axis=0) + precision)


def propose(
    fits: Sequence[Fitted],
    weights: Sequence[float],
    noise: Mapping[str, OutputNoise],
    catalogue: Sequence[Experiment],
) -> list[Proposal]:
    """Every experiment of the catalogue with its separation, best first."""
    out = [Proposal(e, separation(fits, weights, e, noise)) for e in catalogue]
    return sorted(out, key=lambda q: (-q.separation, q.experiment.name))
