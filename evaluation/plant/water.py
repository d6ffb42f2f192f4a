"""The water in one tube apart from its heat: where it stands, what it carries, how it enters."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    BUBBLE,
    CELLS,
    COAT,
    FILL,
    FLOW,
    MOLTEN,
    MOTOR,
    PLATE,
    POCKET,
    PUMP,
    RESERVOIR,
    SPILT,
    STOOD,
    WALL,
    WET,
    T,
    W,
    X,
)
from evaluation.plant.phase import falling
from evaluation.plant.thermal import HEAT_WATER, HEAT_WIRE

Array = NDArray[np.float64]

DRAIN = slot("water_drain")
BUBBLES = slot("air_bubbles")
WALL_HEAT = slot("tube_wall_heat")
SLUG = slot("hose_slug")
COATING = slot("gas_coat")
SPILL = slot("evaporating_spill")
WAX = slot("wax_melting")
TOUCH = slot("frame_touch")
WASTE = slot("pump_waste_heat")

DRY = 0.04  # what a drained cell keeps: a film on the wall
POCKETS_PER_S = 1.2
POCKET_S = 0.5
WALL_S = 12.0
DEW = 14.0  # °C
WAX_MELTS, WAX_SETS = 39.0, 34.5  # °C; it sets at the former once it has begun to
WAX_W_K = 0.5  # between the whole wire and its wax
PLATE_J_K = 12.0  # heat capacity of the part of the frame that a tube touches
PLATE_S = 40.0
HOSE_J_K = 1.0  # heat capacity of the water that stands in the supply hose


@compiled
def wet_shares(s: int, e: Array, cells: Array, side: Array, inlet: float, dt: float) -> None:
    """Let water leave from the outlet end while the pump rests, and come back with the flow."""
    rate = e[s, DRAIN]
    if rate <= 0.0:
        return
    flowing = side[s, FLOW]
    if flowing > 0.02:
        side[s, FILL] = min(1.0, side[s, FILL] + dt * flowing / 2.5)
    else:
        side[s, FILL] = max(0.3, side[s, FILL] - dt * rate)
    for i in range(CELLS):
        wet = min(1.0, max(DRY, side[s, FILL] * CELLS - i))
        before = cells[s, i, WET]
        if wet > before:
            cells[s, i, W] = (cells[s, i, W] * before + inlet * (wet - before)) / wet
        cells[s, i, WET] = wet


@compiled
def pockets(s: int, e: Array, cells: Array, side: Array, luck: float, dt: float) -> None:
    """Air pockets: enter at random while water flows (`luck` uniform in 0…1), then travel."""
    if e[s, BUBBLES] <= 0.0:
        return
    share = max(side[s, FLOW], 0.0) / 0.5
    side[s, POCKET] = max(0.0, side[s, POCKET] - dt)
    if side[s, POCKET] <= 0.0 and luck < POCKETS_PER_S * share * dt:
        side[s, POCKET] = POCKET_S * (0.5 + luck / max(POCKETS_PER_S * share * dt, 1e-9))
    entering = 1.0 if side[s, POCKET] > 0.0 else 0.0
    step = 1.0 - math.exp(-dt * CELLS * share / 4.7)
    for j in range(CELLS):
        i = CELLS - 1 - j
        before = entering if i == 0 else cells[s, i - 1, BUBBLE]
        cells[s, i, BUBBLE] += step * (before - cells[s, i, BUBBLE])


@compiled
def coat(s: int, e: Array, cells: Array, side: Array, dt: float) -> None:
    """Share of each cell's wire under gas: it comes where the wire is warm, goes with the flow."""
    if e[s, COATING] <= 0.0:
        return
    swept = 0.02 + max(side[s, FLOW], 0.0) / 0.5
    for i in range(CELLS):
        comes = max(cells[s, i, T] - 33.0, 0.0) / 60.0
        rate = comes + swept
        cells[s, i, COAT] = approach(cells[s, i, COAT], comes / rate, dt, 1.0 / rate)


@compiled
def evaporate(s: int, e: Array, cells: Array, side: Array, rows: Array, dt: float) -> None:
    """Let what the pump spilt on the tube evaporate; it takes heat even from cool water."""
    if e[s, SPILL] <= 0.0:
        return
    spills = max(side[s, FLOW], 0.0) / 0.5 / 4.0
    rate = spills + 1.0 / 40.0
    side[s, SPILT] = approach(side[s, SPILT], spills / rate, dt, 1.0 / rate)
    for i in range(CELLS):
        # The tube's wet outside is as warm as the water in it; vapour pressure over that of the air
        pressure = math.exp(0.06 * (cells[s, i, W] - DEW))
        rows[i, HEAT_WATER] -= e[s, SPILL] * side[s, SPILT] * (pressure - 1.0) / CELLS


@compiled
def melt(s: int, e: Array, cells: Array, rows: Array, dt: float) -> None:
    """Let the wax between the coils take heat from the wire to melt, and give it back."""
    if e[s, WAX] <= 0.0:
        return
    for i in range(CELLS):
        molten = cells[s, i, MOLTEN]
        over = cells[s, i, T] - WAX_MELTS
        setting = molten < 1.0 or cells[s, i, T] < WAX_SETS
        if over > 0.0 or setting:
            after = min(max(molten + WAX_W_K / e[s, WAX] * over * dt, 0.0), 1.0)
            rows[i, HEAT_WIRE] -= e[s, WAX] / CELLS * (after - molten) / dt
            cells[s, i, MOLTEN] = after


@compiled
def touch(
    s: int, air: float, e: Array, cells: Array, side: Array, pair: Array, rows: Array, dt: float
) -> None:
    """Let the tube of a shortened spring give heat to the frame, and take it back."""
    if e[s, TOUCH] <= 0.0:
        return
    contracted_mm = 1e3 * (pair[X] if s == 0 else -pair[X])
    conducts = e[s, TOUCH] * (1.0 - falling((contracted_mm - 3.5) / 2.0)) / CELLS
    given = 0.0
    for i in range(CELLS):
        watts = conducts * (cells[s, i, W] - side[s, PLATE])
        rows[i, HEAT_WATER] -= watts
        given += watts
    side[s, PLATE] += dt * (given / PLATE_J_K - (side[s, PLATE] - air) / PLATE_S)


@compiled
def entering(s: int, inlet: float, dt: float, e: Array, side: Array, pair: Array) -> float:
    """Temperature (°C) of the water at the tube's inlet, after what stood in the hose."""
    source = inlet + pair[RESERVOIR]
    if e[s, SLUG] != 0.0:
        flowing = side[s, FLOW]
        if flowing > 0.01:
            side[s, STOOD] *= math.exp(-flowing * dt / HOSE_J_K)
        else:
            side[s, STOOD] = approach(side[s, STOOD], 1.0, dt, 15.0)
        source += e[s, SLUG] * side[s, STOOD]
    if e[s, WASTE] > 0.0:
        side[s, MOTOR] = approach(side[s, MOTOR], side[s, PUMP], dt, 20.0)
        source += e[s, WASTE] * side[s, MOTOR]
    return float(source)


@compiled
def warm_wall(s: int, e: Array, cells: Array, dt: float) -> None:
    """Let the tube's wall follow its water where the wall's heat counts."""
    if e[s, WALL_HEAT] <= 0.0:
        return
    for i in range(CELLS):
        wet = cells[s, i, WET]
        cells[s, i, WALL] += dt / WALL_S * wet * (cells[s, i, W] - cells[s, i, WALL])
