"""What rarer effects do to one tube: odd heat, odd temperatures of transformation, odd memories."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMPERE,
    CELLS,
    COLDEST,
    FLOW,
    FLUSHED,
    FRACTION,
    FRETTED,
    SHUNT,
    SLEEVED,
    SPEED,
    TIME,
    TURNED,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.thermal import HEAT_WATER, HEAT_WIRE, SHIFT_COOL, SHIFT_HEAT, STORES, TO_CLAMP

Array = NDArray[np.float64]

FULL_FLOW = index("flow_W_K")
AT_START = index("turned_at_start")

PEAK = slot("premartensitic_peak")
LEADS = slot("leads_along_neighbour")
SWEATING = slot("sweating_tube")
TURNED_RESISTS = slot("turned_resists")
SHAKEN = slot("shaken_interfaces")
DRIPPING = slot("dripping_outlet")
ROD = slot("rod_in_coil")
LAMP = slot("cycling_lamp")
BENT = slot("bent_coils")
INDUCED = slot("induced_heat")
CARTRIDGE = slot("warm_cartridge")
DEEP_COOLED = slot("deep_cooled")
HAMMERED = slot("hammered_variants")
SHRUNK_SLEEVE = slot("shrunk_sleeve")
FRETTING = slot("fretted_crimp")

LAMP_S, LAMP_ON = 24.0, 0.375  # how often a lamp comes on, and for what share of that


@compiled
def odd_heat(s: int, e: Array, cells: Array, side: Array, rows: Array) -> None:
    """Add to `rows` what rarer effects do to the heat of wire and water."""
    lead = e[1 - s, LEADS] * side[1 - s, SHUNT]
    for i in range(CELLS):
        over = max(cells[s, i, W] - 34.0, 0.0) / 10.0
        rows[i, HEAT_WATER] += (lead - e[s, SWEATING] * over * over) / CELLS
        off = (cells[s, i, T] - 40.0) / 3.0
        rows[i, STORES] *= 1.0 + e[s, PEAK] * math.exp(-off * off)


@compiled
def elsewhere(
    s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array, rows: Array
) -> None:
    """Add to `rows` the heat of rarer effects: to a rod, from the other side and from a lamp."""
    drawn_out = pair[X] if s == 1 else -pair[X]
    gripped = min(max((drawn_out + 1e-3) / 5e-3, 0.0), 1.0)
    dripping = e[1 - s, DRIPPING] * min(side[1 - s, FLOW] / p[FULL_FLOW], 1.5)
    warm = cells[1 - s, CELLS - 1, W]
    turn = pair[TIME] / LAMP_S + e[2, LAMP]
    shone = e[0, LAMP] if turn - math.floor(turn) < LAMP_ON else 0.0
    ampere = side[1 - s, AMPERE]
    induced = e[1 - s, INDUCED] * ampere * max(4.0 - ampere, 0.0) / 4.0
    for i in range(CELLS):
        rows[i, HEAT_WIRE] += induced / CELLS
        rows[i, TO_CLAMP] += e[s, ROD] * gripped / CELLS
        rows[i, HEAT_WATER] += (dripping * (warm - cells[s, i, W]) + shone) / CELLS


@compiled
def odd_shifts(
    s: int, share: float, p: Array, e: Array, cells: Array, pair: Array, rows: Array
) -> None:
    """Add to `rows` what rarer effects do to the temperatures of transformation."""
    eased = e[s, SHAKEN] * share
    length = 1.0 + (pair[X] if s == 1 else -pair[X]) / 25e-3
    bent = e[s, BENT] * (length * length - 1.0)
    for i in range(CELLS):
        further = (cells[s, i, TURNED] - p[AT_START]) / 0.05
        rows[i, SHIFT_HEAT] += e[s, TURNED_RESISTS] * further - eased + bent
        rows[i, SHIFT_COOL] += eased + bent


@compiled
def age(s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what rarer effects remember of a tick of spring `s`."""
    share = side[s, FLOW] / p[FULL_FLOW]
    if e[s, FRETTING] > 0.0:
        side[s, FRETTED] += dt * abs(pair[SPEED])
    if e[s, CARTRIDGE] > 0.0:
        side[s, FLUSHED] += dt * share
    if e[s, DEEP_COOLED] > 0.0:
        for i in range(CELLS):
            cell = cells[s, i]
            cell[COLDEST] = cell[T] if cell[FRACTION] < 0.5 else min(cell[COLDEST], cell[T])
    if e[s, HAMMERED] > 0.0:
        for i in range(CELLS):
            further = cells[s, i, TURNED] + e[s, HAMMERED] * share * dt / 10.0
            cells[s, i, TURNED] = min(further, 0.8)
    if e[s, SHRUNK_SLEEVE] > 0.0:
        warmth = 0.0
        for i in range(CELLS):
            warmth += cells[s, i, T] / CELLS
        side[s, SLEEVED] = max(side[s, SLEEVED], min(max(warmth - 36.0, 0.0) / 15.0, 1.0))
