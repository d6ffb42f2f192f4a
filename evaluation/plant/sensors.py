"""What the bench reads at one tick: four temperatures, travel, force, currents and voltages."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach, late, switched
from evaluation.plant.effects import slot
from evaluation.plant.encoder import travel
from evaluation.plant.layout import (
    AMPERE,
    AVERAGED,
    BLANKED,
    CELL_UNEVEN,
    CELLS,
    CHARGE,
    CONTACT,
    CONVERTED,
    CREEP_FAST,
    CREEP_SLOW,
    DROP,
    FLOW,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    FUSE_WARM,
    GLANCE,
    HELD_FORCE,
    LAST_SHOWN,
    LEAD_WARM,
    LOGGED,
    MISTED,
    MOIST,
    MOTOR_HEAT,
    OHM,
    PARTED,
    PASTED,
    PUMP,
    RESERVOIR,
    RING_FORCE,
    RING_X,
    RTD_A,
    RTD_B,
    RUST,
    SHUNT_WARM,
    SINCE_LOGGED,
    SLEEVE,
    SLOWED,
    SPEED,
    SPEED_BEFORE,
    SPILT,
    STEM,
    SWITCHED_AT,
    TIME,
    TIPPED,
    TURNED,
    UNZEROED,
    WAITS,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index

Array = NDArray[np.float64]

RTD_PLACE = index("rtd_place")
RTD_LAG = index("rtd_lag_s")
SUPPLY = index("supply_V")
SUPPLY_OHM = index("supply_ohm")
FULL_FLOW = index("flow_W_K")

CONTACT_OHM = slot("contact_resistance")
SLOW_RTD = slot("rtd_lag")
STEM_ERROR = slot("rtd_stem_error")
RTD_OFFSET = slot("rtd_offset")
DELAY = slot("channel_delay")
FORCE_OFFSET = slot("force_offset")
FORCE_GAIN = slot("force_gain")
FORCE_CREEP = slot("force_creep")
MIST = slot("misted_board")
RTD_LEAD = slot("rtd_lead_on_neighbour")
RIPPLE_FILTER = slot("ripple_filter")
RIPPLE = slot("rectified_ripple")
MOTOR_FIELD = slot("motor_beside_sensor")
RMS = slot("rms_voltmeter")
PAST_MAGNET = slot("rtd_leads_past_magnet")
BLANKS = slot("blanked_transmitter")
GRADIENT = slot("gradient_in_cell")
CARRIER = slot("beating_carrier")
SWAYING = slot("swaying_lead")
CONVERTS = slot("averaging_voltmeter")
PASTE = slot("setting_paste")
SPARES = slot("sparing_logger")
DROPS = slot("drops_on_cell")
PUMPS_WAIT = slot("indicator_waits_for_pumps")
VALLEY = slot("sampled_at_valley")
COMPRESSES = slot("compressing_divider")
JET = slot("jet_on_rtd")
QUADRATIC = slot("quadratic_rtd")
TAUT_CABLE = slot("taut_cell_cable")
EXCITATION = slot("sagging_excitation")
PUMP_RAIL = slot("sensors_on_pump_rail")
WAVY = slot("wavy_converter")
WASHED = slot("washed_terminal")
LOOSE_TIE = slot("loose_tie")
SAGGING_LEAD = slot("sagging_lead")
MOIST_GAUGE = slot("moist_gauge")
MISCORRECTED = slot("wrong_compensation")
OVER_MOTOR = slot("lead_over_other_motor")
SWAYS = slot("swaying_reference")
SLEEVED = slot("warm_sleeve")
PARTS = slot("parting_rtd_joint")
CHARGES = slot("charging_slide")
ROLLER = slot("eccentric_roller_on_cell")
ZEROED = slot("zeroed_at_rest")
SMALL_SIGNAL = slot("slow_at_small_signal")
TO_HEATER = slot("lead_drawn_to_heater")
BREATHES = slot("breathing_sheath")
TIPS = slot("tipping_cell")
BRUSHES = slot("brush_noise_on_bridge")
SHUNT = slot("shunt_in_feed")

BLANKS_A = 0.5  # change of its current that blanks an RTD's transmitter
STARTLES_PER_S = 0.5  # change of a pump's speed that an indicator waits for
CONVERTS_S = 0.5  # how often a voltmeter keeps a conversion for its average
STANDS_m_s = 2e-4  # speed at which a logger reads twice as often
CARRIER_S = 5.5  # how often a carrier beats with the chopped currents
WAVE_V = 0.8  # period of a converter's error
SWAYS_S = 8.0  # how often a voltmeter's reference sways
ROLLER_m = 9e-3  # travel in one turn of a roller on the load cell
PARTS_m, MEETS_m = 2.5e-3, 1e-3  # own stretch at which a joint parts and meets again


@compiled
def rtd(
    s: int,
    ambient: float,
    dt: float,
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
) -> float:
    """Reading (°C) of the RTD tied to spring `s`, before the converter."""
    place = p[RTD_PLACE] * CELLS - 0.5
    i = min(max(math.floor(place), 0), CELLS - 2)
    part = min(max(place - i, 0.0), 1.0)
    seen = (1.0 - part) * cells[s, i, T] + part * cells[s, i + 1, T]
    seen -= e[s, JET] * min(side[s, FLOW] / p[FULL_FLOW], 1.0) * (seen - cells[s, 0, W])
    if e[s, STEM_ERROR] > 0.0:
        side[s, STEM] = approach(side[s, STEM], 0.3 * seen + 0.7 * ambient, dt, 15.0)
        seen -= e[s, STEM_ERROR] * (seen - side[s, STEM])
    before = side[s, RTD_B]
    lifted = e[s, LOOSE_TIE] * abs(pair[SPEED]) / (abs(pair[SPEED]) + 1e-3)
    side[s, RTD_A] = approach(side[s, RTD_A], seen, dt, p[RTD_LAG] + e[s, SLOW_RTD] + lifted)
    if e[s, SLOW_RTD] > 0.0:
        side[s, RTD_B] = approach(side[s, RTD_B], side[s, RTD_A], dt, 0.35 * e[s, SLOW_RTD])
    else:
        side[s, RTD_B] = side[s, RTD_A]
    reading = side[s, RTD_B]
    set_by = 1.0 - min(max((reading - 32.0) / 10.0, 0.0), 1.0)
    side[s, PASTED] = approach(side[s, PASTED], reading, dt, e[s, PASTE] * set_by)
    reading = side[s, PASTED]
    falling = e[s, SLEEVED] if reading < side[s, SLEEVE] else 0.0
    side[s, SLEEVE] = approach(side[s, SLEEVE], reading, dt, falling)
    reading = side[s, SLEEVE]
    reading += e[s, RTD_OFFSET] * (1.0 + 0.01 * (reading - 27.0))
    reading += e[s, QUADRATIC] * ((reading - 27.0) / 20.0) ** 2
    if e[1 - s, RTD_LEAD] > 0.0:
        warm = 0.0
        for j in range(CELLS):
            warm += (cells[1 - s, j, W] - 27.0) / CELLS
        side[s, LEAD_WARM] = approach(side[s, LEAD_WARM], warm / 20.0, dt, 8.0)
        reading += e[1 - s, RTD_LEAD] * side[s, LEAD_WARM]
    drawn_out = pair[X] if s == 1 else -pair[X]
    reading += e[s, TO_HEATER] * side[s, AMPERE] / 4.0 * max(-drawn_out, 0.0) / 5e-3
    side[s, PARTED] = switched(side[s, PARTED], drawn_out, PARTS_m, MEETS_m, dt, 0.2)
    reading += e[s, PARTS] * side[s, PARTED]
    reading += e[s, WASHED] * (1.0 - math.exp(-2.0 * side[s, RUST]))
    fallen = max(before - side[s, RTD_B], 0.0) / 10.0
    side[s, MOIST] = approach(side[s, MOIST], 0.0, dt, 6.0) + fallen
    reading -= e[s, BREATHES] * side[s, MOIST]
    if e[s, RIPPLE_FILTER] > 0.0:
        slow = e[s, RIPPLE_FILTER] * side[s, AMPERE] / 4.0
        side[s, AVERAGED] = approach(side[s, AVERAGED], reading, dt, slow)
        reading = side[s, AVERAGED]
    reading += e[s, PAST_MAGNET] * (pair[SPEED] if s == 0 else -pair[SPEED]) / 5e-3
    if abs(side[s, AMPERE] - side[s, SWITCHED_AT]) > BLANKS_A:
        side[s, SWITCHED_AT] = side[s, AMPERE]
        side[s, BLANKED] = e[s, BLANKS]
    reading += min(side[s, BLANKED] / dt, 1.0) * (side[s, LAST_SHOWN] - reading)
    side[s, BLANKED] = max(side[s, BLANKED] - dt, 0.0)
    side[s, LAST_SHOWN] = reading
    return float(reading)


@compiled
def load(seen_N: float, dt: float, e: Array, side: Array, pair: Array) -> float:
    """Load cell reading (N) for a tendon force (N)."""
    time = pair[TIME]
    reading = seen_N * (1.0 + e[0, FORCE_GAIN] * (0.7 + 0.2 * seen_N))
    if e[0, FORCE_CREEP] > 0.0:
        pair[CREEP_FAST] = approach(pair[CREEP_FAST], seen_N - 1.24, dt, 4.0)
        pair[CREEP_SLOW] = approach(pair[CREEP_SLOW], seen_N - 1.24, dt, 40.0)
        reading += e[0, FORCE_CREEP] * (0.5 * pair[CREEP_FAST] + pair[CREEP_SLOW])
    reading += e[0, FORCE_OFFSET] * (1.0 - 0.2 * math.exp(-time / 25.0))
    rolled = pair[X] / ROLLER_m + e[2, ROLLER]
    reading *= 1.0 + min(e[0, ROLLER], 0.9) * math.sin(2.0 * math.pi * rolled)
    pair[CHARGE] = approach(pair[CHARGE], 0.0, dt, 4.0) + dt * abs(pair[SPEED]) / 10e-3
    reading += e[0, CHARGES] * pair[CHARGE]
    reading += e[0, GRADIENT] * side[0, CELL_UNEVEN]
    reading *= max(0.1, 1.0 - e[0, EXCITATION] * (side[0, AMPERE] + side[1, AMPERE]) / 4.0)
    reading *= max(0.1, 1.0 - e[0, MOIST_GAUGE] * pair[SPILT])
    reading += e[0, SAGGING_LEAD] * side[0, FUSE_WARM]
    reading += e[0, TAUT_CABLE] * max(pair[X] / 5e-3 - 0.3, 0.0)
    pair[DROP] += dt / 5.0 * side[0, FLOW] / 0.55
    pair[DROP] -= math.floor(pair[DROP])
    reading += e[0, DROPS] * pair[DROP]
    beat = time / CARRIER_S + e[2, CARRIER]
    for s in range(2):
        ampere = side[s, AMPERE]
        rippling = ampere * max(4.0 - ampere, 0.0) / 4.0
        reading += e[0, RIPPLE] * ampere * max(4.0 - ampere, 0.0) / 4.0
        reading += e[0, CARRIER] * rippling * math.sin(2.0 * math.pi * beat)
        if abs(side[s, PUMP] - side[s, SPEED_BEFORE]) > STARTLES_PER_S * dt:
            pair[WAITS] = e[0, PUMPS_WAIT]
        side[s, SPEED_BEFORE] = side[s, PUMP]
    sparking = side[0, PUMP] * side[1, AMPERE] + side[1, PUMP] * side[0, AMPERE]
    reading += e[0, BRUSHES] * sparking / 4.0
    running = pair[SPEED] / (abs(pair[SPEED]) + 1e-3)
    pair[TIPPED] = approach(pair[TIPPED], running, dt, 2.0)
    reading += e[0, TIPS] * pair[TIPPED]
    reading += min(pair[WAITS] / dt, 1.0) * (pair[HELD_FORCE] - reading)
    pair[WAITS] = max(pair[WAITS] - dt, 0.0)
    pair[HELD_FORCE] = reading
    return float(reading)


@compiled
def read(
    inlet: float,
    ambient: float,
    dt: float,
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    out: Array,
) -> None:
    """All readings of one tick into `out`, in the order of `layout.READINGS`."""
    pair[SINCE_LOGGED] += dt
    logs = pair[SINCE_LOGGED] > e[0, SPARES] / (1.0 + abs(pair[SPEED]) / STANDS_m_s)
    if logs:
        pair[SINCE_LOGGED] = 0.0
    for s in range(2):
        out[s] = side[s, AMPERE]
        out[s] -= e[s, VALLEY] * side[s, AMPERE] * max(4.0 - side[s, AMPERE], 0.0) / 4.0
        out[s] += e[0, MOTOR_FIELD] * side[s, PUMP]
        drawn_in = pair[X] if s == 0 else -pair[X]
        out[s] /= max(0.3, 1.0 + e[s, SWAYING] * drawn_in / 5e-3)
        out[s] *= max(0.1, 1.0 - e[0, PUMP_RAIL] * (side[0, PUMP] + side[1, PUMP]))
        out[s] *= max(0.1, 1.0 + e[s, MISCORRECTED] * (side[s, RTD_B] - 27.0) / 20.0)
        heating = side[s, AMPERE] > 0.05
        side[s, UNZEROED] = approach(side[s, UNZEROED], 1.0, dt, 6.0) if heating else 0.0
        out[s] += e[s, ZEROED] * side[s, UNZEROED]
        out[s] *= max(0.1, 1.0 + e[s, SHUNT] * side[s, SHUNT_WARM])
        contact = e[s, CONTACT_OHM] * (0.7 + 0.6 * side[s, CONTACT])
        contact += e[1 - s, OVER_MOTOR] * side[1 - s, MOTOR_HEAT]
        out[2 + s] = side[s, AMPERE] * (side[s, OHM] + contact)
        swayed = math.sin(2.0 * math.pi * (pair[TIME] / SWAYS_S + e[2, SWAYS]))
        out[2 + s] *= 1.0 + e[s, SWAYS] * swayed
        heard = max(out[2 + s], 0.0)
        out[2 + s] += e[s, RMS] * (math.sqrt(heard * p[SUPPLY]) - heard)
        out[2 + s] /= 1.0 + e[s, COMPRESSES] * max(out[2 + s], 0.0) / p[SUPPLY]
        out[2 + s] += e[s, WAVY] * math.sin(2.0 * math.pi * out[2 + s] / WAVE_V)
        if e[s, MIST] > 0.0:
            share = side[s, FLOW] / p[FULL_FLOW]
            slow = 3.0 if share > side[s, MISTED] else 15.0
            side[s, MISTED] = approach(side[s, MISTED], share, dt, slow)
            out[2 + s] *= 1.0 - e[s, MIST] * side[s, MISTED]
        slow = 1.0 / (0.2 + abs(out[2 + s]))
        side[s, SLOWED] = approach(side[s, SLOWED], out[2 + s], dt, slow)
        out[2 + s] -= min(e[s, SMALL_SIGNAL], 0.95) * (out[2 + s] - side[s, SLOWED])
        turn = pair[TIME] / CONVERTS_S
        if math.floor(turn) != math.floor(turn - dt / CONVERTS_S):
            side[s, CONVERTED] = out[2 + s]
        out[2 + s] -= e[s, CONVERTS] * (out[2 + s] - side[s, CONVERTED])
        out[4 + s] = rtd(s, ambient, dt, p, e, cells, side, pair)
        if logs:
            side[s, LOGGED] = out[4 + s]
        out[4 + s] = side[s, LOGGED]
    out[6] = inlet + 0.3 * pair[RESERVOIR]
    out[7] = ambient
    ticks = 0.0
    if e[0, DELAY] > 0.0:
        wander = 1.0 + 0.15 * math.sin(2.0 * math.pi * (pair[TIME] / 20.0 + e[2, DELAY]))
        ticks = e[0, DELAY] * wander / dt
    out[8] = travel(1e3 * late(ring, RING_X, pair[GLANCE], ticks), dt, e, side, pair)
    out[9] = load(late(ring, RING_FORCE, pair[GLANCE], ticks), dt, e, side, pair)
    total = side[0, AMPERE] + side[1, AMPERE]
    out[10] = p[SUPPLY] - p[SUPPLY_OHM] * total


@compiled
def truth(cells: Array, side: Array, pair: Array, out: Array) -> None:
    """What is true, in the order of `layout.TRUTHS`; the bank never contains it."""
    for s in range(2):
        for column, where in ((T, 0), (W, 2), (FRACTION, 4), (TURNED, 6)):
            total = 0.0
            for i in range(CELLS):
                total += cells[s, i, column] / CELLS
            out[where + s] = total
        out[10 + s] = side[s, FLOW]
    out[8] = 1e3 * pair[X]
    out[9] = 0.5 * (pair[FORCE_X] + pair[FORCE_Y])
