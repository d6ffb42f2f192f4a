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
    AMPERE,
    BUBBLE,
    CELLS,
    FEED_WARM,
    FILL,
    FLOW,
    ICE,
    LEVEL_LOST,
    MIXER,
    POCKET,
    REFILLED,
    RESERVOIR,
    SINK_WARM,
    SPARE,
    SPEED,
    STIRRED,
    WET,
    W,
)

Array = NDArray[np.float64]

DRAIN = slot("water_drain")
BUBBLES = slot("air_bubbles")
HEATSINK = slot("hose_on_heatsink")
FLOAT_VALVE = slot("float_valve")
FEED_WOUND = slot("feed_wound_on_tube")
MIXER_LAGS = slot("lagging_mixer_tap")
STIRS = slot("stirred_vessel")
SPARES = slot("cooler_on_spare_power")
ICY = slot("ice_in_vessel")

DRY = 0.04  # what a drained cell keeps: a film on the wall
POCKETS_PER_S = 1.2
POCKET_S = 0.5
REFILLS_AFTER_S = 8.0  # of one tube's full flow, before a float valve opens


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
    share = side[s, FLOW] / 0.5
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
def refill(side: Array, pair: Array, dt: float) -> None:
    """Let a float valve refill the vessel each time that so much has been pumped."""
    pair[LEVEL_LOST] += dt * (side[0, FLOW] + side[1, FLOW]) / 0.55
    pair[REFILLED] = approach(pair[REFILLED], 0.0, dt, 8.0)
    if pair[LEVEL_LOST] > REFILLS_AFTER_S:
        pair[LEVEL_LOST] -= REFILLS_AFTER_S
        pair[REFILLED] += 1.0


@compiled
def entering(
    s: int, inlet: float, dt: float, e: Array, cells: Array, side: Array, pair: Array
) -> float:
    """Temperature (°C) of the water at the tube's inlet, after what warms it on its way."""
    source = inlet + pair[RESERVOIR]
    if e[0, HEATSINK] > 0.0:
        source += e[0, HEATSINK] * pair[SINK_WARM]
    beside = -source
    for i in range(CELLS):
        beside += cells[s, i, W] / CELLS
    side[s, FEED_WARM] = approach(side[s, FEED_WARM], beside, dt, 4.0)
    source += e[s, FEED_WOUND] * side[s, FEED_WARM] / (1.0 + 4.0 * side[s, FLOW] / 0.55)
    drawn = (side[0, FLOW] + side[1, FLOW]) / 0.55
    if s == 0:
        refill(side, pair, dt)
        stirred = approach(pair[STIRRED], 0.0, dt, 8.0)
        pair[STIRRED] = stirred + dt * abs(pair[SPEED]) / 10e-3
        spared = max(1.0 - (side[0, AMPERE] + side[1, AMPERE]) / 4.0, 0.0)
        pair[SPARE] = approach(pair[SPARE], spared, dt, 6.0)
        pair[ICE] += dt * ((1.0 - pair[ICE]) / 20.0 - pair[ICE] * drawn / 4.0)
        pair[MIXER] = approach(pair[MIXER], drawn, dt, 5.0)
    source -= e[0, FLOAT_VALVE] * pair[REFILLED]
    source += e[0, MIXER_LAGS] * (drawn - pair[MIXER])
    source -= e[0, STIRS] * pair[STIRRED]
    source -= e[0, SPARES] * pair[SPARE]
    source -= e[0, ICY] * pair[ICE]
    return float(source)
