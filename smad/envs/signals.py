"""What an agent sees and does, as one table each; the same in an environment and on a bench."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from firmware_protocol.supervisor.limits import compiled_limits
from sim_device.hardware import I16_MOST, U16_MOST, RTD_RAIL_HIGH_cC, RTD_RAIL_LOW_cC
from smad.arrays import Array, Singles
from smad.envs.errors import ActionRefused, EnvError

PREVIEW_S = 0.5
"""How far ahead the second reference looks."""
_TRAVEL_mm, _FORCE_N = 100.0, 100.0
DUTY_STEPS = 255


@dataclass(frozen=True)
class Observed:
    """One number of an observation: name as in a run log, range, and what one step of it is."""

    name: str
    low: float
    high: float
    step: float


_RTD = (RTD_RAIL_LOW_cC * 0.01, RTD_RAIL_HIGH_cC * 0.01, 0.01)
OBSERVATION: tuple[Observed, ...] = (
    Observed("displacement_mm", -_TRAVEL_mm, _TRAVEL_mm, 1e-3),
    Observed("force_N", -_FORCE_N, _FORCE_N, 1e-3),
    *(Observed(f"rtd_{name}_degC", *_RTD) for name in ("x", "y", "inlet", "ambient")),
    *(Observed(f"i_meas_{s}_A", -I16_MOST * 1e-3, I16_MOST * 1e-3, 1e-3) for s in "xy"),
    *(Observed(f"v_{s}_V", -I16_MOST * 1e-3, U16_MOST * 1e-3, 1e-3) for s in "xy"),
    Observed("reference_mm", -_TRAVEL_mm, _TRAVEL_mm, 0.0),
    Observed("reference_ahead_mm", -_TRAVEL_mm, _TRAVEL_mm, 0.0),
)
NAMES = tuple(seen.name for seen in OBSERVATION)
MEASURED = tuple(seen.name for seen in OBSERVATION if seen.step > 0.0)
LOW = np.array([seen.low for seen in OBSERVATION], dtype=np.float32)
HIGH = np.array([seen.high for seen in OBSERVATION], dtype=np.float32)
STEPS = np.array([seen.step for seen in OBSERVATION[: len(MEASURED)]])

MOST_A = compiled_limits().current_limit_mA * 1e-3
_ACTIONS: dict[str, tuple[tuple[str, float, float], ...]] = {
    "currents": (
        ("i_x_A", 0.0, MOST_A),
        ("i_y_A", 0.0, MOST_A),
        ("duty_x", 0.0, 1.0),
        ("duty_y", 0.0, 1.0),
    ),
    "demand": (("demand", -1.0, 1.0), ("duty_x", 0.0, 1.0), ("duty_y", 0.0, 1.0)),
}
ACTIONS = tuple(_ACTIONS)
"""currents: two currents in A. demand: one signed share of the largest current, to X where it is
positive and to Y where it is negative. Both with two pump duties, 0 to 1."""


def action_range(kind: str) -> tuple[Singles, Singles]:
    """Lowest and highest action of a kind of ACTIONS. Raises EnvError for another."""
    if kind not in _ACTIONS:
        raise EnvError("no such kind of action", value=kind, limit=", ".join(ACTIONS))
    rows = _ACTIONS[kind]
    low, high = (np.array([row[c] for row in rows], dtype=np.float32) for c in (1, 2))
    return low, high


ROUNDING = 1e-6
"""So far beyond its space an action is taken as at its edge: what float32 and sums leave."""


def driven(kind: str, actions: Any, plants: int) -> Array:
    """Currents in A and duties, shape (plants, 4), of `actions` (plants, …), in steps of the wire.

    Raises ActionRefused for what lies outside the space: another shape, NaN, beyond a limit.
    """
    rows = _ACTIONS[kind]
    values = np.asarray(actions, dtype=np.float64)
    if values.shape != (plants, len(rows)):
        raise ActionRefused(
            "an action has the wrong shape",
            value=values.shape[1:] if values.ndim > 1 else values.shape,
            limit=f"({len(rows)},): {', '.join(row[0] for row in rows)}",
        )
    low, high = action_range(kind)
    # Neither comparison holds for NaN.
    wrong = np.argwhere(~((values >= low - ROUNDING) & (values <= high + ROUNDING)))
    if wrong.size:
        i, column = (int(v) for v in wrong[0])
        name = rows[column][0]
        raise ActionRefused(
            f"action {name} lies outside its space",
            value=float(values[i, column]),
            limit=f"{low[column]:g} to {high[column]:g}",
            action="clip it before the step",
        )
    values = np.clip(values, low, high)
    out = np.empty((plants, 4))
    if kind == "demand":
        out[:, 0] = MOST_A * np.maximum(values[:, 0], 0.0)
        out[:, 1] = MOST_A * np.maximum(-values[:, 0], 0.0)
        out[:, 2:] = values[:, 1:]
    else:
        out[:] = values
    out[:, :2] = np.rint(out[:, :2] * 1e3) * 1e-3
    out[:, 2:] = np.rint(out[:, 2:] * DUTY_STEPS) / DUTY_STEPS
    return out
