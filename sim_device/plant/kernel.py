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
S_HOT = 9  # unified_kinetics: where heating turned (progress, martensite), and the turn before
S_COLD = 13  # where cooling turned (progress, austenite), and the turn before
S_DELTA = 17  # deflection of the spring, m
S_RATE = 18  # last rate of S_T, K/s
S_RATE_W = 19  # last rate of S_TW, K/s
S_ACTIVE = 20  # 1 while the fractions change
S_I = 21  # current, A
S_OHM = 22  # resistance of the spring, Ohm
S_FLOW = 23  # water flow, m3/s
S_WORK_Q = 24  # transformation work not yet in the heat balance, J/m
S_IN_J = 25  # electrical heat taken in, J
S_WATER_J = 26  # heat carried off by the water, J
S_AIR_J = 27  # heat lost to the air, J
S_UNEQUAL_J = 28  # heat that unequal capacities and latent heats have made, J
S_WORK_J = 29  # mechanical work done on the spring, J
S_OMITTED_J = 30  # transformation work that the heat balance leaves out, J
S_CYCLES = 31  # transformation cycles so far: half the sum of |Δξ|
S_FILL = 32  # share of the tube that holds water
S_F = 33  # tension of the spring, N
S_PUMP = 34  # flow of the pump before leaks, m3/s
S_PUMP_ON_S = 35  # time since the pump was switched on, s
S_PUMP_COUNT = 36  # times the pump was switched on
S_WETTED = 37  # share of the wire that flowing water touches
S_T_WALL = 38  # tube wall temperature, K
S_XS_END = 39  # detwinned fraction of the cold ends
S_R = 40  # R-phase fraction
S_R_PROGRESS = 41  # its progress on cooling
S_ELASTIC = 42  # elastic energy, J
S_TAU = 43  # shear stress that the kinetics last saw, Pa
# How far cells along the tube are from the mean, from the inlet on, K: wire, then water.
CELLS = 5
S_CELL = 44
S_CELL_W = S_CELL + CELLS
# What the kinetics remember (S_XS to S_XI_LEG), once more for each cell.
S_KINETICS = 15
S_CELLS = S_CELL_W + CELLS
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
# What the sensors give at the last sample, without noise.
G_M = 20
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
# is the plant without any. The first three are switches that the host sets from the others.
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
EFFECTS_SIZE = 61
# unified_kinetics: behind the slots lie its two outer curves, for heating and for cooling, as value
# and slope (per cell) at even steps of the progress from PROGRESS_LOW on. See `lay_curves`.
CURVE_CELLS_PER_UNIT = 128
CURVE_SIZE = 2 * (3 * CURVE_CELLS_PER_UNIT + 1)
E_HEATING = EFFECTS_SIZE
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
W_T = 13
W_DELTA = 14
W_SLOPE = 15  # d delta / d F
W_CAP = 16
W_RW = 17  # water: middle = (RW + GW * middle of the wire) * DW_INV
W_DW_INV = 18
W_GW = 19
W_GD = 20
W_POWER = 21
W_GF = 22
W_UA = 23
W_T_F = 24  # d T / d F
W_LATENT = 25  # factor on the latent heat
W_SHIFT = 26  # drift of the transformation temperatures, K
W_WALL_G = 27
W_GIVE = 28  # compliance
W_ROUGH = 29  # step of temperature still to be taken, K
W_LEAVES = 30  # how much warmer than the mean the water leaves, K
W_CELL_H = 31  # W_LAM_H and W_LAM_C of the cells, where the mean's are fed
W_CELL_C = 32
W_WARMER = 33  # mean of the water over the inlet, K
# unified_kinetics, in the same places: the outer curve at the furthest progress of heating and at
# its two turns, then of cooling, negative until needed.
W_OUTER_HOT = W_FA
W_OUTER_COLD = W_HOT
# W_FA to W_XT once more for each cell.
W_KINETICS = 9
W_CELLS = 34
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
# R-phase: starts this far above M_S, is complete over the width, reverts with the hysteresis, K.
R_ABOVE, R_WIDTH, R_HYSTERESIS = 8.0, 6.0, 2.0
EXPONENT_REF_K = 10.0
# unified_kinetics: how far its curves go beyond 0 and 1, the logistic curve as steep in the middle
# as the cosine, what keeps ratios finite, and the smallest way back that counts as a turn.
PROGRESS_LOW, PROGRESS_HIGH = -1.0, 2.0
TAIL_RATE = 2.0 * math.pi
LEAST_LEFT = 1e-9
LEAST_TURN = 0.01
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
    cell = min(cell, 3 * CURVE_CELLS_PER_UNIT - 1)
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
    through the points where such legs turned before (from slot `turned` on). Effect minor_loop:
    `kappa` as in `minor`, the share that had not transformed when this leg began being in slot
    `other`; and a share of it rests until the outer curve itself is reached. The outer curve at
    the start and at the turns rests within a substep and is kept in `w` from slot `memory` on.
    """
    begin = outer_before(s[far], w, memory, curve, e)
    now_left, now_slope = outer(now, curve, e)
    start = x
    left = 0.0
    slope = 0.0
    arrived = False
    for level in range(2):
        point = s[turned + 2 * level]
        value = s[turned + 2 * level + 1]
        if not arrived and s[far] < point < PROGRESS_HIGH and x > value:
            target = outer_before(point, w, memory + 1 + level, curve, e)
            if begin > target:
                if now < point:
                    share = (x - value) / (begin - target)
                    left = value + share * (now_left - target)
                    slope = share * now_slope
                    arrived = True
                else:
                    x = value
                    begin = target
    if not arrived:
        left = x * now_left / begin
        slope = x * now_slope / begin
    if e[E_MINOR] != 0.0 and left > 0.0 and s[other] < PROGRESS_HIGH:
        exponent, raised = minor(left / start, s[other + 1], e)
        slope = slope * exponent * raised * start / left
        left = raised * start
    left += e[E_MEMORY] * (start - left)
    slope -= e[E_MEMORY] * slope
    if now_left < left:
        return now_left, now_slope
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
    hot: float,
    cold: float,
    turned: float,
    turned_F: float,
    s: Array,
    w: Array,
    p: Array,
    e: Array,
    o: int,
    q: int,
) -> tuple[float, float, float, float, float, float]:
    """As `transform`, by effect unified_kinetics.

    Stress shifts both transformations along their own lines, to begin at `hot` and at `cold`; what
    forms is turned, and what is there is turned further, to the share `turned`.
    """
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
    s[at + 2] = s[at]
    s[at + 3] = s[at + 1]
    s[at] = progress
    s[at + 1] = left


@inlined
def drop_turn(s: Array, at: int) -> None:
    s[at] = s[at + 2]
    s[at + 1] = s[at + 3]
    s[at + 2] = PROGRESS_HIGH
    s[at + 3] = 0.0


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
    from there, so that a small way back and forth again changes nothing. `end` is what was left at
    the furthest point: only a rise of some size above it is a turn, which is kept in `turned`.
    """
    if progress > s[far]:
        s[far] = progress
        s[returning] = back
    elif back > s[returning]:
        s[returning] = back
    if x > end + LEAST_TURN:
        keep_turn(s, turned, s[far], end)
        s[far] = progress
        return True
    for _ in range(2):
        if s[turned] < PROGRESS_HIGH and (s[far] >= s[turned] or x <= s[turned + 1]):
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
def cell_at(i: int, cells: int, s: Array, e: Array) -> tuple[int, int, float]:
    """How far beyond the spring's own the memory of part `i` lies, in `s` and in `w`.

    The last value is how many kelvin the part is from the mean.
    """
    if cells == 1:
        return 0, 0, 0.0
    o = S_CELLS + i * S_KINETICS - S_XS
    q = W_CELLS + i * W_KINETICS - W_FA
    return o, q, e[E_FRONT] * s[S_CELL + i]


@inlined
def transform_all(
    T: float, F: float, s: Array, w: Array, p: Array, e: Array
) -> tuple[float, float, float, float, float, float]:
    """`transform` for the whole spring, or the mean of its cells, each at its own temperature.

    Leaves the fractions of the cells in the scratch.
    """
    cells = cells_of(e)
    hot = cold = turned = turned_F = 0.0
    if e[E_UNIFIED] > 0.0:
        hot, cold = starts(p[P_C1] * F, p)
        turned, turned_F = turned_by(p[P_C1] * F, p)
    xs = xt = xi_T = xi_F = xs_T = xs_F = 0.0
    for i in range(cells):
        o, q, off = cell_at(i, cells, s, e)
        if e[E_UNIFIED] > 0.0:
            own = unified(T + off, hot, cold, turned, turned_F, s, w, p, e, o, q)
        else:
            own = transform(T + off, F, s, w, p, e, o, q)
        w[W_XS + q] = own[0]
        w[W_XT + q] = own[1]
        xs += own[0]
        xt += own[1]
        xi_T += own[2]
        xi_F += own[3]
        xs_T += own[4]
        xs_F += own[5]
    part = 1.0 / cells
    return xs * part, xt * part, xi_T * part, xi_F * part, xs_T * part, xs_F * part


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
    """One spring at tension F: temperature, fractions, deflection and compliance, into scratch.

    The temperature solves T = T* + λ (ξ(T, F) − ξ_old), which has one root: ξ falls with T.
    Exact: that root, held in a bracket; returns False when it is not found. Otherwise one step of
    Newton from the guess, with the deflection extrapolated along it and the size of the step left
    in W_ROUGH, so that temperature and force can converge together.
    """
    start = s[S_XS] + s[S_XT]
    star = w[W_T_STAR]
    low = star - w[W_LAM_H]
    high = star + w[W_LAM_C]
    T = w[W_GUESS]
    if not low <= T <= high:
        T = star
    found = False
    rough = 0.0
    for n in range(ITERATIONS):
        xs, xt, xi_T, xi_F, xs_T, xs_F = transform_all(T, F, s, w, p, e)
        change = xs + xt - start
        lam = w[W_LAM_H] if change < 0.0 else w[W_LAM_C]
        miss = T - star - lam * change
        slope = 1.0 - lam * xi_T
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            found = True
            break
        if not exact:
            rough = -miss / slope
            found = True
            break
        if miss > 0.0:
            high = T
        else:
            low = T
        T = T - miss / slope
        if n >= NEWTON_STEPS or not low < T < high:
            T = 0.5 * (low + high)
    w[W_ROUGH] = rough
    w[W_T] = star + lam * change
    w[W_GUESS] = T + rough
    w[W_XS] = xs
    w[W_XT] = xt
    T_F = 0.0
    if change != 0.0:
        T_F = lam * xi_F / slope
    w[W_T_F] = T_F
    give = compliance(xs + xt, p, e)
    w[W_GIVE] = give
    soft = p[P_K_A] - p[P_K_M]
    plain = give
    weight = 1.0
    if e[E_COLD_ENDS] > 0.0:
        weight = 1.0 - e[E_COLD_ENDS]
        plain = 1.0 / (p[P_K_A] - soft * (xs + xt))
    left, left_S, left_F = inelastic(F, xs, s, p, e)
    softer = F * soft * weight * plain * plain
    w[W_DELTA] = F * give + left + rough * (softer * xi_T + left_S * xs_T)
    w[W_SLOPE] = give + softer * (xi_F + xi_T * T_F) + left_S * (xs_F + xs_T * T_F) + left_F
    return found


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
        found = settle(F, exact, x, wx, p, e)
        found = settle(F, exact, y, wy, p, e) and found
        g[G_ITERATIONS] += 1.0
        if not found:
            return -1.0
        miss = wx[W_DELTA] + wy[W_DELTA] - 2.0 * p[P_DELTA_0]
        settled = wx[W_ROUGH] == 0.0 and wy[W_ROUGH] == 0.0
        if settled and (abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low)):
            return F
        if miss > 0.0 and F == 0.0 and settled:
            return 0.0
        if exact:
            if miss > 0.0:
                high = F
            else:
                low = F
        last = F
        F = narrow(F, miss, wx[W_SLOPE] + wy[W_SLOPE], low, high, n)
        wx[W_GUESS] += (F - last) * wx[W_T_F]
        wy[W_GUESS] += (F - last) * wy[W_T_F]
    return -1.0


@inlined
def balance(target: float, guess: float, s: Array, g: Array, w: Array, p: Array, e: Array) -> float:
    """The tension at which one spring, with its half of the tendon, has the deflection `target`.

    As `balance_pair`: one root, zero when the spring is slack, -1 when it is not found.
    """
    low = 0.0
    high = 1e300
    F = guess if guess > 0.0 else 0.0
    gives = e[E_ROUGH] > 0.0 and p[P_FIXTURE] == 0.0
    for n in range(ITERATIONS):
        found = settle(F, True, s, w, p, e)
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
        if abs(miss) <= DELTA_TOLERANCE or high - low <= 1e-13 * (1.0 + low):
            return F
        if miss > 0.0:
            if F == 0.0:
                return 0.0
            high = F
        else:
            low = F
        last = F
        F = narrow(F, miss, slope, low, high, n)
        w[W_GUESS] += (F - last) * w[W_T_F]
    return -1.0


@inlined
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


@inlined
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
def steeper(difference: float, e: Array) -> float:
    """Effect convection_exponent: factor on a film coefficient at a temperature difference."""
    size = abs(difference) / EXPONENT_REF_K
    return math.pow(size if size > 0.01 else 0.01, e[E_EXPONENT])


@inlined
def taken_up(conductance: float, capacity: float, dt: float) -> float:
    """Mean conductance over dt to a body that comes towards the temperature beside it.

    So that the body, however small, ends where the exponential of its time constant leads, and not
    beyond.
    """
    return float(capacity / dt * (1.0 - math.exp(-dt * conductance / capacity)))


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
            g_water = g_water * steeper(middle - surround, e)
    else:
        surround = T_air
        g_dry = bare(middle, T_air, p)
        if e[E_EXPONENT] != 0.0:
            g_dry = g_dry * steeper(middle - T_air, e)
    net = power + gain - g_dry * (T - T_air) - g_water * (T - (T_water if warms else T_in))
    capacity = p[P_MC_H] if net >= 0.0 else p[P_MC_C]
    inertia = 2.0 * capacity * per_dt
    stiff = inertia + g_water + g_dry
    right = inertia * T + power + gain + g_dry * T_air
    w[W_DW_INV] = 0.0
    if warms:
        inertia = 2.0 * fill * p[P_SHARE] * p[P_CW] * per_dt
        g_flow = flow * p[P_FLOW_G]
        ua = fill * p[P_UA]
        d_water = inertia + g_water + g_flow + ua
        r_water = inertia * T_water + g_flow * T_in + ua * T_air
        w[W_LEAVES] = e[E_FRONT] * s[S_CELL_W + CELLS - 1]
        r_water -= g_flow * w[W_LEAVES]
        w[W_WALL_G] = 0.0
        if e[E_WALL] > 0.0:
            w[W_WALL_G] = taken_up(fill * e[E_WALL_G], e[E_WALL] * p[P_CW], dt)
            d_water += w[W_WALL_G]
            r_water += w[W_WALL_G] * s[S_T_WALL]
        per_d = 1.0 / d_water
        stiff -= g_water * g_water * per_d
        right += g_water * r_water * per_d
        w[W_DW_INV] = per_d
        w[W_RW] = r_water
        w[W_GF] = g_flow
        w[W_UA] = ua
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
    w[W_CAP] = capacity
    w[W_GW] = g_water
    w[W_GD] = g_dry
    w[W_POWER] = power


@inlined
def prepare(s: Array, w: Array, p: Array, e: Array, dt: float) -> None:
    """What `transform` and `settle` need of the start of the substep."""
    w[W_SHIFT] = e[E_SHIFT] * s[S_CYCLES]
    w[W_GUESS] = w[W_T_STAR]
    if s[S_ACTIVE] > 0.0:
        w[W_GUESS] = s[S_T] + dt * s[S_RATE]
    cells = cells_of(e)
    for i in range(cells):
        o, q, off = cell_at(i, cells, s, e)
        w[W_FA + q] = -1.0
        w[W_FB + q] = -1.0
        w[W_FC + q] = -1.0
        if e[E_UNIFIED] > 0.0:
            for turn in range(3):
                w[W_OUTER_COLD + turn + q] = -1.0
            continue
        start = s[S_T] + off - w[W_SHIFT] - p[P_M_S]
        end = w[W_GUESS] + off - w[W_SHIFT] - p[P_M_S]
        w[W_HOT + q] = 1.0 if start > 0.0 else 0.0
        w[W_PART + q] = 0.0
        if start * end < 0.0:
            w[W_PART + q] = start / (start - end)
        if e[E_MINOR] != 0.0:
            xi = s[S_XS + o] + s[S_XT + o]
            w[W_XI_BACK + q] = s[S_XI_LEG + o] if s[S_LEG + o] < 0.0 else xi
            w[W_XI_FORTH + q] = s[S_XI_LEG + o] if s[S_LEG + o] > 0.0 else xi


@inlined
def move_front(s: Array, w: Array, p: Array, dt: float) -> None:
    """Effect cooling_front: how far wire and water of each cell are from the means.

    The cells are stirred tanks in a row; their means are what `heat` has solved, so that only the
    deviations are stepped (implicit Euler, cell by cell downstream) and centred again.
    """
    flow = w[W_GF]
    capacity = w[W_CAP] / dt
    wire = 1.0 / (capacity + w[W_GW] + w[W_GD])
    inertia = s[S_FILL] * p[P_SHARE] * p[P_CW] / dt
    water = inertia + w[W_GW] + w[W_UA] + w[W_WALL_G] + CELLS * flow - w[W_GW] * w[W_GW] * wire
    warmer = w[W_WARMER]
    leaving = flow * (warmer + s[S_CELL_W + CELLS - 1])
    upstream = -warmer
    mean = 0.0
    mean_water = 0.0
    for i in range(CELLS):
        right = inertia * s[S_CELL_W + i] + w[W_GW] * wire * capacity * s[S_CELL + i]
        right += leaving + CELLS * flow * upstream
        upstream = right / water
        s[S_CELL_W + i] = upstream
        s[S_CELL + i] = (capacity * s[S_CELL + i] + w[W_GW] * upstream) * wire
        mean += s[S_CELL + i]
        mean_water += upstream
    for i in range(CELLS):
        s[S_CELL + i] -= mean / CELLS
        s[S_CELL_W + i] -= mean_water / CELLS


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
        w[W_WARMER] = middle_water - g[G_T_IN]
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
def r_phase(T: float, xi_old: float, xi: float, s: Array, p: Array) -> None:
    """Effect r_phase: austenite becomes R-phase on cooling, and back with a small hysteresis."""
    start = p[P_M_S] + R_ABOVE
    austenite = 1.0 - xi
    share = s[S_R] / (1.0 - xi_old) if xi_old < 1.0 else 0.0
    progress = clip01((start - T) / R_WIDTH)
    if xi < xi_old:
        # Austenite that heating has just made holds no R-phase.
        share = s[S_R] / austenite if austenite > 0.0 else 0.0
    if progress > s[S_R_PROGRESS]:
        ratio = remaining(progress) / remaining(s[S_R_PROGRESS])
        share = 1.0 - (1.0 - share) * ratio
    top = 1.0 - remaining((start + R_HYSTERESIS - T) / R_WIDTH)
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
        r_phase(s[S_T], xi_old, xi, s, p)


@inlined
def remember(s: Array, w: Array, p: Array, e: Array, change: float, F_phase: float) -> None:
    """Progress and legs of the spring or of its cells, and what their latent heat does to them.

    At the temperature of the last evaluation, so that progress and fractions belong together.
    """
    tau = p[P_C1] * F_phase
    cells = cells_of(e)
    for i in range(cells):
        o, q, off = cell_at(i, cells, s, e)
        xi_old = s[S_XS + o] + s[S_XT + o]
        own = w[W_XS + q] + w[W_XT + q] - xi_old
        s[S_XS + o] = w[W_XS + q]
        s[S_XT + o] = w[W_XT + q]
        s[S_CELL + i] += (w[W_CELL_H] if own < 0.0 else w[W_CELL_C]) * (own - change)
        T = w[W_GUESS] + off - w[W_SHIFT]
        if e[E_UNIFIED] > 0.0:
            hot, cold = starts(tau, p)
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


@inlined
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
    remember(s, w, p, e, change, F_phase)
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
    if e[E_FRONT] > 0.0 and w[W_DW_INV] > 0.0:
        move_front(s, w, p, dt)


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
def pump(s: Array, p: Array, e: Array, duty: float, sign: float, dt: float) -> None:
    """Flow of one pump before leaks: linear in the duty, and what effects do to it."""
    if duty > 0.0:
        if s[S_PUMP_ON_S] <= 0.0:
            s[S_PUMP_COUNT] += 1.0
        s[S_PUMP_ON_S] += dt
    else:
        s[S_PUMP_ON_S] = 0.0
    flow = p[P_FLOW_MAX] * duty * p[P_WET]
    if e[E_DEAD_S] > 0.0 and s[S_PUMP_ON_S] <= e[E_DEAD_S]:
        flow = 0.0
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
        asked = flow
        flow = asked + (s[S_PUMP] - asked) * math.exp(-dt / e[E_SPINUP_S])
        # What runs out ends; what spins up begins as slowly in a short step.
        if asked == 0.0 and flow < 1e-3 * p[P_FLOW_MAX]:
            flow = 0.0
    s[S_PUMP] = flow


@inlined
def electrify(s: Array, p: Array, e: Array, command: float, fed: bool, dt: float) -> None:
    """Current and resistance of one spring; effects of the driver act on a command only."""
    current = command
    if not fed:
        if e[E_GAIN] != 0.0:
            current = current * (1.0 + e[E_GAIN])
        if e[E_DEFICIT] > 0.0:
            top = (1.0 - e[E_DEFICIT]) * p[P_I_MAX]
            current = min(current, top)
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


@inlined
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


@inlined
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


@inlined
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


@inlined
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
    w[W_CELL_H] = w[W_LAM_H]
    w[W_CELL_C] = w[W_LAM_C]
    if fed:
        first = feeds[F_TEMPERATURE + 1 + side]
        w[W_T_STAR] = first + share * (feeds[F_TEMPERATURE + 3 + side] - first)
        w[W_LAM_H] = 0.0
        w[W_LAM_C] = 0.0
    prepare(s, w, p, e, dt)


@inlined
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
    pump(x, p, e, drive[2], 1.0, dt)
    pump(y, p, e, drive[3], -1.0, dt)
    supply(x, y, wx, p, e, feeds, drive, 0, dt)
    supply(y, x, wy, p, e, feeds, drive, 1, dt)
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
        if dt > 0.0:
            T = T + (g[G_LAG_X + side] - T) * math.exp(-dt / e[E_RTD_LAG_S])
        g[G_LAG_X + side] = T
    g[G_M_RTD + side] = T


@inlined
def sense(x: Array, y: Array, g: Array, p: Array, e: Array, ring: Array, dt: float) -> None:
    """What the sensors give at the end of a sample that lasted dt; dt = 0 before the first."""
    sense_spring(x, g, p, e, 0, dt)
    sense_spring(y, g, p, e, 1, dt)
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
    F = g[G_F]
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
