"""Replay of recorded runs through a plant model, on the analysis grid.

`Dataset` lays out every predicted channel of every run as rows of one long vector: first by run,
then by output. A row is the mean over one bin of the grid. Cells are blocks of consecutive rows of
one output; they are what is reweighted, bootstrapped and left out.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from smad.gap.data.views import lacking_feeds
from smad.gap.errors import GapError
from smad.gap.plant import Array, Mask, ModelPoint, PlantModel, View
from smad.gap.runs import GapRun
from smad.gap.settings import Settings

Index = NDArray[np.intp]


class Detail(Enum):
    """How finely a replay is made.

    FINE: every sample, the plant's own step. FAST: samples averaged over half a bin, and as long a
    step. ROUGH: averaged over a whole bin, for sensitivities, first rounds, and to look where a fit
    should begin; never for a judgement. Evidence may divide the last two further.
    """

    FINE = "fine"
    FAST = "fast"
    ROUGH = "rough"


_PIECES = {Detail.FAST: 2, Detail.ROUGH: 1}


@dataclass(frozen=True, slots=True)
class Grid:
    """Bins of one run: the first sample of each bin, and the share of valid samples in it."""

    starts: Index
    weight: Array
    valid: Mask
    t_s: Array

    @classmethod
    def of(cls, run: GapRun, period_s: float) -> Grid:
        """Bins of `period_s`; a bin counts when at least half of its samples are valid."""
        bins = np.floor((run.t_s - run.t_s[0]) / period_s + 1e-6).astype(np.intp)
        starts = np.flatnonzero(np.r_[True, np.diff(bins) > 0])
        good = run.good.astype(np.float64)
        size = np.add.reduceat(np.ones_like(good), starts)
        share = np.add.reduceat(good, starts) / size
        t = np.add.reduceat(run.t_s, starts) / size
        return cls(starts, good, share >= 0.5, t)

    def mean(self, columns: Array) -> Array:
        """Mean over the valid samples of each bin, along the last axis; 0 where it has none."""
        total = np.add.reduceat(self.weight, self.starts)
        safe = np.where(self.weight > 0, columns, 0.0)
        return np.asarray(
            np.add.reduceat(safe * self.weight, self.starts, axis=-1) / np.maximum(total, 1e-12)
        )

    def majority(self, mask: Mask) -> Mask:
        """True where at least half of the samples of a bin are."""
        size = np.add.reduceat(np.ones(len(mask)), self.starts)
        out: Mask = np.add.reduceat(mask.astype(np.float64), self.starts) >= 0.5 * size
        return out


def thinned(run: GapRun, grid: Grid, pieces: int, period_s: float) -> tuple[GapRun, Grid]:
    """The run with its samples averaged over a `pieces`-th of a bin, and the same bins over them.

    A sample lies at the end of the time it stands for, so that what was applied during that time is
    in force up to it. Falls back to the run itself where it is sampled no finer than that.
    """
    step = period_s / pieces
    if run.dt_s > 0.7 * step or len(run.t_s) < 2:
        return run, grid
    piece = np.floor((run.t_s - run.t_s[0]) / step + 1e-6).astype(np.intp)
    starts = np.flatnonzero(np.r_[True, np.diff(piece) > 0])
    size = np.diff(np.r_[starts, len(piece)]).astype(np.float64)

    def mean(column: Array) -> Array:
        return np.asarray(np.add.reduceat(np.asarray(column, np.float64), starts) / size)

    thin = replace(
        run,
        t_s=run.t_s[np.r_[starts[1:], len(piece)] - 1],
        inputs={k: mean(v) for k, v in run.inputs.items()},
        outputs={k: mean(v) for k, v in run.outputs.items()},
        valid=None if run.valid is None else np.logical_and.reduceat(run.valid, starts),
        whole=run,
    )
    bins = np.searchsorted(grid.starts, starts, side="right")
    firsts = np.flatnonzero(np.r_[True, np.diff(bins) > 0])
    return thin, Grid(firsts, size, grid.valid, grid.t_s)


@dataclass(frozen=True, slots=True)
class Segment:
    """The rows of one output of one run."""

    run: int
    view: str
    sub_model: str
    key: str
    channel: str
    side: str
    start: int
    stop: int

    @property
    def rows(self) -> slice:
        return slice(self.start, self.stop)


def simulate_binned(
    plant: PlantModel,
    run: GapRun,
    grid: Grid,
    *,
    views: Sequence[str],
    keys: Sequence[tuple[str, float, float]],
    points: Sequence[ModelPoint],
    fast: bool,
) -> Array:
    """Predictions of `keys` on the grid for several points; shape (points, bins × keys).

    Each key comes with the lowest and highest value that is believed: a model that runs away must
    lose, but must not carry infinities into the fit. A plain function of picklable values, so that
    any executor can run it.
    """
    out = np.empty((len(points), len(grid.t_s) * len(keys)))
    names = [key for key, _, _ in keys]
    low, high = (np.array([[key[i]] for key in keys]) for i in (1, 2))
    for i, point in enumerate(points):
        predicted = plant.simulate(point, run, views, fast=fast)
        binned = grid.mean(np.array([predicted[name] for name in names]))
        out[i] = np.clip(np.where(np.isnan(binned), high, binned), low, high).ravel()
    return out


class Dataset:
    """Measured rows, and predictions for them. Nothing of it changes once it is made.

    A coarse replay is corrected by what its step costs at one point; `calibrated` and `matching`
    make evidence with the correction of another. `views` are the views that are laid out; a view
    whose feeds or channels a run lacks is left out for that run and named in `missing`, and so are
    outputs that are `not_shared` with other groups of runs. The steps of fast and rough replays are
    divided by `fast`; where that is 0, every replay is made in full detail, whatever is asked for.
    """

    def __init__(
        self,
        plant: PlantModel,
        runs: Sequence[GapRun],
        views: Sequence[View],
        settings: Settings,
        executor: Executor | None = None,
        *,
        fast: int = 1,
        not_shared: Iterable[str] = (),
    ) -> None:
        if not runs:
            raise GapError("there is no run to replay", action="give at least one admitted run")
        self.plant, self.runs, self.settings = plant, tuple(runs), settings
        self.views, self.executor = tuple(views), executor
        self.fast = fast
        self.detail = Detail.FAST if fast else Detail.FINE
        self.grids = [Grid.of(run, settings.period_s) for run in runs]
        whole = list(zip(self.runs, self.grids, strict=True))
        self._replayed = dict.fromkeys(Detail, whole) | {
            detail: [thinned(run, grid, fast * pieces, settings.period_s) for run, grid in whole]
            for detail, pieces in (_PIECES if fast else {}).items()
        }
        self.missing = [f"{k}: not every group of runs can be judged by it" for k in not_shared]
        self.segments: list[Segment] = []
        self._views_of_run: list[list[str]] = []
        self._keys_of_run: list[list[tuple[str, float, float]]] = []
        self._spans: list[slice] = []
        self.n = 0
        for r, run in enumerate(self.runs):
            start = self.n
            self._lay_out(r, run)
            self._spans.append(slice(start, self.n))
        self._step_error: Mapping[Detail, Array] = {d: np.zeros(self.n) for d in Detail}
        self._measure()
        self._cut_cells()

    def _lay_out(self, r: int, run: GapRun) -> None:
        """Gives every output that a run can be judged by its rows, after those there are."""
        channels = {c.name: c for c in self.plant.channels}
        present = [v for v in self.views if self._supported(v, run)]
        self._views_of_run.append([v.name for v in present])
        keys = []
        for view in present:
            for out in view.outputs:
                if out.channel not in run.outputs:
                    self.missing.append(f"{run.name}: {out.channel}")
                    continue
                start, self.n = self.n, self.n + len(self.grids[r].t_s)
                place = (out.key, out.channel, out.side, start, self.n)
                self.segments.append(Segment(r, view.name, view.sub_model, *place))
                c = channels[out.channel]
                span = c.high - c.low
                keys.append((out.key, c.low - span, c.high + span))
        self._keys_of_run.append(keys)

    def _measure(self) -> None:
        """Puts what was measured into the rows, which of them count, and when they are."""
        self.measured = np.zeros(self.n)
        self.valid = np.zeros(self.n, dtype=bool)
        self.t_s = np.zeros(self.n)
        for s in self.segments:
            grid, column = self.grids[s.run], self.runs[s.run].outputs[s.channel]
            finite = np.isfinite(column)
            self.measured[s.rows] = np.nan_to_num(grid.mean(np.where(finite, column, 0.0)))
            self.valid[s.rows] = grid.valid & grid.majority(finite)
            self.t_s[s.rows] = grid.t_s - grid.t_s[0]

    def _supported(self, view: View, run: GapRun) -> bool:
        lacking = lacking_feeds(view, run)
        if lacking:
            self.missing.append(f"{run.name}: view {view.name} lacks {', '.join(lacking)}")
        return not lacking

    def with_cells_of(self, block_s: float) -> Dataset:
        """The same rows, judged in cells of another length."""
        out = copy.copy(self)
        out.settings = replace(self.settings, block_s=block_s)
        out._cut_cells()
        return out

    def _cut_cells(self) -> None:
        starts, seg_of_cell, block_of_cell = [], [], []
        for i, s in enumerate(self.segments):
            block = np.floor(self.t_s[s.rows] / self.settings.block_s).astype(np.intp)
            cuts = np.flatnonzero(np.r_[True, np.diff(block) > 0])
            starts.extend((s.start + cuts).tolist())
            seg_of_cell.extend([i] * len(cuts))
            block_of_cell.extend(block[cuts].tolist())
        self.cell_starts = np.array(starts, dtype=np.intp)
        self.cell_stops = np.r_[self.cell_starts[1:], self.n].astype(np.intp)
        self.cell_segment = np.array(seg_of_cell, dtype=np.intp)
        self.cell_block = np.array(block_of_cell, dtype=np.intp)
        runs = np.array([s.run for s in self.segments], dtype=np.intp)
        self.cell_run = runs[self.cell_segment]
        self.cell_key = np.array([s.key for s in self.segments])[self.cell_segment]
        self.cell_size = np.add.reduceat(self.valid.astype(float), self.cell_starts)
        self.row_cell = np.repeat(np.arange(len(starts)), self.cell_stops - self.cell_starts)

    @property
    def keys(self) -> list[str]:
        """Output keys that occur, in coupling order."""
        return list(dict.fromkeys(s.key for s in self.segments))

    def rows_of(self, key: str) -> list[Segment]:
        """The segments of one output, in run order."""
        return [s for s in self.segments if s.key == key]

    def valid_rows(self, key: str, rows: Array) -> Array:
        """Values of a row quantity in the rows of one output that count, run after run."""
        return np.concatenate([rows[s.rows][self.valid[s.rows]] for s in self.rows_of(key)])

    def cell_sum(self, rows: Array) -> Array:
        """Sum of a row quantity over each cell."""
        return np.add.reduceat(rows, self.cell_starts)

    def predict(
        self,
        points: Sequence[ModelPoint],
        runs: Iterable[int] | None = None,
        detail: Detail | None = None,
    ) -> Array:
        """Predictions on the grid; shape (points, rows). Rows of runs not asked for are 0."""
        return self.predicting(points, runs, detail)()

    def predicting(
        self,
        points: Sequence[ModelPoint],
        runs: Iterable[int] | None = None,
        detail: Detail | None = None,
    ) -> Callable[[], Array]:
        """`predict`, begun: what it returns waits for the workers and gives the predictions."""
        detail = detail or self.detail
        asked = range(len(self.runs)) if runs is None else runs
        return self._replaying(points, asked, detail, self._step_error[detail])

    def _replaying(
        self, points: Sequence[ModelPoint], asked: Iterable[int], detail: Detail, correction: Array
    ) -> Callable[[], Array]:
        """Predictions as the plant makes them, with this correction; begun."""
        # A run of which no view can be judged has no rows.
        wanted = sorted(r for r in set(asked) if self._keys_of_run[r]) if points else []
        places = [(r, chunk) for r in wanted for chunk in self._chunks(len(points), len(wanted))]
        jobs = [self._job(r, points[chunk], detail) for r, chunk in places]
        if self.executor is not None:
            jobs = [self.executor.submit(job).result for job in jobs]

        def predictions() -> Array:
            out = np.zeros((len(points), self.n))
            for (r, chunk), job in zip(places, jobs, strict=True):
                np.add(job(), correction[self._spans[r]], out=out[chunk, self._spans[r]])
            return out

        return predictions

    def failed(self, values: Array, run: int, detail: Detail | None = None) -> bool:
        """Whether the plant could not simulate a run: its first output lies at the upper limit."""
        return self._at_limit(values, run, self._step_error[detail or self.detail])

    def fails(self, values: Array, detail: Detail | None = None) -> bool:
        """Whether any run of a prediction could not be simulated."""
        return any(self.failed(values, r, detail) for r in range(len(self.runs)))

    def change(self, values: Array, base: Array, detail: Detail | None = None) -> Array:
        """`values` (points, rows) less `base` (rows); 0 in runs that could not be simulated.

        A run that fails at one point says nothing of the slope there; its rows at the limit would
        drown all others.
        """
        out = np.asarray(values - base[None, :])
        for r in range(len(self.runs)):
            span = self._spans[r]
            if self.failed(base, r, detail):
                out[:, span] = 0.0
                continue
            for i, row in enumerate(values):
                if self.failed(row, r, detail):
                    out[i, span] = 0.0
        return out

    def _at_limit(self, values: Array, run: int, correction: Array) -> bool:
        if not self._keys_of_run[run]:
            return False
        _, low, high = self._keys_of_run[run][0]
        first = self._spans[run].start
        rows = slice(first, first + len(self.grids[run].t_s))
        # Bins without a valid sample are 0; a correction taken off again leaves a rounding error.
        at_limit = values[rows] - correction[rows] >= high - 1e-6 * (high - low)
        return bool(np.mean(at_limit) > 0.5)

    def calibrated(self, point: ModelPoint) -> Dataset:
        """The same evidence, whose coarser replays agree at `point` with those in full detail.

        The error of a step hardly changes between neighbouring models, so that fits can use the
        coarse step and still end at the model of the fine one.
        """
        if self.detail is Detail.FINE:
            return self
        fine = self.predict([point], detail=Detail.FINE)[0]
        return self._corrected({d: self._error_of_step(d, point, fine) for d in _PIECES})

    def coarse_error(self, point: ModelPoint, predicted: Array) -> Array:
        """What full detail changes of `predicted`, a prediction at `point`; 0 in runs that fail."""
        if self.detail is Detail.FINE:
            return np.zeros(self.n)
        fine = self.predict([point], detail=Detail.FINE)
        return np.asarray(self.change(fine, predicted, Detail.FINE)[0])

    def matching(self, point: ModelPoint, predicted: Array) -> Dataset:
        """The same evidence, whose rough replays agree at `point` with `predicted`."""
        error = self._error_of_step(Detail.ROUGH, point, predicted)
        return self._corrected({Detail.ROUGH: error})

    def _corrected(self, errors: Mapping[Detail, Array]) -> Dataset:
        other = copy.copy(self)
        other._step_error = {**self._step_error, **errors}
        return other

    def _error_of_step(self, detail: Detail, point: ModelPoint, truth: Array) -> Array:
        """What a coarser replay lacks of `truth` at `point`; 0 where either cannot be simulated."""
        runs = range(len(self.runs))
        none = np.zeros(self.n)
        coarse = self._replaying([point], runs, detail, none)()[0]
        if any(self._at_limit(y, r, none) for r in runs for y in (truth, coarse)):
            return none
        return np.asarray(truth - coarse)

    def _job(self, r: int, points: Sequence[ModelPoint], detail: Detail) -> Callable[[], Array]:
        run, grid = self._replayed[detail][r]
        return partial(
            simulate_binned,
            self.plant,
            run,
            grid,
            views=self._views_of_run[r],
            keys=self._keys_of_run[r],
            points=points,
            fast=detail is not Detail.FINE and self.detail is not Detail.FINE,
        )

    @staticmethod
    def _chunks(n_points: int, n_runs: int) -> list[slice]:
        # Enough tasks to keep a few workers busy, few enough that dispatch costs nothing.
        pieces = max(1, min(n_points, -(-8 // n_runs)))
        edges = np.linspace(0, n_points, pieces + 1).astype(int)
        return [slice(a, b) for a, b in pairwise(edges) if b > a]

    def residual(self, predicted: Array) -> Array:
        """Measured − predicted; 0 in rows that do not count."""
        return np.where(self.valid, self.measured - predicted, 0.0)

    @cached_property
    def regime_masks(self) -> Mapping[str, Mask]:
        """Row masks by regime name; the regimes of a row are those of its run and side."""
        out: dict[str, Mask] = {}
        cache: dict[tuple[int, str], dict[str, Mask]] = {}
        for s in self.segments:
            at = (s.run, s.side)
            if at not in cache:
                masks = self.plant.regimes(self.runs[s.run], s.side)
                cache[at] = {k: self.grids[s.run].majority(m) for k, m in masks.items()}
            for name, mask in cache[at].items():
                out.setdefault(name, np.zeros(self.n, dtype=bool))[s.rows] = mask
        return out
