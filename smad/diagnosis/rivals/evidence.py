"""Evidence: recorded runs as rows in floors, and the variance of a model's residual by channel.

A row is one channel of one bin, measured − predicted, divided by its floor (the standard deviation
that a perfect model leaves) and whitened by AR(1). Drifts, directions in which runs differ whatever
the model is (the day, the room), are fitted to each run beside every model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.data.rows import binned, steps_in_gaps
from smad.diagnosis.numerics.white import RunRows, lag_one_correlation, shrinking
from smad.diagnosis.places.bare import InWindows, unwrapped
from smad.diagnosis.places.place import Forcing, PlacesPlant, place_named
from smad.diagnosis.plant import Array, Index, ModelPoint, PlantModel, traits_of
from smad.diagnosis.runs import GapRun

CORRELATED = 16.0
"""Rows over which a model error is correlated: so many count as one."""
_MOST_CORRELATED = 0.98
_DRIFT_ROUNDS = 4
"""A drift of twice the usual size goes from 34 floors to 1.0 in two rounds."""
_FOLDS = 4
_TURNS = 2
_FORM_SHARES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0)
"""Form errors that are tried, as shares of a change."""
_UNRESOLVED = 0.05
"""Share of a usual drift that readings cannot resolve: of 0.2 K the last digit of an RTD."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run to replay, the readings that the model should give, and their weights (`rows`).

    `target` is (bins, channels) in channel units.
    """

    played: Played
    target: Array
    rows: RunRows

    def with_added_sd(self, sd: Array) -> Trial:
        """The trial with `sd` (bins, channels), in channel units, added in quadrature."""
        rows = replace(self.rows, sd=np.sqrt(self.rows.sd**2 + sd**2))
        return replace(self, rows=rows)


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Trials as n rows, each of one channel.

    Mean squares below `least_square`, in floors, count as equal: 1 where a floor includes the
    resolution that no simulator is trusted below, 0 where repeats have measured it.
    """

    trials: tuple[Trial, ...]
    least_square: float = 1.0

    @property
    def played(self) -> list[Played]:
        """The run of each trial."""
        return [t.played for t in self.trials]

    @cached_property
    def coarse(self) -> list[Played]:
        """The runs in fewer pieces, for slopes."""
        return [played.coarse for played in self.played]

    @cached_property
    def channels(self) -> int:
        """Number of channels."""
        return int(self.trials[0].target.shape[1])

    @cached_property
    def recorded(self) -> int:
        """Number of channels with a valid row, at least 1."""
        return max(int((self.counts.sum(axis=0) > 0).sum()), 1)

    @cached_property
    def run_of_row(self) -> Index:
        """Number of the trial of each row, (n,)."""
        sizes = [t.target.size for t in self.trials]
        return np.repeat(np.arange(len(sizes), dtype=np.intp), sizes)

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Where the rows of each trial stand."""
        stops = np.cumsum([0, *(t.target.size for t in self.trials)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(stops))

    @cached_property
    def channel_of_row(self) -> Index:
        """Number of the channel of each row, (n,)."""
        shapes = [t.target.shape for t in self.trials]
        return np.concatenate([np.tile(np.arange(c, dtype=np.intp), n) for n, c in shapes])

    @cached_property
    def valid(self) -> Array:
        """1 for valid rows, else 0; (n,)."""
        return np.concatenate([t.rows.valid.ravel() for t in self.trials]).astype(np.float64)

    @cached_property
    def counts(self) -> Array:
        """Valid rows of each trial and channel, (trials, channels)."""
        return np.asarray([t.rows.valid.sum(axis=0) for t in self.trials], dtype=np.float64)

    @property
    def independent_rows(self) -> float:
        """Independent rows of a run and channel, on average over those with a reading."""
        return float((self.counts / CORRELATED)[self.counts > 0].mean())

    @cached_property
    def floors(self) -> Array:
        """Root mean square of the floors of valid rows, in channel units, (channels,)."""
        square = sum((t.rows.sd**2 * t.rows.valid).sum(axis=0) for t in self.trials)
        return np.asarray(np.sqrt(square / np.maximum(self.counts.sum(axis=0), 1.0)))

    @property
    def by_runs(self) -> bool:
        """Whether a fold is a run; of fewer than four runs it is a quarter of the stretches."""
        return int((self.counts.sum(axis=1) > 0).sum()) >= _FOLDS

    @cached_property
    def fold(self) -> Index:
        """Number of the fold with which each row is left out, (n,); −1 where not valid."""
        fold = np.full(len(self.run_of_row), -1, dtype=np.intp)
        for k, (span, trial) in enumerate(zip(self.spans, self.trials, strict=True)):
            valid = np.flatnonzero(trial.rows.valid)
            # Of a run that was ended early, what was recorded is divided, not what was planned.
            recorded = (1 + valid.max(initial=-1) // self.channels) * self.channels
            block = k if self.by_runs else (valid * _FOLDS * _TURNS) // recorded % _FOLDS
            fold[span.start + valid] = block
        # Consecutive numbers, though a run may have no valid row.
        counted = fold >= 0
        fold[counted] = np.unique(fold[counted], return_inverse=True)[1]
        return fold

    def rows(self, values: Sequence[Array]) -> Array:
        """Per-run arrays (m, bins, channels) in channel units as rows, (m, n)."""
        parts = [t.rows.independent(v) for t, v in zip(self.trials, values, strict=True)]
        return np.concatenate(parts, axis=1)

    def change(self, predicted: Sequence[Array], base: Sequence[Array]) -> Array:
        """The difference of two predictions, (bins, channels) a trial, as rows (n,)."""
        differences = [(p - b)[None] for p, b in zip(predicted, base, strict=True)]
        return np.asarray(self.rows(differences)[0])

    def residual(self, predicted: Sequence[Array]) -> Array:
        """Targets less predictions, (bins, channels) a trial, as rows (n,)."""
        pairs = zip(self.trials, predicted, strict=True)
        return np.asarray(self.rows([(t.target - p)[None] for t, p in pairs])[0])

    @cached_property
    def drift_rows(self) -> tuple[Array, ...]:
        """Drifts of each trial at one standard deviation, as rows (k, rows of the trial)."""
        return tuple(t.rows.days for t in self.trials)

    @property
    def has_drifts(self) -> bool:
        return any(len(d) for d in self.drift_rows)

    def less_drifts(self, r: Array, weight: Array) -> Array:
        """Rows `r` (n,) less the drifts fitted to them with `weight` (n,) of their squares."""
        if not self.has_drifts:
            return r
        pairs = zip(self.drift_coefficients(r, weight), self.drift_rows, strict=True)
        return np.asarray(r - np.concatenate([u @ D for u, D in pairs]))

    def drift_coefficients(self, r: Array, weight: Array) -> list[Array]:
        """Coefficients (k,) of the drifts of each trial, fitted to rows `r` with `weight`, both
        (n,).
        """
        out = []
        for span, D in zip(self.spans, self.drift_rows, strict=True):
            W = D * weight[span]
            out.append(np.asarray(np.linalg.solve(W @ D.T + np.eye(len(D)), W @ r[span])))
        return out

    def whitening(self, weight: Array) -> Callable[[Array], Array]:
        """A function that multiplies rows (m, n) by √`weight` and marginalises the drifts."""
        root = np.sqrt(weight)
        pairs = zip(self.spans, self.drift_rows, strict=True)
        shrinks = [(span, shrinking(D * root[span])) for span, D in pairs if len(D)]

        def of(values: Array) -> Array:
            out = values * root
            for span, shrink in shrinks:
                out[:, span] = shrink(out[:, span])
            return out

        return of

    def squares(self, r: Array) -> Array:
        """Sum of squares of rows by trial and channel, (trials, channels)."""
        key = self.run_of_row * self.channels + self.channel_of_row
        size = len(self.trials) * self.channels
        # The squares of a rival that diverges may overflow: they count as infinite.
        with np.errstate(over="ignore"):
            sums = np.bincount(key, r * r * self.valid, minlength=size)
        return np.asarray(sums.reshape(len(self.trials), self.channels), dtype=np.float64)

    def variances(self, r: Array) -> Array:
        """Mean square of the valid rows of each channel, (channels,); 0 where it has none."""
        return np.asarray(self.squares(r).sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1.0))

    def correlation_rows(self, r: Array) -> Array:
        """Correlation time of each channel's rows, in rows, (channels,): (1 + ρ)/(1 − ρ)."""
        counted = r * self.valid
        pairs = zip(self.trials, self.spans, strict=True)
        courses = (counted[span].reshape(trial.target.shape) for trial, span in pairs)
        rho = lag_one_correlation(courses, _MOST_CORRELATED)
        return np.asarray((1.0 + rho) / (1.0 - rho))

    def part(self, chosen: Sequence[int]) -> Evidence:
        """Some of the trials."""
        return replace(self, trials=tuple(self.trials[k] for k in chosen))


def weights(
    evidence: Evidence, residual: Array, offset: float = 1.0, tau: Array | float = CORRELATED
) -> Array:
    """Weight of each row's square, (n,): 1/((v_c + offset) τ), 0 where it is not valid.

    `tau` are correlation times in rows, of all channels or (channels,).
    """
    of_channel = 1.0 / ((evidence.variances(residual) + offset) * tau)
    return np.asarray(of_channel[evidence.channel_of_row] * evidence.valid)


def without_drifts(evidence: Evidence, residual: Array) -> Array:
    """Rows (n,) less the drifts, fitted with weights that follow from what remains.

    Rows with a large drift weigh little at first, so the fit is repeated a few times. This is for
    judging only: in a fit the weights include the drift, or drifts would absorb what a model of the
    wrong form lacks.
    """
    rows = residual
    for _ in range(_DRIFT_ROUNDS if evidence.has_drifts else 0):
        rows = evidence.less_drifts(residual, weights(evidence, rows))
    return rows


def with_drifts(evidence: Evidence, predicted: Sequence[Array]) -> list[Array]:
    """Predictions (bins, channels) with the drifts that are fitted when they are judged."""
    residual = evidence.residual(predicted)
    weight = weights(evidence, without_drifts(evidence, residual))
    coefficients = evidence.drift_coefficients(residual, weight)
    of_trials = zip(evidence.trials, coefficients, predicted, strict=True)
    return [p + np.tensordot(u * t.rows.day_sd, t.rows.day, axes=1) for t, u, p in of_trials]


def form_sd_of(
    evidence: Evidence, predicted: Sequence[Array], changes: Sequence[Array]
) -> tuple[Array, ...]:
    """Standard deviation of the form error of `changes`, (bins, channels) a trial, in channel
    units.

    For each channel it is the share of the change that makes the residual likeliest: normal, with
    the floor and this share added in quadrature.
    """
    sd = np.concatenate([t.rows.sd for t in evidence.trials])
    valid = np.concatenate([t.rows.valid for t in evidence.trials])
    pairs = zip(evidence.trials, predicted, strict=True)
    residual = np.concatenate([t.target - p for t, p in pairs])
    moved = np.concatenate(changes)
    best, share = np.full(evidence.channels, np.inf), np.zeros(evidence.channels)
    for f in _FORM_SHARES:
        variance = sd**2 + (f * moved) ** 2
        cost = np.where(valid, np.log(variance) + residual**2 / variance, 0.0).sum(axis=0)
        share = np.where(cost < best, f, share)
        best = np.minimum(cost, best)
    return tuple(share * c for c in changes)


def recorded_evidence(
    plant: PlacesPlant, runs: Sequence[GapRun], floors: Array, period_s: float, point: ModelPoint
) -> Evidence:
    """Recorded runs as evidence in rows of `period_s` with `floors` (channels,).

    The drifts of each run are those of the plant's traits, replayed by the model at `point`.
    """
    trials = []
    for run in runs:
        played = Played.of(run, plant.inputs, run.begins_s, period_s)
        measured = binned(run, played.bins, plant, played.start_s, period_s, partly=True)
        rows = RunRows.of(floors, measured.valid, drift_directions(plant, point, played))
        trials.append(Trial(played=played, target=measured.values, rows=rows))
    return Evidence(trials=tuple(trials))


def drift_directions(plant: PlacesPlant, point: ModelPoint, played: Played) -> Array:
    """Drifts of a run at one standard deviation, (k, bins, channels) in channel units.

    They are a constant and a straight line at each place that drifts; a step of an input that falls
    into lost samples, at either end of the gap; and an error of each reading that the run or a
    window begins from. Near a reversal less than a reading can resolve decides which way a spring
    goes: so a small constant of either sign is replayed exactly, too.
    """
    run, whole = played.run, played.whole
    steady, small = np.ones(len(run.t_s)), np.full(len(whole.t_s), _UNRESOLVED)
    line = (run.t_s - run.t_s[0]) / max(run.duration_s, 1e-9)

    def readings(of: GapRun, forcing: Forcing, *, exact: bool = False) -> Array:
        outputs = plant.forced(point, of, forcing, fast=not exact)
        return played.on_grid(outputs, plant.channels, exact=exact)

    base, exact_base = readings(run, {}), readings(whole, {}, exact=True)
    drifts: list[Array] = []
    for name, size in traits_of(plant).drift.items():
        for key in ((name, side) for side in place_named(plant, name).sides):
            drifts += [readings(run, {key: size * c}) - base for c in (steady, line)]
            drifts += [
                readings(whole, {key: size * c}, exact=True) - exact_base for c in (small, -small)
            ]
    for name, gaps in steps_in_gaps(whole, plant.inputs).items():
        for before, after in zip(*gaps, strict=True):
            column = np.array(whole.inputs[name], dtype=np.float64)
            column[before + 1 : after] = column[after]
            stepped = whole.with_columns(inputs={name: column})
            drifts.append(readings(stepped, {}, exact=True) - exact_base)
    drifts += start_directions(plant, point, played)
    if isinstance(plain := unwrapped(plant), InWindows):
        begun = plain.begun_otherwise(point, run)
        drifts += [played.on_grid(outputs, plant.channels) - base for outputs in begun]
    return np.array(drifts).reshape(-1, *base.shape)


def start_directions(plant: PlantModel, point: ModelPoint, played: Played) -> list[Array]:
    """What the usual error of each reading that a run starts from does, (bins, channels) each."""
    starts = played.run.starts
    away = [
        played.with_fields(starts={**starts, name: starts.get(name, 0.0) + reading.error})
        for name, reading in traits_of(plant).starts.items()
        if name in starts or not reading.taken
    ]
    if not away:
        return []
    base, *moved = predictions(plant, point, [played, *away], exact=True)
    return [np.nan_to_num(values - base) for values in moved]
