"""The curves that transformations follow: what is left to transform at a progress."""

from __future__ import annotations

import math
from collections.abc import MutableSequence

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry, inlined
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.model import (
    CURVE_CELLS,
    CURVE_CELLS_PER_UNIT,
    CURVE_SIZE,
    PROGRESS_LOW,
    Constants,
    Effects,
)

Row = MutableSequence[float] | npt.NDArray[np.float64]

HALF_PI = 0.5 * math.pi
# unified_kinetics: the logistic curve as steep in the middle as the cosine, and what keeps ratios
# finite.
TAIL_RATE = 2.0 * math.pi
LEAST_LEFT = 1e-9


@inlined
def clip01(value: float) -> float:
    """The value, held to 0 to 1."""
    if value <= 0.0:
        return 0.0
    if value >= 1.0:
        return 1.0
    return value


@inlined
def remaining(progress: float) -> float:
    """f = (cos πa + 1)/2 of Eqs (11)-(13), as a square so that it stays exact near a = 1."""
    if progress <= 0.0:
        return 1.0
    if progress >= 1.0:
        return 0.0
    root = math.cos(HALF_PI * progress)
    return root * root


@inlined
def remaining_slope(left: float) -> float:
    """df/da of `remaining`, from its value."""
    return -math.pi * math.sqrt(left * (1.0 - left))


@inlined
def remaining_spread(progress: float, spread: float) -> float:
    """f of a wire whose temperatures spread: a quarter each ahead and behind, half between."""
    ends = remaining(progress - spread) + remaining(progress + spread)
    return 0.5 * remaining(progress) + 0.25 * ends


@inlined
def remaining_with_tails(progress: float, e: Effects) -> tuple[float, float]:
    """What is left at a progress, and its slope: the cosine, in part a logistic curve."""
    share = remaining(progress)
    slope = remaining_slope(share)
    tails = e.tails
    if tails > 0.0:
        beyond = progress - 0.5
        z = math.exp(-TAIL_RATE * abs(beyond))
        left = z / (1.0 + z)
        share += tails * ((left if beyond > 0.0 else 1.0 - left) - share)
        slope += tails * (-TAIL_RATE * left / (1.0 + z) - slope)
    return share + LEAST_LEFT, slope


@inlined
def lay_curves_of_side(p: Constants, e: Effects) -> None:
    """Fill in a side's outer curves; that of heating with `spread` as `remaining_spread`."""
    spread = e.spread * p.per_A_range
    for cell in range(CURVE_CELLS + 1):
        progress = PROGRESS_LOW + cell / CURVE_CELLS_PER_UNIT
        left, slope = remaining_with_tails(progress, e)
        e.curves.cooling[2 * cell] = left
        e.curves.cooling[2 * cell + 1] = slope / CURVE_CELLS_PER_UNIT
        early, early_slope = remaining_with_tails(progress - spread, e)
        late, late_slope = remaining_with_tails(progress + spread, e)
        left = 0.5 * left + 0.25 * (early + late)
        slope = 0.5 * slope + 0.25 * (early_slope + late_slope)
        e.curves.heating[2 * cell] = left
        e.curves.heating[2 * cell + 1] = slope / CURVE_CELLS_PER_UNIT


@entry
def lay_curves(models: OneRecord) -> None:
    """Fill in the outer curves of both sides."""
    p, x, y = models[0].p, models[0].x, models[0].y
    lay_curves_of_side(p, x)
    if y.spread != x.spread:
        lay_curves_of_side(p, y)
        return
    for k in range(CURVE_SIZE):
        y.curves.heating[k] = x.curves.heating[k]
        y.curves.cooling[k] = x.curves.cooling[k]


@inlined
def interpolate_outer_curve(progress: float, curve: Row) -> tuple[float, float]:
    """An outer curve as `lay_curves` has tabled it, and its slope: cubic between steps, to 1e-6."""
    where = (progress - PROGRESS_LOW) * CURVE_CELLS_PER_UNIT
    # So written that NaN reads the first cell; see `film_conductance`.
    cell = int(where) if where > 0.0 else 0
    # Known not to be negative, it is not looked at again for each of the four places.
    cell = min(max(cell, 0), CURVE_CELLS - 1)
    x = where - cell
    node = 2 * cell
    first = curve[node + 1]
    rise = curve[node + 2] - curve[node]
    bend = 3.0 * rise - 2.0 * first - curve[node + 3]
    twist = first + curve[node + 3] - 2.0 * rise
    left = curve[node] + x * (first + x * (bend + x * twist))
    slope = (first + x * (2.0 * bend + x * 3.0 * twist)) * CURVE_CELLS_PER_UNIT
    return left, slope
