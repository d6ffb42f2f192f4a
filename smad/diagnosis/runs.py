"""A run as the diagnosis sees it: inputs and measured channels on one time axis."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property

import numpy as np

from smad.arrays import Array, Index, Mask
from smad.diagnosis.errors import GapError
from smad.records.units import Written

_COARSE = 1e-6
"""Resolution of a clock, as a share of the sample interval, above which the interval is a mean."""
_ROUNDINGS = 8.0
"""Most rounding errors of the clock that add up in the position of a sample on a grid."""


@dataclass(frozen=True, eq=False)
class GapRun:
    """One recorded run.

    `t_s` is the sample time. `inputs` and `outputs` hold one value a sample, in the units of the
    plant's signals and channels, NaN where nothing was recorded; a channel that the bench lacks is
    absent. `valid` is False where a sample was lost or marked bad; values there are never read.
    `notes` carry facts of the log that the admission reports, such as its being cut short. `whole`
    is the run that this one was thinned from, for what must be replayed at its own pace. A
    `trusted` run is not refused for what the nominal model thinks of it. `written` says how a
    column stands in its file, where it was converted. `offsets` are series of times and values by
    channel, in its unit: a plant adds them to its signals before its sensors, if it can. `starts`
    says by channel where the bench starts, if not as it was mounted (see `Traits.starts`); a plant
    starts there, if it can. `starts_read`: these are readings, which the sensors of a model may
    falsify; it starts where it would read them.
    """

    name: str
    t_s: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]
    _: KW_ONLY
    valid: Mask | None = None
    cut_short: bool = False
    notes: tuple[str, ...] = ()
    whole: GapRun | None = None
    trusted: bool = False
    offsets: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    written: Mapping[str, Written] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)
    starts_read: bool = False

    def __post_init__(self) -> None:
        # What is an array already stays the same object.
        if not _is_column(self.t_s):
            object.__setattr__(self, "t_s", self._numbers("t_s", self.t_s))
        for role, kind in (("inputs", self.inputs), ("outputs", self.outputs)):
            if not all(_is_column(column) for column in kind.values()):
                numbers = {name: self._numbers(name, column) for name, column in kind.items()}
                object.__setattr__(self, role, numbers)
        n = len(self.t_s)
        for kind in (self.inputs, self.outputs):
            for name, column in kind.items():
                if len(column) != n:
                    raise GapError(
                        f"run {self.name}: column {name} is not as long as the time axis",
                        value=len(column),
                        limit=n,
                        action="give every column one value for each sample",
                    )

    def _numbers(self, name: str, column: object) -> Array:
        """A column, such as a list, as an array. Raises GapError for what is no numbers."""
        try:
            numbers = np.asarray(column, dtype=np.float64)
        except (TypeError, ValueError):
            numbers = np.zeros(())
        if numbers.ndim != 1:
            raise GapError(
                f"run {self.name}: column {name} is not a sequence of numbers",
                value=type(column).__name__,
                limit="one number for each sample",
                action="give an array, or a list",
            )
        return numbers

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample; 0 for an empty run."""
        return float(self.t_s[-1] - self.t_s[0]) if len(self.t_s) > 1 else 0.0

    @cached_property
    def dt_s(self) -> float:
        """Median sample interval."""
        if len(self.t_s) < 2:
            return 0.0
        steps = np.diff(self.t_s)
        usual = float(np.median(steps))
        if self.resolution_s <= _COARSE * usual:
            return usual
        # Each step of Unix time is rounded to 0.24 µs, and the median with it; a mean is not.
        near = np.abs(steps - usual) <= 2.0 * self.resolution_s
        return float(steps[near].mean()) if near.any() else usual

    @property
    def resolution_s(self) -> float:
        """Spacing of numbers at the start of the clock: 0.24 µs for Unix time, near 0 at 0."""
        return float(np.spacing(np.abs(self.t_s[:1])).max(initial=0.0))

    def period_numbers(self, elapsed_s: Array, period_s: float, usual: float) -> Index:
        """Number of the period in which each of the times since a start lies, (n,).

        A sample before an edge by the share `usual` of a period counts as on it; so does one by
        more, if the clock is rounded more coarsely.
        """
        share = max(usual, _ROUNDINGS * self.resolution_s / max(period_s, 1e-9))
        return np.asarray(np.floor(elapsed_s / period_s + share), dtype=np.intp)

    @property
    def begins_s(self) -> float:
        """Start of the interval that the first sample stands for."""
        return float(self.t_s[0] - self.dt_s)

    @property
    def as_recorded(self) -> GapRun:
        """`whole`, or the run itself where it was not thinned."""
        return self if self.whole is None else self.whole

    @cached_property
    def pieces(self) -> Array:
        """Number of samples of `whole` in each sample, (n,); ones in a run not thinned."""
        if self.whole is None:
            return np.ones(len(self.t_s))
        stops = np.searchsorted(self.whole.t_s, self.t_s, side="right")
        return np.asarray(np.diff(np.r_[0, stops]), dtype=np.float64)

    @cached_property
    def readings(self) -> Array:
        """Number of valid samples of `whole` in each sample, (n,)."""
        good = self.as_recorded.good.astype(np.float64)
        size = self.pieces.astype(np.intp)
        return np.asarray(np.add.reduceat(good, np.cumsum(size) - size))

    @property
    def digest(self) -> str:
        """SHA-256 of names, times, inputs and outputs, as hexadecimal digits."""
        h = hashlib.sha256()
        h.update(np.ascontiguousarray(self.t_s).tobytes())
        for kind in (self.inputs, self.outputs):
            for name in sorted(kind):
                h.update(name.encode())
                h.update(np.ascontiguousarray(kind[name], dtype=np.float64).tobytes())
        return h.hexdigest()

    @property
    def good(self) -> Mask:
        """`valid`, or all True."""
        return np.ones(len(self.t_s), dtype=bool) if self.valid is None else self.valid

    def at_start(self, channels: Iterable[str]) -> dict[str, float]:
        """Median of the valid samples of each measured channel in the first second, by name."""
        whole = self.as_recorded
        good = whole.good[: max(1, round(1.0 / max(whole.dt_s, 1e-6)))]
        seen = {c: whole.outputs[c][: len(good)][good] for c in channels if c in whole.outputs}
        finite = {c: v[np.isfinite(v)] for c, v in seen.items()}
        return {c: float(np.median(v)) for c, v in finite.items() if len(v)}

    @property
    def undriven(self) -> GapRun:
        """The run up to the first sample with an input that is not 0, at least one sample."""
        whole = self.as_recorded
        driven = np.any([np.nan_to_num(column) != 0.0 for column in whole.inputs.values()], axis=0)
        return whole.part(0, max(int(np.argmax(driven)) if driven.any() else len(driven), 1))

    def with_columns(
        self, inputs: Mapping[str, Array] | None = None, outputs: Mapping[str, Array] | None = None
    ) -> GapRun:
        """The same run with some columns replaced."""
        return replace(
            self,
            inputs={**self.inputs, **(inputs or {})},
            outputs={**self.outputs, **(outputs or {})},
        )

    def part(self, start: int, stop: int) -> GapRun:
        """Samples `start` to `stop`."""
        return replace(
            self,
            t_s=self.t_s[start:stop],
            inputs={k: v[start:stop] for k, v in self.inputs.items()},
            outputs={k: v[start:stop] for k, v in self.outputs.items()},
            valid=None if self.valid is None else self.valid[start:stop],
        )


def _is_column(column: object) -> bool:
    return isinstance(column, np.ndarray) and column.ndim == 1


def bridged(column: Array) -> Array:
    """The column (n,) with NaN filled by linear interpolation; unchanged if all or none are NaN."""
    good = np.isfinite(column)
    if good.all() or not good.any():
        return column
    index = np.arange(len(column))
    return np.interp(index, index[good], column[good])


def ranges_of(columns: Iterable[Mapping[str, Array]]) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each column over several mappings; empty columns do not count."""
    out: dict[str, tuple[float, float]] = {}
    for of_run in columns:
        for name, values in of_run.items():
            if len(values):
                low, high = out.get(name, (np.inf, -np.inf))
                out[name] = min(low, float(values.min())), max(high, float(values.max()))
    return out


def distinctly_named(groups: Iterable[Sequence[GapRun]]) -> list[list[GapRun]]:
    """The groups with distinct names: a second run of a name is numbered, "push (2)"."""
    taken: set[str] = set()

    def named(run: GapRun) -> GapRun:
        tries = (run.name, *(f"{run.name} ({i})" for i in range(2, len(taken) + 2)))
        name = next(n for n in tries if n not in taken)
        taken.add(name)
        return replace(run, name=name)

    return [[named(run) for run in group] for group in groups]
