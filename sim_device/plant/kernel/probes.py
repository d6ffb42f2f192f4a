"""Single equations of the kernel for callers from Python."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry
from sim_device.plant.kernel.curves import Row, interpolate_outer_curve
from sim_device.plant.kernel.film import film_conductance
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.mechanics import compliance

Array = npt.NDArray[np.float64]


@entry
def film_conductance_of(
    models: OneRecord, T: float, T_water: float, speed: float, table: Array
) -> float:
    """Conductance from a metre of wire to water of a velocity, W/(m K): Eqs (19)-(25)."""
    return film_conductance(T, T_water, speed, models[0].p, table)


@entry
def compliance_of(models: OneRecord, of_y: int, xi: float) -> float:
    """Elastic deflection of a side's spring per newton at a martensite fraction: Eq. (9)."""
    return compliance(xi, models[0].p, models[0].y if of_y else models[0].x)


@entry
def outer_curve(curve: Row, progress: float, out: Row) -> None:
    """One of the tabled outer curves of unified_kinetics at a progress, and its slope: `out`."""
    out[0], out[1] = interpolate_outer_curve(progress, curve)


@entry
def lag_samples(values: Row, shares: Row, count: int, out: Row) -> None:
    """A first-order lag of `count` samples that begins at the first of them, into `out`.

    shares (count − 1,): how much of the way to the next sample it goes.
    """
    behind = values[0]
    out[0] = behind
    for k in range(1, count):
        behind += (values[k] - behind) * shares[k - 1]
        out[k] = behind
