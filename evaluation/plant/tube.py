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
    BUBBLE,
    CELLS,
    CONTACT,
    COOLED_FROM,
    CORRODED,
    DEFECTS,
    FLOW,
    FRACTION,
    GRAINS,
    HEATED_FROM,
    HEATING,
    INNER_STRESS,
    LATE_HEAT,
    LIMED,
    OHM,
    ORDERED,
    PLAY,
    PLAYS,
    QUIET,
    R_PHASE,
    RATE,
    RESERVOIR,
    TURNED,
    WET,
    WORK_DONE,
    T,
    W,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import WEIGHT, falling, turned_by
from evaluation.plant.rarer import (
    BENT,
    DRIPPING,
    LAMP,
    ROD,
    bend,
    collect,
    elsewhere,
    grow,
    haunt,
    hold_back,
    joints,
    linger,
    seldom,
    stay,
)
from evaluation.plant.thermal import (
    FILM,
    HEAT_WATER,
    HEAT_WIRE,
    LATENT,
    LOSS,
    SHIFT_COOL,
    SHIFT_HEAT,
    STORES,
    TO_CLAMP,
    WATER_HEAT,
    advance,
    film,
)
from evaluation.plant.thresholds import shifts
from evaluation.plant.water import DRY, entering, pockets, wet_shares

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
AT_START = index("turned_at_start")
STRESS = index("stress_MPa_N")
Y_RESISTANCE = index("y_resistance")
Y_LOSS = index("y_loss")

RESISTIVITY = slot("resistivity")
BUBBLES = slot("air_bubbles")
RESERVOIR_WARMS = slot("reservoir_warming")
COLD_ENDS = slot("cold_ends")
EXPONENT = slot("convection_exponent")
STRESS_LATENT = slot("stress_latent_heat")
R_PHASES = slot("r_phase")
TEXTURED = slot("textured_resistance")
CORRODING = slot("corroding_wire")
LIME = slot("lime_on_wire")
LATENT_FADES = slot("fading_latent")
LINGERING = slot("lingering_stress")
HEALING = slot("healing_defects")
ORDERING = slot("ordering_austenite")
MARTENSITE_WARMS = slot("warm_martensite_resists")
UNEVEN = slot("uneven_latent")
LATE_LATENT = slot("late_latent")
PLAYS_OF_GRAINS = slot("grains_with_play")


@compiled
def resistance(s: int, p: Array, e: Array, cells: Array, side: Array, heat: Array) -> float:
    """Resistance (ohm) of spring `s`; what heats each cell's wire goes to `heat`."""
    base = p[RESISTANCE] * (p[Y_RESISTANCE] if s == 1 else 1.0)
    if e[s, CORRODING] > 0.0:
        base *= 1.0 + min(e[s, CORRODING] * side[s, CORRODED], 2.0)
    base *= 1.0 + e[s, HEALING] * side[s, DEFECTS]
    base *= max(1.0 - e[s, ORDERING] * side[s, ORDERED], 0.2)
    total = 0.0
    strength = e[s, RESISTIVITY]
    for i in range(CELLS):
        factor = 1.0
        if strength > 0.0:
            warm = cells[s, i, T] - 25.0
            off = cells[s, i, FRACTION] - 0.5
            factor += strength * (0.008 * warm + 1.2e-4 * warm * warm + off * (1.0 + 0.5 * off))
            factor += strength * 0.3 * cells[s, i, R_PHASE]
        if e[s, TEXTURED] > 0.0:
            further = cells[s, i, FRACTION] * (cells[s, i, TURNED] - p[AT_START])
            factor += e[s, TEXTURED] * min(max(further, 0.0) / 0.05, 8.0)
        warm = (cells[s, i, T] - 27.0) / 10.0
        factor += e[s, MARTENSITE_WARMS] * cells[s, i, FRACTION] * warm
        heat[i] = base * factor / CELLS
        total += heat[i]
    return float(total + joints(s, e, side, heat))


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
    side[s, OHM] = resistance(s, p, e, cells, side, heat)
    power = p[LOSS_POWER] + e[s, EXPONENT]
    loss = p[LOSS_RATE] * (p[Y_LOSS] if s == 1 else 1.0) / CELLS
    latent = p[LATENT_HEAT] / CELLS
    if e[s, STRESS_LATENT] != 0.0:
        relative = stress / 57.0
        latent *= max(0.1, 1.0 + e[s, STRESS_LATENT] * (relative - 1.0) * abs(relative))
    if e[s, LATENT_FADES] > 0.0:
        latent *= 1.0 - min(e[s, LATENT_FADES], 0.9) * (1.0 - math.exp(-side[s, WORK_DONE] / 1.5))
    share = min(side[s, FLOW] / p[FULL_FLOW], 1.5)
    reach = 1.0 / (1.0 + e[s, LIME] * side[s, LIMED])
    still = p[STATIC] / CELLS
    for i in range(CELLS):
        row = rows[i]
        water = cells[s, i, W]
        across = abs(cells[s, i, T] - water)
        out = max(abs(water - ambient), 0.2)
        wet = cells[s, i, WET]
        row[HEAT_WIRE] = amperes * amperes * heat[i]
        row[HEAT_WIRE] += e[s, LATE_LATENT] * latent * side[s, LATE_HEAT] / 6.0
        row[HEAT_WATER] = 0.0
        covered = wet * (1.0 - e[s, BUBBLES] * cells[s, i, BUBBLE])
        conductance = film(still, p[FORCED] / CELLS, 0.15 + 0.5 * e[s, EXPONENT], across, share)
        row[FILM] = conductance * max(covered, DRY) * reach
        row[WATER_HEAT] = p[WATER] / CELLS * wet
        row[LOSS] = loss * (out / 15.0) ** power * (0.4 + 0.6 * wet)
        row[TO_CLAMP] = 0.0
        row[SHIFT_HEAT], row[SHIFT_COOL] = shifts(s, i, stress, p, e, cells, side)
        row[LATENT] = latent * (1.0 + e[s, UNEVEN] * (1.0 - cells[s, i, FRACTION]))
        row[LATENT] *= 1.0 - min(e[s, LATE_LATENT], 0.9)
        row[STORES] = p[WIRE_HEAT] / CELLS
    rows[0, TO_CLAMP] = e[s, COLD_ENDS]
    rows[CELLS - 1, TO_CLAMP] = 0.5 * e[s, COLD_ENDS]
    if max(e[1 - s, DRIPPING], e[0, LAMP], e[s, ROD]) > 0.0:
        elsewhere(s, p, e, cells, side, pair, rows)
    if e[s, BENT] > 0.0:
        bend(s, e, pair, rows)
    seldom(s, e, cells, side, pair, rows)
    return float(CELLS * p[CONDUCTION] + p[MIXING] * side[s, FLOW] * CELLS / 6.0)


@compiled
def remember(
    s: int, stress: float, p: Array, e: Array, cells: Array, side: Array, dt: float
) -> None:
    """Update what each cell remembers after its fraction has moved."""
    moved_all = 0.0
    formed = 0.0
    warmth = 0.0
    turned_new = turned_by(stress, p)
    for i in range(CELLS):
        cell = cells[s, i]
        fraction = 0.0
        for k in range(PLAYS):
            fraction += WEIGHT[k] * cell[PLAY + k]
        moved = fraction - cell[FRACTION]
        if moved > 0.0:
            cell[TURNED] = (cell[TURNED] * cell[FRACTION] + turned_new * moved) / fraction
        if moved < -1e-6 and cell[HEATING] < 0.5:
            cell[HEATING] = 1.0
            cell[HEATED_FROM] = cell[FRACTION]
        elif moved > 1e-6 and cell[HEATING] > 0.5:
            cell[HEATING] = 0.0
            cell[COOLED_FROM] = cell[FRACTION]
        cell[FRACTION] = fraction
        moved_all += abs(moved) / CELLS
        formed += max(moved, 0.0) / CELLS
        warmth += cell[T] / CELLS
        if e[s, R_PHASES] > 0.0 or e[s, RESISTIVITY] > 0.0:
            lift = 0.1 * (stress - 57.0)
            comes = falling((cell[T] - 37.0 - lift) / 2.0) * (1.0 - fraction)
            stays = falling((cell[T] - 40.5 - lift) / 2.0) * (1.0 - fraction)
            cell[R_PHASE] = min(max(cell[R_PHASE], comes), max(stays, comes))
    if e[s, CORRODING] > 0.0:
        side[s, CORRODED] += dt / 30.0 * math.exp(min(warmth - 45.0, 30.0) / 10.0)
    if e[s, LIME] > 0.0:
        side[s, LIMED] += dt / 20.0 * max(warmth - 36.0, 0.0) / 10.0
    if e[s, LINGERING] > 0.0:
        tension = stress / p[STRESS]
        fading = approach(side[s, INNER_STRESS], tension, dt, 25.0)
        side[s, INNER_STRESS] = max(tension, fading)
    half = 0.5 * e[s, PLAYS_OF_GRAINS]
    load = stress / p[STRESS]
    side[s, GRAINS] = min(max(side[s, GRAINS], load - half), load + half)
    side[s, WORK_DONE] += moved_all
    side[s, DEFECTS] = approach(side[s, DEFECTS], 0.0, dt, 10.0) + formed
    side[s, RATE] = approach(side[s, RATE], moved_all / dt, dt, 0.3)


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
    source = entering(s, inlet, dt, e, cells, side, pair)
    wet_shares(s, e, cells, side, source, dt)
    pockets(s, e, cells, side, luck, dt)
    mix = coefficients(s, amperes, stress, ambient, p, e, cells, side, pair, heat, rows)
    left = int(side[s, QUIET]) if calm else 0
    side[s, QUIET] = advance(
        cells[s],
        rows,
        side[s, FLOW],
        mix,
        source,
        ambient,
        dt,
        p,
        scratch,
        left,
    )
    if e[s, RESERVOIR_WARMS] > 0.0:
        gained = side[s, FLOW] * (cells[s, CELLS - 1, W] - source) * dt
        pair[RESERVOIR] += e[s, RESERVOIR_WARMS] * gained / 400.0
    remember(s, stress, p, e, cells, side, dt)
    haunt(s, p, cells, side, pair, dt)
    stay(s, p, cells, side, pair, dt)
    grow(s, p, cells, side, pair, dt)
    collect(s, p, cells, side, pair, dt)
    hold_back(s, p, e, cells, side, pair, dt)
    linger(s, p, cells, side, pair, dt)
    side[s, CONTACT] = approach(side[s, CONTACT], amperes * amperes / 16.0, dt, 8.0)
