"""Evidence: recorded runs as rows in floors, and the channel variances that a model leaves there.

A row is one channel of one bin, measured − predicted, in standard deviations of what a perfect
model leaves (its floor), what neighbours tell of each other taken off. Directions in which one run
differs from another by itself (a day, a room that wanders) are fitted to each run beside any model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from smad.diagnosis.data.played import Played
from smad.diagnosis.data.rows import binned, steps_in_gaps
from smad.diagnosis.numerics.white import RunRows, Shrink, lag_one_correlation
from smad.diagnosis.places.bare import BarePlaces
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.plant import Array, Index, ModelPoint, traits_of
from smad.diagnosis.runs import GapRun

CORRELATED = 16.0
"""Rows that an error of the model's form is correlated over: as many count as one."""
_MOST_CORRELATED = 0.98
_DRIFT_ROUNDS = 4
"""A drift of twice the usual size that shows as 34 floors is at 1.0 after two."""
_FOLDS = 4
_TURNS = 2
_FORM_SHARES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0)
"""Shares of a change that are tried for how far its form is off: none, and up to three times it."""
_UNTOLD = 0.05
"""Share of what a place wanders by that readings cannot tell: of 0.2 K the last digit of an RTD."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run: what is replayed, and what the simulator should show there.

    `target` (bins, channels) is in channel units; `rows` says which of it counts and how much.
    """

    played: Played
    target: Array
    rows: RunRows

    def less_known(self, sd: Array) -> Trial:
        """The same where as much more, (bins, channels) in channel units, is not known."""
        rows = replace(self.rows, sd=np.sqrt(self.rows.sd**2 + sd**2))
        return replace(self, rows=rows)


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Some trials as rows; n rows in all, each of one of the channels.

    `fold` (n,) numbers the part of the data that a row is left out with, −1 where it is not valid.
    `least` is the mean square in floors below which nothing can be told: 1 where a floor holds what
    no simulator is trusted below, 0 where repeats have shown it.
    """

    trials: tuple[Trial, ...]
    least: float = 1.0

    @property
    def played(self) -> list[Played]:
        """What is replayed."""
        return [t.played for t in self.trials]

    @cached_property
    def coarse(self) -> list[Played]:
        """The same in fewer pieces, for slopes."""
        return [played.coarse for played in self.played]

    @cached_property
    def channels(self) -> int:
        """How many channels there are."""
        return int(self.trials[0].target.shape[1])

    @cached_property
    def recorded(self) -> int:
        """How many of them have a row that counts, at least one."""
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
        """1 for rows that count, else 0; (n,)."""
        return np.concatenate([t.rows.valid.ravel() for t in self.trials]).astype(np.float64)

    @cached_property
    def counts(self) -> Array:
        """Valid rows of each trial and channel, (trials, channels)."""
        return np.asarray([t.rows.valid.sum(axis=0) for t in self.trials], dtype=np.float64)

    @cached_property
    def floors(self) -> Array:
        """Root mean square of the floors of valid rows, in channel units, (channels,)."""
        square = sum((t.rows.sd**2 * t.rows.valid).sum(axis=0) for t in self.trials)
        return np.asarray(np.sqrt(square / np.maximum(self.counts.sum(axis=0), 1.0)))

    @property
    def by_runs(self) -> bool:
        """Whether each run is left out as a whole: of fewer than four, stretches are."""
        return len(self.trials) >= _FOLDS

    @cached_property
    def fold(self) -> Index:
        """Each run, or of fewer than four every fourth stretch of them; −1 where not valid."""
        fold = np.empty(len(self.run_of_row), dtype=np.intp)
        for k in range(len(self.trials)):
            span = self.spans[k]
            size = span.stop - span.start
            block = (np.arange(size) * _FOLDS * _TURNS) // size
            fold[span] = k if self.by_runs else block % _FOLDS
        fold[self.valid == 0.0] = -1
        return fold

    def rows(self, values: Sequence[Array]) -> Array:
        """Per-run arrays (m, bins, channels) in channel units as rows, (m, n)."""
        parts = [t.rows.independent(v) for t, v in zip(self.trials, values, strict=True)]
        return np.concatenate(parts, axis=1)

    def change(self, predicted: Sequence[Array], base: Sequence[Array]) -> Array:
        """Rows of what predictions (bins, channels) differ by from others, (n,)."""
        differences = [(p - b)[None] for p, b in zip(predicted, base, strict=True)]
        return np.asarray(self.rows(differences)[0])

    def left(self, predicted: Sequence[Array]) -> Array:
        """Rows that predictions (bins, channels) leave of the targets, (n,)."""
        pairs = zip(self.trials, predicted, strict=True)
        return np.asarray(self.rows([(t.target - p)[None] for t, p in pairs])[0])

    @cached_property
    def wandering(self) -> tuple[Array, ...]:
        """Directions of each run by itself at one standard deviation, (k, rows of the run)."""
        return tuple(t.rows.days for t in self.trials)

    @property
    def wanders(self) -> bool:
        """Whether any run has directions of its own."""
        return any(len(d) for d in self.wandering)

    def freed(self, r: Array, weight: Array) -> Array:
        """Rows `r` (n,) less what the directions of each run take, at weights (n,) of squares."""
        if not self.wanders:
            return r
        taken = zip(self.taken(r, weight), self.wandering, strict=True)
        return np.asarray(r - np.concatenate([u @ D for u, D in taken]))

    def taken(self, r: Array, weight: Array) -> list[Array]:
        """How far rows `r` (n,) go along the directions of each run, (k,), at weights (n,)."""
        out = []
        for span, D in zip(self.spans, self.wandering, strict=True):
            W = D * weight[span]
            out.append(np.asarray(np.linalg.solve(W @ D.T + np.eye(len(D)), W @ r[span])))
        return out

    def weighted(self, weight: Array) -> Callable[[Array], Array]:
        """What takes rows (m, n) times the root of their weights, each run's directions open."""
        root = np.sqrt(weight)
        pairs = zip(self.spans, self.wandering, strict=True)
        shrinks = [(span, Shrink(D * root[span])) for span, D in pairs if len(D)]

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
    evidence: Evidence, left: Array, alike: float = 1.0, tau: Array | float = CORRELATED
) -> Array:
    """What each row's square counts, (n,): 1/((v_c + alike) τ), 0 where it is not valid.

    `tau` are correlation times in rows, of all channels or (channels,).
    """
    of_channel = 1.0 / ((evidence.variances(left) + alike) * tau)
    return np.asarray(of_channel[evidence.channel_of_row] * evidence.valid)


def without_drifts(evidence: Evidence, left: Array) -> Array:
    """Rows (n,) less what wanders in each run, at weights that follow from what is left without it.

    Rows that hold a drift weigh little, and then little of it is taken: so a few rounds are needed.
    This is for judging. A fit takes the weights of what it leaves, the drift included: in a model
    of the wrong form drifts would else take much of what it lacks.
    """
    rows = left
    for _ in range(_DRIFT_ROUNDS if evidence.wanders else 0):
        rows = evidence.freed(left, weights(evidence, rows))
    return rows


def with_drifts(evidence: Evidence, predicted: Sequence[Array]) -> list[Array]:
    """Predictions (bins, channels) with what wanders in each run, as they are judged."""
    left = evidence.left(predicted)
    weight = weights(evidence, without_drifts(evidence, left))
    steps = zip(evidence.trials, evidence.taken(left, weight), predicted, strict=True)
    return [p + np.tensordot(u * t.rows.day_sd, t.rows.day, axes=1) for t, u, p in steps]


def form_of(
    evidence: Evidence, predicted: Sequence[Array], changes: Sequence[Array]
) -> tuple[Array, ...]:
    """How well the form of `changes` is known, one deviation in channel units, as them.

    Of each channel that is the share of the change under which what the prediction leaves is
    likeliest, normal with that beside the floor. All are (bins, channels) of each trial.
    """
    sd, valid = (
        np.concatenate(rows)
        for rows in zip(*((t.rows.sd, t.rows.valid) for t in evidence.trials), strict=True)
    )
    left = np.concatenate([t.target - p for t, p in zip(evidence.trials, predicted, strict=True)])
    moved = np.concatenate(changes)
    best, share = np.full(evidence.channels, np.inf), np.zeros(evidence.channels)
    for f in _FORM_SHARES:
        variance = sd**2 + (f * moved) ** 2
        cost = np.where(valid, np.log(variance) + left**2 / variance, 0.0).sum(axis=0)
        share = np.where(cost < best, f, share)
        best = np.minimum(cost, best)
    return tuple(share * c for c in changes)


def recorded_evidence(
    plant: PlacesPlant, runs: Sequence[GapRun], floors: Array, period_s: float, point: ModelPoint
) -> Evidence:
    """Recorded runs as evidence, each on a grid of `period_s`; `floors` (channels,) of a row.

    What the plant's traits say wanders by itself is left open in each run, as the model at `point`
    shows it.
    """
    trials = []
    for run in runs:
        played = Played.of(run, plant.inputs, run.begins_s, period_s)
        measured = binned(run, played.bins, plant, played.start_s, period_s, partly=True)
        rows = RunRows.of(floors, measured.valid, wandering(plant, point, played))
        trials.append(Trial(played=played, target=measured.values, rows=rows))
    return Evidence(trials=tuple(trials))


def wandering(plant: PlacesPlant, point: ModelPoint, played: Played) -> Array:
    """What a constant and a straight line at each place that wanders change, at its usual size;
    what a run's start may be off by; and what an input changes that steps while samples are lost,
    which may then be as after the step, or as before it.

    Near a reversal a spring goes one way or the other by less than a reading can tell: a small
    constant, up and down, is replayed as recorded.
    """
    run, whole = played.run, played.whole
    steady, small = np.ones(len(run.t_s)), np.full(len(whole.t_s), _UNTOLD)
    line = (run.t_s - run.t_s[0]) / max(run.duration_s, 1e-9)

    def readings(outputs: Mapping[str, Array], *, exact: bool = False) -> Array:
        return played.on_grid(outputs, plant.channels, exact=exact)

    base = readings(plant.forced(point, run, {}, fast=True))
    exact = readings(plant.forced(point, whole, {}), exact=True)
    out = [np.zeros((0, *base.shape))]
    places = {p.name: p for p in plant.places}
    for name, size in traits_of(plant).drift.items():
        for side in places[name].sides:
            for course in (steady, line):
                forced = plant.forced(point, run, {(name, side): size * course}, fast=True)
                out.append((readings(forced) - base)[None])
            for course in (small, -small):
                forced = plant.forced(point, whole, {(name, side): size * course})
                out.append((readings(forced, exact=True) - exact)[None])
    for name, gaps in steps_in_gaps(whole, plant.inputs).items():
        for before, after in zip(*gaps, strict=True):
            column = np.array(whole.inputs[name], dtype=np.float64)
            column[before + 1 : after] = column[after]
            stepped = plant.forced(point, whole.with_columns(inputs={name: column}), {})
            out.append((readings(stepped, exact=True) - exact)[None])
    if isinstance(plant, BarePlaces):
        out += [(readings(begun) - base)[None] for begun in plant.begun_otherwise(point, run)]
    return np.concatenate(out)
