"""Screening of every candidate by its sensitivity, the refitted parameters projected out.

Each effect is probed at a few points of its range, since some (a backlash, a saturation) have no
slope at zero strength. A probe's white change of the prediction is s; what the refitted parameters
can imitate of it is projected out; one amplitude and the parameters are then fitted by linear
algebra, without another replay.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.replay import Detail
from smad.gap.fit.lsq import FitResult, Problem
from smad.gap.plant import Array, Effect, ModelPoint

_REWEIGHTINGS = 4
_BATCH = 16
_LEVELS = (0.25, 1.0)
_WAYS: dict[float, Sequence[float]] = {0.2: (1.0,), 0.6: _LEVELS}
"""Of the way from a shape's typical value to its bounds, and the levels that are probed there. What
acts beyond a threshold has hardly a slope where the threshold is far off: hence the near ones."""


@dataclass(frozen=True)
class Probe:
    """One effect at one point of its range; `base` is where the model has it now.

    Amplitudes scale the way from `base` to `values`; the bounds keep it in the effect's range.
    """

    effect: Effect
    base: dict[str, float]
    values: dict[str, float]
    min_amplitude: float
    max_amplitude: float

    def at(self, amplitude: float) -> dict[str, float]:
        """Values at an amplitude, within the effect's range."""
        out = {}
        for q in self.effect.parameters:
            way = self.values[q.name] - self.base[q.name] if q.strength else 0.0
            start = self.base[q.name] if q.strength else self.values[q.name]
            out[q.name] = float(np.clip(start + amplitude * way, q.low, q.high))
        return out


@dataclass(frozen=True)
class Probes:
    """Probes and their white signatures S (rows, probes), at the model point of `fit`.

    AA (cells, k, k), AS (cells, k, probes) and SS (cells, probes) are the products by cell, so that
    weighing the cells anew costs next to nothing.
    """

    fit: FitResult
    probes: tuple[Probe, ...]
    S: NDArray[np.float32]
    AA: Array
    AS: Array
    SS: Array


@dataclass(frozen=True)
class Screened:
    """What screening says of one effect.

    `gain` is the rise in log-likelihood at the best probe, `amplitude` its fitted share of it.
    `masked` is the share of the signature that the refitted parameters can imitate. `size` is the
    projected signature of the typical effect, in floors (root of its squared norm).
    """

    effect: Effect
    gain: float
    amplitude: float
    masked: float
    size: float
    start: dict[str, float]
    second: dict[str, float] | None


def probes_of(effect: Effect, now: Mapping[str, float] | None = None) -> list[Probe]:
    """Probes of an effect: each strength alone at two levels, each shape also lower and higher.

    `now` are the effect's values in the model, when it is part of it already: the probes are then
    changes of it, its shapes as they are.
    """
    strengths = [p for p in effect.parameters if p.strength]
    shapes = [p for p in effect.parameters if not p.strength]
    base = dict(now) if now is not None else effect.at(0.0)
    usual = {q.name: base[q.name] for q in shapes}
    settings: list[tuple[dict[str, float], Sequence[float]]] = [(usual, _LEVELS)]
    for q in shapes if now is None else []:
        for edge, (share, levels) in product((q.low, q.high), _WAYS.items()):
            other = {**usual, q.name: q.typical + share * (edge - q.typical)}
            settings.append((other, levels))
    out = []
    for p in strengths:
        for shape, level in ((shape, level) for shape, levels in settings for level in levels):
            value = float(np.clip(base[p.name] + level * p.typical, p.low, p.high))
            way = value - base[p.name]
            if way == 0.0:
                continue
            low, high = sorted(((p.low - base[p.name]) / way, (p.high - base[p.name]) / way))
            values = {q.name: base[q.name] for q in strengths} | shape | {p.name: value}
            out.append(Probe(effect, base, values, low, high))
    return out


def probe(fit: FitResult, effects: Sequence[Effect]) -> Probes:
    """Signatures of every probe of `effects` on top of the model of `fit`, replayed roughly."""
    base = fit.point
    everything = [p for e in effects for p in probes_of(e, base.effects.get(e.name))]
    points = [ModelPoint(base.theta, {**base.effects, p.effect.name: p.values}) for p in everything]
    ev = fit.problem.dataset.matching(base, fit.predicted)
    S = np.zeros((ev.n, len(points)), dtype=np.float32)
    for a, b in pairwise([*range(0, len(points), _BATCH), len(points)]):
        values = ev.predict(points[a:b], detail=Detail.ROUGH)
        change = ev.change(values, fit.predicted, Detail.ROUGH)
        S[:, a:b] = fit.problem.whitening.white(np.ascontiguousarray(change.T))
    return _assembled(fit, tuple(everything), S)


def reprobe(known: Probes, fit: FitResult) -> Probes:
    """The probes of an earlier model on top of a later one, without those of its own effects.

    Signatures are taken over: they change little, and the joint fits that follow do not use them.
    """
    own = {e.name for e in fit.space.effects}
    keep = [i for i, p in enumerate(known.probes) if p.effect.name not in own]
    return _assembled(fit, tuple(known.probes[i] for i in keep), known.S[:, keep])


def _assembled(fit: FitResult, probes: tuple[Probe, ...], S: NDArray[np.float32]) -> Probes:
    ev = fit.problem.dataset
    k, m, cells = fit.space.size, S.shape[1], len(ev.cell_starts)
    AA, AS, SS = np.empty((cells, k, k)), np.empty((cells, k, m)), np.empty((cells, m))
    for c, (i, j) in enumerate(zip(ev.cell_starts, ev.cell_stops, strict=True)):
        A_c, S_c = fit.A[i:j], S[i:j]
        AA[c], AS[c] = A_c.T @ A_c, A_c.T @ S_c
        SS[c] = np.einsum("ij,ij->j", S_c, S_c)
    return Probes(fit, probes, S, AA, AS, SS)


@dataclass(frozen=True)
class Projected:
    """Weighted products of signatures with the residual, the refitted parameters projected out.

    `step` is the parameter step without any effect, `follow` (k, probes) how the parameters give
    way to a unit of each probe.
    """

    b: Array
    d: Array
    full: Array
    step: Array
    follow: Array


def project(probes: Probes, z: Array, cell_weight: Array) -> Projected:
    """b = sᵀP⊥z, d = sᵀP⊥s, and sᵀs, with cells weighted; priors act as further rows."""
    fit = probes.fit
    mean, precision = fit.space.prior()
    H = np.tensordot(cell_weight, probes.AA, 1) + precision
    B = np.tensordot(cell_weight, probes.AS, 1)
    full = cell_weight @ probes.SS
    wz = (cell_weight[fit.problem.dataset.row_cell] * z).astype(np.float32)
    g = (wz @ fit.A).astype(float) - precision @ (fit.p - mean)
    solved = np.linalg.solve(H, np.column_stack([B, g]))
    follow, step = solved[:, :-1], solved[:, -1]
    d = full - np.einsum("ij,ij->j", B, follow)
    b = (wz @ probes.S).astype(float) - B.T @ step
    return Projected(b, np.maximum(d, 1e-9), full, np.asarray(step), np.asarray(follow))


def screen(probes: Probes) -> list[Screened]:
    """Every effect, best first. Amplitude and weights are refined a few times per probe.

    Begun with the weights of the fit, and with those of a floor as large as the misfit: what is far
    off in a few cells, as in the one run that shows an effect, weighs next to nothing by the first
    until it is explained.
    """
    fit = probes.fit
    problem = fit.problem
    if not probes.probes:
        return []
    base_score = problem.cell_score(fit.z).sum()
    weights = [problem.cell_weight(fit.z, h) for h in (1.0, max(1.0, problem.misfit(fit.z)))]
    starts = [project(probes, fit.z, w) for w in weights]
    start = starts[0]
    gains = np.zeros(len(probes.probes))
    amplitudes = np.zeros(len(probes.probes))
    count = max(24, len(probes.probes) // 3)
    for begun, weight in zip(starts, weights, strict=True):
        # What reweighting alone would gain is not the effect's.
        idle, _ = _refined(probes, problem, None, base_score, weight)
        for i in np.argsort(-np.square(begun.b) / begun.d)[:count]:
            gain, amplitude = _refined(probes, problem, int(i), base_score, weight)
            if gain - idle > gains[i]:
                gains[i], amplitudes[i] = gain - idle, amplitude
    out = []
    by_effect: dict[str, list[int]] = {}
    for i, p in enumerate(probes.probes):
        by_effect.setdefault(p.effect.name, []).append(i)
    for indices in by_effect.values():
        order = sorted(indices, key=lambda i: (-gains[i], -(start.b[i] ** 2) / start.d[i]))
        best = order[0]
        second = next((i for i in order[1:] if _other_shape(probes, best, i)), None)
        visible = max(indices, key=lambda i: start.d[i])
        out.append(
            Screened(
                probes.probes[best].effect,
                float(gains[best]),
                float(amplitudes[best]),
                float(1 - start.d[visible] / max(start.full[visible], start.d[visible])),
                float(np.sqrt(start.d[visible])),
                _scaled(probes.probes[best], amplitudes[best]),
                None if second is None else _scaled(probes.probes[second], amplitudes[second]),
            )
        )
    return sorted(out, key=lambda s: (-s.gain, -s.size))


def _other_shape(probes: Probes, a: int, b: int) -> bool:
    va, vb = probes.probes[a].values, probes.probes[b].values
    effect = probes.probes[a].effect
    if any(va[p.name] != vb[p.name] for p in effect.parameters if not p.strength):
        return True
    base = probes.probes[a].base
    on = [
        {p.name for p in effect.parameters if p.strength and v[p.name] != base[p.name]}
        for v in (va, vb)
    ]
    return on[0] != on[1]


def _scaled(p: Probe, amplitude: float) -> dict[str, float]:
    """Starting values at an amplitude, or at a small part of the probe if it is off."""
    return p.at(amplitude if abs(amplitude) > 0.02 else 0.2)


def _refined(
    probes: Probes, problem: Problem, i: int | None, base: float, weight: Array
) -> tuple[float, float]:
    """Best gain and amplitude of one probe, reweighting the cells as it begins to explain them.

    `weight` is that of the cells to begin with. Without a probe: the gain that the model parameters
    alone still have.
    """
    fit = probes.fit
    at = 0 if i is None else i
    p = probes.probes[at]
    one = Probes(
        fit,
        (p,),
        probes.S[:, at : at + 1],
        probes.AA,
        probes.AS[:, :, at : at + 1],
        probes.SS[:, at : at + 1],
    )
    s = probes.S[:, at].astype(float)
    z, best, amplitude = fit.z, 0.0, 0.0
    mean, precision = fit.space.prior()
    shift = fit.p - mean
    for _ in range(_REWEIGHTINGS):
        pr = project(one, fit.z, weight)
        a = 0.0
        if i is not None:
            a = float(np.clip(pr.b[0] / pr.d[0], p.min_amplitude, p.max_amplitude))
        step = pr.step - pr.follow[:, 0] * a
        z = fit.z - a * s - fit.A @ step.astype(np.float32)
        penalty = float(step @ precision @ (shift + 0.5 * step))
        gain = float(problem.cell_score(z).sum() - base - penalty)
        if gain <= best + 0.1:
            break
        best, amplitude = gain, a
        weight = problem.cell_weight(z)
    return best, amplitude
