"""One spring in its tube over one tick: coefficients of each cell, the solve, and the memories."""

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
    ARREST,
    ARRESTED,
    ASLEEP,
    BATHED,
    BRIDGED,
    BUBBLE,
    CELLS,
    CHARGE,
    COAT,
    CONTACT,
    COOLED_FROM,
    EASED,
    FLOW,
    FRACTION,
    HEATED_FROM,
    HEATING,
    MOST_TURNED,
    OHM,
    OUTLET,
    PEAK,
    PLAY,
    PLAYS,
    QUENCH,
    QUIET,
    R_PHASE,
    RATE,
    RESERVOIR,
    SHUNT,
    SPEED,
    TURNED,
    WALL,
    WET,
    WORK_DONE,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import WEIGHT, falling, turned_by
from evaluation.plant.thermal import (
    FILM,
    HEAT_SHARE,
    HEAT_WATER,
    HEAT_WIRE,
    LATENT,
    LOSS,
    SHIFT_COOL,
    SHIFT_HEAT,
    TO_CLAMP,
    WATER_HEAT,
    advance,
    film,
)
from evaluation.plant.thresholds import shifts
from evaluation.plant.water import (
    DRY,
    WALL_S,
    coat,
    entering,
    evaporate,
    melt,
    pockets,
    touch,
    warm_wall,
    wet_shares,
)

Array = NDArray[np.float64]

WIRE_HEAT = index("wire_J_K")
LATENT_HEAT = index("latent_J")
WATER = index("water_J_K")
LOSS_RATE = index("loss_W_K")
LOSS_POWER = index("loss_power")
STATIC = index("film_static_W_K")
FORCED = index("film_forced_W_K")
FULL_FLOW = index("flow_W_K")
MIXING = index("mixing")
CONDUCTION = index("conduction_W_K")
RESISTANCE = index("resistance_ohm")
Y_RESISTANCE = index("y_resistance")
Y_LOSS = index("y_loss")
RTD_PLACE = index("rtd_place")

RESISTIVITY = slot("resistivity")
BUBBLES = slot("air_bubbles")
RESERVOIR_WARMS = slot("reservoir_warming")
COLD_ENDS = slot("cold_ends")
EXPONENT = slot("convection_exponent")
STRESS_LATENT = slot("stress_latent_heat")
SWELLING = slot("tube_swelling")
WATER_SHUNT = slot("water_shunt")
TWO_WAY = slot("two_way_memory")
R_PHASES = slot("r_phase")
STRAIN_GAUGE = slot("wire_strain_gauge")
WALL_HEAT = slot("tube_wall_heat")
RECOVERY = slot("detwin_recovery")
FRICTION_HEAT = slot("friction_heat")
PITCH = slot("coil_pitch_film")
RIPPLE = slot("ripple_heating")
WORKED = slot("worked_resistance")
COATING = slot("gas_coat")
HEAT_BY_PHASE = slot("phase_heat_capacity")
BINDING = slot("rtd_binding")
OVERTURNING = slot("overturning_water")
QUENCHED = slot("quenched_martensite")
SHORTS = slot("shorted_turns")
VARIANTS = slot("variant_creep")
HOT_CLIPS = slot("hot_clips")
STIRRING = slot("stirring_coils")

BRIDGING_A = 0.5  # current that breaks the oxide between turns that touch
VARIANTS_S = 2.0
QUICK_PER_S = 0.3  # rate of forming at which half of what haste can do is done


@compiled
def closed(contracted_mm: float) -> float:
    """Share of the turns that touch (0…1) where a spring is so much shorter than at assembly."""
    return 1.0 - falling((contracted_mm - 3.5) / 3.0)


@compiled
def bridged(s: int, side: Array, pair: Array) -> float:
    """Share of the touching turns that are bridged: current bridges them, parting opens them."""
    contracted_mm = 1e3 * (-pair[X] if s == 1 else pair[X])
    if side[s, AMPERE] > BRIDGING_A:
        side[s, BRIDGED] = max(side[s, BRIDGED], closed(contracted_mm))
    side[s, BRIDGED] = min(side[s, BRIDGED], closed(contracted_mm + 1.5))
    return float(side[s, BRIDGED])


@compiled
def resistance(
    s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array, heat: Array
) -> float:
    """Resistance (ohm) of spring `s`; each cell's share goes to `heat`."""
    base = p[RESISTANCE] * (p[Y_RESISTANCE] if s == 1 else 1.0)
    if e[s, STRAIN_GAUGE] > 0.0:
        stretch = (pair[X] if s == 1 else -pair[X]) / 0.01
        base *= 1.0 + e[s, STRAIN_GAUGE] * (stretch + 0.25 * stretch * stretch)
    if e[s, WORKED] > 0.0:
        base *= 1.0 + e[s, WORKED] * (1.0 - math.exp(-side[s, WORK_DONE] / 4.0))
    if e[s, SHORTS] > 0.0:
        base *= 1.0 - e[s, SHORTS] * bridged(s, side, pair)
    total = 0.0
    strength = e[s, RESISTIVITY]
    for i in range(CELLS):
        factor = 1.0
        if strength > 0.0:
            warm = cells[s, i, T] - 25.0
            off = cells[s, i, FRACTION] - 0.5
            factor += strength * (0.008 * warm + 1.2e-4 * warm * warm + off * (1.0 + 0.5 * off))
            factor += strength * 0.3 * cells[s, i, R_PHASE]
        heat[i] = base * factor / CELLS
        total += heat[i]
    return total


@compiled
def coefficients(
    s: int,
    amperes: float,
    stress: float,
    ambient: float,
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
    heat: Array,
    rows: Array,
) -> float:
    """Fill `rows` for one tick; the axial exchange (W/K) between neighbouring cells."""
    side[s, OHM] = resistance(s, p, e, cells, side, pair, heat)
    leaves = e[s, WATER_SHUNT]
    power = p[LOSS_POWER] + e[s, EXPONENT]
    loss = p[LOSS_RATE] * (p[Y_LOSS] if s == 1 else 1.0) / CELLS
    latent = p[LATENT_HEAT] / CELLS
    if e[s, STRESS_LATENT] != 0.0:
        relative = stress / 57.0
        latent *= max(0.1, 1.0 + e[s, STRESS_LATENT] * (relative - 1.0) * abs(relative))
    share = min(abs(side[s, FLOW]) / p[FULL_FLOW], 1.5)
    reach = 1.0
    if e[s, PITCH] > 0.0:
        stretch = (pair[X] if s == 1 else -pair[X]) / 0.01
        reach = math.exp(e[s, PITCH] * stretch / (1.0 + 0.5 * abs(stretch)))
    if e[s, STIRRING] > 0.0:
        reach *= 1.0 + e[s, STIRRING] * min(abs(pair[SPEED]) / 5e-3, 3.0)
    for i in range(CELLS):
        row = rows[i]
        water = cells[s, i, W]
        across = abs(cells[s, i, T] - water)
        out = max(abs(water - ambient), 0.2)
        wet = cells[s, i, WET]
        swollen = 1.0
        if e[s, SWELLING] > 0.0:
            swollen += e[s, SWELLING] * max(water - 27.0, 0.0) / 40.0
        joule = amperes * amperes * heat[i]
        if e[s, RIPPLE] > 0.0:
            joule += e[s, RIPPLE] * max(amperes, 0.0) * max(4.0 - amperes, 0.0) * heat[i]
        lost = min(0.9, leaves * wet * max(0.1, 1.0 + 0.02 * (water - 27.0)))
        row[HEAT_WIRE] = joule * (1.0 - lost)
        row[HEAT_WATER] = 0.6 * joule * lost
        if e[s, WALL_HEAT] > 0.0:
            row[HEAT_WATER] += e[s, WALL_HEAT] / CELLS / WALL_S * wet * (cells[s, i, WALL] - water)
        if e[s, FRICTION_HEAT] > 0.0:
            row[HEAT_WIRE] += e[s, FRICTION_HEAT] * side[s, RATE] / CELLS
        covered = wet * (1.0 - e[s, BUBBLES] * cells[s, i, BUBBLE])
        conductance = film(
            p[STATIC] / CELLS, p[FORCED] / CELLS, 0.15 + 0.5 * e[s, EXPONENT], across, share
        )
        row[FILM] = conductance * max(covered, DRY) / swollen**1.5 * reach
        if e[s, COATING] > 0.0:
            row[FILM] /= 1.0 + e[s, COATING] * cells[s, i, COAT]
        row[WATER_HEAT] = p[WATER] / CELLS * wet * swollen
        row[LOSS] = loss * (out / 15.0) ** power * (0.4 + 0.6 * wet)
        row[TO_CLAMP] = 0.0
        row[SHIFT_HEAT], row[SHIFT_COOL] = shifts(s, i, stress, p, e, cells, side)
        row[LATENT] = latent
        row[HEAT_SHARE] = 1.0 + e[s, HEAT_BY_PHASE] * (1.0 - cells[s, i, FRACTION])
    rows[0, TO_CLAMP] = e[s, COLD_ENDS]
    rows[CELLS - 1, TO_CLAMP] = 0.5 * e[s, COLD_ENDS]
    rows[0, HEAT_WIRE] += 0.5 * e[s, HOT_CLIPS] * side[s, CONTACT]
    rows[CELLS - 1, HEAT_WIRE] += 0.5 * e[s, HOT_CLIPS] * side[s, CONTACT]
    mix = CELLS * p[CONDUCTION] + p[MIXING] * abs(side[s, FLOW]) * CELLS / 6.0
    if e[s, OVERTURNING] > 0.0:
        unstable = max(cells[s, CELLS - 1, W] - cells[s, 0, W], 0.0)
        mix += e[s, OVERTURNING] * math.sqrt(unstable / 10.0)
    return float(mix)


@compiled
def remember(
    s: int, stress: float, p: Array, e: Array, cells: Array, side: Array, dt: float
) -> None:
    """Update what each cell remembers after its fraction has moved."""
    moved_all = 0.0
    mean = 0.0
    turned_new = turned_by(stress + side[s, EASED], p)
    if e[s, TWO_WAY] > 0.0:
        turned_new = min(1.0, turned_new + e[s, TWO_WAY] * (0.1 + side[s, MOST_TURNED]))
    for i in range(CELLS):
        cell = cells[s, i]
        fraction = 0.0
        for k in range(PLAYS):
            fraction += WEIGHT[k] * cell[PLAY + k]
        moved = fraction - cell[FRACTION]
        if moved > 0.0:
            cell[TURNED] = (cell[TURNED] * cell[FRACTION] + turned_new * moved) / fraction
            if e[s, QUENCHED] > 0.0:
                fresh = moved / (moved + QUICK_PER_S * dt)
                cell[QUENCH] = (cell[QUENCH] * cell[FRACTION] + fresh * moved) / fraction
        if e[s, RECOVERY] > 0.0:
            excess = max(cell[TURNED] - turned_new, 0.0)
            cell[TURNED] -= excess * min(0.5, e[s, RECOVERY] * dt * math.sqrt(excess / 0.1))
        if e[s, VARIANTS] > 0.0 and turned_new > 0.0:
            ahead = max(cell[TURNED] - turned_new, 0.0) / e[s, VARIANTS]
            rate = e[s, VARIANTS] / VARIANTS_S * math.exp(-ahead) * turned_new / (turned_new + 0.01)
            cell[TURNED] = min(cell[TURNED] + dt * rate, 1.0)
        if moved < -1e-6 and cell[HEATING] < 0.5:
            cell[HEATING] = 1.0
            cell[HEATED_FROM] = cell[FRACTION]
            cell[PEAK] = cell[T]
        elif moved > 1e-6 and cell[HEATING] > 0.5:
            cell[HEATING] = 0.0
            cell[COOLED_FROM] = cell[FRACTION]
            cell[ARREST] = cell[PEAK]
            cell[ARRESTED] = 4.0 * cell[FRACTION] * (1.0 - cell[FRACTION])
        cell[PEAK] = max(cell[PEAK], cell[T])
        cell[FRACTION] = fraction
        moved_all += abs(moved) / CELLS
        mean += fraction / CELLS
        if e[s, R_PHASES] > 0.0 or e[s, RESISTIVITY] > 0.0:
            lift = 0.1 * (stress - 57.0)
            comes = falling((cell[T] - 37.0 - lift) / 2.0) * (1.0 - fraction)
            stays = falling((cell[T] - 40.5 - lift) / 2.0) * (1.0 - fraction)
            cell[R_PHASE] = min(max(cell[R_PHASE], comes), max(stays, comes))
    side[s, CHARGE] += abs(side[s, AMPERE]) * dt
    side[s, WORK_DONE] += moved_all
    side[s, RATE] = approach(side[s, RATE], moved_all / dt, dt, 0.3)
    if mean < 0.5:
        side[s, ASLEEP] = 0.0
    elif side[s, RATE] < 0.01:
        side[s, ASLEEP] += dt


@compiled
def tube(
    s: int,
    amperes: float,
    stress: float,
    inlet: float,
    ambient: float,
    luck: float,
    dt: float,
    p: Array,
    e: Array,
    cells: Array,
    side: Array,
    pair: Array,
    heat: Array,
    rows: Array,
    scratch: Array,
) -> None:
    """Advance spring `s` and its water by one tick."""
    calm = abs(amperes - side[s, AMPERE]) < 0.2
    side[s, AMPERE] = amperes
    source = entering(s, inlet, dt, e, side, pair)
    wet_shares(s, e, cells, side, source, dt)
    pockets(s, e, cells, side, luck, dt)
    coat(s, e, cells, side, dt)
    mix = coefficients(s, amperes, stress, ambient, p, e, cells, side, pair, heat, rows)
    evaporate(s, e, cells, side, rows, dt)
    melt(s, e, cells, rows, dt)
    touch(s, ambient, e, cells, side, pair, rows, dt)
    if e[s, BINDING] > 0.0:
        side[s, BATHED] = rows[int(p[RTD_PLACE] * CELLS), FILM]
    left = int(side[s, QUIET]) if calm else 0
    side[s, QUIET] = advance(
        cells[s],
        rows,
        p[WIRE_HEAT] / CELLS,
        side[s, FLOW],
        mix,
        source,
        side[s, OUTLET],
        ambient,
        dt,
        p,
        scratch,
        left,
    )
    if side[s, FLOW] > 0.0:
        last = cells[s, CELLS - 1, W]
        side[s, OUTLET] = approach(side[s, OUTLET], last, dt, 0.3 / side[s, FLOW])
        if e[s, RESERVOIR_WARMS] > 0.0:
            gained = side[s, FLOW] * (last - source) * dt
            pair[RESERVOIR] += e[s, RESERVOIR_WARMS] * gained / 400.0
    warm_wall(s, e, cells, dt)
    remember(s, stress, p, e, cells, side, dt)
    warmth = amperes * amperes
    side[s, CONTACT] = approach(side[s, CONTACT], warmth / 16.0, dt, 8.0)
    side[s, SHUNT] = approach(side[s, SHUNT], warmth / 16.0, dt, 10.0)
    if e[s, WATER_SHUNT] > 0.0:
        side[s, OHM] *= max(0.3, 1.0 - 0.5 * leaves_through_water(s, e, cells))


@compiled
def leaves_through_water(s: int, e: Array, cells: Array) -> float:
    """Mean share of the current that takes the water."""
    total = 0.0
    for i in range(CELLS):
        warm = max(0.1, 1.0 + 0.02 * (cells[s, i, W] - 27.0))
        total += min(0.9, e[s, WATER_SHUNT] * cells[s, i, WET] * warm) / CELLS
    return total
