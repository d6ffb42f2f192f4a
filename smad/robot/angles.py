"""Trajectories of the two joint angles of a segment. Pure.

Each begins where the segment stands, at `from_deg` (pitch, yaw): the axes of a segment keep in
step only when neither has a way to go before its trajectory.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from smad.arrays import Array
from smad.records.points import TIME, read_points

Pair = tuple[float, float]

POINTS_A_S = 20.0
"""Points of a trajectory; between them the angles go straight."""

COLUMNS = ("pitch_deg", "yaw_deg")


@dataclass(frozen=True)
class Angles:
    """Joint angles over time: `t_s`, shape (n,), rising from 0; `pitch_deg`, `yaw_deg`, (n,)."""

    t_s: Array
    pitch_deg: Array
    yaw_deg: Array

    def __len__(self) -> int:
        return len(self.t_s)


def step(to_deg: Pair, *, duration_s: float, from_deg: Pair = (0.0, 0.0)) -> Angles:
    """Jump to (pitch, yaw) within one point, and stay there until `duration_s` is over."""
    t_s = np.array([0.0, 1.0 / POINTS_A_S, max(duration_s, 2.0 / POINTS_A_S)])
    return Angles(t_s, *(np.array([a, b, b]) for a, b in zip(from_deg, to_deg, strict=True)))


def sine(
    amplitude_deg: Pair, *, period_s: float, cycles: int, from_deg: Pair = (0.0, 0.0)
) -> Angles:
    """A sinusoid of both joints about where the segment stands, going up."""
    t_s = _times(period_s * cycles)
    wave = np.sin(2.0 * np.pi * t_s / period_s)
    return Angles(t_s, *(m + a * wave for m, a in zip(from_deg, amplitude_deg, strict=True)))


def circle(
    radius_deg: float, *, period_s: float, cycles: int = 1, approach_s: float | None = None
) -> Angles:
    """A circle of the tip about the straight segment, from there and back there.

    Both joints turn by sinusoids of the radius, a quarter of a period apart. The radius grows and
    shrinks smoothly in `approach_s` (a fifth of the period), with the phase standing still.
    """
    approach_s = period_s / 5.0 if approach_s is None else approach_s
    turn_s = period_s * cycles
    t_s = _times(turn_s + 2.0 * approach_s)
    phase = 2.0 * np.pi * np.clip((t_s - approach_s) / period_s, 0.0, cycles)
    share = np.minimum(t_s, t_s[-1] - t_s) / approach_s
    radius = radius_deg * 0.5 * (1.0 - np.cos(np.pi * np.clip(share, 0.0, 1.0)))
    return Angles(t_s, radius * np.cos(phase), radius * np.sin(phase))


def waypoints(path: str | Path) -> Angles:
    """The angles in a CSV file with the columns t_s, pitch_deg and yaw_deg.

    Times are shifted to begin at 0. Raises CommandError, naming line and column.
    """
    columns = read_points(Path(path), [(name,) for name in COLUMNS])
    return Angles(*(np.array(columns[name]) for name in (TIME, *COLUMNS)))


def _times(duration_s: float) -> Array:
    return np.linspace(0.0, duration_s, max(2, round(duration_s * POINTS_A_S) + 1))
