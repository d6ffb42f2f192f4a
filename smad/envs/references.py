"""What is to be tracked: references drawn for an episode."""

from collections.abc import Callable

import numpy as np

from smad.arrays import Array
from smad.envs.errors import EnvError

Reference = Callable[[np.random.Generator, Array], Array]
"""Positions in mm at the times given in s, shape as the times."""
REACH_mm = 4.0
"""Of the paper's segment: ±4 mm turn it by ±25°."""


def sines(rng: np.random.Generator, t_s: Array) -> Array:
    """A sinusoid of 1 to 4 mm, in 8 to 16 s, to either side first."""
    amplitude = rng.uniform(1.0, REACH_mm) * rng.choice([-1.0, 1.0])
    return np.asarray(amplitude * np.sin(2.0 * np.pi * t_s / rng.uniform(8.0, 16.0)))


def levels(rng: np.random.Generator, t_s: Array) -> Array:
    """Random levels of up to 4 mm, 4 s each, with a second's ramp to the next."""
    dwell, rise = 4.0, 1.0
    count = int(np.ceil(t_s[-1] / dwell)) + 2
    level = np.concatenate([[0.0], rng.uniform(-REACH_mm, REACH_mm, count)])
    level_s = np.arange(count + 1) * dwell
    times = np.column_stack([level_s, level_s + dwell - rise]).ravel()
    return np.asarray(np.interp(t_s, times, np.repeat(level, 2)))


KINDS: dict[str, Reference] = {"sines": sines, "levels": levels}


def drawn(reference: str | Reference, rng: np.random.Generator, t_s: Array) -> Array:
    """The reference of an episode, mm. Raises EnvError for one that is not usable."""
    if isinstance(reference, str) and reference not in KINDS:
        raise EnvError("no such reference", value=reference, limit=", ".join(KINDS))
    make = KINDS[reference] if isinstance(reference, str) else reference
    positions = np.asarray(make(rng, t_s), dtype=np.float64)
    if positions.shape != t_s.shape or not np.isfinite(positions).all():
        raise EnvError(
            "a reference is not one finite position for each time",
            value=f"shape {positions.shape}",
            limit=f"shape {t_s.shape}",
        )
    return positions
