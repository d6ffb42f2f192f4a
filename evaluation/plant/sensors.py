"""What the bench reads at one tick: four temperatures, travel, force, currents and voltages."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach, drawn, late
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMMETER,
    AMPERE,
    AVERAGED,
    BATHED,
    CELL_WARM,
    CELLS,
    CONTACT,
    CORE,
    COUNTED,
    CREEP_FAST,
    CREEP_SLOW,
    DECODED,
    DECODED_RATE,
    ENCODER,
    FLOW,
    FOIL_COARSE,
    FOIL_FINE,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    FRAME,
    GLANCE,
    HIGH_RANGE,
    KNEE,
    LOAD_MEAN,
    MISCOUNTS,
    OHM,
    POLARISED,
    PUMP,
    REPORTED,
    RESERVOIR,
    RING_FORCE,
    RING_X,
    RTD_A,
    RTD_B,
    SHUNT,
    SLIPPED,
    SOAKED,
    SPOT,
    STEM,
    STRAYED,
    TARED,
    TIME,
    TRACKED,
    TURNED,
    TURNED_AT,
    TURNING,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index

Array = NDArray[np.float64]

RTD_PLACE = index("rtd_place")
RTD_LAG = index("rtd_lag_s")
WIRE_HEAT = index("wire_J_K")
SUPPLY = index("supply_V")
SUPPLY_OHM = index("supply_ohm")

CONTACT_OHM = slot("contact_resistance")
SLOW_RTD = slot("rtd_lag")
STEM_ERROR = slot("rtd_stem_error")
RTD_OFFSET = slot("rtd_offset")
DELAY = slot("channel_delay")
BACKLASH = slot("encoder_backlash")
SLIP = slot("encoder_slip")
FORCE_OFFSET = slot("force_offset")
FORCE_GAIN = slot("force_gain")
FORCE_CREEP = slot("force_creep")
PICKUP = slot("rtd_current_pickup")
ECCENTRIC = slot("encoder_eccentricity")
FRAME_WARMS = slot("force_frame_warming")
SHUNT_WARMS = slot("shunt_self_heating")
RTD_STRAIN = slot("rtd_strain")
SPOOL = slot("spool_buildup")
SELF_HEATING = slot("rtd_flow_self_heating")
VIBRATION = slot("pump_vibration")
GHOST = slot("mux_ghosting")
BEAT = slot("supply_beat")
RETURN_WIRE = slot("shared_return")
REFERENCE = slot("ratiometric_reference")
FOIL = slot("force_hysteresis")
REMANENCE = slot("core_remanence")
DROOP = slot("pump_load_droop")
ANGLE = slot("tendon_angle")
CARRY = slot("converter_carry")
REPORT_BAND = slot("rtd_report_band")
STOP = slot("overload_stop")
MISCOUNT = slot("reversal_miscount")
POLARISATION = slot("clip_polarisation")
BINDING = slot("rtd_binding")
NEIGHBOUR = slot("neighbour_field")
TRACKING = slot("zero_tracking")
GROUND_LIFT = slot("pump_ground_lift")
WANDERING = slot("rtd_wandering")
DECODER = slot("tracking_decoder")
RANGES = slot("range_switching")
ZENER = slot("soft_zener")
COUNTS = slot("pwm_counts")
SEEPAGE = slot("rtd_seepage")
AVERAGING = slot("adaptive_filter")
CLIPS = slot("clip_tension")
BOW = slot("rtd_bow")
BENDING = slot("shaft_bending")
SPAN_DRIFT = slot("cell_span_drift")
AMMETER_LAG = slot("ammeter_average")

TURN_mm = 13.0
AXIS_OFF = 0.2  # rad between the tendon and the load cell's axis at rest
TURN_SEEN_mm = 0.1  # way back from which a reversal counts as one
UP_A, DOWN_A = 1.2, 0.6  # where an ammeter of two ranges changes them
NOISY_A = 1.5  # current from which the heaters' edges pass for the encoder's
TARE_TICKS = 100.0  # the settling before a run, in which the indicator was tared


@compiled
def soaked(s: int, reading: float, side: Array, dt: float) -> float:
    """How wet the glue under an RTD is (0…1): the pump presses water in, warmth drives it out."""
    creeps = max(side[s, FLOW], 0.0) / 0.5 / 5.0
    dries = (1.0 + max(reading - 30.0, 0.0) / 6.0) / 50.0
    rate = creeps + dries
    side[s, SOAKED] = approach(side[s, SOAKED], creeps / rate, dt, 1.0 / rate)
    return float(side[s, SOAKED])


@compiled
def rtd(
    s: int, ambient: float, dt: float, p: Array, e: Array, cells: Array, side: Array, pair: Array
) -> float:
    """Reading (°C) of the RTD tied to spring `s`, before the converter."""
    place = p[RTD_PLACE] * CELLS - 0.5
    if e[s, WANDERING] != 0.0:
        place += e[s, WANDERING] * CELLS * (pair[X] if s == 1 else -pair[X]) / 0.01
    i = min(max(math.floor(place), 0), CELLS - 2)
    part = min(max(place - i, 0.0), 1.0)
    seen = (1.0 - part) * cells[s, i, T] + part * cells[s, i + 1, T]
    if e[s, BINDING] > 0.0:
        water = (1.0 - part) * cells[s, i, W] + part * cells[s, i + 1, W]
        rate = max(side[s, BATHED], 1e-4) * CELLS / p[WIRE_HEAT] / (1.0 + e[s, BINDING])
        side[s, SPOT] = approach(side[s, SPOT], e[s, BINDING] * (seen - water), dt, 1.0 / rate)
        seen += side[s, SPOT]
    if e[s, STEM_ERROR] > 0.0:
        side[s, STEM] = approach(side[s, STEM], 0.3 * seen + 0.7 * ambient, dt, 15.0)
        seen -= e[s, STEM_ERROR] * (seen - side[s, STEM])
    side[s, RTD_A] = approach(side[s, RTD_A], seen, dt, p[RTD_LAG] + e[s, SLOW_RTD])
    if e[s, SLOW_RTD] > 0.0:
        side[s, RTD_B] = approach(side[s, RTD_B], side[s, RTD_A], dt, 0.35 * e[s, SLOW_RTD])
    else:
        side[s, RTD_B] = side[s, RTD_A]
    reading = side[s, RTD_B]
    reading += e[s, RTD_OFFSET] * (1.0 + 0.01 * (reading - 27.0))
    reading += e[s, PICKUP] * (side[s, AMPERE] + 0.2 * side[1 - s, AMPERE])
    reading += e[s, SELF_HEATING] * math.exp(-8.0 * side[s, PUMP])
    if e[s, RTD_STRAIN] != 0.0:
        off = pair[X] if s == 1 else -pair[X]
        reading += e[s, RTD_STRAIN] * (off / 0.01 + 0.3 * (off / 0.01) ** 2)
    if e[s, BOW] != 0.0:
        z = (reading - 27.0) / 30.0
        reading += 4.0 * e[s, BOW] * z * (1.0 - z)
    if e[s, SEEPAGE] > 0.0:
        reading -= e[s, SEEPAGE] * soaked(s, reading, side, dt)
    if e[s, CARRY] != 0.0:
        code = 33.0 + 8.0 * e[2, CARRY]
        reading += e[s, CARRY] * 0.5 * (1.0 + math.tanh((reading - code) / 0.15))
    if e[s, REPORT_BAND] > 0.0:
        if abs(reading - side[s, REPORTED]) >= e[s, REPORT_BAND]:
            side[s, REPORTED] = reading
        reading = side[s, REPORTED]
    return float(reading)


@compiled
def reversals(place_mm: float, pair: Array) -> float:
    """How often the shaft has turned round by now."""
    off = place_mm - pair[TURNED_AT]
    way = pair[TURNING]
    if off * way > 0.0:
        pair[TURNED_AT] = place_mm
    elif abs(off) > TURN_SEEN_mm:
        if way != 0.0:
            pair[MISCOUNTS] += 1.0
        pair[TURNING] = math.copysign(1.0, off)
        pair[TURNED_AT] = place_mm
    return float(pair[MISCOUNTS])


@compiled
def decoded(reading: float, lag: float, dt: float, pair: Array) -> float:
    """What a loop of second type makes of the encoder's angle; locked on before a run."""
    if pair[GLANCE] <= TARE_TICKS:
        pair[DECODED] = reading
        return reading
    fast = dt / lag
    weight = fast + fast * fast
    place = (pair[DECODED] + dt * pair[DECODED_RATE] + weight * reading) / (1.0 + weight)
    pair[DECODED_RATE] += fast / lag * (reading - place)
    pair[DECODED] = place
    return float(place)


@compiled
def travel(seen_mm: float, dt: float, e: Array, side: Array, pair: Array) -> float:
    """Encoder reading (mm) for the tendon's travel (mm)."""
    width = e[0, BACKLASH]
    before = pair[ENCODER]
    if width > 0.0:
        gap = seen_mm - before
        half = 0.5 * width
        soft = half / 3.0
        excess = abs(gap) - half
        if excess > 0.0:
            pair[ENCODER] = before + math.copysign(excess * excess / (excess + soft), gap)
    else:
        pair[ENCODER] = seen_mm
    moved = pair[ENCODER] - before
    if e[0, SLIP] > 0.0 and pair[FORCE_X] > 1.4:
        pair[SLIPPED] -= e[0, SLIP] * (moved if moved > 0.0 else 0.4 * moved)
    reading = pair[ENCODER] + pair[SLIPPED]
    if e[0, ECCENTRIC] > 0.0:
        phase = 2.0 * math.pi * e[2, ECCENTRIC]
        turn = 2.0 * math.pi * reading / TURN_mm
        reading += e[0, ECCENTRIC] * (math.sin(turn + phase) - math.sin(phase))
    reading += e[0, SPOOL] * (reading / 10.0) ** 2
    reading += e[0, BENDING] * (pair[FORCE_X] / 1.24 - 1.0)
    if e[0, MISCOUNT] > 0.0:
        reading += e[0, MISCOUNT] * reversals(pair[ENCODER], pair)
    if e[0, COUNTS] != 0.0:
        for s in range(2):
            pair[COUNTED] += e[0, COUNTS] * dt * max(side[s, AMPERE] - NOISY_A, 0.0)
        reading += pair[COUNTED]
    if e[0, DECODER] > 0.0:
        reading = decoded(reading, e[0, DECODER], dt, pair)
    return float(reading)


@compiled
def tracked(reading: float, strength: float, dt: float, pair: Array) -> float:
    """What the indicator shows (N) that moves its zero after a still load near its tare."""
    if pair[GLANCE] <= TARE_TICKS:
        pair[TARED] = reading
        pair[LOAD_MEAN] = reading
        return reading
    rate = (reading - pair[LOAD_MEAN]) / 0.5
    pair[LOAD_MEAN] = approach(pair[LOAD_MEAN], reading, dt, 0.5)
    off = reading - pair[TRACKED] - pair[TARED]
    trust = math.exp(-((off / 0.3) ** 2)) / (1.0 + (rate / 0.03) ** 2)
    pair[TRACKED] += off * trust * (1.0 - math.exp(-strength * dt))
    return float(reading - pair[TRACKED])


@compiled
def averaged(reading: float, longest: float, shape: float, dt: float, pair: Array) -> float:
    """What an indicator shows (N) whose average is the shorter, the further the load is off."""
    if pair[GLANCE] <= TARE_TICKS:
        pair[AVERAGED] = reading
        return reading
    off = (reading - pair[AVERAGED]) / (0.06 + 0.06 * shape)
    pair[AVERAGED] = approach(pair[AVERAGED], reading, dt, longest * math.exp(-off * off))
    return float(pair[AVERAGED])


@compiled
def load(seen_N: float, dt: float, e: Array, cells: Array, side: Array, pair: Array) -> float:
    """Load cell reading (N) for a tendon force (N)."""
    time = pair[TIME]
    reading = seen_N * (1.0 + e[0, FORCE_GAIN] * (0.7 + 0.2 * seen_N))
    if e[0, ANGLE] != 0.0:
        reading *= math.cos(AXIS_OFF + e[0, ANGLE] * pair[X] / 0.01) / math.cos(AXIS_OFF)
    if e[0, SPAN_DRIFT] != 0.0:
        warm = 0.0
        for i in range(CELLS):
            warm += (cells[0, i, W] - 27.0) / CELLS
        pair[CELL_WARM] = approach(pair[CELL_WARM], warm, dt, 20.0)
        reading *= 1.0 + e[0, SPAN_DRIFT] * pair[CELL_WARM] / 20.0
    if e[0, STOP] > 0.0:
        past = seen_N - 1.27 - 0.2 * e[2, STOP]
        reading -= e[0, STOP] * 0.5 * (past + math.sqrt(past * past + 9e-4))
    if e[0, FORCE_CREEP] > 0.0:
        pair[CREEP_FAST] = approach(pair[CREEP_FAST], seen_N - 1.24, dt, 4.0)
        pair[CREEP_SLOW] = approach(pair[CREEP_SLOW], seen_N - 1.24, dt, 40.0)
        reading += e[0, FORCE_CREEP] * (0.5 * pair[CREEP_FAST] + pair[CREEP_SLOW])
    if e[0, FOIL] > 0.0:
        fine = min(max(pair[FOIL_FINE], seen_N - 0.08), seen_N + 0.08)
        coarse = min(max(pair[FOIL_COARSE], seen_N - 0.3), seen_N + 0.3)
        reading -= e[0, FOIL] * (0.6 * (seen_N - fine) / 0.08 + 0.4 * (seen_N - coarse) / 0.3)
        pair[FOIL_FINE] = fine
        pair[FOIL_COARSE] = coarse
    reading += e[0, FORCE_OFFSET] * (1.0 - 0.2 * math.exp(-time / 25.0))
    watts = side[0, AMPERE] ** 2 * side[0, OHM] + side[1, AMPERE] ** 2 * side[1, OHM]
    pair[FRAME] = approach(pair[FRAME], watts / 3.0, dt, 45.0)
    reading += e[0, FRAME_WARMS] * pair[FRAME]
    if e[0, VIBRATION] > 0.0:
        hertz = 1.7 + 2.4 * e[2, VIBRATION]
        hum = math.sin(2.0 * math.pi * hertz * time)
        reading += e[0, VIBRATION] * (side[0, PUMP] + side[1, PUMP]) * hum
    if e[0, TRACKING] > 0.0:
        reading = tracked(reading, e[0, TRACKING], dt, pair)
    if e[0, AVERAGING] > 0.0:
        reading = averaged(reading, e[0, AVERAGING], e[2, AVERAGING], dt, pair)
    return float(reading)


@compiled
def low_range(s: int, side: Array) -> float:
    """1 while the ammeter is in its low range, else 0."""
    if side[s, AMPERE] > UP_A:
        side[s, HIGH_RANGE] = 1.0
    elif side[s, AMPERE] < DOWN_A:
        side[s, HIGH_RANGE] = 0.0
    return float(1.0 - side[s, HIGH_RANGE])


@compiled
def clamped(s: int, volts: float, shape: float, side: Array, dt: float) -> float:
    """By how much (V) a voltage passes the knee of the sense lines' Zener, and its own warmth."""
    past = volts - 1.2 - 0.5 * shape + 0.5 * side[s, KNEE]
    over = 0.5 * (past + math.sqrt(past * past + 0.01))
    side[s, KNEE] = approach(side[s, KNEE], over, dt, 5.0)
    return float(over)


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
    for s in range(2):
        warm = 1.0 + e[s, SHUNT_WARMS] * side[s, SHUNT]
        out[s] = (side[s, AMPERE] + side[s, STRAYED]) * warm
        if e[s, NEIGHBOUR] != 0.0:
            out[s] += e[s, NEIGHBOUR] * side[1 - s, AMPERE] / (1.0 + 0.25 * side[s, AMPERE])
        if e[s, REMANENCE] > 0.0:
            relative = side[s, AMPERE] / 4.0
            side[s, CORE] = max(approach(side[s, CORE], 0.0, dt, 12.0), relative)
            out[s] += e[s, REMANENCE] * (side[s, CORE] - relative)
        if e[s, RANGES] != 0.0:
            out[s] *= 1.0 + e[s, RANGES] * low_range(s, side)
        if e[s, AMMETER_LAG] > 0.0:
            side[s, AMMETER] = approach(side[s, AMMETER], out[s], dt, e[s, AMMETER_LAG])
            out[s] = side[s, AMMETER]
        contact = e[s, CONTACT_OHM] * (0.7 + 0.6 * side[s, CONTACT])
        out[2 + s] = side[s, AMPERE] * (side[s, OHM] + contact)
        if e[s, POLARISATION] > 0.0:
            pulled = math.tanh(side[s, AMPERE] / 0.8)
            slow = 6.0 if pulled > side[s, POLARISED] else 15.0
            side[s, POLARISED] = approach(side[s, POLARISED], pulled, dt, slow)
            out[2 + s] += e[s, POLARISATION] * side[s, POLARISED]
        if e[s, CLIPS] > 0.0:
            tension = max(pair[FORCE_X] if s == 0 else pair[FORCE_Y], 0.3)
            out[2 + s] += e[s, CLIPS] * side[s, AMPERE] * ((1.24 / tension) ** 2 - 1.0)
        out[2 + s] += e[s, RETURN_WIRE] * (side[0, AMPERE] + side[1, AMPERE])
        if e[s, GROUND_LIFT] != 0.0:
            out[2 + s] += e[s, GROUND_LIFT] * drawn(side)
        if e[s, ZENER] > 0.0:
            out[2 + s] -= e[s, ZENER] * clamped(s, out[2 + s], e[2, ZENER], side, dt)
        out[4 + s] = rtd(s, ambient, dt, p, e, cells, side, pair)
    out[6] = inlet + 0.3 * pair[RESERVOIR]
    out[7] = ambient
    if e[0, GHOST] > 0.0:
        for k in range(3):
            kept = 5 + k
            out[kept] += e[0, GHOST] * (out[kept - 1] - out[kept])
    ticks = 0.0
    if e[0, DELAY] > 0.0:
        wander = 1.0 + 0.15 * math.sin(2.0 * math.pi * (pair[TIME] / 20.0 + e[2, DELAY]))
        ticks = e[0, DELAY] * wander / dt
    out[8] = travel(1e3 * late(ring, RING_X, pair[GLANCE], ticks), dt, e, side, pair)
    out[9] = load(late(ring, RING_FORCE, pair[GLANCE], ticks), dt, e, cells, side, pair)
    total = side[0, AMPERE] + side[1, AMPERE]
    beat = 0.0
    if e[0, BEAT] > 0.0:
        beat = 0.1 * math.sin(2.0 * math.pi * (0.17 + 0.23 * e[2, BEAT]) * pair[TIME])
    out[10] = p[SUPPLY] * (1.0 + e[0, BEAT] * beat) - p[SUPPLY_OHM] * total
    if e[0, DROOP] > 0.0:
        out[10] *= 1.0 - 0.3 * e[0, DROOP] * drawn(side)
    if e[0, REFERENCE] > 0.0:
        rise = 1.0 + e[0, REFERENCE] * 0.25 * total * (1.0 + 0.06 * total)
        for k in range(4):
            out[k] *= rise
        out[9] *= rise
        out[10] *= rise


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
