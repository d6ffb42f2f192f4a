"""A recorded run as inputs that can be played again, with what must agree before they are."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from firmware_protocol.enums import BoardState
from smad.arrays import Array
from smad.config import Config, bench_in
from smad.control.commands import FollowInputs
from smad.control.inputs import LONGEST_QUEUE_ROWS, require_playable
from smad.control.pieces import READINGS, rows_in_pieces
from smad.control.plan import Action, Do, Plan, UntilDone
from smad.errors import CommandError
from smad.experiments.errors import ExperimentError
from smad.experiments.rest import Start, start_of_columns
from smad.runlog.reader import Run, read_run
from smad.runlog.schema import MISSING_INTEGER

_DRIVEN = {
    "i_x_A": "i_applied_x_A",
    "i_y_A": "i_applied_y_A",
    "pump_x_duty": "duty_x",
    "pump_y_duty": "duty_y",
}
"""Fields of FollowInputs with the channels that hold what the board really applied."""

_DRAINS = ("drain_x", "drain_y")
LONGEST_GAP_S = 0.1
"""A board that hears nothing for so long lets go of the current, whatever the log says before."""
_RATE_TOLERANCE = 0.02
_DECIMALS = 4


class RepeatError(ExperimentError):
    """A run that cannot be repeated, or not on this bench."""


@dataclass(frozen=True)
class RecordedInputs:
    """A run to play again.

    `command` holds its inputs and readings, over the stretch in which its board was armed first;
    `start` is where that began, `armed_s` its length, `whole_s` that of the run.
    `uid` is the board's serial number, `bench` the bench's name; either is empty where the log does
    not tell. `source` names the run in the header of the new one: file and SHA-256.
    """

    name: str
    source: str
    command: FollowInputs
    rate_hz: float
    uid: str
    bench: str
    start: Start
    armed_s: float
    whole_s: float

    def plan(self, name: str = "") -> Plan:
        """The same as a plan, whatever carries it out; without a name, as the repeat of its run."""
        actions: list[Action] = [Do(piece) for piece in rows_in_pieces(self.command)]
        waited = (*actions, UntilDone(self.command.end_s + 5.0))
        name = name or f"repeat-of-{Path(self.name).stem}"[:64]
        return Plan(name, waited, repeats=self.source)

    def part_in_words(self) -> str:
        """Return which part of the run is repeated; empty where it is all of it."""
        if self.armed_s >= self.whole_s - 0.1:
            return ""
        armed = f"its board was armed for {self.armed_s:.1f} of {self.whole_s:.1f} s"
        return f"{self.name}: {armed}; that part is repeated"

    def require_fit(self, config: Config) -> None:
        """Raise RepeatError where rate or limits of the bench forbid it: nothing was moved yet."""
        if abs(self.rate_hz - config.link.rate_hz) > _RATE_TOLERANCE * config.link.rate_hz:
            raise RepeatError(
                f"{self.name} was recorded at another rate, and is played sample by sample",
                value=f"{self.rate_hz:.4g} Hz",
                limit=f"{config.link.rate_hz} Hz (link.rate_hz)",
                action="start the daemon with the rate of the run",
            )
        rows = len(self.command.t_s)
        if rows > LONGEST_QUEUE_ROWS:
            raise RepeatError(
                f"{self.name} is too long to be repeated",
                value=f"{rows} samples",
                limit=f"{LONGEST_QUEUE_ROWS} samples",
                action="repeat a shorter run",
            )
        try:
            require_playable(self.command, config.control.current_limit_A)
        except CommandError as error:
            raise RepeatError(f"{self.name}: {error.cause}", **error.parts) from None
        limits = config.limits
        for reading, highest, where in (
            ("displacement_mm", limits.displacement_max_mm, "limits.displacement_max_mm"),
            ("rtd_x_degC", limits.temperature_max_degC, "limits.temperature_max_degC"),
            ("rtd_y_degC", limits.temperature_max_degC, "limits.temperature_max_degC"),
            ("force_N", limits.force_max_N, "limits.force_max_N"),
        ):
            magnitudes = [abs(v) for v in getattr(self.command, reading) if v is not None]
            if magnitudes and max(magnitudes) > highest:
                raise RepeatError(
                    f"{self.name} exceeds a limit of this bench: {reading}",
                    value=f"{max(magnitudes):.4g}",
                    limit=f"{highest:g} ({where})",
                    action="the host would reduce its currents; repeat a run within the limits",
                )

    def require_bench(self, uid: str, bench: str) -> None:
        """Raise RepeatError when the run is of another board or another bench."""
        for logged, connected in ((self.uid, uid), (self.bench, bench)):
            if logged != connected:
                raise RepeatError(
                    f"{self.name} was recorded on another bench",
                    value=logged or "a log that names none",
                    limit=connected,
                    action="to play its inputs here all the same, add --other-bench",
                )


def read_recorded_inputs(path: Path) -> RecordedInputs:
    """The run of a log. Raises RunLogError for a file that is none, RepeatError."""
    run = read_run(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return recorded_inputs_of(run, f"{path.name} sha256:{digest}")


def recorded_inputs_of(run: Run, source: str) -> RecordedInputs:
    """The run as inputs. Raises RepeatError, naming what the log lacks and where."""
    name = run.path.name
    columns = run.columns
    rows = _armed(columns, name)
    t_s = np.asarray(columns["t_s"], float)[rows]
    steps = np.diff(t_s)
    if not (steps > 0.0).all() or float(steps.max(initial=0.0)) > LONGEST_GAP_S:
        worst = int(np.argmax(np.where(steps > 0.0, steps, np.inf)))
        raise RepeatError(
            f"{name} lacks samples: the inputs between them are not known",
            value=f"{t_s[worst]:.2f} s, then {t_s[worst + 1]:.2f} s",
            limit=f"{LONGEST_GAP_S:g} s from one sample to the next",
            action="repeat a run that was recorded whole",
        )
    zero = t_s - t_s[0]
    # What a STATE shows as applied was sent because of the sample before.
    fields: dict[str, Any] = {
        field: _inputs(columns[channel], rows, t_s, name, channel)
        for field, channel in _DRIVEN.items()
    }
    for field in _DRAINS:
        column = np.asarray(columns[field])[rows][:-1]
        if (column == 1).any():
            fields[field] = tuple(bool(v == 1) for v in column)
    for field in READINGS:
        column = np.asarray(columns[field], float)[rows][:-1]
        if np.isfinite(column).any():
            fields[field] = tuple(
                None if np.isnan(v) else round(float(v), _DECIMALS) for v in column
            )
    header = run.header
    return RecordedInputs(
        name=name,
        source=source,
        command=FollowInputs(
            t_s=tuple(round(float(v), 6) for v in zero[:-1]), end_s=float(zero[-1]), **fields
        ),
        rate_hz=float(1.0 / np.median(steps)),
        uid=header.board.get("uid", ""),
        bench=bench_in(header.configuration),
        start=start_of_columns(columns, rows.start),
        armed_s=float(zero[-1]),
        whole_s=run.duration_s,
    )


def _armed(columns: Any, name: str) -> slice:
    """The first stretch in which the board let current through; all of a log without states."""
    mode = np.asarray(columns["mode"])
    if (mode == MISSING_INTEGER).all():
        rows = slice(0, len(mode))
    else:
        armed = np.isin(mode, (BoardState.ARMED, BoardState.HOLD))
        first = int(np.argmax(armed)) if armed.any() else len(mode)
        after = np.flatnonzero(~armed[first:])
        rows = slice(first, first + int(after[0]) if len(after) else len(mode))
    if rows.stop - rows.start < 2:
        raise RepeatError(
            f"{name} holds nothing to repeat: its board was never armed",
            value=f"{len(mode)} samples",
            action="give the log of a run",
        )
    return rows


def _inputs(column: Any, rows: slice, t_s: Array, name: str, channel: str) -> tuple[float, ...]:
    values = np.asarray(column, float)[rows][1:]
    lost = np.flatnonzero(~np.isfinite(values))
    if len(lost):
        raise RepeatError(
            f"{name} does not say what was applied",
            value=f"{channel} at {t_s[lost[0] + 1]:.2f} s and {len(lost) - 1} more samples",
            limit="a number in every sample",
            action="repeat a run of which all inputs were recorded",
        )
    return tuple(round(float(v), _DECIMALS) for v in values)
