"""What rarer effects do to one tube: odd heat, odd temperatures of transformation, odd memories."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach, switched
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMPERE,
    BELT,
    BLOWN,
    BRAKING,
    BULGED,
    BURST,
    CARRIED,
    CELL_SOAK,
    CELL_UNEVEN,
    CELLS,
    CHARGED,
    CURED,
    CURING,
    DRAGGED,
    DRAUGHT,
    DUMMY,
    FLOW,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    FRETTED,
    FROTH,
    GASSED,
    LATE_HEAT,
    LATE_SET,
    LINT,
    LIT,
    MELTS,
    MOLTEN,
    MOTOR_HEAT,
    ORDERED,
    OTHER_PLUME,
    PHASE_BEFORE,
    PUDDLE,
    PUMP,
    RACK_BLOWS,
    RACK_HOT,
    RATE,
    REGULATOR,
    RUBBED_BEFORE,
    RUST,
    SETTLED,
    SHAKEN,
    SHUNT_WARM,
    SINCE_MOVED,
    SLIME,
    SPEED,
    SPEED_BEFORE,
    STRETCHED,
    TIME,
    TRAINED,
    TWINS_RUB,
    VARIANTS,
    WALLS,
    WATCHED,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.thermal import (
    FILM,
    HEAT_WATER,
    HEAT_WIRE,
    LOSS,
    SHIFT_COOL,
    SHIFT_HEAT,
    TO_CLAMP,
)

Array = NDArray[np.float64]

FULL_FLOW = index("flow_W_K")

DRIPPING = slot("dripping_outlet")
ROD = slot("rod_in_coil")
LAMP = slot("cycling_lamp")
BENT = slot("bent_coils")
RUSTS = slot("rusty_feed")
ON_FRAME = slot("tube_against_frame")
PLUME = slot("plume_of_other_tube")
END_STRAP = slot("strap_between_ends")
FROTHS = slot("frothing_pump")
BELTED = slot("thermostat_belt")
REGULATED = slot("regulator_on_tube")
UNLIKE = slot("unlike_crimp")
SLIMY = slot("scoured_slime")
BLOWS = slot("thermostat_fan")
DUMMY_LOAD = slot("dummy_load_under_tubes")
PRESSED = slot("clamp_pressed_by_pull")
SOLDER = slot("migrating_solder")
LINTY = slot("lint_in_coil")
CAM_LAMP = slot("cam_switched_lamp")
BRAKES = slot("brake_resistor_under_tube")
RESIN = slot("curing_resin")
SILTY = slot("silt_of_other_return")
CHIMNEY = slot("chimney_over_tube")
DETECTOR = slot("motion_detector_lamp")
WAX = slot("supercooling_wax")
BURSTS = slot("bursting_variants")
CRIMP = slot("rewelding_crimp")
GASSY = slot("clinging_gas")
RACK = slot("rack_fan")
PUDDLES = slot("warm_puddle")
CHOPPER = slot("chopper_in_coil")
WALLS_RUB = slot("rubbing_walls")

RUBS_N = 0.25  # change of load over which rubbing twins turn round
BELT_ON_degC, BELT_OFF_degC = 30.0, 33.0  # mean water that switches a heating belt
FAN_ON_degC, FAN_OFF_degC = 36.0, 32.0  # mean water that switches a fan
CAM_ON_m, CAM_OFF_m = 2.5e-3, 1e-3  # own contraction at which a cam switches a lamp
CURES_degC, CURES_K_s = 34.0, 100.0  # wire above which a resin cures, and what that takes
MELTS_degC, SETS_degC, WAX_K = 38.0, 32.0, 4.0  # where a wax begins to melt, and has set
MOVES_m_s, SHINES_S = 1e-3, 5.0  # speed that lights a lamp, and how long it stays on
BASE_A = 0.5  # sum of currents below which a supply needs its dummy load
GASSES_K, CLEARS_K = 5.0, 2.0  # wire above water at which gas clings to it, and lets go
RACK_ON, RACK_OFF = 0.25, 0.12  # warmth of both drivers that switches the fan of their rack
LAMP_S, LAMP_ON = 24.0, 0.375  # how often a lamp comes on, and for what share of that


@compiled
def mean(s: int, column: int, less: float, cells: Array) -> float:
    """Mean over the cells of spring `s` of what a column of theirs is above `less`."""
    total = 0.0
    for i in range(CELLS):
        total += (cells[s, i, column] - less) / CELLS
    return total


@compiled
def joints(s: int, e: Array, side: Array, heat: Array) -> float:
    """What joints at the inlet's end of spring `s` add to its resistance (ohm), and to `heat`."""
    inlet = e[s, SOLDER] * (1.0 - math.exp(-side[s, CARRIED]))
    inlet += e[s, CRIMP] * side[s, FRETTED]
    heat[0] += inlet
    return float(inlet)


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
    for i in range(CELLS):
        rows[i, TO_CLAMP] += e[s, ROD] * gripped / CELLS
        rows[i, HEAT_WATER] += (dripping * (warm - cells[s, i, W]) + shone) / CELLS


@compiled
def bend(s: int, e: Array, pair: Array, rows: Array) -> None:
    """Add to `rows` what bending a drawn-out coil does to the temperatures of transformation."""
    length = 1.0 + (pair[X] if s == 1 else -pair[X]) / 25e-3
    bent = e[s, BENT] * (length * length - 1.0)
    for i in range(CELLS):
        rows[i, SHIFT_HEAT] += bent
        rows[i, SHIFT_COOL] += bent


@compiled
def seldom(s: int, e: Array, cells: Array, side: Array, pair: Array, rows: Array) -> None:
    """Change `rows` by what films, losses, ends and cores do to a tube."""
    stirred = 1.0 / (1.0 + e[s, RUSTS] * side[s, RUST])
    stirred /= 1.0 + e[s, FROTHS] * side[s, FROTH]
    stirred /= 1.0 + e[s, SLIMY] * side[s, SLIME]
    stirred /= 1.0 + e[s, LINTY] * side[s, LINT]
    stirred /= 1.0 + e[1 - s, SILTY] * side[s, SETTLED]
    stirred /= 1.0 + e[s, GASSY] * side[s, GASSED]
    wetter = 1.0 + e[s, BLOWS] * side[s, BLOWN]
    wetter *= 1.0 + e[s, CHIMNEY] * side[s, DRAUGHT]
    wetter *= 1.0 + e[0, RACK] * pair[RACK_BLOWS]
    speed = min(max(side[1 - s, PUMP], 0.0), 1.0)
    within = 4.0 * e[1 - s, CHOPPER] * speed * (1.0 - speed) + e[s, WALLS_RUB] * side[s, RATE]
    rows[0, HEAT_WIRE] += e[s, UNLIKE] * side[s, AMPERE]
    warming = e[s, BELTED] * side[s, BELT] + e[s, REGULATED] * side[s, REGULATOR]
    warming += e[0, DUMMY_LOAD] * pair[DUMMY]
    warming += e[0, DETECTOR] * pair[WATCHED] + e[s, PUDDLES] * side[s, PUDDLE]
    warming += e[s, CAM_LAMP] * side[s, LIT] + e[s, BRAKES] * side[s, BRAKING]
    tension = pair[FORCE_X] if s == 0 else pair[FORCE_Y]
    framed = e[s, ON_FRAME] * min(max((tension - 1.24) / 0.4, 0.0), 1.0) / CELLS
    warmer = cells[1 - s, CELLS - 1, T] - cells[s, CELLS - 1, T]
    rows[CELLS - 1, HEAT_WIRE] += e[0, END_STRAP] * warmer
    rows[0, TO_CLAMP] += e[s, PRESSED] * max(tension, 0.0) / 1.24
    for i in range(CELLS):
        rows[i, HEAT_WATER] += warming / CELLS
        rows[i, HEAT_WIRE] += e[s, RESIN] * side[s, CURING] / CELLS
        rows[i, HEAT_WIRE] -= e[s, WAX] * side[s, MELTS] / CELLS
        rows[i, HEAT_WIRE] += within / CELLS
        rows[i, FILM] *= stirred
        rows[i, LOSS] *= wetter
        rows[i, LOSS] += framed
        rows[i, HEAT_WATER] += e[1 - s, PLUME] * side[s, OTHER_PLUME] / CELLS


@compiled
def haunt(s: int, p: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what stays about spring `s`: a plume, rust, warmth in a load cell, interfaces."""
    beside = mean(1 - s, W, 27.0, cells)
    side[s, OTHER_PLUME] = approach(side[s, OTHER_PLUME], max(beside, 0.0) / 10.0, dt, 5.0)
    warm = (cells[s, CELLS - 1, W] - 27.0) / 20.0
    side[s, CELL_SOAK] = approach(side[s, CELL_SOAK], warm, dt, 10.0)
    side[s, CELL_UNEVEN] = warm - side[s, CELL_SOAK]
    side[s, DRAGGED] = approach(side[s, DRAGGED], side[s, RATE] / (side[s, RATE] + 0.05), dt, 3.0)
    side[s, RUST] += dt * side[s, FLOW] / p[FULL_FLOW] / 20.0
    tension = pair[FORCE_X] if s == 0 else pair[FORCE_Y]
    # Over 0.3 s: a strain that followed the load at once would be found one tick late.
    taken = approach(side[s, RUBBED_BEFORE], tension, dt, 0.3)
    rubbed = side[s, TWINS_RUB] + (taken - side[s, RUBBED_BEFORE]) / RUBS_N
    side[s, TWINS_RUB] = min(max(rubbed, -1.0), 1.0)
    side[s, RUBBED_BEFORE] = taken


@compiled
def stay(s: int, p: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what stays in spring `s` and its tube: order, load, hydrogen, a belt, froth, gas."""
    austenite = -mean(s, FRACTION, 1.0, cells)
    warmth = mean(s, T, 0.0, cells)
    water = mean(s, W, 0.0, cells)
    side[s, ORDERED] = approach(side[s, ORDERED], austenite, dt, 8.0)
    tension = pair[FORCE_X] if s == 0 else pair[FORCE_Y]
    side[s, TRAINED] += dt / 15.0 * austenite * tension / 1.24
    taken = side[s, FLOW] / p[FULL_FLOW] * (1.0 - side[s, CHARGED])
    given = max(warmth - 35.0, 0.0) / 10.0 * side[s, CHARGED]
    side[s, CHARGED] += dt / 10.0 * (taken - given)
    side[s, BELT] = switched(side[s, BELT], -water, -BELT_ON_degC, -BELT_OFF_degC, dt, 1.0)
    speed = min(max(side[s, PUMP], 0.0), 1.0)
    beaten = 4.0 * speed * (1.0 - speed)
    slow = 0.5 if beaten > side[s, FROTH] else 6.0
    side[s, FROTH] = approach(side[s, FROTH], beaten, dt, slow)
    above = warmth - water
    side[s, GASSED] = switched(side[s, GASSED], above, GASSES_K, CLEARS_K, dt, 0.5)
    ampere = side[s, AMPERE]
    side[s, REGULATOR] = approach(side[s, REGULATOR], ampere * (4.0 - ampere) / 4.0, dt, 5.0)


@compiled
def grow(s: int, p: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what grows on spring `s` or waits for it: slime, a fan, a dummy load, late strain."""
    water = mean(s, W, 0.0, cells)
    grown = side[s, SLIME] + dt / 10.0 * max(water - 30.0, 0.0) / 10.0
    side[s, SLIME] = grown * math.exp(-dt * side[s, FLOW] / p[FULL_FLOW] / 6.0)
    side[s, BLOWN] = switched(side[s, BLOWN], water, FAN_ON_degC, FAN_OFF_degC, dt, 1.0)
    side[s, LATE_SET] = approach(side[s, LATE_SET], mean(s, FRACTION, 0.0, cells), dt, 3.0)
    if s == 1:
        needed = 1.0 if side[0, AMPERE] + side[1, AMPERE] < BASE_A else 0.0
        pair[DUMMY] = approach(pair[DUMMY], needed, dt, 3.0)


@compiled
def collect(s: int, p: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what collects on spring `s` or is left in it: solder, lint, resin, stretch, lamps."""
    side[s, CARRIED] += dt * side[s, AMPERE] / 40.0
    drawn_in = pair[X] if s == 0 else -pair[X]
    share = side[s, FLOW] / p[FULL_FLOW]
    caught = side[s, LINT] + dt / 5.0 * share * max(drawn_in, 0.0) / 5e-3
    side[s, LINT] = caught * math.exp(-dt / 3.0 * max(-drawn_in, 0.0) / 5e-3)
    over = max(mean(s, T, CURES_degC, cells), 0.0)
    side[s, CURING] = (1.0 - side[s, CURED]) * over / CURES_K_s
    side[s, CURED] += dt * side[s, CURING]
    side[s, LIT] = switched(side[s, LIT], drawn_in, CAM_ON_m, CAM_OFF_m, dt, 0.3)
    # A motor's speed before this tick is the one that the load cell's indicator saw last.
    lost = max(side[s, SPEED_BEFORE] - side[s, PUMP], 0.0)
    side[s, BRAKING] = approach(side[s, BRAKING], 0.0, dt, 4.0) + lost
    side[s, STRETCHED] = max(side[s, STRETCHED], -drawn_in / 5e-3)
    side[s, VARIANTS] = approach(side[s, VARIANTS], -drawn_in / 5e-3, dt, 12.0)


@compiled
def hold_back(
    s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array, dt: float
) -> None:
    """Update what comes late to spring `s`: silt, a draught, molten wax, heat and strain."""
    side[s, MOTOR_HEAT] = approach(side[s, MOTOR_HEAT], side[s, PUMP], dt, 8.0)
    brought = side[s, SETTLED] + dt / 8.0 * side[1 - s, FLOW] / p[FULL_FLOW]
    side[s, SETTLED] = brought * math.exp(-dt / 3.0 * side[s, FLOW] / p[FULL_FLOW])
    warm = max(mean(s, W, 27.0, cells), 0.0) / 10.0
    side[s, DRAUGHT] = approach(side[s, DRAUGHT], warm, dt, 8.0)
    wire = mean(s, T, 0.0, cells)
    melting = min(max((wire - MELTS_degC) / WAX_K, 0.0), 1.0)
    setting = min(max((wire - SETS_degC) / WAX_K, 0.0), 1.0)
    goal = min(max(side[s, MOLTEN], melting), setting)
    # Over 0.5 s: heat that followed the wire at once would swing from tick to tick.
    molten = approach(side[s, MOLTEN], goal, dt, 0.5)
    side[s, MELTS] = (molten - side[s, MOLTEN]) / dt
    side[s, MOLTEN] = molten
    fraction = mean(s, FRACTION, 0.0, cells)
    gained = fraction - side[s, PHASE_BEFORE]
    side[s, LATE_HEAT] = approach(side[s, LATE_HEAT], 0.0, dt, 6.0) + gained
    side[s, PHASE_BEFORE] = fraction
    if abs(fraction - side[s, BURST]) > e[s, BURSTS]:
        side[s, BURST] = fraction
    if s == 1:
        pair[SINCE_MOVED] = 0.0 if abs(pair[SPEED]) > MOVES_m_s else pair[SINCE_MOVED] + dt
        lit = 1.0 if pair[SINCE_MOVED] < SHINES_S else 0.0
        pair[WATCHED] = approach(pair[WATCHED], lit, dt, 0.3)


@compiled
def linger(s: int, p: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Update what lingers about spring `s`: a fretted crimp, a puddle, walls, a cap, a fan."""
    share = side[s, FLOW] / p[FULL_FLOW]
    heated = (side[s, AMPERE] / 4.0) ** 2
    fretted = side[s, FRETTED] + dt * abs(pair[SPEED]) / 10e-3
    side[s, FRETTED] = fretted * math.exp(-dt / 3.0 * heated)
    brought = dt / 4.0 * share * max(cells[s, CELLS - 1, W] - 27.0, 0.0) / 10.0
    side[s, PUDDLE] = approach(side[s, PUDDLE], 0.0, dt, 10.0) + brought
    side[s, SHAKEN] = approach(side[s, SHAKEN], side[s, PUMP], dt, 2.0)
    freed = math.exp(-dt * side[s, RATE] / 0.25)
    side[s, WALLS] = approach(side[s, WALLS], 1.0, dt, 10.0) * freed
    side[s, BULGED] = approach(side[s, BULGED], share * share, dt, 1.0)
    side[s, SHUNT_WARM] += dt / 5.0 * (heated - side[s, SHUNT_WARM] * (1.0 + 6.0 * share))
    if s == 1:
        both = (side[0, AMPERE] / 4.0) ** 2 + heated
        pair[RACK_HOT] = approach(pair[RACK_HOT], both, dt, 8.0)
        blows = switched(pair[RACK_BLOWS], pair[RACK_HOT], RACK_ON, RACK_OFF, dt, 1.0)
        pair[RACK_BLOWS] = blows
