"""One fit of a rival: parameters and its own coefficients together, by replay.

Minimises, over the coordinates x of a model,

    F(x) = Σ_c n_c/τ · log(v_c(x) + 1) + (x − m)ᵀ P (x − m),

v_c being the mean square of channel c's n_c rows in floors and τ their correlation time. So each
channel counts by what the fit leaves of it now: neither a loud channel nor one that the model
cannot show decides alone. Gauss–Newton steps with damping; a step that does not lessen F is not
taken, and a fit ends when no damping lessens it or F falls by less than `_ENOUGH`.
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
from smad.diagnosis.rivals.parts import Model

_DAMPING = (0.0, 0.003, 0.03, 0.3, 3.0, 30.0)
_LONGER = (1.0, 2.0, 4.0, 8.0)
_ROUNDS = 8
NAT = 2.0
"""Of F, where every row counts."""
_ENOUGH = 0.1 * NAT
"""Of F, a tenth of a nat where every row counts: by less, a round has led no further."""
_WORTH = 0.05
"""Of F, that a step must promise to be tried."""
_HIDDEN = 0.5
"""Of what a part changes, that averaged inputs may hide: a slope half wrong still leads on."""
_POLISHES, _POLISH_ROUNDS = 12, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A point with its predictions: as recorded, and of averaged inputs, (bins, channels) a run.

    `slopes` are rows of what a unit of each coordinate changes there, of the first ones: (p, n) of
    the parameters, or (k, n) with those of the parts. Those of the parameters were measured at the
    coordinates `linearized_at`.
    """

    model: Model
    x: Array
    exact: tuple[Array, ...]
    averaged: tuple[Array, ...]
    slopes: Array
    linearized_at: Array

    @cached_property
    def shift(self) -> tuple[Array, ...]:
        """What exact predictions differ by from those of averaged inputs."""
        return tuple(e - a for e, a in zip(self.exact, self.averaged, strict=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A fitted model: coordinates x (k,), rows `left` (n,), `slopes` (k, n) = −d left/dx in single
    precision, since an answer keeps dozens.

    Slopes of the parameters were measured at the coordinates `linearized_at`, and corrected since.
    `objective` is F. `shift` is what exact predictions differ by from those of averaged inputs, and
    None where the fit's predictions are exact.
    """

    model: Model
    x: Array
    left: Array
    slopes: Array
    linearized_at: Array
    objective: float
    shift: tuple[Array, ...] | None

    @property
    def point(self) -> ModelPoint:
        """The simulator that was fitted."""
        return self.model.point(self.x)

    def of_parts(self, order: Sequence[int]) -> Fit:
        """The same coordinates with these of its parts alone, in this order; not fitted anew."""
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
    """Predictions of all trials by a point; None where the model cannot run.

    They are exact where the model has a quick part, too.
    """
    predicted = predictions(model.plant, point, evidence.played, exact=exact or model.quick)
    return predicted if finite(predicted) else None


def reference_at(
    evidence: Evidence, model: Model, x: Array, fitted: Fit | None = None
) -> Reference | None:
    """Predictions and slopes at `x`; None where the model cannot run.

    Slopes are those of a fit where one is given, else made there for all coordinates.
    """
    point = model.point(x)
    exact = replayed(evidence, point, model, exact=True)
    averaged = exact if model.quick else replayed(evidence, point, model, exact=False)
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


def rebased(evidence: Evidence, fitted: Fit) -> Reference | None:
    """The fitted model as a reference of its own, with the slopes that the fit has."""
    return reference_at(evidence, fitted.model, fitted.x, fitted)


def slopes_at(evidence: Evidence, model: Model, x: Array, which: Sequence[int]) -> Array:
    """Rows of what the coordinates `which` change at `x`, for a unit of each; (len(which), n).

    Of coarse replays, since a slope that is 2 % off costs a fit no round; those of the parts of a
    model with a quick one are of exact replays. A coordinate whose step the model cannot run has
    none.
    """
    steps = model.steps(x)
    _, high = model.bounds
    out = np.zeros((len(which), len(evidence.run_of_row)))
    bases: dict[bool, list[Array]] = {}

    def predicted_at(coordinates: Array, exact: bool) -> list[Array]:
        runs = evidence.played if exact else evidence.coarse
        return predictions(model.plant, model.point(coordinates), runs, exact=exact)

    for row, i in enumerate(which):
        exact = model.quick and i >= model.parameters
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
    """Whether averaged inputs hide what the last part of a model changes at `x`.

    Asked of the run that the reference leaves most of.
    """
    e = evidence.part([int(evidence.squares(evidence.left(reference.exact)).sum(axis=1).argmax())])
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


def objective(
    evidence: Evidence, model: Model, x: Array, left: Array, *, alike: float = 1.0
) -> float:
    """F, see the module, with `alike` in place of 1."""
    mean, precision = model.prior
    likelihood = evidence.counts.sum(axis=0) / CORRELATED @ np.log(evidence.variances(left) + alike)
    return float(likelihood + (x - mean) @ precision @ (x - mean))


def objective_at(evidence: Evidence, model: Model, x: Array) -> float:
    """F of a model that is replayed as recorded at `x`; infinite where it cannot run."""
    predicted = replayed(evidence, model.point(x), model, exact=True)
    if predicted is None:
        return np.inf
    left = evidence.left(predicted)
    return objective(evidence, model, x, evidence.freed(left, weights(evidence, left)))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Stand:
    """Where a fit stands: coordinates, the rows left there, and F."""

    x: Array
    left: Array
    value: float = np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class _Descent:
    """One round of a fit: F with the weights of where it began.

    Predictions are exact without a `shift`, else those of averaged inputs with it.
    """

    evidence: Evidence
    model: Model
    shift: tuple[Array, ...] | None
    weight: Array
    alike: float

    def at(self, x: Array) -> _Stand | None:
        """A stand at coordinates `x`; None where the model cannot run."""
        exact = self.shift is None
        predicted = replayed(self.evidence, self.model.point(x), self.model, exact=exact)
        if predicted is None:
            return None
        if self.shift is not None:
            predicted = [p + s for p, s in zip(predicted, self.shift, strict=True)]
        return self.valued(_Stand(x=x, left=self.evidence.left(predicted)))

    def valued(self, stand: _Stand) -> _Stand:
        """The stand with F by these weights."""
        left = self.evidence.freed(stand.left, self.weight)
        value = objective(self.evidence, self.model, stand.x, left, alike=self.alike)
        return replace(stand, value=value)

    def lessened(self, stand: _Stand, slopes: Array) -> _Stand:
        """One Gauss–Newton step, damped until it lessens F, lengthened while it does; or none."""
        e, (mean, precision), (low, high) = self.evidence, self.model.prior, self.model.bounds
        J, r = _weighted(e, slopes, stand.left, self.weight)
        A, g = J @ J.T + precision, J @ r - precision @ (stand.x - mean)
        for damping in _DAMPING:
            step = bounded_step(A, g, low - stand.x, high - stand.x, damping)
            promised = 2.0 * g @ step - step @ A @ step
            if promised < _WORTH:
                break
            best = stand
            # The weights of the log-likelihood lag behind the fit: what gives more than it promised
            # was too short.
            for times in _LONGER:
                moved = self.at(np.clip(stand.x + times * step, low, high))
                if moved is None or not moved.value < best.value:
                    break
                best = moved
                if stand.value - best.value < promised:
                    break
            if best is not stand:
                return best
        return stand


def fit(
    evidence: Evidence,
    model: Model,
    start: Array,
    reference: Reference,
    *,
    rounds: int = _ROUNDS,
    enough: float = _ENOUGH,
    alike: float = 1.0,
    exact: bool = False,
) -> Fit | None:
    """Fit a model from `start` until a round lessens F by less than `enough`; None where the model
    cannot run there.

    Channels that leave less than `alike`, a mean square in floors, count alike. Above 1 it leads
    past local minima of F, in which one channel has been given up.

    Predictions are `exact`, or those of averaged inputs shifted by what exact replays of the
    `reference` differ by: where a spring hangs at a reversal the two part at the first step.

    Slopes are the reference's, and where it has none made where the fit begins. Each step corrects
    them by what it showed (Broyden); where it can go no further those of the parts are made anew.
    """
    low, high = model.bounds
    shift = None if exact or model.quick else reference.shift
    even = _Descent(evidence=evidence, model=model, shift=shift, weight=evidence.valid, alike=alike)
    stand = even.at(np.clip(start, low, high))
    if stand is None:
        return None
    parts = range(model.parameters, len(start))
    linearized_at = stand.x
    if len(reference.slopes) >= model.parameters:
        new = model.absent(stand.x, reference.model.parts)
        linearized_at = np.concatenate([reference.linearized_at, new])
    unknown = range(len(reference.slopes), len(start))
    slopes = np.concatenate([reference.slopes, slopes_at(evidence, model, stand.x, unknown)])
    corrected = False
    for _ in range(rounds):
        descent = replace(even, weight=weights(evidence, stand.left, alike))
        before = descent.valued(stand)
        stand = descent.lessened(before, slopes)
        if before.value - stand.value >= enough:
            step = stand.x - before.x
            unforeseen = before.left - stand.left - step @ slopes
            slopes += np.outer(step / (step @ step), unforeseen)
            corrected = True
        elif corrected and parts:
            slopes[parts.start :] = slopes_at(evidence, model, stand.x, parts)
            corrected = False
        else:
            break
    ended = replace(even, weight=weights(evidence, stand.left, alike)).valued(stand)
    return Fit(
        model=model,
        x=stand.x,
        left=stand.left,
        slopes=slopes.astype(np.float32),
        linearized_at=linearized_at,
        objective=ended.value,
        shift=shift,
    )


def reusable_slopes(source: Reference | Fit) -> Array:
    """Slopes (p, n) of the parameters, or none (0, n) where a coordinate has moved since by more
    than the step that slopes are measured with, or a part has come or gone."""
    x, then = source.x, source.linearized_at
    far = len(then) != len(x) or (np.abs(x - then) > source.model.steps(then)).any()
    return source.slopes[: 0 if far else source.model.parameters]


def polished(evidence: Evidence, fitted: Fit, *, alike: float = 1.0, exact: bool = True) -> Fit:
    """The fit carried on, by exact replays or averaged inputs, until that lessens F no further.

    Slopes of the parts are made anew each time, those of the parameters where they are far from
    where those were measured.
    """
    for _ in range(_POLISHES):
        base = rebased(evidence, replace(fitted, slopes=reusable_slopes(fitted)))
        refitted = base and fit(
            evidence, fitted.model, fitted.x, base, rounds=_POLISH_ROUNDS, alike=alike, exact=exact
        )
        if not refitted:
            return fitted
        gained, fitted = fitted.objective - refitted.objective, refitted
        if abs(gained) < NAT:
            break
    return fitted


def fit_to_end(evidence: Evidence, reference: Reference, *, near: bool = False) -> Fit | None:
    """The model of a reference fitted from there on to its end; None where it cannot run.

    It begins by least squares, in which channels count alike that leave less than the loudest, and
    comes to F by way of the geometric mean; or with F, where it begins `near` its end.
    """
    start = replace(reference, slopes=reusable_slopes(reference))
    loudest = max(float(evidence.variances(evidence.left(reference.exact)).max()), 1.0)
    alikes = (1.0,) if near else (loudest, loudest**0.5, 1.0)
    fitted = fit(evidence, reference.model, reference.x, start, alike=alikes[0])
    for alike in dict.fromkeys(alikes):
        if fitted:
            fitted = polished(
                evidence,
                replace(fitted, objective=np.inf),
                alike=alike,
                # What is far from its end needs no more than a direction.
                exact=alike < loudest or alike == 1.0,
            )
    return fitted


def fit_from_several(evidence: Evidence, reference: Reference) -> Fit | None:
    """The best of fits to their end from three starts, for what much else is compared with.

    Where springs reverse F has many minima: 583 and 215 of the same good runs. They begin at the
    reference, by least squares and with F, and half way from there to where the first one ended.
    """
    first = fit_to_end(evidence, reference)
    if first is None:
        return None
    half = reference_at(evidence, reference.model, 0.5 * (reference.x + first.x))
    fits = (first, fit_to_end(evidence, reference, near=True), half and fit_to_end(evidence, half))
    return min((fitted for fitted in fits if fitted), key=lambda fitted: fitted.objective)


def leave_out(evidence: Evidence, fitted: Fit) -> tuple[Array, ...]:
    """Coordinates without each fold, one Gauss–Newton step from those of all rows.

    A fit has ended, so a step that its slopes still ask for with all rows is an error of these
    slopes, and is subtracted.
    """
    model, x = fitted.model, fitted.x
    low, high = model.bounds
    mean, precision = model.prior
    weight = weights(evidence, fitted.left)
    J, r = _weighted(evidence, fitted.slopes, fitted.left, weight)
    products, along = J @ J.T + precision, J @ r - precision @ (x - mean)
    of_all = bounded_step(products, along, low - x, high - x)
    out = []
    for f in range(int(evidence.fold.max(initial=-1)) + 1):
        held_out = evidence.fold == f
        A, g = products - J[:, held_out] @ J[:, held_out].T, along - J[:, held_out] @ r[held_out]
        step = bounded_step(A, g, low - x, high - x) - of_all
        out.append(np.clip(x + step, low, high))
    return tuple(out)


def _weighted(evidence: Evidence, slopes: Array, left: Array, weight: Array) -> tuple[Array, Array]:
    """Slopes (k, n) and rows (n,) at their weights (n,), each run's directions open."""
    both = evidence.weighted(weight)(np.concatenate([slopes, left[None]]))
    return both[:-1], both[-1]
