"""Screening: which effects of the library are worth a fit.

At a reference the change by an effect, and that by its strengths together, is scaled to explain
most of the residual, with the parameters marginalised. A few rounds of a fit choose among the best
by that linear estimate. Parameters that have moved to imitate an effect hide it, so effects are
screened at several references. A change is not linear in the values of its effect: a fit starts
where a replay leaves least. An effect without a strength is always fitted, since a linear estimate
of it means nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.bounded import bounded_step
from smad.diagnosis.numerics.white import shrinking
from smad.diagnosis.plant import Array, Effect, EffectParameter
from smad.diagnosis.rivals.changes import Change
from smad.diagnosis.rivals.evidence import Evidence, weights
from smad.diagnosis.rivals.fit import Fit, Reference, fit, model_beside, replayed
from smad.diagnosis.rivals.parts import EffectPart

_TRIED, _ROUNDS, _MOST = 20, 2, 8
"""Effects that so many rounds of a fit try beside each reference, and those that are fitted. The
right one may have a small estimate: that of an exponent was the eleventh, and left least. After one
round a front of cooling water was not among the first."""
_FURTHEST = 3.0
"""A change is scaled by at most this factor."""
_WORTH, _STARTS = 0.5, 4
"""Least gain of a start as a share of the effect's best one, and most starts of an effect."""
_WEAKER = 0.3
"""A fit may also start from this share of the estimated strength."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """An effect at a reference: starts for a fit, the most promising first, and its estimated
    `gain` in weighted squares.
    """

    part: EffectPart
    starts: tuple[Array, ...]
    gain: float


def marginaliser(evidence: Evidence, reference: Reference) -> Callable[[Array], Array]:
    """A function that weights rows (m, n) as at the reference and marginalises its drifts and all
    coordinates that it has slopes of, within their priors."""
    weight = weights(evidence, evidence.residual(reference.exact))
    count = len(reference.slopes)
    _, precision = reference.model.prior
    root = np.linalg.cholesky(np.linalg.inv(precision[:count, :count]))
    whitening = evidence.whitening(weight)
    shrink = shrinking(whitening(root.T @ reference.slopes))
    return lambda values: shrink(whitening(values))


def marginal_variances(evidence: Evidence, reference: Reference) -> Callable[[Array], Array]:
    """A function that gives the mean square of rows (n,) by channel, in floors, (channels,), with
    the coordinates of the reference marginalised."""
    weight = weights(evidence, evidence.residual(reference.exact))
    root = np.sqrt(np.where(weight > 0.0, weight, 1.0))
    marginalised = marginaliser(evidence, reference)
    return lambda rows: evidence.variances(marginalised(rows[None])[0] / root)


def screen(evidence: Evidence, reference: Reference, changes: Sequence[Change]) -> list[Screened]:
    """Effects by how much of the reference's residual they explain, the best first."""
    residual = evidence.residual(reference.exact)
    marginalised = marginaliser(evidence, reference)
    z = marginalised(residual[None])[0]
    promising: dict[str, list[tuple[float, Array]]] = {}
    by_shape: dict[tuple[str, tuple[float, ...]], dict[EffectParameter, Array]] = {}
    parts = {change.effect.name: EffectPart(change.effect) for change in changes}

    def add_start(effect: Effect, gain: float, values: Mapping[str, float]) -> None:
        start = np.clip(parts[effect.name].coordinates(values), *parts[effect.name].bounds())
        promising.setdefault(effect.name, []).append((gain, start))

    for change in changes:
        s = marginalised(change.rows[None].astype(np.float64))[0]
        square, along = float(s @ s), float(s @ z)
        effect = change.effect
        strengths = {q.name for q in effect.parameters if q.strength}
        if (alone := change.alone) is not None and square > 0.0:
            by_shape.setdefault((effect.name, change.shape), {})[alone] = s
        if strengths and (square <= 0.0 or along <= 0.0):
            continue
        scale = min(along / square, _FURTHEST) if strengths else 1.0
        gain = 2.0 * scale * along - scale**2 * square
        scaled = {n: v * scale if n in strengths else v for n, v in change.values.items()}
        add_start(effect, gain, scaled)
    for (name, shape), columns in by_shape.items():
        if len(columns) > 1:
            gain, values = _strengths_together(columns, z)
            effect = parts[name].effect
            shapes = (q.name for q in effect.parameters if not q.strength)
            absent = {q.name: 0.0 for q in effect.parameters if q.strength}
            add_start(effect, gain, absent | values | dict(zip(shapes, shape, strict=True)))
    out = []
    for name, pairs in promising.items():
        pairs.sort(key=lambda pair: -pair[0])
        best = pairs[0][0]
        # The estimate for an effect without a strength may be negative.
        least = best - (1.0 - _WORTH) * abs(best)
        starts = [start for gain, start in pairs if gain >= least][:_STARTS]
        out.append(Screened(part=parts[name], starts=tuple(starts), gain=best))
    return sorted(out, key=lambda s: -s.gain)


def _strengths_together(
    columns: Mapping[EffectParameter, Array], z: Array
) -> tuple[float, dict[str, float]]:
    """The gain of all strengths of an effect together, and their values.

    Strengths whose changes nearly cancel explain little alone.
    """
    S = np.array(list(columns.values()))
    A, g = S @ S.T, S @ z
    ends = np.array([sorted((q.low / q.typical, q.high / q.typical)) for q in columns])
    low, high = np.clip(ends, -_FURTHEST, _FURTHEST).T
    scale = bounded_step(A, g, low, high)
    values = {q.name: float(x * q.typical) for q, x in zip(columns, scale, strict=True)}
    return float(2.0 * scale @ g - scale @ A @ scale), values


def best_starts(
    evidence: Evidence, reference: Reference, candidates: Sequence[Screened]
) -> list[tuple[EffectPart, Array]]:
    """Coordinates from which to fit the effects that are worth it beside the reference.

    Of the first `_TRIED` and all without a strength, each is replayed from its starts and a weaker
    one. Rounds of the fit from the start that leaves least, parameters marginalised, decide. Of
    four runs or more the half with the largest residuals counts, which takes half the time.
    """
    if evidence.by_runs:
        squares = evidence.squares(evidence.residual(reference.exact)).sum(axis=1)
        which = sorted(np.argsort(-squares)[: -(-len(squares) // 2)].tolist())
        reference, evidence = reference.part(evidence, which), evidence.part(which)
    variances = marginal_variances(evidence, reference)
    rows = evidence.counts.sum(axis=0)

    def least(part: EffectPart, start: Array) -> float:
        model = reference.model.with_parts([*reference.model.parts, part])
        x = np.concatenate([reference.x, start])
        predicted = replayed(evidence, model.point(x), model, exact=False)
        if predicted is None:
            return np.inf
        residual = evidence.residual(
            [p + s for p, s in zip(predicted, reference.shift, strict=True)]
        )
        return float(rows @ np.log(variances(residual) + 1.0))

    rounds: list[tuple[EffectPart, Fit]] = []
    for k, s in enumerate(candidates):
        if k < _TRIED or not s.part.has_strength:
            starts = (*s.starts, s.part.weaker(s.starts[0], _WEAKER))
            start = min(starts, key=lambda start: least(s.part, start))
            x = np.concatenate([reference.x, start])
            model = model_beside(evidence, reference, s.part, x)
            if fitted := fit(evidence, model, x, reference, rounds=_ROUNDS):
                rounds.append((s.part, fitted))
    rounds.sort(key=lambda pair: pair[1].objective)
    return [
        (part, fitted.x)
        for k, (part, fitted) in enumerate(rounds)
        if k < _MOST or not part.has_strength
    ]
