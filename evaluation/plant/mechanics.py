"""The pair on its tendon: one scalar equilibrium in the displacement, with friction in it.

Positive displacement shortens spring X. Every term keeps the residual falling in displacement,
so that safeguarded Newton always finds the one root.
"""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    BULGED,
    BURST,
    CELLS,
    COLLAR,
    COMPLIANT,
    DEFECTS,
    FILL,
    FLOW,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    FREE_STRAIN,
    FRICTION,
    FUSE_WARM,
    GEL,
    GROWN,
    KNOT,
    LATE_SET,
    OIL_WARM,
    PUMP,
    R_PHASE,
    RATE,
    RUN_IN,
    SHAKEN,
    SHRUNK,
    SPEED,
    SPILT,
    SPONGE,
    STOOD,
    TIME,
    TONGUE,
    TURNED,
    TWINS_RUB,
    VARIANTS,
    WORK_DONE,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import TURN_ONSET, TURN_POWER, TURN_SCALE, turned_by
from evaluation.plant.tendon import (
    BIMETAL,
    longer_tendon,
    tied,
)

Array = NDArray[np.float64]

SPAN = index("span_m")
K_MART = index("k_mart_N_m")
K_AUST = index("k_aust_N_m")
STRAIN = index("strain_m")
STRESS = index("stress_MPa_N")
Y_STIFFNESS = index("y_stiffness")
FULL_FLOW = index("flow_W_K")

FRICTION_IN_TUBE = slot("tube_friction")
DRAG = slot("viscous_drag")
PARALLEL = slot("tube_stiffness")
DRIFT = slot("transformation_drift")
R_PHASES = slot("r_phase")
MOBILE = slot("mobile_interfaces")
SHRINKING = slot("shrinking_tendon")
SOAKING = slot("hanging_sponge")
GRIPPING = slot("gripping_hose")
TWINS_RUBBING = slot("rubbing_twins")
RUNS_IN = slot("running_in_guide")
PUSHED = slot("pushed_collar")
PAWL = slot("pawl_on_rack")
YOUNG = slot("young_martensite")
TAPERING = slot("tapering_dashpot")
FELT = slot("wet_felt")
LATE_STRAIN = slot("late_strain")
PADDLE = slot("paddle_in_water")
SETTLES = slot("relaxing_coils")
TAPED = slot("taped_slide")
GUY = slot("relaxing_guy")
BOLT = slot("anchor_bolt_in_circuit")
BURSTING = slot("bursting_variants")
CAM = slot("turning_cam")
DASHPOT = slot("dashpot_on_outlet")
TWINS_SHAKEN = slot("twins_shaken_by_pump")
CAP = slot("bulging_end_cap")
STANDS = slot("guide_grips_at_rest")
GELLED = slot("gel_pad")

PRESTRETCH_m = 0.025
BRISTLE_m = 1.5e-4
TAPER_m = 4e-3  # travel over which a dashpot's drag grows by a factor of 2.7
RUN_IN_m, TOOTH_m = 3e-2, 2.5e-3  # way over which a guide runs in, and from tooth to tooth
TAPE_END_m, GUY_S = 5e-4, 20.0  # how sharp a tape's end is, and how fast a guy relaxes
CAM_S = 11.0  # how often a turning cam presses on the tendon
GEL_m, STOOD_m = 5e-3, 2e-3  # to which a gel's force belongs, and way that frees a guide
BURST_m = 12e-3  # deflection that waits for the whole wire to burst
COLLAR_m, GRIPS_m = 1.5e-3, 3e-4  # half a collar's play, and how far it gives


@compiled
def soften(s: int, p: Array, e: Array, cells: Array, side: Array) -> None:
    """Set the elastic compliance (m/N) and free strain (m) of spring `s` for this tick."""
    stiffness = p[Y_STIFFNESS] if s == 1 else 1.0
    strain = p[STRAIN]
    if e[s, DRIFT] > 0.0:
        strain *= 1.0 - 0.02 * e[s, DRIFT] * (1.0 - math.exp(-side[s, WORK_DONE] / 3.0))
    total = 0.0
    martensite = 0.0
    for i in range(CELLS):
        fraction = cells[s, i, FRACTION]
        martensite += fraction / CELLS
        total += 1.0 / (stiffness * (p[K_MART] * fraction + p[K_AUST] * (1.0 - fraction)))
        if e[s, R_PHASES] > 0.0:
            total += strain * e[s, R_PHASES] * cells[s, i, R_PHASE] * p[STRESS] / 57.0
    side[s, GROWN] = 1e-3 * e[s, TWINS_RUBBING] * martensite * side[s, TWINS_RUB]
    side[s, GROWN] += 1e-3 * e[s, LATE_STRAIN] * (side[s, LATE_SET] - martensite)
    side[s, GROWN] += 1e-3 * e[s, SETTLES] * side[s, VARIANTS]
    side[s, GROWN] += 1e-3 * e[s, BOLT] * side[s, FUSE_WARM]
    side[s, GROWN] += 1e-3 * e[s, TWINS_SHAKEN] * martensite * side[s, SHAKEN]
    side[s, GROWN] -= 1e-3 * e[s, CAP] * side[s, BULGED]
    if e[s, BURSTING] > 0.0:
        side[s, GROWN] += BURST_m * (side[s, BURST] - martensite)
    side[s, GROWN] -= 1e-3 * (e[s, SHRINKING] * side[s, SHRUNK])
    if e[s, MOBILE] > 0.0:
        total *= 1.0 + e[s, MOBILE] * side[s, RATE] / (side[s, RATE] + 0.03)
    total *= 1.0 + e[s, YOUNG] * side[s, DEFECTS]
    side[s, COMPLIANT] = total / CELLS
    side[s, FREE_STRAIN] = strain / CELLS


@compiled
def deflection(s: int, force: float, p: Array, cells: Array, side: Array) -> tuple[float, float]:
    """Deflection (m) of the wire of spring `s` under its own force, and its slope (m/N)."""
    turned = 0.0
    rate = 0.0
    excess = (force * p[STRESS] - p[TURN_ONSET]) / p[TURN_SCALE]
    if excess > 0.0:
        power = excess ** p[TURN_POWER]
        left = math.exp(-power)
        turned = 1.0 - left
        rate = left * p[TURN_POWER] * power / excess * p[STRESS] / p[TURN_SCALE]
    length = side[s, COMPLIANT] * force + side[s, GROWN]
    slope = side[s, COMPLIANT]
    for i in range(CELLS):
        share = side[s, FREE_STRAIN] * cells[s, i, FRACTION]
        if turned > cells[s, i, TURNED]:
            length += share * turned
            slope += share * rate
        else:
            length += share * cells[s, i, TURNED]
    return length, slope


@compiled
def pull(
    s: int, length: float, guess: float, p: Array, e: Array, cells: Array, side: Array
) -> tuple[float, float]:
    """Tendon force (N) of spring `s` at a deflection (m), and its slope (N/m)."""
    force = max(guess, 1e-3)
    slope = 1.0
    slack, _ = deflection(s, 0.0, p, cells, side)
    if slack >= length:
        force = 0.0
    else:
        low = 0.0
        high = 60.0
        for _ in range(40):
            here, softness = deflection(s, force, p, cells, side)
            slope = 1.0 / softness
            step = (length - here) * slope
            if abs(step) < 1e-7:
                break
            if step < 0.0:
                high = force
            else:
                low = force
            force += step
            if force <= low or force >= high:
                force = 0.5 * (low + high)
    off = length - PRESTRETCH_m
    if e[s, PARALLEL] > 0.0:
        warm = 0.0
        for i in range(CELLS):
            warm += (cells[s, i, W] - 27.0) / CELLS
        rate = e[s, PARALLEL] * 58.0 * max(0.3, 1.0 - 0.004 * warm)
        force += rate * off * (1.0 + 60.0 * abs(off))
        slope += rate * (1.0 + 120.0 * abs(off))
    return force, slope


@compiled
def resisting(
    x: float,
    before: float,
    tension: float,
    dt: float,
    full_flow: float,
    e: Array,
    side: Array,
    pair: Array,
) -> tuple[float, float, float]:
    """Friction and drag against a move to `x` (N), their slope (N/m), and the bristle's force."""
    bristle = 0.0
    total = 0.0
    slope = 0.0
    strength = e[0, FRICTION_IN_TUBE]
    if strength > 0.0:
        speed = pair[SPEED] / 2e-3
        ceiling = strength * (0.5 + 0.4 * math.exp(-speed * speed) + 0.4 * max(tension, 0.0))
        rate = ceiling / BRISTLE_m
        bristle = pair[FRICTION] + rate * (x - before)
        if abs(bristle) > ceiling:
            bristle = math.copysign(ceiling, bristle)
        else:
            slope += rate
        total += bristle
    if e[0, DRAG] > 0.0:
        dry = 0.33 + 0.67 * 0.5 * (side[0, FILL] + side[1, FILL])
        v = (x - before) / dt / 5e-3
        scale = e[0, DRAG] * dry
        if abs(v) < 0.02:
            gain = 0.02**0.8 / 0.02
            total += scale * gain * v
            slope += scale * gain / dt / 5e-3
        else:
            total += scale * math.copysign(abs(v) ** 0.8, v)
            slope += scale * 0.8 * abs(v) ** -0.2 / dt / 5e-3
    total += e[0, SOAKING] * pair[SPONGE]
    flowing = side[0, FLOW] + side[1, FLOW]
    rubbing = e[0, GRIPPING] * flowing / full_flow
    rubbing += e[0, FELT] * pair[SPILT]
    rubbing += e[0, RUNS_IN] * math.exp(-pair[RUN_IN] / RUN_IN_m)
    taped = (before - 6e-3 * (e[2, TAPED] - 0.5)) / TAPE_END_m
    rubbing += e[0, TAPED] * 0.5 * (1.0 + math.tanh(taped))
    pressing = math.sin(math.pi * (pair[TIME] / CAM_S + e[2, CAM]))
    rubbing += e[0, CAM] * pressing * pressing
    rubbing += e[0, STANDS] * pair[STOOD]
    if x > before:
        teeth = before / TOOTH_m + e[2, PAWL]
        rubbing += e[0, PAWL] * (teeth - math.floor(teeth))
    v = (x - before) / dt / 5e-4
    total += rubbing * v / (abs(v) + 1.0)
    slope += rubbing / (abs(v) + 1.0) ** 2 / dt / 5e-4
    braking = e[0, TAPERING] * math.exp(before / TAPER_m) / dt / 5e-3
    braking += e[0, DASHPOT] * math.exp(-pair[OIL_WARM]) / dt / 5e-3
    total += braking * (x - before)
    slope += braking
    v = (x - before) / dt / 5e-3
    total += e[0, PADDLE] * v * abs(v)
    slope += 2.0 * e[0, PADDLE] * abs(v) / dt / 5e-3
    total += e[0, GELLED] * (x - pair[GEL]) / GEL_m
    slope += e[0, GELLED] / GEL_m
    moved = pair[COLLAR] + (x - before)
    over = abs(moved) - COLLAR_m
    total += math.copysign(e[0, PUSHED] * min(max(over / GRIPS_m, 0.0), 1.0), moved)
    slope += e[0, PUSHED] / GRIPS_m if 0.0 < over < GRIPS_m else 0.0
    hung, stiff = tied(x, e)
    hung -= e[0, BIMETAL] * pair[TONGUE]
    hung -= e[0, GUY] * math.exp(-pair[TIME] / GUY_S)
    return total + hung, slope + stiff, bristle


@compiled
def equilibrium(p: Array, e: Array, cells: Array, side: Array, pair: Array, dt: float) -> None:
    """Move the pair to its equilibrium: displacement, both forces, friction, turned martensite."""
    before = pair[X]
    x = before
    low = -0.5 * p[SPAN]
    high = 0.5 * p[SPAN]
    force_x = pair[FORCE_X]
    force_y = pair[FORCE_Y]
    bristle = 0.0
    for s in range(2):
        soften(s, p, e, cells, side)
    for _ in range(30):
        force_y, slope_y = pull(1, 0.5 * p[SPAN] + x, force_y, p, e, cells, side)
        longer, slope_t = longer_tendon(force_y, e, pair)
        away = 0.5 * p[SPAN] - x - longer
        force_x, slope_x = pull(0, away, force_x, p, e, cells, side)
        against, slope_f, bristle = resisting(x, before, force_y, dt, p[FULL_FLOW], e, side, pair)
        residual = force_x - force_y - against
        stiffness_x = slope_x * (1.0 + slope_t * slope_y)
        step = residual / (stiffness_x + slope_y + slope_f)
        if abs(step) < 1e-9:
            break
        if step > 0.0:
            low = x
        else:
            high = x
        x += step
        if x <= low or x >= high:
            x = 0.5 * (low + high)
    pair[X] = x
    pair[FORCE_X] = force_x
    pair[FORCE_Y] = force_y
    pair[FRICTION] = bristle
    pair[SPEED] = (x - before) / dt
    pair[RUN_IN] += abs(x - before)
    stood = approach(pair[STOOD], 1.0, dt, 4.0)
    pair[STOOD] = stood * math.exp(-abs(x - before) / STOOD_m)
    pair[GEL] = approach(pair[GEL], x, dt, 5.0)
    gripped = COLLAR_m + GRIPS_m
    pair[COLLAR] = min(max(pair[COLLAR] + (x - before), -gripped), gripped)
    apart = (cells[0, CELLS - 1, W] - cells[1, CELLS - 1, W]) / 20.0
    pair[TONGUE] = approach(pair[TONGUE], apart, dt, 6.0)
    oil = max(cells[0, CELLS - 1, W] - 27.0, 0.0) / 10.0
    pair[OIL_WARM] = approach(pair[OIL_WARM], oil, dt, 6.0)
    pair[KNOT] += dt / 10.0 * (side[0, PUMP] + side[1, PUMP])
    if e[0, SOAKING] > 0.0:
        spilt = (side[0, FLOW] + side[1, FLOW]) / p[FULL_FLOW]
        pair[SPONGE] += dt * (spilt / 10.0 - pair[SPONGE] / 40.0)
    for s in range(2):
        wire = wire_stress(s, p, e, cells, side, pair)
        turned = turned_by(wire, p)
        for i in range(CELLS):
            cells[s, i, TURNED] = max(cells[s, i, TURNED], turned)
        if e[s, SHRINKING] > 0.0:
            warm = (cells[s, CELLS - 1, W] - 27.0) / 20.0
            side[s, SHRUNK] = approach(side[s, SHRUNK], warm, dt, 3.0)


@compiled
def wire_stress(s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array) -> float:
    """Shear stress (MPa) in the wire itself, without what the tube carries beside it."""
    tendon = pair[FORCE_X] if s == 0 else pair[FORCE_Y]
    beside = 0.0
    length = 0.5 * p[SPAN] + (pair[X] if s == 1 else -pair[X])
    off = length - PRESTRETCH_m
    if e[s, PARALLEL] > 0.0:
        beside += e[s, PARALLEL] * 58.0 * off * (1.0 + 60.0 * abs(off))
    return float(max(tendon - beside, 0.0) * p[STRESS])
