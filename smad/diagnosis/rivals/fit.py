"""Fit the parameters and the coefficients of a rival together, by replay.

Minimises, over the coordinates x of a model,

    F(x) = Σ_c n_c/τ · log(v_c(x) + 1) + (x − m)ᵀ P (x − m),

where v_c is the mean square of the n_c rows of channel c, in floors and less the drifts, τ their
correlation time, m and P the mean and the precision of the prior.
A channel weighs the less the larger its residual is, so that no single channel decides the fit.
Damped Gauss–Newton steps minimise F. The fit ends when no damping lowers F, when a round lowers it
by less than `_ENOUGH`, or after `_ROUNDS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.diagnosis.data.played import finite, predictions
from smad.diagnosis.numerics.bounded import bounded_step
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence, weights
from smad.diagnosis.rivals.parts import EffectPart, Model, Part

_DAMPING = (0.0, 0.003, 0.03, 0.3, 3.0, 30.0)
_LONGER = (1.0, 2.0, 4.0, 8.0)
_ROUNDS = 8
NAT = 2.0
"""Of F, where every row counts."""
_ENOUGH = 0.1 * NAT
"""A round that lowers F by less ends the fit: a tenth of a nat where every row counts."""
_WORTH = 0.05
"""A step is tried if the linear model predicts that it lowers F by at least this."""
_HIDDEN = 0.5
"""Averaged inputs serve while they miss at most this share of a part's effect: a slope that is half
wrong still points downhill."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A point with its predictions: as recorded, and of averaged inputs, (bins, channels) a run.

    `slopes` are derivatives of the prediction by coordinate: (p, n) for the parameters alone, or
    (k, n) with those of the parts. `linearized_at` is where those of the parameters were measured.
    """

    model: Model
    x: Array
    exact: tuple[Array, ...]
    averaged: tuple[Array, ...]
    slopes: Array
    linearized_at: Array

    @cached_property
    def shift(self) -> tuple[Array, ...]:
        """Exact predictions less those of averaged inputs, (bins, channels) for each run."""
        return tuple(e - a for e, a in zip(self.exact, self.averaged, strict=True))

    def part(self, evidence: Evidence, which: Sequence[int]) -> Reference:
        """The same for some of the runs of the evidence."""
        return replace(
            self,
            exact=tuple(self.exact[k] for k in which),
            averaged=tuple(self.averaged[k] for k in which),
            slopes=self.slopes[:, np.isin(evidence.run_of_row, which)],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A fitted model: coordinates x (k,), `residual` (n,), `slopes` (k, n) = −d residual/dx.

    Slopes have single precision, since an answer keeps dozens of fits. Those of the parameters were
    measured at `linearized_at` and corrected since. `objective` is F; `shift` is as in `Reference`,
    None where predictions are exact.
    """

    model: Model
    x: Array
    residual: Array
    slopes: Array
    linearized_at: Array
    objective: float
    shift: tuple[Array, ...] | None

    @property
    def point(self) -> ModelPoint:
        """The simulator that was fitted."""
        return self.model.point(self.x)

    def of_parts(self, order: Sequence[int]) -> Fit:
        """The fit with only these parts, in this order; the coordinates are not fitted again."""
        model = self.model
        of_parts = [np.arange(model.slices[k].start, model.slices[k].stop) for k in order]
        columns = np.concatenate([np.arange(model.parameters), *of_parts])
        return replace(
            self,
            model=model.with_parts([model.parts[k] for k in order]),
            x=self.x[columns],
            slopes=self.slopes[columns],
            linearized_at=self.linearized_at[columns],
        )


def replayed(
    evidence: Evidence, point: ModelPoint, model: Model, *, exact: bool
) -> list[Array] | None:
    """Predictions of all trials at a point, (bins, channels) each; None where the model fails.

    A model with a part that needs exact replays is always replayed exactly.
    """
    predicted = predictions(model.plant, point, evidence.played, exact=exact or model.needs_exact)
    return predicted if finite(predicted) else None


def reference_at(
    evidence: Evidence, model: Model, x: Array, fitted: Fit | None = None
) -> Reference | None:
    """Predictions and slopes at `x`; None where the model fails.

    The slopes are taken from `fitted` if it is given, else computed at `x` for all coordinates.
    """
    point = model.point(x)
    exact = replayed(evidence, point, model, exact=True)
    averaged = exact if model.needs_exact else replayed(evidence, point, model, exact=False)
    if exact is None or averaged is None:
        return None
    return Reference(
        model=model,
        x=x,
        exact=tuple(exact),
        averaged=tuple(averaged),
        slopes=fitted.slopes if fitted else slopes_at(evidence, model, x, range(len(x))),
        linearized_at=fitted.linearized_at if fitted else x,
    )


def reference_of(evidence: Evidence, fitted: Fit) -> Reference | None:
    """The reference at the coordinates of a fit, with the slopes of the fit."""
    return reference_at(evidence, fitted.model, fitted.x, fitted)


def slopes_at(evidence: Evidence, model: Model, x: Array, which: Sequence[int]) -> Array:
    """Derivatives of the rows by the coordinates `which` at `x`, (len(which), n).

    They are finite differences of coarse replays, since a slope that is 2 % off costs a fit no
    round. If a part needs exact replays, those of the parts are exact. A coordinate along which the
    model fails has zeros.
    """
    steps = model.steps(x)
    _, high = model.bounds
    out = np.zeros((len(which), len(evidence.run_of_row)))
    bases: dict[bool, list[Array]] = {}

    def predicted_at(coordinates: Array, exact: bool) -> list[Array]:
        runs = evidence.played if exact else evidence.coarse
        return predictions(model.plant, model.point(coordinates), runs, exact=exact)

    for row, i in enumerate(which):
        exact = model.needs_exact and i >= model.parameters
        if exact not in bases:
            bases[exact] = predicted_at(x, exact)
        for sign in (1.0, -1.0) if x[i] + steps[i] <= high[i] else (-1.0, 1.0):
            moved = x.copy()
            moved[i] += sign * steps[i]
            predicted = predicted_at(moved, exact)
            if finite(predicted) and finite(bases[exact]):
                out[row] = evidence.change(predicted, bases[exact]) / (sign * steps[i])
                break
    return out


def averages_hide(evidence: Evidence, reference: Reference, model: Model, x: Array) -> bool:
    """Whether averaged inputs hide the effect of a model's last part at `x`.

    The run with the largest residual at the reference is tested.
    """
    e = evidence.part(
        [int(evidence.squares(evidence.residual(reference.exact)).sum(axis=1).argmax())]
    )
    without = reference.model.point(reference.x)
    changes = []
    for exact in (True, False):
        predicted = predictions(model.plant, model.point(x), e.played, exact=exact)
        base = predictions(model.plant, without, e.played, exact=exact)
        if not (finite(predicted) and finite(base)):
            return False
        changes.append(e.change(predicted, base))
    as_recorded, averaged = changes
    hidden = np.sum((averaged - as_recorded) ** 2)
    return bool(hidden > _HIDDEN**2 * np.sum(as_recorded**2))


def model_beside(evidence: Evidence, reference: Reference, part: Part, x: Array) -> Model:
    """The model of a reference with one part more, at `x` where it is to be fitted.

    An effect that averaged inputs hide there is marked to need exact replays.
    """
    parts = reference.model.parts
    model = reference.model.with_parts([*parts, part])
    if isinstance(part, EffectPart) and averages_hide(evidence, reference, model, x):
        return model.with_parts([*parts, replace(part, needs_exact=True)])
    return model


def objective(
    evidence: Evidence, model: Model, x: Array, residual: Array, *, offset: float = 1.0
) -> float:
    """F as in the module's docstring, with `offset` in place of 1 in the logarithm."""
    mean, precision = model.prior
    independent = evidence.counts.sum(axis=0) / CORRELATED
    likelihood = independent @ np.log(evidence.variances(residual) + offset)
    return float(likelihood + (x - mean) @ precision @ (x - mean))


def objective_at(evidence: Evidence, model: Model, x: Array) -> float:
    """F at `x` by exact replays; infinite where the model fails."""
    predicted = replayed(evidence, model.point(x), model, exact=True)
    if predicted is None:
        return np.inf
    residual = evidence.residual(predicted)
    return objective(
        evidence, model, x, evidence.less_drifts(residual, weights(evidence, residual))
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Iterate:
    """A point on the way of a fit: coordinates, residual, and F."""

    x: Array
    residual: Array
    value: float = np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class _Round:
    """One round of a fit, in which the weights of the rows stay as they were at its start.

    Without a `shift` predictions are exact; else they are those of averaged inputs plus the shift.
    """

    evidence: Evidence
    model: Model
    shift: tuple[Array, ...] | None
    weight: Array
    offset: float

    def iterate_at(self, x: Array) -> _Iterate | None:
        """The iterate at coordinates `x`; None where the model fails."""
        exact = self.shift is None
        predicted = replayed(self.evidence, self.model.point(x), self.model, exact=exact)
        if predicted is None:
            return None
        if self.shift is not None:
            predicted = [p + s for p, s in zip(predicted, self.shift, strict=True)]
        return self.with_objective(_Iterate(x=x, residual=self.evidence.residual(predicted)))

    def with_objective(self, iterate: _Iterate) -> _Iterate:
        """The iterate with F by these weights."""
        residual = self.evidence.less_drifts(iterate.residual, self.weight)
        value = objective(self.evidence, self.model, iterate.x, residual, offset=self.offset)
        return replace(iterate, value=value)

    def stepped(self, iterate: _Iterate, slopes: Array) -> _Iterate:
        """The iterate after a Gauss–Newton step that lowers F, or `iterate` where none does."""
        e, (mean, precision), (low, high) = self.evidence, self.model.prior, self.model.bounds
        J, r = _whitened(e, slopes, iterate.residual, self.weight)
        A, g = J @ J.T + precision, J @ r - precision @ (iterate.x - mean)
        for damping in _DAMPING:
            step = bounded_step(A, g, low - iterate.x, high - iterate.x, damping)
            promised = 2.0 * g @ step - step @ A @ step
            if promised < _WORTH:
                break
            best = iterate
            # The weights lag behind the fit: a step that gains more than predicted was too short.
            for times in _LONGER:
                moved = self.iterate_at(np.clip(iterate.x + times * step, low, high))
                if moved is None or not moved.value < best.value:
                    break
                best = moved
                if iterate.value - best.value < promised:
                    break
            if best is not iterate:
                return best
        return iterate


def fit(
    evidence: Evidence,
    model: Model,
    start: Array,
    reference: Reference | Fit,
    *,
    rounds: int = _ROUNDS,
    enough: float = _ENOUGH,
    offset: float = 1.0,
    exact: bool = False,
) -> Fit | None:
    """Fit a model from `start` until a round lowers F by less than `enough`, or so many `rounds`.

    Return None where the model fails at `start`. `offset` stands for 1 in log(v_c + 1): channels
    with a mean square below it weigh alike, and a larger one leads past local minima in which one
    channel is given up. Predictions are `exact`, or those of averaged inputs plus the shift of the
    `reference`. Slopes that the reference lacks are computed at the start. Each step corrects them
    by a Broyden update; when no step lowers F, those of the parts are computed again.
    """
    low, high = model.bounds
    shift = None if exact or model.needs_exact else reference.shift
    first = _Round(
        evidence=evidence, model=model, shift=shift, weight=evidence.valid, offset=offset
    )
    iterate = first.iterate_at(np.clip(start, low, high))
    if iterate is None:
        return None
    parts = range(model.parameters, len(start))
    linearized_at = iterate.x
    if len(reference.slopes) >= model.parameters:
        new = model.absent(iterate.x, reference.model.parts)
        linearized_at = np.concatenate([reference.linearized_at, new])
    unknown = range(len(reference.slopes), len(start))
    slopes = np.concatenate([reference.slopes, slopes_at(evidence, model, iterate.x, unknown)])
    corrected = False
    for _ in range(rounds):
        current = replace(first, weight=weights(evidence, iterate.residual, offset))
        before = current.with_objective(iterate)
        iterate = current.stepped(before, slopes)
        if before.value - iterate.value >= enough:
            step = iterate.x - before.x
            unforeseen = before.residual - iterate.residual - step @ slopes
            slopes += np.outer(step / (step @ step), unforeseen)
            corrected = True
        elif corrected and parts:
            slopes[parts.start :] = slopes_at(evidence, model, iterate.x, parts)
            corrected = False
        else:
            break
    ended = replace(first, weight=weights(evidence, iterate.residual, offset)).with_objective(
        iterate
    )
    return Fit(
        model=model,
        x=iterate.x,
        residual=iterate.residual,
        slopes=slopes.astype(np.float32),
        linearized_at=linearized_at,
        objective=ended.value,
        shift=shift,
    )


def leave_out(evidence: Evidence, fitted: Fit) -> tuple[Array, ...]:
    """Coordinates (k,) fitted without each fold: one Gauss–Newton step from those of all rows.

    At a minimum the step for all rows is 0 but for errors of the slopes, so it is subtracted. The
    drifts couple the rows of a run, so they are marginalised anew where stretches are left out.
    """
    model, x = fitted.model, fitted.x
    low, high = model.bounds
    mean, precision = model.prior

    def step_by(weight: Array) -> Array:
        J, r = _whitened(evidence, fitted.slopes, fitted.residual, weight)
        A, g = J @ J.T + precision, J @ r - precision @ (x - mean)
        return bounded_step(A, g, low - x, high - x)

    weight, folds = weights(evidence, fitted.residual), int(evidence.fold.max(initial=-1)) + 1
    of_all = step_by(weight)
    steps = (step_by(weight * (evidence.fold != f)) - of_all for f in range(folds))
    return tuple(np.clip(x + step, low, high) for step in steps)


def _whitened(
    evidence: Evidence, slopes: Array, residual: Array, weight: Array
) -> tuple[Array, Array]:
    """Slopes (k, n) and residual (n,), weighted (n,) and with the drifts marginalised."""
    both = evidence.whitening(weight)(np.concatenate([slopes, residual[None]]))
    return both[:-1], both[-1]
