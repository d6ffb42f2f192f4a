"""The plant's equations, stepped: every function that numba compiles is in this one module.

It is longer than the house's 400 lines on purpose. numba's cache knows only the file of the
function it compiled: a compiled caller in another module would keep an old copy of a callee that
has been edited. For the same reason nothing here reads a constant of another module: parameters,
effects and tables come in as arrays, and the slots of those arrays are numbered here.

Equation numbers are those of Cheng et al., J. Intell. Mater. Syst. Struct. 28(16), 2017.
All quantities are SI. Thermal quantities are per metre of wire unless they say joule.

One substep advances both springs and the force together. The fractions depend on temperature and
stress at the end of the substep, the temperature on the fractions (latent heat), and the stress on
both, so a lagged value would either oscillate or ratchet; the three are solved at once:
an outer bracketed root in the force, and inside it, for each spring, one in the temperature.
"""

from __future__ import annotations

# Kernel functions take arrays by position: a keyword call costs numba's dispatcher more.
# ruff: noqa: PLR0917
import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit
from numba.core.options import DefaultOptions

Array = npt.NDArray[np.float64]
Slots = npt.NDArray[np.int64]
_Function = TypeVar("_Function", bound=Callable[..., Any])

# The state is one array: spring X, spring Y, then what they share. Inside the kernel each part
# is an array of its own, `x`, `y` (or `s` for either) and `g`, so that every index is a constant.
# Slots of one spring's state.
S_T = 0  # wire temperature, K
S_TW = 1  # temperature of the water in the tube, K
S_XS = 2  # detwinned martensite fraction
S_XT = 3  # twinned martensite fraction
S_A = 4  # progress of the reverse transformation, 0 to 1, Eq. (11)
S_B = 5  # progress of detwinning and of stress-induced martensite, Eqs (12), (13)
S_C = 6  # progress of twinned martensite on cooling, Eq. (12c)
S_LEG = 7  # -1 in a reverse, +1 in a forward transformation, 0 before any
S_XI_LEG = 8  # fraction at which the present leg began; unified_kinetics: at its furthest point
# unified_kinetics: turns of either kind that are remembered, and the slots where they begin.
TURNS = 6
S_HOT = 9  # where heating turned (progress, martensite), the latest first
S_COLD = S_HOT + 2 * TURNS  # where cooling turned (progress, austenite), the latest first
S_DELTA = 33  # deflection of the spring, m
S_RATE = 34  # last rate of S_T, K/s
S_RATE_W = 35  # last rate of S_TW, K/s
S_ACTIVE = 36  # 1 while the fractions change
S_I = 37  # current, A
S_OHM = 38  # resistance of the spring, Ohm
S_FLOW = 39  # water flow, m3/s
S_WORK_Q = 40  # transformation work not yet in the heat balance, J/m
S_IN_J = 41  # electrical heat taken in, J
S_WATER_J = 42  # heat carried off by the water, J
S_AIR_J = 43  # heat lost to the air, J
S_UNEQUAL_J = 44  # heat that unequal capacities and latent heats have made, J
S_WORK_J = 45  # mechanical work done on the spring, J
S_OMITTED_J = 46  # transformation work that the heat balance leaves out, J
S_CYCLES = 47  # transformation cycles so far: half the sum of |Δξ|
S_FILL = 48  # share of the tube that holds water
S_F = 49  # tension of the spring, N
S_PUMP = 50  # flow of the pump before leaks, its mean over the substep, m3/s
S_PUMP_ON_S = 51  # time since the pump was switched on, s
S_PUMP_COUNT = 52  # times the pump was switched on
S_WETTED = 53  # share of the wire that flowing water touches
S_T_WALL = 54  # tube wall temperature, K
S_XS_END = 55  # detwinned fraction of the cold ends
S_R = 56  # R-phase fraction
S_R_PROGRESS = 57  # its progress on cooling
S_ELASTIC = 58  # elastic energy, J
S_TAU = 59  # shear stress that the kinetics last saw, Pa
S_PUMP_END = 60  # flow of the pump at the end of the substep, m3/s
# How far cells along the tube are from the mean, from the inlet on, K: wire, then water.
CELLS = 5
S_CELL = 61
S_CELL_W = S_CELL + CELLS
# What the kinetics remember (from S_XS up to S_DELTA), once more for each cell.
S_KINETICS = S_DELTA - S_XS
# Their last rates, apart from what the front moves, K/s.
S_CELL_RATE = S_CELL_W + CELLS
S_CELLS = S_CELL_RATE + CELLS
S_SIZE = S_CELLS + CELLS * S_KINETICS

# Slots of the shared state.
SHARED = 2 * S_SIZE
G_TIME = 0  # s
G_U = 1  # displacement, m, positive when X contracts
G_F = 2  # tension of the tendon, N
G_F_RATE = 3  # last rate of the tension, N/s
G_T_IN = 4  # water at the inlet, K
G_T_AIR = 5  # ambient, K
G_ITERATIONS = 6  # evaluations of the equilibrium so far
G_ENV_IN = 7  # inlet and ambient as given from outside, K
G_ENV_AIR = 8
G_RESERVOIR = 9  # rise of the reservoir, K
G_DRIFT = 10  # rise of the ambient, K
G_SPEED = 11  # rate of the displacement, m/s
G_LAG_X = 12  # sensor dynamics: RTDs, K
G_LAG_Y = 13
G_CREEP = 14  # N
G_PLAY = 15  # m
G_SLIP = 16  # m
G_SEEN_U = 17  # displacement at the last sample, m
G_SAMPLES = 18
G_SEEN_X = 19  # what the RTDs were last given to follow, K
G_SEEN_Y = 20
# What the sensors give at the last sample, without noise.
G_M = 21
G_M_I = G_M + 0  # x, y, A
G_M_V = G_M + 2  # x, y, V
G_M_RTD = G_M + 4  # x, y, inlet, ambient, K
G_M_U = G_M + 8  # m
G_M_F = G_M + 9  # N
G_SIZE = G_M + 10
STATE_SIZE = SHARED + G_SIZE

# History of the samples, for channels that are read late: t, T_x, T_y, u, F.
RING_ROWS = 512
RING_COLUMNS = 5

# Slots of the constants made from a parameter set (see constants.py).
P_C1 = 0  # Pa/N
P_K_M = 1  # N/m
P_K_A = 2
P_DELTA_L = 3
P_A_S = 4
P_A_INV = 5  # 1/(A_F - A_S)
P_C_A_INV = 6  # 1/C_A
P_M_S = 7
P_M_INV = 8  # 1/(M_S - M_F)
P_C_M = 9
P_TAU_S = 10
P_TAU_INV = 11  # 1/(tau_f - tau_s)
P_MC_H = 12  # J/(m K)
P_MC_C = 13
P_ML_H = 14  # J/m
P_ML_C = 15
P_OHM_M = 16  # Ohm/m
P_LENGTH = 17  # m of wire
P_CW = 18  # capacity of the water in the tube, J/(m K)
P_SHARE = 19
P_UA = 20
P_FLOW_G = 21  # conductance for a flow, W/(m K) per m3/s
P_FLOW_MAX = 22
P_AREA_INV = 23  # 1/annulus area, 1/m2
P_DH = 24
P_SQRT_DH = 25
P_PERIMETER = 26  # wire perimeter times film scale, m
P_AIR_K = 27  # pi k_a
P_AIR_C = 28  # Churchill-Chu factor of air, 1/K^(1/6)
P_GAP = 29  # conductance from the wire through a dry tube to ambient, W/(m K)
P_DRAIN_RATE = 30  # 1/s
P_FILM = 31
P_FILL_RATE = 32  # 1/(tube volume), 1/m3
P_DELTA_0 = 33
P_FIXTURE = 34  # 0 antagonistic, 1 stretch, 2 blocked
P_WARMS = 35  # 1 when the water in the tube is a node
P_WET = 36  # 1 with cooling module, 0 bare wire in air
P_WORK_SHARE = 37
P_T_REF = 38  # reference of stored heat, K
P_TABLE_T0 = 39
P_I_MAX = 40
P_F0 = 41
P_LENGTH_INV = 42
P_DH_INV = 43
CONSTANTS_SIZE = 44

# Slots of the candidate effects; the registry in `effects` refers to them by these names. All zero
# is the plant without any. The first three, switches, E_KNEE and E_READS_X are set by the host from
# others.
E_ROUGH = 0  # friction, drag, tube stiffness or a tendon that gives
E_UNEVEN_STRAIN = 1  # anything that adds to Eq. (9) of a spring
E_LATE = 2  # any delayed channel
E_GAIN = 3
E_LAG_S = 4
E_DEFICIT = 5
E_OHM_ALPHA = 6
E_OHM_BETA = 7
E_CONTACT_OHM = 8
E_I_OFFSET = 9
E_RTD_LAG_S = 10
E_RTD_OFFSET = 11
E_RTD_STEM = 12
E_BACKLASH = 13
E_SLIP = 14
E_F_OFFSET = 15
E_F_GAIN = 16
E_CREEP = 17
E_CREEP_S = 18
E_DELAY_T = 19
E_DELAY_U = 20
E_DELAY_F = 21
E_SKEW_PPM = 22
E_DRIFT = 23
E_COLD_ENDS = 24
E_SPREAD = 25
E_EXPONENT = 26
E_CROSSTALK = 27
E_WALL = 28
E_WALL_G = 29
E_WARMING = 30
E_DRAINAGE = 31
E_DRAINAGE_S = 32
E_POCKETS = 33
E_DEAD_S = 34
E_SPINUP_S = 35
E_SHORTFALL = 36
E_UNEVEN = 37
E_RESERVOIR = 38
E_LEAK = 39
E_MINOR = 40
E_SHIFT = 41
E_SHRINK = 42
E_R_STRAIN = 43
E_R_OHM = 44
E_LATENT_STRESS = 45
E_COULOMB = 46
E_PROPORTIONAL = 47
E_STRIBECK = 48
E_STRIBECK_V = 49
E_DRAG = 50
E_SLACK = 51
E_SLACK_F = 52
E_TENDON = 53
E_TUBE_K = 54
E_ELONGATION = 55
E_FRONT = 56
E_PLACE = 57
E_MEMORY = 58
E_UNIFIED = 59
E_TAILS = 60
E_SHARPNESS = 61
E_KNEE = 62  # (I_max/I_s)^n
E_R_ABOVE = 63
E_R_WIDTH = 64
E_LOSS_EXPONENT = 65
E_READS_X = 66  # share of X's tension in what the force sensor reads, beyond one half; 0 alike
E_EXPONENT_REF = 67
E_END_LOSS = 68
EFFECTS_SIZE = 69
# The slots once more as they are for side Y: the drivers, leads, RTDs and water lines differ. What
# the sides share, and X, is read from the first.
SIDES_SIZE = 2 * EFFECTS_SIZE
# unified_kinetics: behind the slots lie its two outer curves, for heating and for cooling, as value
# and slope (per cell) at even steps of the progress from PROGRESS_LOW on. See `lay_curves`.
CURVE_CELLS_PER_UNIT = 128
CURVE_SIZE = 2 * (3 * CURVE_CELLS_PER_UNIT + 1)
E_HEATING = SIDES_SIZE
E_COOLING = E_HEATING + CURVE_SIZE
UNIFIED_SIZE = E_COOLING + CURVE_SIZE

# Scratch of one substep, one part for each spring.
W_T_STAR = 0  # end temperature if no fraction changed
W_LAM_H = 1  # kelvin per unit of fraction, reverse transformation
W_LAM_C = 2
W_FA = 3  # f(a), f(b), f(c) at the start, negative until needed
W_FB = 4
W_FC = 5
W_HOT = 6  # 1 when the substep starts above M_S
W_PART = 7  # share of the substep after which M_S is passed, 0 when it is not
W_XI_BACK = 8  # fraction at which a reverse leg began, or would begin now
W_XI_FORTH = 9
W_XS = 10
W_XT = 11
W_GUESS = 12
W_T_F = 13  # d T / d F
W_XI_T = 14  # slopes of the fractions at the last evaluation
W_XI_F = 15
W_XS_T = 16
W_XS_F = 17
W_T = 18
W_DELTA = 19
W_SLOPE = 20  # d delta / d F
W_CAP = 21
W_RW = 22  # water: middle = (RW + GW * middle of the wire) * DW_INV
W_DW_INV = 23
W_GW = 24
W_GD = 25
W_POWER = 26
W_GF = 27
W_UA = 28
W_LATENT = 29  # factor on the latent heat
W_SHIFT = 30  # drift of the transformation temperatures, K
W_WALL_G = 31
W_GIVE = 32  # compliance
W_ROUGH = 33  # step of temperature still to be taken, K
W_LEAVES = 34  # how much warmer than the mean the water leaves, K
W_CELL_H = 35  # W_LAM_H and W_LAM_C of a cell's own transformation; those of the only one
W_CELL_C = 36
W_LINE_HOT = 37  # unified_kinetics: where both transformations begin at the tension, K
W_LINE_COLD = 38
W_TURNED = 39  # what the tension turns of all martensite, and the slope with the tension
W_TURNED_F = 40
W_UNIT = 41  # of each cell: water where all lose alike, what its latent heat makes of the wire, K
W_BEFORE = W_UNIT + CELLS  # cells before `move_front`
# unified_kinetics, in the same places: the outer curve at the furthest progress of heating and at
# its latest turn, then of cooling, negative until needed.
W_OUTER_HOT = W_FA
W_OUTER_COLD = W_FC
# W_FA to W_XS_F once more for each cell; its W_GUESS is its own temperature.
W_KINETICS = W_T - W_FA
W_CELLS = W_BEFORE + 2 * CELLS
W_SIZE = W_CELLS + CELLS * W_KINETICS
SCRATCH_SIZE = 2 * W_SIZE

# Slots of the feeds: measured series that replace inner signals, at start and end of a sample.
F_CURRENT = 0  # flag, x, y
F_TEMPERATURE = 3  # flag, x start, y start, x end, y end
F_FORCE = 8  # flag, start, end
F_DISPLACEMENT = 11  # flag, start, end
F_SURROUNDINGS = 14  # flag, inlet, ambient
FEEDS_SIZE = 17

# Scalars and borrowed arrays only: without `_nrt` every call in the inner loop would count
# references atomically, which doubles the time. The option is numba's own but not documented, so
# it is used where this numba has it.
_FAST: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}


def compiled(function: _Function) -> _Function:
    """Compile an entry of the kernel; plain Python, with the same bits, under NUMBA_DISABLE_JIT=1.

    No fast-math, so that no operation is reordered or fused. error_model "numpy" leaves out a
    check of every division; the divisors here cannot be zero.
    """
    made: Any = njit(cache=True, nogil=True, error_model="numpy", **_FAST)
    return cast(_Function, made(function))


def inlined(function: _Function) -> _Function:
    """Compile a function of the inner loop into its callers: halves the time of a substep."""
    made: Any = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, **_FAST)
    return cast(_Function, made(function))


OK = 0
NOT_CONVERGED = 1
NOT_FINITE = 2

HALF_PI = 0.5 * math.pi
SIXTH = 1.0 / 6.0
T_TOLERANCE = 1e-8
DELTA_TOLERANCE = 1e-10
ITERATIONS = 200
JOINT_STEPS = 4  # of force and temperatures together
NEWTON_STEPS = 30  # before a bracket is only halved
REST_SPEED = 1e-9
SDIRK_PART = 1.0 - math.sqrt(0.5)
SDIRK_FURTHER = (1.0 - SDIRK_PART) / SDIRK_PART
# R-phase: reverts so far above where it began, K.
R_HYSTERESIS = 2.0
# unified_kinetics: how far its curves go beyond 0 and 1, the logistic curve as steep in the middle
# as the cosine, and what keeps ratios finite.
PROGRESS_LOW, PROGRESS_HIGH = -1.0, 2.0
TAIL_RATE = 2.0 * math.pi
LEAST_LEFT = 1e-9
STRESS_REF_PA = 1e8


@inlined
def clip01(value: float) -> float:
    if value <= 0.0:
        return 0.0
    if value >= 1.0:
        return 1.0
    return value


@inlined
def remaining(progress: float) -> float:
    """f = (cos πa + 1)/2 of Eqs (11)-(13), as a square so that it stays exact near a = 1."""
    if progress <= 0.0:
        return 1.0
    if progress >= 1.0:
        return 0.0
    root = math.cos(HALF_PI * progress)
    return root * root


@inlined
def remaining_slope(left: float) -> float:
    """df/da of `remaining`, from its value."""
    return -math.pi * math.sqrt(left * (1.0 - left))


@inlined
def remaining_spread(progress: float, spread: float) -> float:
    """f of a wire whose temperatures spread: a quarter each ahead and behind, half between."""
    ends = remaining(progress - spread) + remaining(progress + spread)
    return 0.5 * remaining(progress) + 0.25 * ends


@inlined
def left_before(progress: float, w: Array, memory: int, spread: float) -> float:
    """f at the start of the substep, worked out once and only when it is needed."""
    if w[memory] < 0.0:
        if spread > 0.0:
            w[memory] = remaining_spread(progress, spread)
        else:
            w[memory] = remaining(progress)
    return float(w[memory])


@inlined
def progress_a(T: float, tau: float, p: Array, spread: float) -> float:
    value = (T - p[P_A_S] - tau * p[P_C_A_INV]) * p[P_A_INV]
    if value <= -spread:
        return -spread
    if value >= 1.0 + spread:
        return 1.0 + spread
    return float(value)


@inlined
def progress_b(T: float, tau: float, p: Array) -> float:
    above = T - p[P_M_S]
    if above > 0.0:
        tau = tau - p[P_C_M] * above
    return clip01((tau - p[P_TAU_S]) * p[P_TAU_INV])


@inlined
def progress_c(T: float, p: Array) -> float:
    return clip01((p[P_M_S] - T) * p[P_M_INV])


@inlined
def minor(ratio: float, share: float, e: Array) -> tuple[float, float]:
    """Effect minor_loop: the exponent, and the ratio raised to it, of a leg begun half way."""
    exponent = 1.0 + e[E_MINOR] * share
    return exponent, math.pow(ratio, exponent)


@inlined
def remembered(
    ratio: float, slope: float, left: float, left_slope: float, before: float, part: float, e: Array
) -> tuple[float, float]:
    """Effect minor_loop: a share of the wire rests until the outer curve reaches its fraction.

    `left` and `before` are the outer curve at the end and the start of the substep, `part` the
    fraction that is still to transform. Returns the ratio by which it shrinks, and its slope.
    """
    if part < before:
        outer = 1.0
        outer_slope = 0.0
        if left < part:
            outer = left / part
            outer_slope = left_slope / part
        ratio += e[E_MEMORY] * (outer - ratio)
        slope += e[E_MEMORY] * (outer_slope - slope)
    return ratio, slope


@inlined
def back_to_austenite(
    a: float,
    xs: float,
    xt: float,
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    spread: float,
    o: int,
    q: int,
) -> tuple[float, float]:
    """Eq. (11) in rate form. Returns the ratio by which both fractions shrink and its da-slope."""
    if spread > 0.0:
        left = remaining_spread(a, spread)
        slope = 0.5 * remaining_slope(remaining(a)) + 0.25 * (
            remaining_slope(remaining(a - spread)) + remaining_slope(remaining(a + spread))
        )
    else:
        left = remaining(a)
        slope = remaining_slope(left)
    before = left_before(s[S_A + o], w, W_FA + q, spread)
    ratio = left / before
    outer_slope = slope
    slope = slope / before
    if e[E_MINOR] != 0.0 and ratio > 0.0:
        exponent, raised = minor(ratio, 1.0 - w[W_XI_BACK + q], e)
        slope = slope * exponent * raised / ratio
        ratio = raised
    if e[E_MEMORY] > 0.0:
        ratio, slope = remembered(ratio, slope, left, outer_slope, before, xs + xt, e)
    return ratio, slope


@inlined
def grow(
    xs: float, xt: float, before: float, left: float, hot: bool, w: Array, e: Array, q: int
) -> tuple[float, float]:
    """Eq. (13) above M_S, Eq. (12) below: fractions when f(b) falls from `before` to `left`."""
    ratio = left / before if before > 0.0 else 1.0
    if e[E_MINOR] != 0.0 and hot and ratio > 0.0:
        ratio = minor(ratio, w[W_XI_FORTH + q], e)[1]
    if e[E_MEMORY] > 0.0 and hot:
        ratio = remembered(ratio, 0.0, left, 0.0, before, 1.0 - xs, e)[0]
    new = 1.0 - (1.0 - xs) * ratio
    if not hot and 1.0 - left < new:
        new = 1.0 - left
    if new > xs:
        xt = xt * (1.0 - new) / (1.0 - xs)
        xs = new
    return xs, xt


@inlined
def across(
    tau: float,
    b: float,
    xs: float,
    xt: float,
    xs_F: float,
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    o: int,
    q: int,
) -> tuple[float, float, float]:
    """Fractions when the substep passes M_S: one rule up to there, the other from there.

    How far into the substep that is has been foreseen, so that the fractions stay monotone in
    temperature and force. The last value is the slope of ξ_S with the force, good enough for the
    few substeps concerned.
    """
    stress = s[S_TAU] + w[W_PART + q] * (tau - s[S_TAU])
    middle = clip01((stress - p[P_TAU_S]) * p[P_TAU_INV])
    between = remaining(middle)
    if middle > s[S_B + o]:
        before = left_before(s[S_B + o], w, W_FB + q, 0.0)
        grown, xt = grow(xs, xt, before, between, w[W_HOT + q] > 0.0, w, e, q)
        if grown > xs and between > 0.0:
            steep = remaining_slope(between) * (1.0 - grown) / between
            xs_F = xs_F - steep * p[P_TAU_INV] * p[P_C1] * w[W_PART + q]
        xs = grown
    if b > middle:
        left = remaining(b)
        grown, xt = grow(xs, xt, between, left, w[W_HOT + q] == 0.0, w, e, q)
        if grown > xs and left > 0.0:
            steep = remaining_slope(left) * (1.0 - grown) / left
            xs_F = xs_F - steep * p[P_TAU_INV] * p[P_C1] * (1.0 - w[W_PART + q])
        xs = grown
    return xs, xt, xs_F


@inlined
def transform(
    T_wire: float, F: float, s: Array, w: Array, p: Array, e: Array, o: int, q: int
) -> tuple[float, float, float, float, float, float]:
    """Fractions at (T, F) from those at the start of the substep, with their slopes.

    Returns (xi_S, xi_T, dxi/dT, dxi/dF, dxi_S/dT, dxi_S/dF). Rate forms of Eqs (11)-(13): a
    fraction that is left scales by f(new)/f(old) whenever its progress grows, and rests otherwise.
    `o` and `q` are where a cell's memory lies in `s` and `w`, beyond that of the whole spring.
    """
    T = T_wire - w[W_SHIFT]
    tau = p[P_C1] * F
    xs = s[S_XS + o]
    xt = s[S_XT + o]
    xs_T = 0.0
    xs_F = 0.0
    xt_T = 0.0
    xt_F = 0.0
    spread = e[E_SPREAD] * p[P_A_INV]
    a = progress_a(T, tau, p, spread)
    if a > s[S_A + o] and xs + xt > 0.0:
        ratio, slope = back_to_austenite(a, xs, xt, s, w, p, e, spread, o, q)
        slope = slope * p[P_A_INV] if a < 1.0 + spread else 0.0
        slope_F = -slope * p[P_C1] * p[P_C_A_INV]
        xs_T = xs * slope
        xs_F = xs * slope_F
        xt_T = xt * slope
        xt_F = xt * slope_F
        xs = xs * ratio
        xt = xt * ratio
    b = progress_b(T, tau, p)
    if w[W_PART + q] > 0.0:
        xs, xt, xs_F = across(tau, b, xs, xt, xs_F, s, w, p, e, o, q)
    elif b > s[S_B + o] and xs < 1.0:
        left = remaining(b)
        before = left_before(s[S_B + o], w, W_FB + q, 0.0)
        ratio = left / before
        bend = 1.0
        if e[E_MINOR] != 0.0 and w[W_HOT + q] > 0.0 and ratio > 0.0:
            exponent, raised = minor(ratio, w[W_XI_FORTH + q], e)
            bend = exponent * raised / ratio
            ratio = raised
        if e[E_MEMORY] > 0.0 and w[W_HOT + q] > 0.0:
            ratio, bend = remembered(ratio, bend / before, left, 1.0, before, 1.0 - xs, e)
            bend = bend * before
        new = 1.0 - (1.0 - xs) * ratio
        on_curve = w[W_HOT + q] == 0.0 and 1.0 - left < new
        if on_curve:
            new = 1.0 - left
        if new > xs:
            slope_F = 0.0
            slope_T = 0.0
            if b < 1.0:
                slope_F = remaining_slope(left) * p[P_TAU_INV] * p[P_C1]
                if p[P_M_S] < T:
                    slope_T = -slope_F / p[P_C1] * p[P_C_M]
            free = 1.0 - xs
            if on_curve:
                ratio = left / free
                ratio_T = (slope_T + ratio * xs_T) / free
                ratio_F = (slope_F + ratio * xs_F) / free
            else:
                ratio_T = slope_T * bend / before
                ratio_F = slope_F * bend / before
            xs_T = ratio * xs_T - free * ratio_T
            xs_F = ratio * xs_F - free * ratio_F
            xt_T = ratio * xt_T + xt * ratio_T
            xt_F = ratio * xt_F + xt * ratio_F
            xs = new
            xt = xt * ratio
    elif b < s[S_B + o] and a >= 1.0 + spread and s[S_A + o] >= 1.0 + spread:
        # Above the crossing of the A_F line and the M_S line nothing is metastable: martensite
        # that stress has made goes back along the forward curve.
        left = remaining(b)
        if xs > 1.0 - left:
            xs = 1.0 - left
            xs_F = 0.0
            xs_T = 0.0
            if b > 0.0:
                slope_F = remaining_slope(left) * p[P_TAU_INV] * p[P_C1]
                xs_F = -slope_F
                xs_T = slope_F / p[P_C1] * p[P_C_M]
    c = progress_c(T, p)
    if c > s[S_C + o]:
        austenite = 1.0 - xs - xt
        if austenite > 0.0:
            left = remaining(c)
            before = left_before(s[S_C + o], w, W_FC + q, 0.0)
            ratio = left / before
            slope = 0.0
            if c < 1.0:
                slope = -remaining_slope(left) / before * p[P_M_INV]
            outer_slope = slope * before
            if e[E_MINOR] != 0.0 and ratio > 0.0:
                exponent, raised = minor(ratio, w[W_XI_FORTH + q], e)
                slope = slope * exponent * raised / ratio
                ratio = raised
            if e[E_MEMORY] > 0.0:
                ratio, slope = remembered(ratio, slope, left, outer_slope, before, austenite, e)
            xt_T = -xs_T + ratio * (xs_T + xt_T) - austenite * slope
            xt_F = -xs_F + ratio * (xs_F + xt_F)
            xt = 1.0 - xs - austenite * ratio
    xt = min(xt, 1.0 - xs)
    xt = max(xt, 0.0)
    return xs, xt, xs_T + xt_T, xs_F + xt_F, xs_T, xs_F


@inlined
def held(progress: float) -> float:
    """Progress where it still matters: curves with tails go beyond 0 and 1."""
    if progress <= PROGRESS_LOW:
        return PROGRESS_LOW
    if progress >= PROGRESS_HIGH:
        return PROGRESS_HIGH
    return progress


@inlined
def tailed(progress: float, e: Array) -> tuple[float, float]:
    """What is left at a progress, and its slope: the cosine, in part a logistic curve."""
    own = remaining(progress)
    slope = remaining_slope(own)
    tails = e[E_TAILS]
    if tails > 0.0:
        beyond = progress - 0.5
        z = math.exp(-TAIL_RATE * abs(beyond))
        left = z / (1.0 + z)
        own += tails * ((left if beyond > 0.0 else 1.0 - left) - own)
        slope += tails * (-TAIL_RATE * left / (1.0 + z) - slope)
    return own + LEAST_LEFT, slope


@inlined
def lay_curves(p: Array, e: Array) -> None:
    """Fill in the outer curves of `e`; that of heating with `spread` as `remaining_spread`."""
    spread = e[E_SPREAD] * p[P_A_INV]
    for cell in range(3 * CURVE_CELLS_PER_UNIT + 1):
        progress = PROGRESS_LOW + cell / CURVE_CELLS_PER_UNIT
        left, slope = tailed(progress, e)
        e[E_COOLING + 2 * cell] = left
        e[E_COOLING + 2 * cell + 1] = slope / CURVE_CELLS_PER_UNIT
        early, early_slope = tailed(progress - spread, e)
        late, late_slope = tailed(progress + spread, e)
        left = 0.5 * left + 0.25 * (early + late)
        slope = 0.5 * slope + 0.25 * (early_slope + late_slope)
        e[E_HEATING + 2 * cell] = left
        e[E_HEATING + 2 * cell + 1] = slope / CURVE_CELLS_PER_UNIT


@inlined
def outer(progress: float, curve: int, e: Array) -> tuple[float, float]:
    """The outer curve that lies at `curve`, and its slope: cubic between the steps, to 1e-6."""
    where = (progress - PROGRESS_LOW) * CURVE_CELLS_PER_UNIT
    # So written that NaN reads the first cell; see `film`.
    cell = int(where) if where > 0.0 else 0
    # Known not to be negative, it is not looked at again for each of the four places.
    cell = min(max(cell, 0), 3 * CURVE_CELLS_PER_UNIT - 1)
    x = where - cell
    at = curve + 2 * cell
    first = e[at + 1]
    rise = e[at + 2] - e[at]
    bend = 3.0 * rise - 2.0 * first - e[at + 3]
    twist = first + e[at + 3] - 2.0 * rise
    left = e[at] + x * (first + x * (bend + x * twist))
    slope = (first + x * (2.0 * bend + x * 3.0 * twist)) * CURVE_CELLS_PER_UNIT
    return left, slope


@inlined
def outer_before(progress: float, w: Array, memory: int, curve: int, e: Array) -> float:
    """The outer curve where a leg began or turned, worked out once in a substep when needed."""
    if w[memory] < 0.0:
        w[memory] = outer(progress, curve, e)[0]
    return float(w[memory])


@inlined
def branch(
    now: float,
    x: float,
    s: Array,
    w: Array,
    e: Array,
    far: int,
    turned: int,
    other: int,
    memory: int,
    curve: int,
) -> tuple[float, float]:
    """What is left of a fraction `x` at progress `now`, and its slope.

    The outer curve, scaled to pass through `x` at the furthest progress so far (slot `far`) and
    through the points where such legs turned before (from slot `turned` on), so that every loop
    closes, a ripple's too. Effect minor_loop raises the share of the way that is left: by `kappa`
    as in `minor`, the share that had not transformed when the leg began being in slot `other`, and
    by the share that rests until the outer curve itself is reached. The outer curve at the start
    and at the latest turn rests within a substep and is kept in `w` from slot `memory` on.
    """
    begin = outer_before(s[far], w, memory, curve, e)
    now_left, now_slope = outer(now, curve, e)
    # Curves with tails cross: what lies beyond the outer curve already goes along beside it.
    beyond = max(1.0, x / begin)
    value = 0.0
    target = 0.0
    began = 0.0
    for level in range(TURNS):
        point = s[turned + 2 * level]
        began = s[other + 2 * level + 1] if s[other + 2 * level] < PROGRESS_HIGH else 0.0
        if point >= PROGRESS_HIGH:
            break
        if s[far] < point:
            if level == 0:
                there = outer_before(point, w, memory + 1, curve, e)
            else:
                there = outer(point, curve, e)[0]
            if begin > there:
                value = s[turned + 2 * level + 1]
                target = there
                if now < point:
                    break
                x = min(x, value)
                begin = target
                value = 0.0
                target = 0.0
    exponent = (1.0 - e[E_MEMORY]) * (1.0 + e[E_MINOR] * began)
    # Rounding may leave a fraction that rests at a turn's below it.
    value = min(value, x)
    part = 1.0 / (begin - target)
    ratio = (now_left - target) * part
    slope = (x - value) * now_slope * part
    if exponent != 1.0 and ratio > 0.0:
        raised = math.pow(ratio, exponent)
        slope *= exponent * raised / ratio
        ratio = raised
    left = value + (x - value) * ratio
    if beyond * now_left < left:
        return beyond * now_left, beyond * now_slope
    return left, slope


@inlined
def starts(tau: float, p: Array) -> tuple[float, float]:
    """Where heating and cooling begin to transform at a stress, K. M_S is at the mount's stress."""
    cold = p[P_M_S] + (tau - p[P_C1] * p[P_F0]) / p[P_C_M]
    return p[P_A_S] + tau * p[P_C_A_INV], cold


@inlined
def heating_progress(T: float, hot: float, p: Array) -> float:
    return held((T - hot) * p[P_A_INV])


@inlined
def cooling_progress(T: float, cold: float, p: Array) -> float:
    return held((cold - T) * p[P_M_INV])


@inlined
def turned_by(tau: float, p: Array) -> tuple[float, float]:
    """How much of all martensite a stress turns, f(b) of Eq. (12), and its slope with the force."""
    left = remaining(clip01((tau - p[P_TAU_S]) * p[P_TAU_INV]))
    return 1.0 - left, -remaining_slope(left) * p[P_TAU_INV] * p[P_C1]


@inlined
def unified(
    T_wire: float,
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    o: int,
    q: int,
) -> tuple[float, float, float, float, float, float]:
    """As `transform`, by effect unified_kinetics, at the tension that `draw_lines` was given.

    Stress shifts both transformations along their own lines; what forms is turned, and what is
    there is turned further.
    """
    hot = w[W_LINE_HOT]
    cold = w[W_LINE_COLD]
    turned = w[W_TURNED]
    turned_F = w[W_TURNED_F]
    T = T_wire - w[W_SHIFT]
    xs = s[S_XS + o]
    xi = xs + s[S_XT + o]
    xi_T = 0.0
    xi_F = 0.0
    xs_T = 0.0
    xs_F = 0.0
    a = heating_progress(T, hot, p)
    if a > s[S_A + o] and xi > 0.0:
        left, slope = branch(
            a, xi, s, w, e, S_A + o, S_HOT + o, S_COLD + o, W_OUTER_HOT + q, E_HEATING
        )
        if left < xi:
            share = xs / xi
            xi_T = slope * p[P_A_INV]
            xi_F = -xi_T * p[P_C1] * p[P_C_A_INV]
            xs_T = share * xi_T
            xs_F = share * xi_F
            xs = share * left
            xi = left
    c = cooling_progress(T, cold, p)
    if c > s[S_C + o] and xi < 1.0:
        left, slope = branch(
            c, 1.0 - xi, s, w, e, S_C + o, S_COLD + o, S_HOT + o, W_OUTER_COLD + q, E_COOLING
        )
        more = 1.0 - left - xi
        if more > 0.0:
            xi_T = slope * p[P_M_INV]
            xi_F = -xi_T * p[P_C1] / p[P_C_M]
            xs_T += turned * xi_T
            xs_F += turned * xi_F + turned_F * more
            xs += turned * more
            xi = 1.0 - left
    if turned * xi > xs:
        xs = turned * xi
        xs_T = turned * xi_T
        xs_F = turned * xi_F + turned_F * xi
    return xs, xi - xs, xi_T, xi_F, xs_T, xs_F


@inlined
def keep_turn(s: Array, at: int, progress: float, left: float) -> None:
    for level in range(TURNS - 1, 0, -1):
        s[at + 2 * level] = s[at + 2 * level - 2]
        s[at + 2 * level + 1] = s[at + 2 * level - 1]
    s[at] = progress
    s[at + 1] = left


@inlined
def drop_turn(s: Array, at: int) -> None:
    for level in range(TURNS - 1):
        s[at + 2 * level] = s[at + 2 * level + 2]
        s[at + 2 * level + 1] = s[at + 2 * level + 3]
    s[at + 2 * TURNS - 2] = PROGRESS_HIGH
    s[at + 2 * TURNS - 1] = 0.0


@inlined
def go_on(
    s: Array,
    x: float,
    progress: float,
    back: float,
    far: int,
    returning: int,
    turned: int,
    other: int,
    end: float,
) -> bool:
    """One substep of a leg on which `x` falls; True when it turns out to have ended before.

    Slots `far` and `returning` keep the furthest progress of the leg, and that on the way back
    from there. `end` is what was left at the furthest point; more than that is a turn, which is
    kept in `turned`, however small: a threshold here would make what follows jump with the
    parameters. Of more turns than there is room for the innermost loop is forgotten.
    """
    if progress > s[far]:
        s[far] = progress
        s[returning] = back
    elif back > s[returning]:
        s[returning] = back
    if x > end:
        if s[turned + 2 * TURNS - 2] < PROGRESS_HIGH:
            drop_turn(s, turned)
            drop_turn(s, other)
        keep_turn(s, turned, s[far], end)
        s[far] = progress
        return True
    for _ in range(TURNS):
        if s[turned] >= PROGRESS_HIGH or s[far] < s[turned]:
            break
        drop_turn(s, turned)
        drop_turn(s, other)
    return False


@inlined
def keep_legs(s: Array, o: int, xi: float, a: float, c: float) -> None:
    """What `unified` has to remember of a substep that ends at the fraction `xi`."""
    end = s[S_XI_LEG + o]
    if s[S_LEG + o] < 0.0:
        ended = go_on(s, xi, a, c, S_A + o, S_C + o, S_HOT + o, S_COLD + o, end)
        further = xi < end
    else:
        ended = go_on(s, 1.0 - xi, c, a, S_C + o, S_A + o, S_COLD + o, S_HOT + o, 1.0 - end)
        further = xi > end
    if ended:
        s[S_LEG + o] = -s[S_LEG + o]
    if ended or further:
        s[S_XI_LEG + o] = xi


@inlined
def cells_of(e: Array) -> int:
    """How many parts of a spring have kinetics of their own."""
    return CELLS if e[E_FRONT] > 0.0 else 1


@inlined
def cell_at(i: int, cells: int) -> tuple[int, int]:
    """How far beyond the spring's own the memory of part `i` lies, in `s` and in `w`."""
    if cells == 1:
        return 0, 0
    return S_CELLS + i * S_KINETICS - S_XS, W_CELLS + i * W_KINETICS - W_FA


@inlined
def draw_lines(F: float, w: Array, p: Array, e: Array) -> None:
    """What a tension does to the whole spring's kinetics, for `unified`."""
    if e[E_UNIFIED] > 0.0:
        w[W_LINE_HOT], w[W_LINE_COLD] = starts(p[P_C1] * F, p)
        w[W_TURNED], w[W_TURNED_F] = turned_by(p[P_C1] * F, p)


@inlined
def copy_lines(w: Array, other: Array) -> None:
    """The same for a spring at the same tension: its material is the same."""
    for slot in range(W_LINE_HOT, W_TURNED_F + 1):
        other[slot] = w[slot]


@inlined
def kinetics(
    T: float, F: float, o: int, q: int, s: Array, w: Array, p: Array, e: Array
) -> tuple[float, float]:
    """Fractions of a spring, or of one of its cells, at its temperature, with their slopes.

    All goes to the scratch. Returns the change of the martensite fraction in this substep, and its
    slope with the temperature.
    """
    if e[E_UNIFIED] > 0.0:
        xs, xt, xi_T, xi_F, xs_T, xs_F = unified(T, s, w, p, e, o, q)
    else:
        xs, xt, xi_T, xi_F, xs_T, xs_F = transform(T, F, s, w, p, e, o, q)
    w[W_XS + q] = xs
    w[W_XT + q] = xt
    w[W_XI_T + q] = xi_T
    w[W_XI_F + q] = xi_F
    w[W_XS_T + q] = xs_T
    w[W_XS_F + q] = xs_F
    return xs + xt - s[S_XS + o] - s[S_XT + o], xi_T


@inlined
def latent(change: float, w: Array) -> float:
    """Kelvin per unit of fraction of a cell, in the direction in which it transforms."""
    return float(w[W_CELL_H] if change < 0.0 else w[W_CELL_C])


@compiled
def seat_cell(
    base: float, F: float, share: float, o: int, q: int, s: Array, w: Array, p: Array, e: Array
) -> tuple[float, float]:
    """The temperature of a cell: the one root of T = base + s λ (ξ(T, F) − ξ_old), in a bracket.

    Returns the change of its fraction and the slope with the temperature, as `kinetics` does.
    """
    low = base - share * w[W_CELL_H]
    high = base + share * w[W_CELL_C]
    T = w[W_GUESS + q]
    if not low <= T <= high:
        T = base
    change = 0.0
    xi_T = 0.0
    for n in range(ITERATIONS):
        change, xi_T = kinetics(T, F, o, q, s, w, p, e)
        lam = share * latent(change, w)
        miss = T - base - lam * change
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            break
        if miss > 0.0:
            high = T
        else:
            low = T
        T = T - miss / (1.0 - lam * xi_T)
        if n >= NEWTON_STEPS or not low < T < high:
            T = 0.5 * (low + high)
    w[W_GUESS + q] = T
    return change, xi_T


@compiled
def seat_cells(F: float, s: Array, w: Array, p: Array, e: Array) -> bool:
    """The temperatures of all cells at tension F; False when they are not found.

    Cell i ends at T_i = B + s (D_i + λ_i Δξ_i), D_i its distance from the mean along a front of
    share s, λ_i Δξ_i its own latent heat (of a spring without a front: one cell, D = 0, s = 1).
    B = T* + λ m − s M, with m and M the means of Δξ_i and λ_i Δξ_i, makes the mean of T_i what the
    heat balance says, T* + λ m, or what is fed. Each side of it rises with B, so that there is one
    root.
    """
    star = w[W_T_STAR]
    cells = cells_of(e)
    each = 1.0 / cells
    share = e[E_FRONT] if cells > 1 else 1.0
    low = star - w[W_LAM_H] - share * w[W_CELL_C]
    high = star + w[W_LAM_C] + share * w[W_CELL_H]
    base = star
    for n in range(ITERATIONS):
        mean = 0.0
        latent_mean = 0.0
        for i in range(cells):
            o, q = cell_at(i, cells)
            change, _ = seat_cell(base + share * s[S_CELL + i], F, share, o, q, s, w, p, e)
            mean += change * each
            latent_mean += latent(change, w) * change * each
        lam = w[W_LAM_H] if mean < 0.0 else w[W_LAM_C]
        miss = base - star - lam * mean + share * latent_mean
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            return True
        if miss > 0.0:
            high = base
        else:
            low = base
        steep = 1.0
        for i in range(cells):
            o, q = cell_at(i, cells)
            own = share * latent(w[W_XS + q] + w[W_XT + q] - s[S_XS + o] - s[S_XT + o], w)
            steep += (own - lam) * w[W_XI_T + q] / (1.0 - own * w[W_XI_T + q]) * each
        base = base - miss / steep
        if n >= NEWTON_STEPS or not low < base < high:
            base = 0.5 * (low + high)
    return False


@inlined
def step_cells(F: float, s: Array, w: Array, p: Array, e: Array) -> None:
    """A spring of cells at its guesses of their temperatures, and one step of Newton from there.

    Each cell has latent heat of its own, see `seat_cells`. Fractions, deflection, extrapolated
    along the step, and compliance go to the scratch; W_ROUGH is 0 if there was nothing to step.
    """
    cells = cells_of(e)
    each = 1.0 / cells
    share = e[E_FRONT] if cells > 1 else 1.0
    xs = xt = mean = latent_mean = 0.0
    for i in range(cells):
        o, q = cell_at(i, cells)
        change, _ = kinetics(w[W_GUESS + q], F, o, q, s, w, p, e)
        xs += w[W_XS + q] * each
        xt += w[W_XT + q] * each
        mean += change * each
        latent_mean += latent(change, w) * change * each
    lam = w[W_LAM_H] if mean < 0.0 else w[W_LAM_C]
    base = w[W_T_STAR] + lam * mean - share * latent_mean
    # One step of Newton in all temperatures, and how they follow the force.
    worst = coupled = pulled = forced = 0.0
    for i in range(cells):
        o, q = cell_at(i, cells)
        change = w[W_XS + q] + w[W_XT + q] - s[S_XS + o] - s[S_XT + o]
        own = share * latent(change, w)
        miss = w[W_GUESS + q] - own * change - base - share * s[S_CELL + i]
        worst = max(worst, abs(miss))
        part = (lam - own) / (1.0 - own * w[W_XI_T + q]) * each
        coupled += part * w[W_XI_T + q]
        pulled -= part * w[W_XI_T + q] * miss
        forced += part * w[W_XI_F + q]
    step = pulled / (1.0 - coupled)
    base_F = forced / (1.0 - coupled)
    rough = worst > T_TOLERANCE
    xi_step = xs_step = xi_F = xs_F = 0.0
    for i in range(cells):
        o, q = cell_at(i, cells)
        change = w[W_XS + q] + w[W_XT + q] - s[S_XS + o] - s[S_XT + o]
        own = share * latent(change, w)
        eased = 1.0 / (1.0 - own * w[W_XI_T + q])
        T_F = (base_F + own * w[W_XI_F + q]) * eased
        w[W_T_F + q] = T_F
        xi_F += (w[W_XI_F + q] + w[W_XI_T + q] * T_F) * each
        xs_F += (w[W_XS_F + q] + w[W_XS_T + q] * T_F) * each
        if rough:
            miss = w[W_GUESS + q] - own * change - base - share * s[S_CELL + i]
            own_step = (step - miss) * eased
            xi_step += w[W_XI_T + q] * own_step * each
            xs_step += w[W_XS_T + q] * own_step * each
            w[W_GUESS + q] += own_step
    w[W_ROUGH] = worst if rough else 0.0
    w[W_T] = w[W_T_STAR] + lam * mean
    w[W_XS] = xs
    w[W_XT] = xt
    deflect(F, xi_step, xs_step, xi_F, xs_F, s, w, p, e)


@inlined
def deflect(
    F: float,
    xi_step: float,
    xs_step: float,
    xi_F: float,
    xs_F: float,
    s: Array,
    w: Array,
    p: Array,
    e: Array,
) -> None:
    """Deflection and compliance at tension F with the fractions in scratch, into scratch.

    The fractions are still to make the steps given; `xi_F` and `xs_F` are how they follow the
    force, the temperature with them.
    """
    xs = w[W_XS]
    xi = xs + w[W_XT]
    give = compliance(xi, p, e)
    w[W_GIVE] = give
    soft = p[P_K_A] - p[P_K_M]
    plain = give
    weight = 1.0
    if e[E_COLD_ENDS] > 0.0:
        weight = 1.0 - e[E_COLD_ENDS]
        plain = 1.0 / (p[P_K_A] - soft * xi)
    left, left_S, left_F = inelastic(F, xs, s, p, e)
    softer = F * soft * weight * plain * plain
    w[W_DELTA] = F * give + left + softer * xi_step + left_S * xs_step
    w[W_SLOPE] = give + softer * xi_F + left_S * xs_F + left_F


@inlined
def compliance(xi: float, p: Array, e: Array) -> float:
    """Elastic deflection per newton: Eq. (9) with (7); effect cold_ends in series."""
    soft = p[P_K_A] - p[P_K_M]
    give = 1.0 / (p[P_K_A] - soft * xi)
    if e[E_COLD_ENDS] > 0.0:
        give = (1.0 - e[E_COLD_ENDS]) * give + e[E_COLD_ENDS] / p[P_K_M]
    return float(give)


@inlined
def end_fraction(F: float, s: Array, p: Array) -> tuple[float, float]:
    """Detwinned fraction of ends that stay cold, and its slope: Eq. (12) on the curve."""
    b = clip01((p[P_C1] * F - p[P_TAU_S]) * p[P_TAU_INV])
    left = remaining(b)
    if 1.0 - left > s[S_XS_END]:
        return 1.0 - left, -remaining_slope(left) * p[P_TAU_INV] * p[P_C1]
    return s[S_XS_END], 0.0


@inlined
def inelastic(F: float, xs: float, s: Array, p: Array, e: Array) -> tuple[float, float, float]:
    """Deflection at no load and its slopes with ξ_S and F: δ_L ξ_S, and what effects add."""
    reach = p[P_DELTA_L]
    if e[E_UNEVEN_STRAIN] == 0.0:
        return reach * xs, reach, 0.0
    reach = reach * (1.0 - e[E_SHRINK] * s[S_CYCLES])
    extra = e[E_R_STRAIN] * p[P_DELTA_L] * s[S_R] + e[E_ELONGATION] * s[S_CYCLES]
    if e[E_COLD_ENDS] > 0.0:
        end, end_F = end_fraction(F, s, p)
        part = (1.0 - e[E_COLD_ENDS]) * reach
        cold = e[E_COLD_ENDS] * reach
        return part * xs + cold * end + extra, part, cold * end_F
    return reach * xs + extra, reach, 0.0


@inlined
def settle(F: float, exact: bool, s: Array, w: Array, p: Array, e: Array) -> bool:
    """One spring at tension F: temperatures, fractions, deflection and compliance, into scratch.

    Exact: the temperatures that the heat balance asks for, in the end held in brackets; returns
    False when they are not found. Otherwise one step of Newton from the guesses, with the
    deflection extrapolated along it and the size of the step left in W_ROUGH, so that temperatures
    and force can converge together.
    """
    draw_lines(F, w, p, e)
    return settle_along(F, exact, s, w, p, e)


@compiled
def settle_along(F: float, exact: bool, s: Array, w: Array, p: Array, e: Array) -> bool:
    """`settle`, with the lines for tension F in scratch already."""
    found = True
    for n in range(JOINT_STEPS + 1):
        if n == JOINT_STEPS:
            found = seat_cells(F, s, w, p, e)
        step_cells(F, s, w, p, e)
        if not exact or w[W_ROUGH] == 0.0:
            return True
    w[W_ROUGH] = 0.0
    return found


@inlined
def follow(dF: float, w: Array, e: Array) -> None:
    """Moves the guesses of temperature along with a step of the tension."""
    cells = cells_of(e)
    for i in range(cells):
        _, q = cell_at(i, cells)
        w[W_GUESS + q] += dF * w[W_T_F + q]


@inlined
def tendon(F: float, e: Array) -> tuple[float, float]:
    """Half the stretch of the tendon at tension F, m, and its slope: slack taken up, compliance."""
    reach = 0.5 * e[E_TENDON] * F
    slope = 0.5 * e[E_TENDON]
    if e[E_SLACK] > 0.0:
        decay = math.exp(-F / e[E_SLACK_F])
        reach += 0.5 * e[E_SLACK] * (1.0 - decay)
        slope += 0.5 * e[E_SLACK] * decay / e[E_SLACK_F]
    return reach, slope


@inlined
def narrow(F: float, miss: float, slope: float, low: float, high: float, n: int) -> float:
    """Newton's next tension inside its bracket, or the middle of the bracket if that has to be."""
    if n < NEWTON_STEPS or high > 1e299:
        F = F - miss / slope
        if low < F < high:
            return F
        if low == 0.0 and F <= 0.0:
            return 0.0
    return 0.5 * (low + high)


@inlined
def met(F: float, miss: float, low: float, high: float) -> bool:
    """Whether the root is found: within tolerance, in a closed bracket, or slack, at no tension."""
    if abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low):
        return True
    return miss > 0.0 and F == 0.0


@compiled
def balance_pair(
    guess: float, x: Array, y: Array, g: Array, wx: Array, wy: Array, p: Array, e: Array
) -> float:
    """The tension at which the pair fills its length: δ_X(F) + δ_Y(F) = 2 δ0.

    Deflections grow with the tension, so there is one root, held in a bracket; a few steps in which
    force and temperatures converge together come first, and are nearly always enough. No tension
    at all is the answer when the unloaded springs are already long enough: the tendon is slack.
    Returns the tension, or -1 when it is not found.
    """
    low = 0.0
    high = 1e300
    F = guess if guess > 0.0 else 0.0
    for n in range(ITERATIONS):
        exact = n >= JOINT_STEPS
        draw_lines(F, wx, p, e)
        copy_lines(wx, wy)
        found = settle_along(F, exact, x, wx, p, e)
        found = settle_along(F, exact, y, wy, p, e) and found
        g[G_ITERATIONS] += 1.0
        if not found:
            return -1.0
        miss = wx[W_DELTA] + wy[W_DELTA] - 2.0 * p[P_DELTA_0]
        settled = wx[W_ROUGH] == 0.0 and wy[W_ROUGH] == 0.0
        if settled and met(F, miss, low, high):
            return F
        if exact:
            if miss > 0.0:
                high = F
            else:
                low = F
        last = F
        F = narrow(F, miss, wx[W_SLOPE] + wy[W_SLOPE], low, high, n)
        follow(F - last, wx, e)
        follow(F - last, wy, e)
    return -1.0


@compiled
def balance(target: float, guess: float, s: Array, g: Array, w: Array, p: Array, e: Array) -> float:
    """The tension at which one spring, with its half of the tendon, has the deflection `target`.

    As `balance_pair`: one root, zero when the spring is slack, -1 when it is not found.
    """
    low = 0.0
    high = 1e300
    F = guess if guess > 0.0 else 0.0
    gives = e[E_ROUGH] > 0.0 and p[P_FIXTURE] == 0.0
    for n in range(ITERATIONS):
        exact = n >= JOINT_STEPS
        found = settle(F, exact, s, w, p, e)
        reach = w[W_DELTA]
        slope = w[W_SLOPE]
        if gives:
            stretch, stretch_F = tendon(F, e)
            reach += stretch - tendon(p[P_F0], e)[0]
            slope += stretch_F
        g[G_ITERATIONS] += 1.0
        if not found:
            return -1.0
        miss = reach - target
        settled = w[W_ROUGH] == 0.0
        if settled and met(F, miss, low, high):
            return F
        if exact:
            if miss > 0.0:
                high = F
            else:
                low = F
        last = F
        F = narrow(F, miss, slope, low, high, n)
        follow(F - last, w, e)
    return -1.0


@compiled
def slide(
    rub: float,
    guess: float,
    x: Array,
    y: Array,
    g: Array,
    wx: Array,
    wy: Array,
    p: Array,
    e: Array,
    dt: float,
) -> tuple[float, float, float]:
    """The pair with friction `rub` (signed), drag, tube stiffness and a tendon that gives.

    Unknown is the tension of X; that of Y is less by what resists the motion. Returns
    (tension of X, of Y, displacement), tension -1 when it is not found.
    """
    low = 0.0
    high = 1e300
    F = guess if guess > 0.0 else 0.0
    before = g[G_U]
    wet = 0.5 * (x[S_FILL] + y[S_FILL])
    drag = e[E_DRAG] * wet / dt
    mounted = tendon(p[P_F0], e)[0]
    for n in range(ITERATIONS):
        found = settle(F, True, x, wx, p, e)
        stretch, stretch_F = tendon(F, e)
        reach = wx[W_DELTA] + stretch - mounted
        reach_F = wx[W_SLOPE] + stretch_F
        u = p[P_DELTA_0] - reach
        other = F - rub - 2.0 * e[E_TUBE_K] * u - drag * (u - before)
        other_F = 1.0 + (2.0 * e[E_TUBE_K] + drag) * reach_F
        if other < 0.0:
            other = 0.0
            other_F = 0.0
        found = settle(other, True, y, wy, p, e) and found
        stretch, stretch_F = tendon(other, e)
        g[G_ITERATIONS] += 1.0
        if not found:
            return -1.0, 0.0, 0.0
        miss = reach + wy[W_DELTA] + stretch - mounted - 2.0 * p[P_DELTA_0]
        slope = reach_F + (wy[W_SLOPE] + stretch_F) * other_F
        if abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low):
            return F, other, u
        if miss > 0.0:
            if F == 0.0:
                return F, other, slack_position(before, wx, wy, p)
            high = F
        else:
            low = F
        F = narrow(F, miss, slope, low, high, n)
    return -1.0, 0.0, 0.0


@inlined
def friction_level(F: float, speed: float, e: Array) -> float:
    """Friction of tube on spring at a tension and a speed: constant, proportional, Stribeck."""
    level = e[E_COULOMB] + e[E_PROPORTIONAL] * F
    if e[E_STRIBECK] > 0.0 and level > 0.0:
        level = level * (1.0 + e[E_STRIBECK] * math.exp(-abs(speed) / e[E_STRIBECK_V]))
    return float(level)


@compiled
def rough_pair(
    guess: float, x: Array, y: Array, g: Array, wx: Array, wy: Array, p: Array, e: Array, dt: float
) -> tuple[float, float, float]:
    """The pair where something resists its motion: stick if friction can hold it, else slide.

    Returns (tension of X, of Y, displacement), tension -1 when it is not found.
    """
    rub = 0.0
    hold = friction_level(g[G_F], 0.0, e)
    if hold > 0.0:
        u = g[G_U]
        F_x = balance(p[P_DELTA_0] - u, x[S_F], x, g, wx, p, e)
        F_y = balance(p[P_DELTA_0] + u, y[S_F], y, g, wy, p, e)
        if F_x < 0.0 or F_y < 0.0:
            return -1.0, 0.0, 0.0
        pull = F_x - F_y - 2.0 * e[E_TUBE_K] * u
        if abs(pull) <= hold:
            return F_x, F_y, u
        rub = friction_level(g[G_F], g[G_SPEED], e)
        if pull < 0.0:
            rub = -rub
    return slide(rub, guess, x, y, g, wx, wy, p, e, dt)


@inlined
def film(T: float, T_water: float, speed: float, p: Array, table: Array) -> float:
    """Conductance from wire to water, W/(m K): the larger of free and forced convection.

    Free: Eqs (19)-(21) with the flow's hydraulic diameter. Forced: Eqs (24), (25).
    """
    where = 0.5 * (T + T_water) - p[P_TABLE_T0]
    last = table.shape[0] - 3
    # Kept within the table before it is made an integer: of what has run away, or of NaN, any
    # integer may be made, and memory that is not the table's would be read.
    cell = int(where) if 1.0 < where < last else (last if where > 1.0 else 1)
    x = where - cell
    x = max(x, -1.0)
    x = min(x, 2.0)
    w0 = -x * (x - 1.0) * (x - 2.0) * SIXTH
    w1 = (x + 1.0) * (x - 1.0) * (x - 2.0) * 0.5
    w2 = -(x + 1.0) * x * (x - 2.0) * 0.5
    w3 = (x + 1.0) * x * (x - 1.0) * SIXTH
    k = w0 * table[cell - 1, 0] + w1 * table[cell, 0]
    k = k + w2 * table[cell + 1, 0] + w3 * table[cell + 2, 0]
    rise = w0 * table[cell - 1, 1] + w1 * table[cell, 1]
    rise = rise + w2 * table[cell + 1, 1] + w3 * table[cell + 2, 1]
    root = 0.60 + rise * math.pow(abs(T - T_water), SIXTH) * p[P_SQRT_DH]
    h = k * p[P_DH_INV] * root * root
    if speed > 0.0:
        c2 = w0 * table[cell - 1, 2] + w1 * table[cell, 2]
        c2 = c2 + w2 * table[cell + 1, 2] + w3 * table[cell + 2, 2]
        c3 = w0 * table[cell - 1, 3] + w1 * table[cell, 3]
        c3 = c3 + w2 * table[cell + 1, 3] + w3 * table[cell + 2, 3]
        forced = (c2 + c3 * math.sqrt(speed * p[P_DH])) * p[P_DH_INV]
        h = max(h, forced)
    return float(h * p[P_PERIMETER])


@inlined
def bare(T: float, T_air: float, p: Array) -> float:
    """Conductance from a bare wire to still air, W/(m K): Eq. (20) with the wire's diameter."""
    root = 0.60 + p[P_AIR_C] * math.pow(abs(T - T_air), SIXTH)
    return float(p[P_AIR_K] * root * root)


@inlined
def steeper(difference: float, exponent: float, e: Array) -> float:
    """Effect convection_exponent: factor on a film coefficient at a temperature difference."""
    size = abs(difference) / e[E_EXPONENT_REF]
    return math.pow(size if size > 0.01 else 0.01, exponent)


@inlined
def taken_up(conductance: float, capacity: float, dt: float) -> float:
    """Mean conductance over dt to a body that comes towards the temperature beside it.

    So that the body, however small, ends where the exponential of its time constant leads, and not
    beyond.
    """
    return float(capacity / dt * (1.0 - math.exp(-dt * conductance / capacity)))


@inlined
def mix_cells(s: Array, w: Array, p: Array, warmer: float, dt: float) -> None:
    """One implicit Euler step of `move_front`; its cells need not be centred yet.

    What all cells lose to the outlet is such that their mean water stays: the row is solved
    without, and with nothing but a unit of it.
    """
    flow = w[W_GF]
    capacity = w[W_CAP] / dt
    wire = 1.0 / (capacity + w[W_GW] + w[W_GD])
    inertia = s[S_FILL] * p[P_SHARE] * p[P_CW] / dt
    water = 1.0 / (
        inertia + w[W_GW] + w[W_UA] + w[W_WALL_G] + CELLS * flow - w[W_GW] * w[W_GW] * wire
    )
    upstream = -warmer
    unit = 0.0
    mean = 0.0
    unit_mean = 0.0
    for i in range(CELLS):
        right = inertia * s[S_CELL_W + i] + w[W_GW] * wire * capacity * s[S_CELL + i]
        upstream = (right + CELLS * flow * upstream) * water
        unit = (1.0 + CELLS * flow * unit) * water
        s[S_CELL_W + i] = upstream
        w[W_UNIT + i] = unit
        mean += upstream
        unit_mean += unit
    leaving = -mean / unit_mean
    for i in range(CELLS):
        s[S_CELL_W + i] += leaving * w[W_UNIT + i]
        s[S_CELL + i] = (capacity * s[S_CELL + i] + w[W_GW] * s[S_CELL_W + i]) * wire


@inlined
def move_front(s: Array, w: Array, p: Array, warmer: float, dt: float) -> None:
    """Effect cooling_front: how far wire and water of each cell are from the means.

    The cells are stirred tanks in a row; their means are what `heat` solves, so that only the
    deviations are stepped. `warmer` is the mean of the water over the inlet. Of second order and
    damped where the step is long (SDIRK2, Alexander 1977): two steps of implicit Euler of a part
    of `dt`, the second from where the first leads to.
    """
    for i in range(2 * CELLS):
        w[W_BEFORE + i] = s[S_CELL + i]
    mix_cells(s, w, p, warmer, SDIRK_PART * dt)
    for i in range(2 * CELLS):
        s[S_CELL + i] = w[W_BEFORE + i] + SDIRK_FURTHER * (s[S_CELL + i] - w[W_BEFORE + i])
    mix_cells(s, w, p, warmer, SDIRK_PART * dt)


@inlined
def heat(
    s: Array, other: Array, g: Array, w: Array, p: Array, e: Array, table: Array, dt: float
) -> None:
    """Set up the heat balance of one spring over the substep: Eqs (15)-(18) and the water node.

    Implicit midpoint in both temperatures with film coefficients at the extrapolated midpoint.
    The water is eliminated, so that what is left is T = T* + λ Δξ.
    """
    T = s[S_T]
    T_water = s[S_TW]
    T_air = g[G_T_AIR]
    T_in = g[G_T_IN]
    middle = T + 0.5 * dt * s[S_RATE]
    middle_water = T_water + 0.5 * dt * s[S_RATE_W]
    power = s[S_I] * s[S_I] * s[S_OHM] * p[P_LENGTH_INV]
    per_dt = 1.0 / dt
    gain = s[S_WORK_Q] * per_dt
    if e[E_CROSSTALK] > 0.0:
        gain += e[E_CROSSTALK] * p[P_LENGTH_INV] * (other[S_T] - T)
    g_water = 0.0
    fill = s[S_FILL]
    flow = s[S_FLOW]
    warms = p[P_WARMS] > 0.0
    if p[P_WET] > 0.0:
        surround = middle_water if warms else T_in
        g_water = fill * film(middle, surround, flow * p[P_AREA_INV], p, table)
        g_water = g_water * s[S_WETTED]
        g_dry = (1.0 - fill) * p[P_GAP]
        if e[E_EXPONENT] != 0.0:
            g_water = g_water * steeper(middle - surround, e[E_EXPONENT], e)
    else:
        surround = T_air
        g_dry = bare(middle, T_air, p)
        if e[E_EXPONENT] != 0.0:
            g_dry = g_dry * steeper(middle - T_air, e[E_EXPONENT], e)
    if e[E_END_LOSS] > 0.0:
        g_dry += e[E_END_LOSS] * p[P_LENGTH_INV]
    net = power + gain - g_dry * (T - T_air) - g_water * (T - (T_water if warms else T_in))
    capacity = p[P_MC_H] if net >= 0.0 else p[P_MC_C]
    w[W_CAP] = capacity
    w[W_GW] = g_water
    w[W_GD] = g_dry
    inertia = 2.0 * capacity * per_dt
    stiff = inertia + g_water + g_dry
    right = inertia * T + power + gain + g_dry * T_air
    w[W_DW_INV] = 0.0
    if warms:
        inertia = 2.0 * fill * p[P_SHARE] * p[P_CW] * per_dt
        g_flow = flow * p[P_FLOW_G]
        ua = fill * p[P_UA]
        if e[E_LOSS_EXPONENT] != 0.0:
            ua = ua * steeper(middle_water - T_air, e[E_LOSS_EXPONENT], e)
        d_water = inertia + g_water + g_flow + ua
        r_water = inertia * T_water + g_flow * T_in + ua * T_air
        w[W_WALL_G] = 0.0
        if e[E_WALL] > 0.0:
            w[W_WALL_G] = taken_up(fill * e[E_WALL_G], e[E_WALL] * p[P_CW], dt)
            d_water += w[W_WALL_G]
            r_water += w[W_WALL_G] * s[S_T_WALL]
        w[W_GF] = g_flow
        w[W_UA] = ua
        w[W_LEAVES] = 0.0
        if e[E_FRONT] > 0.0:
            left = s[S_CELL_W + CELLS - 1]
            move_front(s, w, p, middle_water - T_in, dt)
            w[W_LEAVES] = 0.5 * e[E_FRONT] * (left + s[S_CELL_W + CELLS - 1])
            r_water -= g_flow * w[W_LEAVES]
        per_d = 1.0 / d_water
        stiff -= g_water * g_water * per_d
        right += g_water * r_water * per_d
        w[W_DW_INV] = per_d
        w[W_RW] = r_water
    else:
        right += g_water * T_in
    w[W_LATENT] = 1.0
    if e[E_LATENT_STRESS] != 0.0:
        stress = p[P_C1] * (s[S_F] - p[P_F0]) / STRESS_REF_PA
        w[W_LATENT] = 1.0 + e[E_LATENT_STRESS] * stress
    soft = 2.0 / stiff
    w[W_T_STAR] = right * soft - T
    soft = soft * per_dt * w[W_LATENT]
    w[W_LAM_H] = p[P_ML_H] * soft
    w[W_LAM_C] = p[P_ML_C] * soft
    w[W_POWER] = power


@inlined
def prepare(s: Array, w: Array, p: Array, e: Array, dt: float) -> None:
    """What `transform` and `settle` need of the start of the substep."""
    w[W_SHIFT] = e[E_SHIFT] * s[S_CYCLES]
    guess = w[W_T_STAR]
    if s[S_ACTIVE] > 0.0:
        guess = s[S_T] + dt * s[S_RATE]
    cells = cells_of(e)
    for i in range(cells):
        o, q = cell_at(i, cells)
        off = 0.0
        w[W_GUESS + q] = guess
        if cells > 1:
            off = e[E_FRONT] * s[S_CELL + i]
            w[W_GUESS + q] = off + w[W_T_STAR]
            if s[S_ACTIVE] > 0.0:
                w[W_GUESS + q] = off + s[S_T] + dt * s[S_CELL_RATE + i]
        w[W_FA + q] = -1.0
        w[W_FB + q] = -1.0
        w[W_FC + q] = -1.0
        if e[E_UNIFIED] > 0.0:
            w[W_OUTER_COLD + 1 + q] = -1.0
            continue
        start = s[S_T] + off - w[W_SHIFT] - p[P_M_S]
        end = guess + off - w[W_SHIFT] - p[P_M_S]
        w[W_HOT + q] = 1.0 if start > 0.0 else 0.0
        w[W_PART + q] = 0.0
        if start * end < 0.0:
            w[W_PART + q] = start / (start - end)
        if e[E_MINOR] != 0.0:
            xi = s[S_XS + o] + s[S_XT + o]
            w[W_XI_BACK + q] = s[S_XI_LEG + o] if s[S_LEG + o] < 0.0 else xi
            w[W_XI_FORTH + q] = s[S_XI_LEG + o] if s[S_LEG + o] > 0.0 else xi


@inlined
def at_place(s: Array, place: float) -> float:
    """How far the wire at a place along the tube, 0 to 1 from the inlet, is from its mean, K."""
    where = place * CELLS - 0.5
    where = min(max(where, 0.0), CELLS - 1.0)
    cell = min(int(where), CELLS - 2)
    part = where - cell
    return float((1.0 - part) * s[S_CELL + cell] + part * s[S_CELL + cell + 1])


@inlined
def heat_books(
    s: Array,
    g: Array,
    w: Array,
    p: Array,
    e: Array,
    T_old: float,
    T: float,
    change: float,
    dt: float,
) -> None:
    """Water and wall temperatures at the end of the substep, and where the heat went."""
    length = p[P_LENGTH]
    per_dt = 1.0 / dt
    middle = 0.5 * (T + T_old)
    if w[W_DW_INV] > 0.0:
        T_water = s[S_TW]
        middle_water = (w[W_RW] + w[W_GW] * middle) * w[W_DW_INV]
        new_water = 2.0 * middle_water - T_water
        s[S_RATE_W] = (new_water - T_water) * per_dt
        s[S_TW] = new_water
        carried = length * dt * w[W_GF] * (middle_water + w[W_LEAVES] - g[G_T_IN])
        s[S_AIR_J] += length * dt * w[W_UA] * (middle_water - g[G_T_AIR])
        if w[W_WALL_G] > 0.0:
            given = dt * w[W_WALL_G] * (middle_water - s[S_T_WALL])
            s[S_T_WALL] += given / (e[E_WALL] * p[P_CW])
    else:
        carried = length * dt * w[W_GW] * (middle - g[G_T_IN])
    s[S_WATER_J] += carried
    g[G_RESERVOIR] += e[E_RESERVOIR] * carried
    s[S_AIR_J] += length * dt * w[W_GD] * (middle - g[G_T_AIR])
    s[S_IN_J] += length * dt * w[W_POWER]
    latent = (p[P_ML_H] if change < 0.0 else p[P_ML_C]) * w[W_LATENT]
    s[S_UNEQUAL_J] += length * (
        (p[P_MC_H] - w[W_CAP]) * (T - T_old) - (p[P_ML_H] - latent) * change
    )


@inlined
def r_phase(T: float, xi_old: float, xi: float, s: Array, p: Array, e: Array) -> None:
    """Effect r_phase: austenite becomes R-phase on cooling, and back with a small hysteresis."""
    start = p[P_M_S] + e[E_R_ABOVE]
    austenite = 1.0 - xi
    share = s[S_R] / (1.0 - xi_old) if xi_old < 1.0 else 0.0
    progress = clip01((start - T) / e[E_R_WIDTH])
    if xi < xi_old:
        # Austenite that heating has just made holds no R-phase.
        share = s[S_R] / austenite if austenite > 0.0 else 0.0
    if progress > s[S_R_PROGRESS]:
        ratio = remaining(progress) / remaining(s[S_R_PROGRESS])
        share = 1.0 - (1.0 - share) * ratio
    top = 1.0 - remaining((start + R_HYSTERESIS - T) / e[E_R_WIDTH])
    share = min(share, top)
    s[S_R_PROGRESS] = progress
    s[S_R] = share * austenite


@inlined
def history(
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    F_phase: float,
    xi_old: float,
    change: float,
) -> None:
    """What the next substep has to remember of the transformation."""
    xi = xi_old + change
    s[S_CYCLES] += 0.5 * abs(change)
    if e[E_COLD_ENDS] > 0.0:
        s[S_XS_END] = end_fraction(F_phase, s, p)[0]
    if e[E_R_STRAIN] != 0.0 or e[E_R_OHM] != 0.0:
        r_phase(s[S_T], xi_old, xi, s, p, e)


@inlined
def spread_latent(s: Array, w: Array, p: Array, released: float, dt: float) -> None:
    """What latent heat did to each cell beyond the mean, `released`, and what its water got of it.

    In scratch: how much warmer each cell ends for its own. It was so for half the step on average.
    """
    given = 0.0
    if w[W_DW_INV] > 0.0:
        inertia = 2.0 * s[S_FILL] * p[P_SHARE] * p[P_CW] / dt
        given = w[W_GW] / (inertia + w[W_GW] + w[W_UA] + w[W_WALL_G] + CELLS * w[W_GF])
    for i in range(CELLS):
        more = w[W_UNIT + i] - released
        s[S_CELL + i] += more
        s[S_CELL_W + i] += given * more


@inlined
def remember(s: Array, w: Array, p: Array, e: Array, F_phase: float, dt: float) -> None:
    """Progress and legs of the spring or of its cells, and what their latent heat does to them.

    At the temperature of the last evaluation, so that progress and fractions belong together.
    """
    tau = p[P_C1] * F_phase
    cells = cells_of(e)
    hot, cold = starts(tau, p)
    released = 0.0
    for i in range(cells):
        o, q = cell_at(i, cells)
        xi_old = s[S_XS + o] + s[S_XT + o]
        own = w[W_XS + q] + w[W_XT + q] - xi_old
        s[S_XS + o] = w[W_XS + q]
        s[S_XT + o] = w[W_XT + q]
        before = s[S_T] + e[E_FRONT] * s[S_CELL + i]
        s[S_CELL_RATE + i] = (w[W_GUESS + q] - before) / dt
        w[W_UNIT + i] = latent(own, w) * own
        released += w[W_UNIT + i] / cells
        T = w[W_GUESS + q] - w[W_SHIFT]
        if e[E_UNIFIED] > 0.0:
            a = heating_progress(T, hot, p)
            keep_legs(s, o, xi_old + own, a, cooling_progress(T, cold, p))
            continue
        s[S_A + o] = progress_a(T, tau, p, e[E_SPREAD] * p[P_A_INV])
        s[S_B + o] = progress_b(T, tau, p)
        s[S_C + o] = progress_c(T, p)
        if own != 0.0:
            leg = -1.0 if own < 0.0 else 1.0
            if leg != s[S_LEG + o]:
                s[S_LEG + o] = leg
                s[S_XI_LEG + o] = xi_old
    if cells > 1:
        spread_latent(s, w, p, released, dt)


@compiled
def accept(
    s: Array,
    g: Array,
    w: Array,
    p: Array,
    e: Array,
    F_spring: float,
    F_phase: float,
    fed: bool,
    dt: float,
) -> None:
    """Take over the end of the substep for one spring and write its energy books."""
    T_old = s[S_T]
    T = w[W_T]
    xi_old = s[S_XS] + s[S_XT]
    xs = w[W_XS]
    xt = w[W_XT]
    change = xs + xt - xi_old
    remember(s, w, p, e, F_phase, dt)
    if not fed or e[E_FRONT] > 0.0:
        heat_books(s, g, w, p, e, T_old, T, change, dt)
    work = 0.5 * (F_spring + s[S_F]) * (w[W_DELTA] - s[S_DELTA])
    elastic = 0.5 * F_spring * F_spring * w[W_GIVE]
    lost = work - elastic + s[S_ELASTIC]
    s[S_ELASTIC] = elastic
    s[S_WORK_J] += work
    s[S_OMITTED_J] += (1.0 - p[P_WORK_SHARE]) * lost
    s[S_WORK_Q] = p[P_WORK_SHARE] * lost * p[P_LENGTH_INV]
    s[S_RATE] = (T - T_old) / dt
    s[S_ACTIVE] = 1.0 if change != 0.0 else 0.0
    s[S_T] = T
    s[S_XS] = xs
    s[S_XT] = xt
    s[S_F] = F_spring
    s[S_DELTA] = w[W_DELTA]
    s[S_TAU] = p[P_C1] * F_phase
    history(s, w, p, e, F_phase, xi_old, change)


@inlined
def water_inventory(s: Array, p: Array, e: Array, drain: float, dt: float) -> None:
    """Drain or refill the tube; heat that leaves or enters with the water goes to the books."""
    fill = s[S_FILL]
    new = fill
    if s[S_FLOW] > 0.0:
        new = fill + dt * s[S_FLOW] * p[P_FILL_RATE]
        new = min(new, 1.0)
    elif drain > 0.0:
        if fill > p[P_FILM]:
            new = p[P_FILM] + (fill - p[P_FILM]) * math.exp(-dt * p[P_DRAIN_RATE])
    elif e[E_DRAINAGE] > 0.0:
        floor = 1.0 - e[E_DRAINAGE]
        floor = max(floor, p[P_FILM])
        if fill > floor and s[S_PUMP_COUNT] > 0.0:
            new = floor + (fill - floor) * math.exp(-dt / e[E_DRAINAGE_S])
    if new != fill:
        moved = (fill - new) * p[P_SHARE] * p[P_CW] * p[P_LENGTH] * p[P_WARMS]
        s[S_WATER_J] += moved * (s[S_TW] - p[P_T_REF])
        s[S_FILL] = new


@inlined
def scattered(count: float) -> float:
    """A number in 0 to 1 for each count, evenly scattered (van der Corput, base 2)."""
    n = int(count)
    place = 0.5
    total = 0.0
    while n > 0:
        if n & 1:
            total += place
        n >>= 1
        place *= 0.5
    return total


@inlined
def towards(goal: float, start: float, span: float, tau: float) -> tuple[float, float]:
    """A first-order lag from `start` after `span`, and its integral over that time."""
    if start == goal:
        return goal, goal * span
    gone = 1.0 - math.exp(-span / tau)
    return start + (goal - start) * gone, goal * span + (start - goal) * tau * gone


@inlined
def pump(s: Array, p: Array, e: Array, duty: float, sign: float, dt: float) -> None:
    """Flow of one pump before leaks: linear in the duty, and what effects do to it."""
    if duty > 0.0:
        if s[S_PUMP_ON_S] <= 0.0:
            s[S_PUMP_COUNT] += 1.0
        s[S_PUMP_ON_S] += dt
    else:
        s[S_PUMP_ON_S] = 0.0
    flow = p[P_FLOW_MAX] * duty * p[P_WET]
    # A dead time may end within the step.
    late = 1.0 - clip01((s[S_PUMP_ON_S] - e[E_DEAD_S]) / dt) if e[E_DEAD_S] > 0.0 else 0.0
    if e[E_SHORTFALL] != 0.0:
        flow = flow * (1.0 - e[E_SHORTFALL])
    if e[E_UNEVEN] != 0.0:
        flow = flow * (1.0 + sign * e[E_UNEVEN])
    s[S_WETTED] = 1.0
    if e[E_POCKETS] > 0.0 and duty > 0.0:
        part = 1.0 - e[E_POCKETS] * scattered(s[S_PUMP_COUNT])
        flow = flow * part
        s[S_WETTED] = part
    if e[E_SPINUP_S] > 0.0:
        start = s[S_PUMP_END]
        turn, before = towards(0.0, start, late * dt, e[E_SPINUP_S])
        end, after = towards(flow, turn, (1.0 - late) * dt, e[E_SPINUP_S])
        s[S_PUMP] = (before + after) / dt
        # What runs out ends; what spins up begins as slowly in a short step.
        s[S_PUMP_END] = end if flow > 0.0 or end >= 1e-3 * p[P_FLOW_MAX] else 0.0
    else:
        s[S_PUMP] = (1.0 - late) * flow
        s[S_PUMP_END] = flow


@inlined
def electrify(s: Array, p: Array, e: Array, command: float, fed: bool, dt: float) -> None:
    """Current and resistance of one spring; effects of the driver act on a command only."""
    current = command
    if not fed:
        if e[E_GAIN] != 0.0:
            current = current * (1.0 + e[E_GAIN])
        if e[E_KNEE] > 0.0 and current > 0.0:
            over = e[E_KNEE] * math.pow(current / p[P_I_MAX], e[E_SHARPNESS])
            current = current * math.pow(1.0 + over, -1.0 / e[E_SHARPNESS])
        if e[E_LAG_S] > 0.0:
            current = current + (s[S_I] - current) * math.exp(-dt / e[E_LAG_S])
    s[S_I] = current
    if e[E_OHM_ALPHA] != 0.0 or e[E_OHM_BETA] != 0.0 or e[E_R_OHM] != 0.0:
        xi = s[S_XS] + s[S_XT]
        factor = 1.0 + e[E_OHM_ALPHA] * (s[S_T] - p[P_T_REF])
        factor += e[E_OHM_BETA] * (0.5 - xi) + e[E_R_OHM] * s[S_R]
        s[S_OHM] = p[P_OHM_M] * p[P_LENGTH] * factor


@inlined
def frozen(F: float, s: Array, w: Array, p: Array, e: Array) -> None:
    """Deflection of a spring at tension F with the fractions in scratch."""
    left = inelastic(F, w[W_XS], s, p, e)[0]
    w[W_DELTA] = F * compliance(w[W_XS] + w[W_XT], p, e) + left


@inlined
def from_deflection(delta: float, s: Array, w: Array, p: Array, e: Array) -> float:
    """Tension of a spring at a deflection with the fractions in scratch, Eq. (9); never below 0."""
    left = inelastic(s[S_F], w[W_XS], s, p, e)[0]
    F = (delta - left) / compliance(w[W_XS] + w[W_XT], p, e)
    w[W_DELTA] = delta
    return F if F > 0.0 else 0.0


@inlined
def slack_position(u: float, wx: Array, wy: Array, p: Array) -> float:
    """Where the encoder stands when the tendon is slack: where it was, between the spring ends."""
    low = p[P_DELTA_0] - wx[W_DELTA]
    high = wy[W_DELTA] - p[P_DELTA_0]
    if u < low:
        return float(low)
    if u > high:
        return float(high)
    return u


@compiled
def move_pair(
    x: Array,
    y: Array,
    g: Array,
    wx: Array,
    wy: Array,
    p: Array,
    e: Array,
    feeds: Array,
    u: float,
    dt: float,
) -> int:
    """Antagonistic pair: equilibrium, or both springs at a fed displacement u."""
    fed = feeds[F_TEMPERATURE] > 0.0
    if feeds[F_DISPLACEMENT] > 0.0:
        F_x = balance(p[P_DELTA_0] - u, x[S_F], x, g, wx, p, e)
        F_y = balance(p[P_DELTA_0] + u, y[S_F], y, g, wy, p, e)
    elif e[E_ROUGH] > 0.0:
        F_x, F_y, u = rough_pair(x[S_F] + dt * g[G_F_RATE], x, y, g, wx, wy, p, e, dt)
    else:
        F_x = balance_pair(g[G_F] + dt * g[G_F_RATE], x, y, g, wx, wy, p, e)
        F_y = F_x
        u = slack_position(u, wx, wy, p) if F_x == 0.0 else p[P_DELTA_0] - wx[W_DELTA]
    if F_x < 0.0 or F_y < 0.0:
        return NOT_CONVERGED
    accept(x, g, wx, p, e, F_x, F_x, fed, dt)
    accept(y, g, wy, p, e, F_y, F_y, fed, dt)
    finish(g, u, 0.5 * (F_x + F_y), dt)
    return OK


@compiled
def move_single(
    x: Array,
    y: Array,
    g: Array,
    wx: Array,
    wy: Array,
    p: Array,
    e: Array,
    feeds: Array,
    stage: float,
    dt: float,
) -> int:
    """Spring X held by the stage (stretch) or between walls (blocked); Y hangs free."""
    fed = feeds[F_TEMPERATURE] > 0.0
    delta = stage if p[P_FIXTURE] == 1.0 else p[P_DELTA_0] + stage
    F_x = balance(delta, g[G_F] + dt * g[G_F_RATE], x, g, wx, p, e)
    if F_x < 0.0 or not settle(0.0, True, y, wy, p, e):
        return NOT_CONVERGED
    F = F_x
    if e[E_ROUGH] > 0.0:
        speed = (stage - g[G_U]) / dt
        F += 0.5 * e[E_DRAG] * x[S_FILL] * speed + e[E_TUBE_K] * stage
        if abs(speed) > REST_SPEED:
            F += 0.5 * math.copysign(friction_level(F_x, speed, e), speed)
        F = max(F, 0.0)
    accept(x, g, wx, p, e, F_x, F_x, fed, dt)
    accept(y, g, wy, p, e, 0.0, 0.0, fed, dt)
    finish(g, stage, F, dt)
    return OK


@inlined
def resistance_to_motion(F: float, u: float, g: Array, e: Array, dt: float) -> float:
    """Force by which X must outpull Y at a displacement and its rate: effects of mechanics."""
    speed = (u - g[G_U]) / dt
    push = 2.0 * e[E_TUBE_K] * u + e[E_DRAG] * speed
    if abs(speed) > REST_SPEED:
        push += math.copysign(friction_level(F, speed, e), speed)
    return float(push)


@compiled
def move_fed(
    x: Array,
    y: Array,
    g: Array,
    wx: Array,
    wy: Array,
    p: Array,
    e: Array,
    feeds: Array,
    F: float,
    u: float,
    stage: float,
    dt: float,
) -> int:
    """Kinetics under a fed tension; tension or displacement then follow from Eq. (9)."""
    fed = feeds[F_TEMPERATURE] > 0.0
    pair = p[P_FIXTURE] == 0.0
    push = resistance_to_motion(F, u, g, e, dt) if e[E_ROUGH] > 0.0 else 0.0
    tension = F + 0.5 * push if F + 0.5 * push > 0.0 else 0.0
    other = F - 0.5 * push if pair and F - 0.5 * push > 0.0 else 0.0
    ok = settle(tension, True, x, wx, p, e)
    if not (settle(other, True, y, wy, p, e) and ok):
        return NOT_CONVERGED
    F_y = 0.0
    if not pair:
        delta = stage if p[P_FIXTURE] == 1.0 else p[P_DELTA_0] + stage
        F_x = from_deflection(delta, x, wx, p, e)
        frozen(0.0, y, wy, p, e)
        u = stage
        result = F_x
    elif feeds[F_DISPLACEMENT] > 0.0:
        F_x = from_deflection(p[P_DELTA_0] - u, x, wx, p, e)
        F_y = from_deflection(p[P_DELTA_0] + u, y, wy, p, e)
        result = 0.5 * (F_x + F_y)
    else:
        frozen(0.0, x, wx, p, e)
        frozen(0.0, y, wy, p, e)
        gap = 2.0 * p[P_DELTA_0] - wx[W_DELTA] - wy[W_DELTA]
        F_x = (gap + push * wy[W_GIVE]) / (wx[W_GIVE] + wy[W_GIVE])
        F_x = F_x if gap > 0.0 and F_x > 0.0 else 0.0
        F_y = F_x - push if F_x > push else 0.0
        frozen(F_x, x, wx, p, e)
        frozen(F_y, y, wy, p, e)
        u = slack_position(u, wx, wy, p) if F_x == 0.0 else p[P_DELTA_0] - wx[W_DELTA]
        result = 0.5 * (F_x + F_y)
    accept(x, g, wx, p, e, F_x, tension, fed, dt)
    accept(y, g, wy, p, e, F_y, other, fed, dt)
    finish(g, u, result, dt)
    return OK


@inlined
def finish(g: Array, u: float, F: float, dt: float) -> None:
    g[G_SPEED] = (u - g[G_U]) / dt
    g[G_U] = u
    g[G_F_RATE] = (F - g[G_F]) / dt
    g[G_F] = F


@inlined
def supply(
    s: Array,
    other: Array,
    w: Array,
    p: Array,
    e: Array,
    feeds: Array,
    drive: Array,
    side: int,
    dt: float,
) -> None:
    """Water and current that one spring gets in this substep."""
    s[S_FLOW] = s[S_PUMP]
    if e[E_LEAK] > 0.0:
        s[S_FLOW] += e[E_LEAK] * other[S_PUMP]
    water_inventory(s, p, e, drive[4 + side], dt)
    known = feeds[F_CURRENT] > 0.0
    electrify(s, p, e, feeds[F_CURRENT + 1 + side] if known else drive[side], known, dt)


@compiled
def warm(
    s: Array,
    other: Array,
    g: Array,
    w: Array,
    p: Array,
    e: Array,
    feeds: Array,
    table: Array,
    side: int,
    share: float,
    dt: float,
) -> None:
    """Heat balance of one spring over the substep, or its fed temperature."""
    fed = feeds[F_TEMPERATURE] > 0.0
    if not fed or e[E_FRONT] > 0.0:
        heat(s, other, g, w, p, e, table, dt)
    if e[E_FRONT] > 0.0:
        # A cell has its own latent heat for half the step, on average, and loses some of it.
        soft = 2.0 * w[W_LATENT] / (2.0 * w[W_CAP] + dt * (w[W_GW] + w[W_GD]))
        w[W_CELL_H] = p[P_ML_H] * soft
        w[W_CELL_C] = p[P_ML_C] * soft
    else:
        w[W_CELL_H] = 0.0 if fed else w[W_LAM_H]
        w[W_CELL_C] = 0.0 if fed else w[W_LAM_C]
    if fed:
        first = feeds[F_TEMPERATURE + 1 + side]
        w[W_T_STAR] = first + share * (feeds[F_TEMPERATURE + 3 + side] - first)
        w[W_LAM_H] = 0.0
        w[W_LAM_C] = 0.0
    prepare(s, w, p, e, dt)


@compiled
def substep(
    x: Array,
    y: Array,
    g: Array,
    wx: Array,
    wy: Array,
    p: Array,
    e: Array,
    feeds: Array,
    table: Array,
    drive: Array,
    share: float,
    dt: float,
) -> int:
    """One substep of both springs; `share` is how far into the sample its end is."""
    g[G_DRIFT] += e[E_DRIFT] * dt
    g[G_T_IN] = g[G_ENV_IN] + g[G_RESERVOIR]
    g[G_T_AIR] = g[G_ENV_AIR] + g[G_DRIFT]
    if feeds[F_SURROUNDINGS] > 0.0:
        g[G_T_IN] = feeds[F_SURROUNDINGS + 1]
        g[G_T_AIR] = feeds[F_SURROUNDINGS + 2]
    e_y = e[EFFECTS_SIZE:SIDES_SIZE]
    pump(x, p, e, drive[2], 1.0, dt)
    pump(y, p, e_y, drive[3], -1.0, dt)
    supply(x, y, wx, p, e, feeds, drive, 0, dt)
    supply(y, x, wy, p, e_y, feeds, drive, 1, dt)
    warm(x, y, g, wx, p, e, feeds, table, 0, share, dt)
    warm(y, x, g, wy, p, e, feeds, table, 1, share, dt)
    g[G_TIME] += dt
    u = g[G_U]
    if feeds[F_DISPLACEMENT] > 0.0:
        u = feeds[F_DISPLACEMENT + 1]
        u += share * (feeds[F_DISPLACEMENT + 2] - feeds[F_DISPLACEMENT + 1])
    if feeds[F_FORCE] > 0.0:
        F = feeds[F_FORCE + 1] + share * (feeds[F_FORCE + 2] - feeds[F_FORCE + 1])
        F = F if F > 0.0 else 0.0
        return move_fed(x, y, g, wx, wy, p, e, feeds, F, u, drive[6], dt)
    if p[P_FIXTURE] == 0.0:
        return move_pair(x, y, g, wx, wy, p, e, feeds, u, dt)
    return move_single(x, y, g, wx, wy, p, e, feeds, drive[6], dt)


@inlined
def recall(ring: Array, samples: float, column: int, when: float) -> float:
    """A channel of the history at a time, linear between samples; the oldest one before them."""
    newest = int(samples) - 1
    oldest = newest - RING_ROWS + 1
    oldest = max(oldest, 0)
    n = newest
    while n > oldest and ring[n % RING_ROWS, 0] > when:
        n -= 1
    here = n % RING_ROWS
    if n == newest or ring[here, 0] >= when:
        return float(ring[here, column])
    then = (n + 1) % RING_ROWS
    part = (when - ring[here, 0]) / (ring[then, 0] - ring[here, 0])
    return float(ring[here, column] + part * (ring[then, column] - ring[here, column]))


@inlined
def sense_late(g: Array, e: Array, ring: Array) -> None:
    """Effects channel_delay and clock_skew: read temperature, displacement and force late."""
    n = int(g[G_SAMPLES])
    now = g[G_TIME]
    row = n % RING_ROWS
    ring[row, 0] = now
    ring[row, 1] = g[G_M_RTD]
    ring[row, 2] = g[G_M_RTD + 1]
    ring[row, 3] = g[G_M_U]
    ring[row, 4] = g[G_M_F]
    when = now - e[E_SKEW_PPM] * 1e-6 * now
    g[G_M_RTD] = recall(ring, n + 1, 1, when - e[E_DELAY_T])
    g[G_M_RTD + 1] = recall(ring, n + 1, 2, when - e[E_DELAY_T])
    g[G_M_U] = recall(ring, n + 1, 3, when - e[E_DELAY_U])
    g[G_M_F] = recall(ring, n + 1, 4, when - e[E_DELAY_F])


@inlined
def sense_spring(s: Array, g: Array, p: Array, e: Array, side: int, dt: float) -> None:
    """Current, voltage and temperature of one spring as its sensors give them."""
    g[G_M_I + side] = s[S_I] + e[E_I_OFFSET]
    g[G_M_V + side] = s[S_I] * (s[S_OHM] + e[E_CONTACT_OHM])
    T = s[S_T]
    if e[E_FRONT] > 0.0:
        T += e[E_FRONT] * at_place(s, e[E_PLACE])
    if e[E_RTD_STEM] != 0.0:
        T -= e[E_RTD_STEM] * (T - g[G_T_AIR])
    T += e[E_RTD_OFFSET]
    if e[E_RTD_LAG_S] > 0.0:
        seen = T
        if dt > 0.0:
            # Of what changes evenly over the sample.
            kept = math.exp(-dt / e[E_RTD_LAG_S])
            behind = (T - g[G_SEEN_X + side]) * e[E_RTD_LAG_S] / dt * (1.0 - kept)
            T = T - behind + (g[G_LAG_X + side] - g[G_SEEN_X + side]) * kept
        g[G_SEEN_X + side] = seen
        g[G_LAG_X + side] = T
    g[G_M_RTD + side] = T


@compiled
def sense(x: Array, y: Array, g: Array, p: Array, e: Array, ring: Array, dt: float) -> None:
    """What the sensors give at the end of a sample that lasted dt; dt = 0 before the first."""
    sense_spring(x, g, p, e, 0, dt)
    sense_spring(y, g, p, e[EFFECTS_SIZE:SIDES_SIZE], 1, dt)
    # Not what is fed: these are what the plant itself would show.
    g[G_M_RTD + 2] = g[G_ENV_IN] + g[G_RESERVOIR]
    g[G_M_RTD + 3] = g[G_ENV_AIR] + g[G_DRIFT]
    u = g[G_U]
    if e[E_SLIP] != 0.0:
        if u > g[G_SEEN_U]:
            g[G_SLIP] -= e[E_SLIP] * (u - g[G_SEEN_U])
        g[G_SEEN_U] = u
        u += g[G_SLIP]
    if e[E_BACKLASH] > 0.0:
        half = 0.5 * e[E_BACKLASH]
        if g[G_PLAY] < u - half:
            g[G_PLAY] = u - half
        elif g[G_PLAY] > u + half:
            g[G_PLAY] = u + half
        u = g[G_PLAY]
    g[G_M_U] = u
    # The tension of the tendon is the mean of what pulls on both springs.
    F = g[G_F]
    if e[E_READS_X] != 0.0 and p[P_FIXTURE] == 0.0:
        F += e[E_READS_X] * (x[S_F] - y[S_F])
    if e[E_CREEP] != 0.0:
        if dt > 0.0:
            g[G_CREEP] = F + (g[G_CREEP] - F) * math.exp(-dt / e[E_CREEP_S])
        else:
            g[G_CREEP] = F
        F += e[E_CREEP] * (g[G_CREEP] - p[P_F0])
    if e[E_F_GAIN] != 0.0:
        F = F * (1.0 + e[E_F_GAIN])
    g[G_M_F] = F + e[E_F_OFFSET]
    if e[E_LATE] > 0.0:
        sense_late(g, e, ring)
    g[G_SAMPLES] += 1.0


@compiled
def advance(
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    feeds: Array,
    ring: Array,
    table: Array,
    drive: Array,
    dt: float,
    steps: int,
) -> int:
    """Advance the state by one sample of `steps` substeps of `dt`. Returns a status.

    drive: currents x, y (A); pump duties x, y; drain x, y (0 or 1); stage (m).
    """
    x = s[0:S_SIZE]
    y = s[S_SIZE:SHARED]
    g = s[SHARED:STATE_SIZE]
    wx = w[0:W_SIZE]
    wy = w[W_SIZE:SCRATCH_SIZE]
    for k in range(steps):
        share = (k + 1.0) / steps
        status = substep(x, y, g, wx, wy, p, e, feeds, table, drive, share, dt)
        if status != OK:
            return status
    sense(x, y, g, p, e, ring, dt * steps)
    seen = g[G_M_RTD] + g[G_M_RTD + 1] + g[G_F] + g[G_U]
    if not math.isfinite(x[S_T] + y[S_T] + x[S_TW] + y[S_TW] + seen):
        return NOT_FINITE
    return OK


@compiled
def wake(s: Array, p: Array, e: Array, ring: Array) -> None:
    """The sensors' first sample, before anything has been advanced."""
    g = s[SHARED:STATE_SIZE]
    g[G_T_IN] = g[G_ENV_IN]
    g[G_T_AIR] = g[G_ENV_AIR]
    sense(s[0:S_SIZE], s[S_SIZE:SHARED], g, p, e, ring, 0.0)


@compiled
def replay(
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    feeds: Array,
    ring: Array,
    flags: Array,
    rows: Array,
    table: Array,
    drives: Array,
    env: Array,
    times: Array,
    dt_max: float,
    slots: Slots,
    out: Array,
) -> tuple[int, int]:
    """Advance through recorded samples; row k of `drives` is in force up to times[k].

    flags (5,) and rows (n, 8): which signals are fed, and i_x, i_y, T_x, T_y, F, u, inlet and
    ambient. env (n, 2):
    inlet and ambient, K. out (n, len(slots)): those slots of the state after each sample.
    Returns (status, row it stopped at).
    """
    n = times.shape[0]
    for k in range(n):
        s[SHARED + G_ENV_IN] = env[k, 0]
        s[SHARED + G_ENV_AIR] = env[k, 1]
        if k == 0:
            wake(s, p, e, ring)
        else:
            span = times[k] - times[k - 1]
            steps = max(math.ceil(span / dt_max - 1e-9), 1)
            load_feeds(feeds, flags, rows, k)
            status = advance(s, w, p, e, feeds, ring, table, drives[k], span / steps, steps)
            if status != OK:
                return status, k
        for j in range(slots.shape[0]):
            out[k, j] = s[slots[j]]
    return OK, n


@compiled
def drive(
    s: Array, p: Array, e: Array, drives: Array, times: Array, dt_max: float, out: Array
) -> None:
    """The drivers alone, as in `replay`: nothing else of the plant acts on a current.

    out (n, 4): currents of x and y as they are measured, then as they are, after each sample.
    """
    x = s[0:S_SIZE]
    y = s[S_SIZE:SHARED]
    e_y = e[EFFECTS_SIZE:SIDES_SIZE]
    for k in range(times.shape[0]):
        if k > 0:
            span = times[k] - times[k - 1]
            steps = max(math.ceil(span / dt_max - 1e-9), 1)
            for _ in range(steps):
                electrify(x, p, e, drives[k, 0], False, span / steps)
                electrify(y, p, e_y, drives[k, 1], False, span / steps)
        out[k, 0] = x[S_I] + e[E_I_OFFSET]
        out[k, 1] = y[S_I] + e_y[E_I_OFFSET]
        out[k, 2] = x[S_I]
        out[k, 3] = y[S_I]


@inlined
def load_feeds(feeds: Array, flags: Array, rows: Array, k: int) -> None:
    """Feeds of the sample that ends at row k. Rows: i_x, i_y, T_x, T_y, F, u, inlet, ambient."""
    feeds[F_CURRENT] = flags[0]
    feeds[F_CURRENT + 1] = rows[k, 0]
    feeds[F_CURRENT + 2] = rows[k, 1]
    feeds[F_TEMPERATURE] = flags[1]
    feeds[F_TEMPERATURE + 1] = rows[k - 1, 2]
    feeds[F_TEMPERATURE + 2] = rows[k - 1, 3]
    feeds[F_TEMPERATURE + 3] = rows[k, 2]
    feeds[F_TEMPERATURE + 4] = rows[k, 3]
    feeds[F_FORCE] = flags[2]
    feeds[F_FORCE + 1] = rows[k - 1, 4]
    feeds[F_FORCE + 2] = rows[k, 4]
    feeds[F_DISPLACEMENT] = flags[3]
    feeds[F_DISPLACEMENT + 1] = rows[k - 1, 5]
    feeds[F_DISPLACEMENT + 2] = rows[k, 5]
    feeds[F_SURROUNDINGS] = flags[4]
    feeds[F_SURROUNDINGS + 1] = rows[k, 6]
    feeds[F_SURROUNDINGS + 2] = rows[k, 7]
