"""Recorded inputs played again, tick by tick, as long as the bench answers as it did then."""

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

from smad.config import RepeatConfig
from smad.control.commands import FollowInputs
from smad.control.pieces import COLUMNS, DRIVEN, READINGS
from smad.control.sample import Sample
from smad.control.setpoint import Output
from smad.errors import CommandError
from smad.units import in_words, parted_name

LONGEST_QUEUE_ROWS = 100_000
"""Rows that wait: a thousand seconds at 100 Hz, some 25 MB."""
_JOINED_S = 1e-4


def require_playable(command: FollowInputs, current_limit_A: float) -> None:
    """Raise CommandError unless rows are whole, in order, and below the limit of the currents."""
    rows = len(command.t_s)
    for name in COLUMNS:
        length = len(getattr(command, name))
        if length != rows and (length or name in DRIVEN):
            raise CommandError(
                f"{name} and t_s differ in length",
                value=f"{length} and {rows}",
                action="give one value for each time",
            )
    ends = (*command.t_s[1:], command.end_s)
    for k, (begin, end) in enumerate(zip(command.t_s, ends, strict=True)):
        if not begin < end:
            raise CommandError(
                "t_s must increase from row to row, and end_s lie beyond the last",
                value=f"t_s[{k}] = {begin:g}, then {end:g}",
                action="sort the rows",
            )
    for spring, currents_A in (("X", command.i_x_A), ("Y", command.i_y_A)):
        highest_A = max(currents_A)
        if highest_A > current_limit_A:
            begin_s = command.t_s[currents_A.index(highest_A)]
            raise CommandError(
                f"the current in spring {spring} is above the host's limit at {begin_s:g} s",
                value=f"{highest_A:g} A",
                limit=f"up to {current_limit_A:g} A (control.current_limit_A)",
                action="repeat another run, or raise the limit in the configuration",
            )


@dataclass(frozen=True)
class Departure:
    """A reading that left the recorded one: values in the unit of the reading's name."""

    reading: str
    t_s: float
    measured: float
    recorded: float
    allowed: float

    def in_words(self) -> str:
        """One line: reading, both values, what is allowed, when."""
        name, unit = parted_name(self.reading)
        return (
            f"{name} is {self.measured:.3g} {in_words(unit)} instead of "
            f"{self.recorded:.3g}; control.repeat allows {self.allowed:g} either way "
            f"({self.t_s:.1f} s after the beginning)"
        )


class _Watch:
    """How long each reading has been too far from the recorded one."""

    def __init__(self, config: RepeatConfig) -> None:
        self._for_s = config.for_s
        self._allowed = (
            config.displacement_mm,
            config.temperature_K,
            config.temperature_K,
            config.force_N,
        )
        self._beyond_s = [0.0] * len(READINGS)

    def step(
        self, piece: FollowInputs, row: int, sample: Sample, t_s: float, dt_s: float
    ) -> Departure | None:
        measured = (
            sample.displacement_m * 1e3,
            sample.rtd_degC[0],
            sample.rtd_degC[1],
            sample.force_N,
        )
        for k, name in enumerate(READINGS):
            column = getattr(piece, name)
            recorded = column[row] if column else None
            # A reading of nan is no departure: host limits deal with a lost sensor.
            if recorded is None or not abs(measured[k] - recorded) > self._allowed[k]:
                self._beyond_s[k] = 0.0
                continue
            self._beyond_s[k] += dt_s
            if self._beyond_s[k] > self._for_s:
                return Departure(name, t_s, measured[k], recorded, self._allowed[k])
        return None


class InputsMode:
    """Plays rows of inputs by the board's time, each in the sample nearest to its own."""

    name = "inputs"

    def __init__(self, config: RepeatConfig, current_limit_A: float) -> None:
        self._limit_A = current_limit_A
        self._watch = _Watch(config)
        self._pieces: deque[FollowInputs] = deque()
        self._rows = 0
        self._t_s = math.nan
        self._tick_s = math.inf
        self.departure: Departure | None = None
        self.done = False

    def follow(self, command: FollowInputs) -> None:
        """Queue rows. Raises CommandError, and then keeps what was there."""
        require_playable(command, self._limit_A)
        begins_s = self._pieces[-1].end_s if self._pieces else 0.0
        if abs(command.t_s[0] - begins_s) > _JOINED_S:
            raise CommandError(
                "the rows do not go on where those before end",
                value=f"t_s[0] = {command.t_s[0]:g}",
                limit=f"{begins_s:g} s",
                action="send the pieces in order, without gaps; the first begins at 0",
            )
        if self._rows + len(command.t_s) > LONGEST_QUEUE_ROWS:
            raise CommandError(
                "the inputs would overfill the queue",
                value=f"{self._rows} waiting + {len(command.t_s)}",
                limit=f"{LONGEST_QUEUE_ROWS} rows",
                action="queue them later",
            )
        self._pieces.append(command)
        self._rows += len(command.t_s)

    def step(self, sample: Sample, dt_s: float) -> Output:
        if math.isnan(self._t_s):
            self._t_s = at_s = 0.0
        else:
            self._t_s += dt_s
            self._tick_s = min(self._tick_s, dt_s)
            # By half a sample, so that neither jitter nor rounding moves a row to the next one.
            at_s = self._t_s + 0.5 * self._tick_s
        while self._pieces and at_s >= self._pieces[0].end_s:
            self._rows -= len(self._pieces.popleft().t_s)
        if not self._pieces:
            self.done = True
            return Output()
        piece = self._pieces[0]
        row = max(0, bisect_right(piece.t_s, at_s) - 1)
        self.departure = self._watch.step(piece, row, sample, self._t_s, dt_s)
        if self.departure is not None:
            self.done = True
            return Output()
        return Output(
            (piece.i_x_A[row], piece.i_y_A[row]),
            (piece.pump_x_duty[row], piece.pump_y_duty[row]),
            (
                bool(piece.drain_x) and piece.drain_x[row],
                bool(piece.drain_y) and piece.drain_y[row],
            ),
        )
