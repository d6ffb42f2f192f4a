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
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    BUCKLED,
    BUCKLING,
    CELLS,
    CLUNG,
    COMPLIANT,
    DAMP,
    EASED,
    FILL,
    FLOW,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    FRAME,
    FREE_STRAIN,
    FRICTION,
    GRIP,
    GROWN,
    MOST_TURNED,
    PULLED,
    PUMP,
    R_PHASE,
    RELAXING,
    SEAT,
    SPEED,
    STARTED,
    TIME,
    TIPPING,
    TURNED,
    WORK_DONE,
    T,
    W,
    X,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import TURN_ONSET, TURN_POWER, TURN_SCALE, falling, turned_by

Array = NDArray[np.float64]

SPAN = index("span_m")
K_MART = index("k_mart_N_m")
K_AUST = index("k_aust_N_m")
STRAIN = index("strain_m")
STRESS = index("stress_MPa_N")
TURNED_AT_START = index("turned_at_start")
Y_STIFFNESS = index("y_stiffness")
FULL_FLOW = index("flow_W_K")

FRICTION_IN_TUBE = slot("tube_friction")
DRAG = slot("viscous_drag")
COMPLIANCE = slot("tendon_compliance")
PARALLEL = slot("tube_stiffness")
CREEP = slot("tendon_log_creep")
COILS_TOUCH = slot("coil_contact")
BOURDON = slot("pump_bourdon")
RELAXATION = slot("tube_relaxation")
DRIFT = slot("transformation_drift")
R_PHASES = slot("r_phase")
IMBALANCE = slot("shaft_imbalance")
THERMAL_PUSH = slot("tube_thermal_push")
SOFTENING = slot("austenite_softening")
EASING = slot("eased_turning")
LEAD = slot("taut_lead")
WETTING = slot("tendon_wetting")
OPENING = slot("coil_opening")
TWIST = slot("tendon_twist")
TAPER = slot("tapered_drum")
ROCKING = slot("rocking_anchor")
PRESSURE = slot("pressure_stiffening")
CLINGING = slot("clinging_coils")
KNOT = slot("knot_tightening")
BUCKLES = slot("tube_buckling")
EXPANSION = slot("coil_expansion")
SLIPPING = slot("clamp_slip")
GROWTH = slot("frame_growth")
HAMMER = slot("water_hammer")

PRESTRETCH_m = 0.025
BRISTLE_m = 1.5e-4
COILS_CLOSE_m = 0.020
SHAFT_TURN_m = 0.013
TAPER_m = 0.010
GRIPS_m = 2e-3  # how far a tube is drawn from its rest before it slips in its clamp
PUSHES_m = 0.0225  # deflection under which a tube is pressed


@compiled
def drum(x: float, e: Array) -> tuple[float, float, float]:
    """How much further than X spring Y is moved (m), the ratio of their moves, and its slope."""
    if e[0, TAPER] == 0.0:
        return 0.0, 1.0, 0.0
    on = math.tanh(x / TAPER_m)
    further = e[0, TAPER] * TAPER_m * math.log(math.cosh(x / TAPER_m))
    return further, 1.0 + e[0, TAPER] * on, e[0, TAPER] / TAPER_m * (1.0 - on * on)


@compiled
def stretched(s: int, x: float, p: Array, e: Array) -> float:
    """Deflection (m) of spring `s` where the pair is at `x`, with a tendon of its usual length."""
    if s == 0:
        return float(0.5 * p[SPAN] - x)
    further, _, _ = drum(x, e)
    return float(0.5 * p[SPAN] + x + further)


@compiled
def rock(p: Array, e: Array, pair: Array, dt: float) -> None:
    """Let the anchor of spring X tip on its seat or back, as the tension of the tendon has it."""
    if e[0, ROCKING] <= 0.0:
        return
    over = pair[FORCE_X] - p[K_MART] * (0.5 * p[SPAN] - p[STRAIN] * p[TURNED_AT_START])
    tips = 0.12 + 0.06 * e[2, ROCKING]
    if over > tips:
        pair[TIPPING] = 1.0
    elif over < tips - 0.1:
        pair[TIPPING] = 0.0
    pair[SEAT] += (pair[TIPPING] - pair[SEAT]) * (1.0 - math.exp(-dt / 0.1))


@compiled
def soften(s: int, p: Array, e: Array, cells: Array, side: Array) -> None:
    """Set the elastic compliance (m/N) and free strain (m) of spring `s` for this tick."""
    stiffness = p[Y_STIFFNESS] if s == 1 else 1.0
    strain = p[STRAIN]
    if e[s, DRIFT] > 0.0:
        strain *= 1.0 - 0.02 * e[s, DRIFT] * (1.0 - math.exp(-side[s, WORK_DONE] / 3.0))
    total = 0.0
    warm = 0.0
    for i in range(CELLS):
        fraction = cells[s, i, FRACTION]
        austenite = p[K_AUST]
        if e[s, SOFTENING] > 0.0:
            above = max(cells[s, i, T] - 34.0, 0.0)
            austenite /= 1.0 + e[s, SOFTENING] * math.exp(-above / 6.0)
        total += 1.0 / (stiffness * (p[K_MART] * fraction + austenite * (1.0 - fraction)))
        warm += (cells[s, i, T] - 27.0) / CELLS
        if e[s, R_PHASES] > 0.0:
            total += strain * e[s, R_PHASES] * cells[s, i, R_PHASE] * p[STRESS] / 57.0
    side[s, EASED] = e[s, EASING] * math.tanh(max(warm, 0.0) / 20.0)
    side[s, GROWN] = e[s, EXPANSION] * 1e-3 * warm / 20.0
    side[s, COMPLIANT] = total / CELLS
    side[s, FREE_STRAIN] = strain / CELLS


@compiled
def deflection(s: int, force: float, p: Array, cells: Array, side: Array) -> tuple[float, float]:
    """Deflection (m) of the wire of spring `s` under its own force, and its slope (m/N)."""
    turned = 0.0
    rate = 0.0
    excess = (force * p[STRESS] + side[s, EASED] - p[TURN_ONSET]) / p[TURN_SCALE]
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
def prop(s: int, e: Array, cells: Array) -> float:
    """Force (N) by which the warm tube of spring `s` takes from the tendon."""
    warm = 0.0
    for i in range(CELLS):
        warm += (cells[s, i, W] - 27.0) / CELLS
    return float(e[s, THERMAL_PUSH] * warm / 20.0)


@compiled
def pressed(s: int, p: Array, e: Array, side: Array) -> float:
    """Stiffness (N/m) that pump pressure gives the tube of spring `s`."""
    share = max(side[s, FLOW], 0.0) / p[FULL_FLOW]
    return float(e[s, PRESSURE] * 58.0 * share * share)


@compiled
def cling(s: int, length: float, e: Array, side: Array) -> None:
    """Let closing coils take hold of one another (0…1), and opening ones tear apart later."""
    if e[s, CLINGING] <= 0.0:
        return
    takes = falling((length - 0.0210) / 0.003)
    keeps = falling((length - 0.0235) / 0.003)
    side[s, CLUNG] = min(max(side[s, CLUNG], takes), keeps)


@compiled
def pressed_tube(s: int, length: float, e: Array, side: Array) -> tuple[float, float]:
    """Force (N) by which a tube pressed short takes from the tendon, and its slope (N/m)."""
    if length >= PUSHES_m:
        return 0.0, 0.0
    on = math.tanh((PUSHES_m - length) / 2e-3)
    holds = e[s, BUCKLES] * (1.0 - 0.7 * side[s, BUCKLED])
    return holds * on, holds * (1.0 - on * on) / 2e-3


@compiled
def buckle(s: int, length: float, e: Array, side: Array, dt: float) -> None:
    """Let a tube that is pressed too short buckle, and straighten once it is drawn out again."""
    if e[s, BUCKLES] <= 0.0:
        return
    at = 0.0205 - 2e-3 * e[2, BUCKLES]
    if length < at:
        side[s, BUCKLING] = 1.0
    elif length > at + 1.3e-3:
        side[s, BUCKLING] = 0.0
    side[s, BUCKLED] += (side[s, BUCKLING] - side[s, BUCKLED]) * (1.0 - math.exp(-dt / 0.1))


@compiled
def tighten(e: Array, pair: Array) -> None:
    """Remember the largest load (N) that has drawn at the tendon's knot."""
    if e[0, KNOT] > 0.0:
        pair[PULLED] = max(pair[PULLED], pair[FORCE_Y] - 1.32 - 0.1 * e[2, KNOT])


@compiled
def gripped(s: int, length: float, e: Array, side: Array) -> float:
    """Force (N) of the tube of spring `s` between its clamps."""
    return float(e[s, SLIPPING] * min(max((length - side[s, GRIP]) / GRIPS_m, -1.0), 1.0))


@compiled
def jolt(s: int, e: Array, side: Array) -> float:
    """Force (N) by which a pump that changes its speed takes from the tendon."""
    return float(e[s, HAMMER] * (side[s, PUMP] - side[s, STARTED]))


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
    if e[s, OPENING] > 0.0:
        arm = math.exp(-e[s, OPENING] * off / 0.01)
        force /= arm
        slope = slope / arm + force * e[s, OPENING] / 0.01
    if e[s, PARALLEL] > 0.0:
        warm = 0.0
        for i in range(CELLS):
            warm += (cells[s, i, W] - 27.0) / CELLS
        rate = e[s, PARALLEL] * 58.0 * max(0.3, 1.0 - 0.004 * warm)
        force += rate * off * (1.0 + 60.0 * abs(off))
        slope += rate * (1.0 + 120.0 * abs(off))
    if e[s, PRESSURE] > 0.0:
        rate = pressed(s, p, e, side)
        force += rate * off
        slope += rate
    if e[s, CLINGING] > 0.0:
        force += e[s, CLINGING] * side[s, CLUNG]
    if e[s, BUCKLES] > 0.0:
        push, rate = pressed_tube(s, length, e, side)
        force -= push
        slope += rate
    if e[s, SLIPPING] > 0.0:
        force += gripped(s, length, e, side)
        slope += e[s, SLIPPING] / GRIPS_m
    force -= jolt(s, e, side)
    if e[s, RELAXATION] > 0.0:
        force += e[s, RELAXATION] * (length - side[s, RELAXING]) / 0.005
        slope += e[s, RELAXATION] / 0.005
    if e[s, COILS_TOUCH] > 0.0 and length < COILS_CLOSE_m:
        close = (COILS_CLOSE_m - length) / 0.005
        force -= 0.05 * e[s, COILS_TOUCH] * close**1.5
        slope += 0.05 * e[s, COILS_TOUCH] * 1.5 * math.sqrt(close) / 0.005
    if e[s, BOURDON] != 0.0:
        force -= e[s, BOURDON] * (max(side[s, FLOW], 0.0) / p[FULL_FLOW]) ** 2
    if e[s, THERMAL_PUSH] > 0.0:
        force -= prop(s, e, cells)
    return force, slope


@compiled
def longer_tendon(force: float, x: float, e: Array, pair: Array) -> tuple[float, float, float]:
    """How much longer the tendon is than at assembly (m), its slope in force, and that in `x`."""
    stretch = 0.0
    slope = 0.0
    slope_x = 0.0
    tension = max(force, 0.0)
    if e[0, COMPLIANCE] > 0.0:
        scale = e[0, COMPLIANCE] * 1e-3 / math.log(4.1)
        stretch += scale * (math.log(1.0 + tension / 0.4) - math.log(4.1))
        slope += scale / (0.4 + tension)
    if e[0, CREEP] > 0.0:
        scale = e[0, CREEP] * 1e-3 * math.log(1.0 + pair[TIME] / 3.0)
        stretch += scale * tension
        slope += scale
    stretch -= e[0, GROWTH] * 1e-3 * pair[FRAME]
    stretch += e[0, WETTING] * 1e-3 * pair[DAMP]
    stretch += e[0, ROCKING] * 1e-3 * pair[SEAT]
    stretch += e[0, KNOT] * 1e-3 * math.tanh(pair[PULLED] / 0.3)
    if e[0, TWIST] > 0.0:
        turns = x / 0.005 + 0.8 * (e[2, TWIST] - 0.5)
        slack = 1.0 + turns * turns
        stretch -= e[0, TWIST] * 1e-3 * turns * turns / slack
        slope_x -= e[0, TWIST] * 0.4 * turns / (slack * slack)
    return stretch, slope, slope_x


@compiled
def resisting(
    x: float, before: float, tension: float, dt: float, e: Array, side: Array, pair: Array
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
    if e[0, IMBALANCE] > 0.0:
        angle = 2.0 * math.pi * (x / SHAFT_TURN_m + e[2, IMBALANCE])
        total += e[0, IMBALANCE] * math.sin(angle)
        slope += e[0, IMBALANCE] * 2.0 * math.pi / SHAFT_TURN_m * math.cos(angle)
    if e[0, LEAD] > 0.0:
        past = (x - 1e-3 * (1.0 + 4.0 * e[2, LEAD])) / 5e-3
        root = math.sqrt(past * past + 0.04)
        hinge = 0.5 * (past + root)
        total += e[0, LEAD] * hinge * hinge
        slope += e[0, LEAD] * 2.0 * hinge * hinge / root / 5e-3
    return total, slope, bristle


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
        further, ratio, bend = drum(x, e)
        force_y, slope_y = pull(1, 0.5 * p[SPAN] + x + further, force_y, p, e, cells, side)
        longer, slope_t, slope_l = longer_tendon(force_y, x, e, pair)
        force_x, slope_x = pull(0, 0.5 * p[SPAN] - x - longer, force_x, p, e, cells, side)
        against, slope_f, bristle = resisting(x, before, force_y, dt, e, side, pair)
        residual = force_x - ratio * force_y - against
        own = slope_x * (1.0 + slope_l + slope_t * slope_y * ratio)
        step = residual / (own + slope_y * ratio * ratio + bend * force_y + slope_f)
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
    rock(p, e, pair, dt)
    tighten(e, pair)
    for s in range(2):
        wire = wire_stress(s, p, e, cells, side, pair)
        turned = turned_by(wire + side[s, EASED], p)
        for i in range(CELLS):
            cells[s, i, TURNED] = max(cells[s, i, TURNED], turned)
        side[s, MOST_TURNED] = max(side[s, MOST_TURNED], turned)
        length = stretched(s, x, p, e)
        cling(s, length, e, side)
        buckle(s, length, e, side, dt)
        side[s, GRIP] = min(max(side[s, GRIP], length - GRIPS_m), length + GRIPS_m)
        side[s, RELAXING] += (length - side[s, RELAXING]) * (1.0 - math.exp(-dt / 6.0))


@compiled
def wire_stress(s: int, p: Array, e: Array, cells: Array, side: Array, pair: Array) -> float:
    """Shear stress (MPa) in the wire itself, without what the tube carries beside it."""
    tendon = pair[FORCE_X] if s == 0 else pair[FORCE_Y]
    beside = 0.0
    length = stretched(s, pair[X], p, e)
    off = length - PRESTRETCH_m
    if e[s, PARALLEL] > 0.0:
        beside += e[s, PARALLEL] * 58.0 * off * (1.0 + 60.0 * abs(off))
    if e[s, PRESSURE] > 0.0:
        beside += pressed(s, p, e, side) * off
    if e[s, CLINGING] > 0.0:
        beside += e[s, CLINGING] * side[s, CLUNG]
    if e[s, BUCKLES] > 0.0:
        push, _ = pressed_tube(s, length, e, side)
        beside -= push
    beside += gripped(s, length, e, side) - jolt(s, e, side)
    if e[s, RELAXATION] > 0.0:
        beside += e[s, RELAXATION] * (length - side[s, RELAXING]) / 0.005
    if e[s, COILS_TOUCH] > 0.0 and length < COILS_CLOSE_m:
        beside -= 0.05 * e[s, COILS_TOUCH] * ((COILS_CLOSE_m - length) / 0.005) ** 1.5
    if e[s, BOURDON] != 0.0:
        beside -= e[s, BOURDON] * (max(side[s, FLOW], 0.0) / p[FULL_FLOW]) ** 2
    if e[s, THERMAL_PUSH] > 0.0:
        beside -= prop(s, e, cells)
    inside = max(tendon - beside, 0.0)
    if e[s, OPENING] > 0.0:
        inside *= math.exp(-e[s, OPENING] * off / 0.01)
    return float(inside * p[STRESS])
