"""At what temperature one cell transforms: how far its curves stand off the stress-free ones."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    ARREST,
    ARRESTED,
    ASLEEP,
    CELLS,
    CHARGE,
    COOLED_FROM,
    FRACTION,
    HEATED_FROM,
    PEAK,
    QUENCH,
    RATE,
    TURNED,
    WORK_DONE,
    T,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import COOL_SLOPE, cooling_shift

Array = NDArray[np.float64]

HEAT_SLOPE = index("heat_slope_MPa_K")

MINOR_LOOP = slot("minor_loop")
DRIFT = slot("transformation_drift")
OVERSHOOT = slot("rate_overshoot")
STABILISED = slot("martensite_stabilisation")
AGED = slot("aged_segment")
BEND = slot("clapeyron_bend")
ARREST_MEMORY = slot("arrest_memory")
OVERHEATED = slot("overheated_nuclei")
FRONTS = slot("phase_fronts")
QUENCHED = slot("quenched_martensite")
PINNING = slot("pinned_fronts")
GRAINS = slot("grain_slopes")
DEFORMED = slot("deformed_martensite")
HYDROGEN = slot("hydrogen_uptake")

ARREST_K = 2.0  # width of what is remembered


@compiled
def front(s: int, i: int, cells: Array) -> float:
    """How much of a phase front (0…1) one cell has towards its neighbours."""
    apart = 0.0
    for j in (max(i - 1, 0), min(i + 1, CELLS - 1)):
        step = cells[s, j, FRACTION] - cells[s, i, FRACTION]
        apart += step * step
    return float(1.0 - math.exp(-apart / 0.06))


@compiled
def shifts(
    s: int, i: int, stress: float, p: Array, e: Array, cells: Array, side: Array
) -> tuple[float, float]:
    """How far (K) the heating and cooling curves of one cell stand above the stress-free ones."""
    heat = stress / p[HEAT_SLOPE]
    cool = cooling_shift(stress, p)
    if e[s, MINOR_LOOP] > 0.0:
        heat += e[s, MINOR_LOOP] * (1.0 - cells[s, i, HEATED_FROM])
        cool -= 0.6 * e[s, MINOR_LOOP] * cells[s, i, COOLED_FROM]
    if e[s, DRIFT] > 0.0:
        fallen = e[s, DRIFT] * (1.0 - math.exp(-side[s, WORK_DONE] / 3.0))
        heat -= fallen
        cool -= fallen
    if e[s, OVERSHOOT] > 0.0:
        apart = e[s, OVERSHOOT] * math.sqrt(side[s, RATE] / 0.2)
        heat += apart
        cool -= 0.5 * apart
    if e[s, STABILISED] > 0.0:
        heat += e[s, STABILISED] * math.log10(1.0 + side[s, ASLEEP] / 4.0)
    if e[s, AGED] > 0.0 and i < CELLS // 3:
        heat += e[s, AGED]
        cool += e[s, AGED]
    if e[s, BEND] != 0.0:
        off = (stress - 57.0) / 30.0
        heat += e[s, BEND] * off * off
        cool += 0.4 * e[s, BEND] * off * off
    if e[s, ARREST_MEMORY] > 0.0:
        off = (cells[s, i, T] - cells[s, i, ARREST]) / ARREST_K
        heat += e[s, ARREST_MEMORY] * cells[s, i, ARRESTED] * math.exp(-off * off)
    if e[s, OVERHEATED] > 0.0:
        cool -= e[s, OVERHEATED] * max(cells[s, i, PEAK] - 38.0, 0.0) / 10.0
    if e[s, FRONTS] > 0.0:
        eased = e[s, FRONTS] * front(s, i, cells)
        heat -= eased
        cool += eased
    if e[s, QUENCHED] > 0.0:
        heat -= e[s, QUENCHED] * cells[s, i, QUENCH]
    if e[s, PINNING] > 0.0:
        bands = 3.0 * cells[s, i, FRACTION] + e[2, PINNING] + 0.08 * i
        held = e[s, PINNING] * math.sin(2.0 * math.pi * bands)
        heat += held
        cool -= 0.5 * held
    if e[s, GRAINS] > 0.0:
        wider = e[s, GRAINS] * (0.5 - cells[s, i, FRACTION]) * (stress - 57.0)
        heat += wider / p[HEAT_SLOPE]
        cool += wider / p[COOL_SLOPE]
    if e[s, HYDROGEN] != 0.0:
        lowered = e[s, HYDROGEN] * side[s, CHARGE] / (side[s, CHARGE] + 60.0)
        heat -= lowered
        cool -= lowered
    if e[s, DEFORMED] > 0.0:
        heat += e[s, DEFORMED] * cells[s, i, TURNED] / 0.1
    return heat, cool
