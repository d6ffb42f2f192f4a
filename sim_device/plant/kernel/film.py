"""Heat from the wire to what surrounds it: Eqs (19)-(25)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.model import Constants

SIXTH = 1.0 / 6.0


@inlined
def film_conductance(
    T: float, T_water: float, speed: float, p: Constants, table: npt.NDArray[np.float64]
) -> float:
    """Conductance from wire to water, W/(m K): the larger of free and forced convection.

    Free: Eqs (19)-(21) with the flow's hydraulic diameter. Forced: Eqs (24), (25). The columns of
    `table` are those of `water.film_table`, interpolated cubically.
    """
    where = 0.5 * (T + T_water) - p.table_T0
    last = table.shape[0] - 3
    # Kept within the table before it is made an integer: of what has run away, or of NaN, any
    # integer may be made, and memory that is not the table's would be read.
    cell = int(where) if 1.0 < where < last else (last if where > 1.0 else 1)
    x = where - cell
    x = max(x, -1.0)
    x = min(x, 2.0)
    w0 = -x * (x - 1.0) * (x - 2.0) * SIXTH
    w1 = (x + 1.0) * (x - 1.0) * (x - 2.0) * 0.5
    w2 = -(x + 1.0) * x * (x - 2.0) * 0.5
    w3 = (x + 1.0) * x * (x - 1.0) * SIXTH
    k = w0 * table[cell - 1, 0] + w1 * table[cell, 0]
    k = k + w2 * table[cell + 1, 0] + w3 * table[cell + 2, 0]
    rise = w0 * table[cell - 1, 1] + w1 * table[cell, 1]
    rise = rise + w2 * table[cell + 1, 1] + w3 * table[cell + 2, 1]
    root = 0.60 + rise * math.pow(abs(T - T_water), SIXTH) * p.sqrt_D_h
    h = k * p.per_D_h * root * root
    if speed > 0.0:
        c2 = w0 * table[cell - 1, 2] + w1 * table[cell, 2]
        c2 = c2 + w2 * table[cell + 1, 2] + w3 * table[cell + 2, 2]
        c3 = w0 * table[cell - 1, 3] + w1 * table[cell, 3]
        c3 = c3 + w2 * table[cell + 1, 3] + w3 * table[cell + 2, 3]
        forced = (c2 + c3 * math.sqrt(speed * p.D_h)) * p.per_D_h
        h = max(h, forced)
    return float(h * p.film_perimeter)


@inlined
def air_conductance(T: float, T_air: float, p: Constants) -> float:
    """Conductance from a bare wire to still air, W/(m K): Eq. (20) with the wire's diameter."""
    root = 0.60 + p.air_convection * math.pow(abs(T - T_air), SIXTH)
    return float(p.air_conductance * root * root)


@inlined
def convection_factor(difference: float, exponent: float, reference: float) -> float:
    """Effect convection_exponent: factor on a film coefficient at a temperature difference."""
    size = abs(difference) / reference
    return math.pow(size if size > 0.01 else 0.01, exponent)


@inlined
def mean_conductance(conductance: float, capacity: float, dt: float) -> float:
    """Mean conductance over dt to a body that comes towards the temperature beside it.

    So that the body, however small, ends where the exponential of its time constant leads, and not
    beyond.
    """
    return float(capacity / dt * (1.0 - math.exp(-dt * conductance / capacity)))
