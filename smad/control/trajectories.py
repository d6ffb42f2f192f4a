"""Pieces of motion as functions of time, queued one after the other with a smooth hand-over.

A piece is compiled when it is queued: its value at its end is then known, so the next piece, and
the hand-over to it, can be checked and placed at once. Nothing but one function call is left for
the control step. Displacements are in metres here; the commands are in millimetres.
"""

import math
import random
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import lt
from typing import Any

from smad import units
from smad.config import LimitsConfig
from smad.control.commands import (
    LONGEST_SAMPLES,
    Chirp,
    Follow,
    Hold,
    Ramp,
    RandomLevels,
    Samples,
    Sine,
    Staircase,
    Step,
    Trajectory,
)
from smad.errors import CommandError

MM = 1e-3
LONGEST_QUEUE = 10_000
_JOINED_M = 1e-6
"""Closer than this, the encoder cannot tell two displacements apart: no hand-over is needed."""

Position = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class Compiled:
    """A piece as a function of its own time, with what has to be checked about it.

    `start_m` is None for a piece that jumps by its nature, which needs no hand-over.
    """

    position: Position
    duration_s: float
    start_m: float | None
    end_m: float
    low_m: float
    high_m: float
    speed_m_per_s: float = 0.0


def _step(piece: Step, from_m: float) -> Compiled:
    level = piece.displacement_mm * MM
    return Compiled(lambda _: level, piece.duration_s, None, level, level, level)


def _hold(piece: Hold, from_m: float) -> Compiled:
    return Compiled(lambda _: from_m, piece.duration_s, from_m, from_m, from_m, from_m)


def _ramp(piece: Ramp, from_m: float) -> Compiled:
    to_m = piece.displacement_mm * MM
    rate = math.copysign(piece.rate_mm_per_s * MM, to_m - from_m)
    return Compiled(
        lambda t: from_m + rate * t,
        (to_m - from_m) / rate,
        from_m,
        to_m,
        min(from_m, to_m),
        max(from_m, to_m),
        abs(rate),
    )


def _sine(piece: Sine, from_m: float) -> Compiled:
    offset, amplitude = piece.offset_mm * MM, piece.amplitude_mm * MM
    omega = math.tau / piece.period_s
    return Compiled(
        lambda t: offset + amplitude * math.sin(omega * t),
        piece.cycles * piece.period_s,
        offset,
        offset,
        offset - amplitude,
        offset + amplitude,
        amplitude * omega,
    )


def _chirp(piece: Chirp, from_m: float) -> Compiled:
    offset, amplitude = piece.offset_mm * MM, piece.amplitude_mm * MM
    start, duration = piece.start_Hz, piece.duration_s
    sweep = (piece.end_Hz - start) / (2.0 * duration)

    def position(t: float) -> float:
        return offset + amplitude * math.sin(math.tau * t * (start + sweep * t))

    return Compiled(
        position,
        duration,
        offset,
        position(duration),
        offset - amplitude,
        offset + amplitude,
        amplitude * math.tau * max(start, piece.end_Hz),
    )


def _levels(levels: Sequence[float], dwell_s: float) -> Compiled:
    last = len(levels) - 1
    return Compiled(
        lambda t: levels[min(last, int(t / dwell_s))],
        len(levels) * dwell_s,
        None,
        levels[last],
        min(levels),
        max(levels),
    )


def _staircase(piece: Staircase, from_m: float) -> Compiled:
    order = list(range(1, piece.steps + 1))
    if piece.there_and_back:
        order += range(piece.steps - 1, -1, -1)
    return _levels([from_m + piece.step_mm * MM * k for k in order], piece.dwell_s)


def _random_levels(piece: RandomLevels, from_m: float) -> Compiled:
    draw = random.Random(piece.seed).random
    offset, amplitude = piece.offset_mm * MM, piece.amplitude_mm * MM
    return _levels(
        [offset + amplitude * (2.0 * draw() - 1.0) for _ in range(piece.levels)], piece.dwell_s
    )


def _samples(piece: Samples, from_m: float) -> Compiled:
    t_s = piece.t_s
    position_m = [value * MM for value in piece.displacement_mm]
    if len(t_s) != len(position_m):
        raise CommandError(
            "t_s and displacement_mm differ in length",
            value=f"{len(t_s)} and {len(position_m)}",
            action="give one displacement for each time",
        )
    if t_s[0] != 0.0 or not all(map(lt, t_s, t_s[1:])):
        raise CommandError(
            "t_s must begin at 0 and increase from point to point",
            value=_first_step_back(t_s),
            action="sort the points and subtract the first time",
        )
    slopes = [
        (b - a) / (tb - ta)
        for (a, b), (ta, tb) in zip(pairwise(position_m), pairwise(t_s), strict=True)
    ]
    last = len(slopes) - 1

    def position(t: float) -> float:
        k = min(last, bisect_right(t_s, t) - 1)
        return position_m[k] + slopes[k] * (t - t_s[k])

    return Compiled(
        position,
        t_s[-1],
        position_m[0],
        position_m[-1],
        min(position_m),
        max(position_m),
        max(map(abs, slopes)),
    )


def _first_step_back(t_s: Sequence[float]) -> str:
    if t_s[0] != 0.0:
        return f"t_s[0] = {t_s[0]:g}"
    k = next(i for i, (a, b) in enumerate(pairwise(t_s), 1) if not a < b)
    return f"t_s[{k - 1}] = {t_s[k - 1]:g}, t_s[{k}] = {t_s[k]:g}"


@dataclass(frozen=True, slots=True)
class _Kind:
    """How one kind of piece is compiled, and which of its fields an excess is blamed on."""

    compile: Callable[[Any, float], Compiled]
    reach_field: str
    speed_field: str = ""


KINDS: dict[type, _Kind] = {
    Step: _Kind(_step, "displacement_mm"),
    Hold: _Kind(_hold, "duration_s"),
    Ramp: _Kind(_ramp, "displacement_mm", "rate_mm_per_s"),
    Sine: _Kind(_sine, "amplitude_mm", "period_s"),
    Chirp: _Kind(_chirp, "amplitude_mm", "end_Hz"),
    Staircase: _Kind(_staircase, "step_mm"),
    RandomLevels: _Kind(_random_levels, "amplitude_mm"),
    Samples: _Kind(_samples, "displacement_mm", "displacement_mm"),
}
"""How each kind of piece is followed."""


def compile_piece(
    piece: Trajectory, from_m: float, limits: LimitsConfig, where: str = ""
) -> Compiled:
    """`piece` as a function of time, for a reference that stands at `from_m` before it.

    Raises CommandError, naming the field behind `where`, when the piece reaches beyond
    `limits.displacement_max_mm` or moves faster than `limits.reference_rate_max_mm_per_s`.
    """
    kind = KINDS[type(piece)]
    compiled = kind.compile(piece, from_m)
    reach_mm = max(abs(compiled.low_m), abs(compiled.high_m)) / MM
    if not reach_mm <= limits.displacement_max_mm + 1e-9:
        raise CommandError(
            f"{where}{_blamed(piece, kind.reach_field)} takes the reference to {reach_mm:g} mm",
            value=_field_of(piece, kind.reach_field),
            limit=f"|displacement| up to {limits.displacement_max_mm:g} mm "
            "(limits.displacement_max_mm, or an axis's travel_mm)",
            action="ask for less, or raise the limit in the configuration",
        )
    speed_mm_per_s = compiled.speed_m_per_s / MM
    if not speed_mm_per_s <= limits.reference_rate_max_mm_per_s + 1e-9:
        raise CommandError(
            f"{where}{_blamed(piece, kind.speed_field)} moves the reference at "
            f"{speed_mm_per_s:g} mm/s",
            value=_field_of(piece, kind.speed_field),
            limit=f"up to {limits.reference_rate_max_mm_per_s:g} mm/s "
            "(limits.reference_rate_max_mm_per_s)",
            action="ask for a slower motion, or raise the limit in the configuration",
        )
    return compiled


def _blamed(piece: Trajectory, name: str) -> str:
    quantity, unit = units.parted_name(name)
    kind = str(piece.__struct_config__.tag).replace("_", " ")
    return f"the {quantity}{' frequency' * (unit == 'Hz')} of the {kind}"


def _field_of(piece: Trajectory, name: str) -> str | None:
    value = getattr(piece, name)
    return None if isinstance(value, tuple) else units.quantity(name, value)


@dataclass(frozen=True, slots=True)
class _Placed:
    position: Position
    start_s: float
    end_s: float


class ReferenceQueue:
    """The reference as a function of the time since it was restarted.

    Between two pieces that do not meet, the reference goes over on a smooth curve (a cubic with no
    speed at either end) whose fastest point has the hand-over rate. After the last piece it stays.
    """

    def __init__(self, limits: LimitsConfig, handover_rate_mm_per_s: float) -> None:
        self._limits = limits
        self._handover_rate_m_per_s = handover_rate_mm_per_s * MM
        self.restart(0.0)

    def restart(self, at_m: float) -> None:
        """Forget all pieces; the reference stands at `at_m`."""
        self._pieces: deque[_Placed] = deque()
        self._t_s = 0.0
        self._end_s = 0.0
        self._end_m = at_m
        self.reference_m = at_m

    @property
    def done(self) -> bool:
        """Whether the last piece has ended."""
        return not self._pieces

    @property
    def remaining_s(self) -> float:
        """Time until the last queued piece ends."""
        return max(0.0, self._end_s - self._t_s)

    def follow(self, command: Follow) -> None:
        """Queue the pieces of `command`, after or instead of those there: all of them or none.

        Raises CommandError when a piece breaks a limit or the queue is full.
        """
        compiled = self.compiled(command, self.reference_m)
        if not command.queue:
            self.restart(self.reference_m)
        for motion in compiled:
            self._place(motion)

    def compiled(self, command: Follow, at_m: float) -> list[Compiled]:
        """Return the pieces of `command`, to begin at `at_m` or, queued, after those there.

        Raises CommandError as `follow` does.
        """
        keep = len(self._pieces) if command.queue else 0
        if keep + len(command.trajectories) > LONGEST_QUEUE:
            raise CommandError(
                "trajectories would overfill the queue",
                value=f"{keep} waiting + {len(command.trajectories)}",
                limit=f"{LONGEST_QUEUE} pieces",
                action="queue them later",
            )
        points = sum(len(p.t_s) for p in command.trajectories if isinstance(p, Samples))
        if points > LONGEST_SAMPLES:
            raise CommandError(
                "the samples of one command are too many to check between two control steps",
                value=f"{points} points",
                limit=f"{LONGEST_SAMPLES} points a command",
                action="split them into several commands with queue=true",
            )
        if command.queue:
            at_m = self._end_m
        compiled: list[Compiled] = []
        count = len(command.trajectories)
        for number, piece in enumerate(command.trajectories, start=1):
            where = f"piece {number} of {count}: " if count > 1 else ""
            compiled.append(compile_piece(piece, at_m, self._limits, where))
            at_m = compiled[-1].end_m
        return compiled

    def advance(self, dt_s: float) -> float:
        """The reference `dt_s` later, m."""
        self._t_s += dt_s
        pieces = self._pieces
        while pieces and self._t_s >= pieces[0].end_s:
            pieces.popleft()
        if pieces:
            head = pieces[0]
            self.reference_m = head.position(self._t_s - head.start_s)
        else:
            self.reference_m = self._end_m
        return self.reference_m

    def peek(self, lead_s: float) -> float:
        """Where the reference will be in `lead_s` seconds, m."""
        t_s = self._t_s + lead_s
        for piece in self._pieces:
            if t_s < piece.end_s:
                return piece.position(t_s - piece.start_s)
        return self._end_m

    def _place(self, piece: Compiled) -> None:
        gap_m = 0.0 if piece.start_m is None else piece.start_m - self._end_m
        if abs(gap_m) > _JOINED_M:
            duration_s = 1.5 * abs(gap_m) / self._handover_rate_m_per_s
            self._append(_smooth(self._end_m, gap_m, duration_s), duration_s)
        self._append(piece.position, piece.duration_s)
        self._end_m = piece.end_m

    def _append(self, position: Position, duration_s: float) -> None:
        start_s = max(self._end_s, self._t_s)
        self._end_s = start_s + duration_s
        self._pieces.append(_Placed(position, start_s, self._end_s))


def _smooth(from_m: float, gap_m: float, duration_s: float) -> Position:
    def position(t: float) -> float:
        s = t / duration_s
        return from_m + gap_m * s * s * (3.0 - 2.0 * s)

    return position
