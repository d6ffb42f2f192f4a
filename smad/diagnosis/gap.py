"""The gap: what bench and model differ by, as rows that a law must explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from smad.diagnosis.data.played import Played, finite, predictions, slopes
from smad.diagnosis.data.rows import binned
from smad.diagnosis.numerics.folds import Array, FoldRows, Index
from smad.diagnosis.numerics.white import Shrink, White
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import EffectValues, Mask, ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun

_MOST_RHO = 0.8
"""Beyond, rows would be the readings' steps alone."""
_FOLDS = 4
"""As many runs, or fewer of which each is in all folds by turns."""
_TURNS = 2


@dataclass(frozen=True, kw_only=True)
class Gap:
    """A difference of bench and model over some runs, and the white space that it is judged in.

    `point` is the reference that responses are of, `base` its prediction of each of `played`,
    `difference` what it leaves, (bins, channels). `open` are directions per run (k, bins, channels)
    at one standard deviation, that stay open. `counts`: runs that laws are selected on.
    """

    plant: PlacesPlant
    point: ModelPoint
    played: tuple[Played, ...]
    base: tuple[Array, ...]
    difference: tuple[Array, ...]
    white: White
    open: tuple[Array, ...]
    counts: tuple[bool, ...]

    @cached_property
    def _shrink(self) -> Shrink:
        return Shrink(self.white(self.open))

    def rows(self, values: Sequence[Array]) -> Array:
        """White rows of per-run arrays (m, bins, channels), beside what is left open; (m, rows)."""
        return self._shrink(self.white(values))

    @cached_property
    def z(self) -> Array:
        """White rows of the difference, (rows,)."""
        return np.asarray(self.rows([d[None] for d in self.difference])[0])

    @cached_property
    def run_of_row(self) -> Index:
        """Number of the run of each row."""
        return np.concatenate([np.full(b.size, k, dtype=np.intp) for k, b in enumerate(self.base)])

    @cached_property
    def fold(self) -> Index:
        """The fold of each row: a run, or every fourth stretch of few runs; −1 for runs that do not
        count and rows that are not valid."""
        kept = [k for k, own in enumerate(self.counts) if own]
        fold = np.full(len(self.run_of_row), -1, dtype=np.intp)
        for n, k in enumerate(kept):
            at = np.flatnonzero(self.run_of_row == k)
            block = (np.arange(len(at)) * _FOLDS * _TURNS) // len(at)
            fold[at] = n if len(kept) >= _FOLDS else block % _FOLDS
        fold[~self.white.valid] = -1
        return fold

    def fold_rows(self, found: Responses, only: Sequence[bool] | None = None) -> FoldRows:
        """The white rows with the responses of every term.

        With `only`, every response stands twice: as it is, and for the runs marked alone.
        """
        count = len(found.runs[0])
        copies = 1 if only is None else 2
        responses = np.zeros((copies * count, len(self.z)), dtype=np.float32)
        # A law at a time: all in double precision would be a gigabyte.
        for own in found.columns:
            raw = [r[own.start : own.stop].astype(np.float64) for r in found.runs]
            responses[own.start : own.stop] = self.rows(raw)
            if only is not None:
                responses[count + own.start : count + own.stop] = self.rows(kept_in(only, raw))
        return FoldRows(self.z, responses, self.fold, found.runs[0].shape[2])


def kept_in(only: Sequence[bool] | None, values: Sequence[Array]) -> list[Array]:
    """Per-run arrays, 0 in runs that are not marked; None: all are."""
    marked = [True] * len(values) if only is None else only
    return [v if own else np.zeros_like(v) for v, own in zip(values, marked, strict=True)]


def change_of(gap: Gap, point: ModelPoint) -> list[Array] | None:
    """What a model predicts beyond the reference, (bins, channels) a run; None if it cannot."""
    runs = {id(p): p for p in gap.played}
    found = dict(zip(runs, predictions(gap.plant, point, list(runs.values())), strict=True))
    if not finite(list(found.values())):
        return None
    return [found[id(p)] - b for p, b in zip(gap.played, gap.base, strict=True)]


def with_effects(point: ModelPoint, effects: EffectValues) -> ModelPoint:
    """The point with these effects in place of its own of the same names."""
    return replace(point, effects={**point.effects, **effects})


def white_change(
    gap: Gap, effects: EffectValues, *, only: Sequence[bool] | None = None
) -> Array | None:
    """White rows of what effects change of the reference, in the runs marked `only`; (rows,)."""
    moved = change_of(gap, with_effects(gap.point, effects))
    if moved is None:
        return None
    return np.asarray(gap.rows(kept_in(only, [m[None] for m in moved]))[0])


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Runs on the grid: what the model replays, and readings (bins, channels) that are valid."""

    played: tuple[Played, ...]
    values: tuple[Array, ...]
    valid: tuple[Mask, ...]

    @classmethod
    def of(cls, plant: PlantModel, runs: Sequence[GapRun], period_s: float) -> Measured:
        """The runs, each on a grid of `period_s` that begins with it."""
        played = tuple(Played.of(r, plant.inputs, float(r.t_s[0] - r.dt_s), period_s) for r in runs)
        found = [
            binned(r, p.bins, plant, p.start_s, period_s) for r, p in zip(runs, played, strict=True)
        ]
        return cls(
            played=played,
            values=tuple(b.values for b in found),
            valid=tuple(b.valid for b in found),
        )

    def __add__(self, other: Measured) -> Measured:
        return Measured(
            played=self.played + other.played,
            values=self.values + other.values,
            valid=self.valid + other.valid,
        )


@dataclass(frozen=True, kw_only=True)
class Residual(Gap):
    """Measured − predicted by a reference model."""

    measured: Measured

    @classmethod
    def of(
        cls,
        plant: PlacesPlant,
        point: ModelPoint,
        measured: Measured,
        *,
        scale: Array,
        counts: Sequence[bool],
        left_open: Sequence[Array] | None = None,
        rho: Array | None = None,
    ) -> Residual:
        """The gap to a model with these directions left open, or none.

        `scale` (channels,) is the standard deviation of a row, what neighbours tell of each other
        counted in; `rho` (channels,) is what a row tells of the next, where that is taken off.
        """
        base = tuple(predictions(plant, point, measured.played))
        of_m = zip(measured.valid, measured.values, base, strict=True)
        return cls(
            plant=plant, point=point, measured=measured, played=measured.played, base=base,
            difference=tuple(np.where(v, y - b, 0.0) for v, y, b in of_m),
            white=White.plain(scale, measured.valid, np.zeros_like(scale) if rho is None else rho),
            open=tuple(np.zeros((0, *b.shape)) for b in base) if left_open is None
            else tuple(left_open),
            counts=tuple(counts),
        )  # fmt: skip


def by_itself(shared: Sequence[Array], own: Sequence[Array]) -> tuple[Array, ...]:
    """Open directions per run: those that all share, and those of each run by itself."""
    return tuple(
        np.concatenate([shared[k], *(x if i == k else np.zeros((len(x), *own[k].shape[1:]))
                                     for i, x in enumerate(own))])
        for k in range(len(own))
    )  # fmt: skip


_CORRELATED = 4.0
"""A residual of the model's form lasts seconds: sixteen rows are worth an independent one."""


def rms(arrays: Sequence[Array], valid: Sequence[Mask]) -> Array:
    """Root mean square of per-run arrays (bins, channels) over valid rows; (channels,)."""
    square = np.sum([(np.where(v, a, 0.0) ** 2).sum(axis=0)
                     for a, v in zip(arrays, valid, strict=True)], axis=0)  # fmt: skip
    count = np.sum([v.sum(axis=0) for v in valid], axis=0)
    return np.asarray(np.sqrt(square / np.maximum(count, 1)))


def neighbours(left: Sequence[Array], valid: Sequence[Mask]) -> Array:
    """Correlation of a row with the one before it, (channels,), from what a model leaves."""
    e = [np.where(v, x, 0.0) for x, v in zip(left, valid, strict=True)]
    lagged = np.sum([(x[1:] * x[:-1]).sum(axis=0) for x in e], axis=0)
    square = np.sum([(x**2).sum(axis=0) for x in e], axis=0)
    return np.asarray(np.clip(lagged / np.maximum(square, 1e-30), 0.0, _MOST_RHO))


def row_scale(difference: Sequence[Array], valid: Sequence[Mask], least: Array) -> Array:
    """Standard deviation that a row counts with, (channels,): the residual's RMS, at least `least`.

    So every channel counts alike, whatever its floor.
    """
    return _CORRELATED * np.maximum(rms(difference, valid), least)


def residual(
    plant: PlacesPlant,
    point: ModelPoint,
    measured: Measured,
    *,
    counts: Sequence[bool],
    least: Array,
) -> Residual:
    """The gap of runs to a model whose parameters stay open within their priors.

    Its scale is that of the residual of the runs that count.
    """
    kept = [k for k, own in enumerate(counts) if own]
    base = predictions(plant, point, [measured.played[k] for k in kept])
    left = [measured.values[k] - b for k, b in zip(kept, base, strict=True)]
    scale = row_scale(left, [measured.valid[k] for k in kept], least)
    J = slopes(plant, point, measured.played)
    return Residual.of(plant, point, measured, scale=scale, counts=counts, left_open=J)
