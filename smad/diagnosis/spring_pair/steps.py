"""The time steps of the kernel in the replay of a recorded run.

Steps are short after an input has jumped; as long as a sample while a current flows, since the
resistance follows the transformation; and longer than several samples while nothing is driven.
Readings between them are interpolated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from sim_device.plant.replay import Inputs
from smad.diagnosis.plant import Array, Index

STEP_S = 6e-3
"""After a jump: two a sample at 100 Hz, jittered ones too. One is too few for a current that
chatters."""
_JUMP = 0.3
"""In A or of a duty: after a smaller change of an input steps are no shorter. Replays of all
effects are off by 0.05 floors on average and by 0.6 at most, as with short steps after every
change; without any, one is off by 3.5."""
_DRIVEN_STEP_S = 1.2e-2
"""One a sample at 100 Hz: steps of 40 ms there leave 0.9 floors of voltage of phase_resistivity."""
_IDLE_STEP_S = 4e-2
"""A fifth of a row: most effects are off by 0.02 floors, with steps of 80 ms by twice as much."""
LONGEST_STEP_S = 1.5 * _IDLE_STEP_S
"""So that a jittered sample does not cost a second one."""
_SETTLING_S = 0.3
"""How long steps stay short: of a driver's typical lag, 0.1 s, a twentieth is left then."""
_MORE = 0.3
"""Of a step, that it may be longer before it is cut in two: jittered samples, or 20 Hz, fit."""


@dataclass(frozen=True, eq=False)
class Steps:
    """Times `t_s` (m,) at which steps end, and the `sample` (m,) whose inputs are in force there.

    `recorded` are the inputs of the n samples. Where an input or a forcing changes a step ends.
    """

    t_s: Array
    sample: Index
    recorded: Inputs

    @classmethod
    def of(cls, inputs: Inputs, forcing: Sequence[npt.ArrayLike] = ()) -> Steps:
        """The steps of recorded inputs and of series (n,) of a forcing."""
        t_s, rows = inputs.t_s, inputs.rows
        begins = np.r_[t_s[0], t_s[:-1]]
        driven = np.column_stack([rows, *forcing])
        change = np.abs(np.diff(driven, axis=0))
        other = np.r_[True, (change > 0.0).any(axis=1)]
        longest = np.where(rows[:, 0:2].any(axis=1), _DRIVEN_STEP_S, _IDLE_STEP_S)
        least = np.r_[np.full(rows.shape[1], _JUMP), np.zeros(len(forcing))]
        jumps = np.r_[True, (change > least).any(axis=1)]
        longest[t_s - _latest(begins, jumps) <= _SETTLING_S] = STEP_S
        # Jumps with an input are over by the end of its first sample.
        fresh = other | np.r_[True, other[:-1] | (longest[1:] != longest[:-1])]
        number = np.ceil((t_s - _latest(begins, fresh)) / longest - _MORE)
        last = np.flatnonzero(np.r_[(number[1:] != number[:-1]) | fresh[1:], True])
        ends = t_s[last]
        length = np.diff(ends, prepend=t_s[0])
        parts = np.maximum(np.ceil(length / longest[last] - _MORE), 1.0).astype(np.intp)
        sample = np.repeat(last, parts)
        # Counted back from the end: 0 for a step that ends with its sample.
        back = np.repeat(np.cumsum(parts), parts) - 1.0 - np.arange(len(sample))
        return cls(t_s[sample] - back * np.repeat(length / parts, parts), sample, inputs)

    @cached_property
    def inputs(self) -> Inputs:
        """Inputs of a replay with a row for each step."""
        rows = self.recorded.rows[self.sample]
        return Inputs(self.t_s, i_A=rows[:, 0:2], pump_duty=rows[:, 2:4], drain=rows[:, 4:6])

    def at_samples(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Readings (m,) at the ends of the steps, at the samples, (n,)."""
        before, share = self._between
        after = np.minimum(before + 1, len(self.t_s) - 1)
        out = {}
        for name, y in columns.items():
            base, value = y.take(before), y.take(after)
            # In place: three times as fast as with temporary arrays.
            value -= base
            value *= share
            value += base
            out[name] = value
        return out

    @cached_property
    def _between(self) -> tuple[Index, Array]:
        """The step that each sample comes after or ends with, and its share of the next."""
        if len(self.t_s) < 2:
            return np.zeros(len(self.recorded.t_s), np.intp), np.zeros(len(self.recorded.t_s))
        before = np.searchsorted(self.t_s, self.recorded.t_s, side="right") - 1
        before = np.clip(before, 0, len(self.t_s) - 2)
        span = self.t_s[before + 1] - self.t_s[before]
        return before, (self.recorded.t_s - self.t_s[before]) / span


def _latest(times: Array, where: np.ndarray) -> Array:
    """For each of increasing times the latest so far at which `where` is true."""
    return np.maximum.accumulate(np.where(where, times, -np.inf))
