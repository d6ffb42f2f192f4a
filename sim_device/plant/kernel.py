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

import math

import numpy as np
from numba import njit

# Slots of one spring's state. X starts at 0, Y at S_SIZE.
S_T = 0  # wire temperature, K
S_TW = 1  # temperature of the water in the tube, K
S_XS = 2  # detwinned martensite fraction
S_XT = 3  # twinned martensite fraction
S_A = 4  # progress of the reverse transformation, 0 to 1, Eq. (11)
S_B = 5  # progress of detwinning and of stress-induced martensite, Eqs (12), (13)
S_C = 6  # progress of twinned martensite on cooling, Eq. (12c)
S_FILL = 7  # share of the tube that holds water
S_F = 8  # tension of the spring, N
S_DELTA = 9  # deflection of the spring, m
S_RATE = 10  # last rate of S_T, K/s
S_RATE_W = 11  # last rate of S_TW, K/s
S_ACTIVE = 12  # 1 while the fractions change
S_I = 13  # current, A
S_OHM = 14  # resistance of the spring, Ohm
S_FLOW = 15  # water flow, m3/s
S_WORK_Q = 16  # transformation work not yet in the heat balance, J/m
S_IN_J = 17  # electrical heat taken in, J
S_WATER_J = 18  # heat carried off by the water, J
S_AIR_J = 19  # heat lost to the air, J
S_UNEQUAL_J = 20  # heat that unequal capacities and latent heats have made, J
S_WORK_J = 21  # mechanical work done on the spring, J
S_OMITTED_J = 22  # transformation work that the heat balance leaves out, J
S_SIZE = 40

# Slots of the shared state.
G = 2 * S_SIZE
G_TIME = G + 0  # s
G_U = G + 1  # displacement, m, positive when X contracts
G_F = G + 2  # tension of the tendon, N
G_F_RATE = G + 3  # last rate of the tension, N/s
G_T_IN = G + 4  # water at the inlet, K
G_T_AIR = G + 5  # ambient, K
G_ITERATIONS = G + 6  # evaluations of the equilibrium so far
STATE_SIZE = G + 40

# Slots of the constants made from a parameter set (see constants.py).
P_C1 = 0  # Pa/N
P_K_M = 1  # N/m
P_K_A = 2
P_DELTA_L = 3
P_A_S = 4
P_A_INV = 5  # 1/(A_F - A_S)
P_C_A = 6
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
CONSTANTS_SIZE = 48

# Scratch of one substep: W of X starts at 0, of Y at W_SIZE.
W_T_STAR = 0  # end temperature if no fraction changed
W_LAM_H = 1  # kelvin per unit of fraction, reverse transformation
W_LAM_C = 2
W_FA = 3
W_FB = 4
W_FC = 5
W_HOT = 6
W_GUESS = 7
W_T = 8
W_XS = 9
W_XT = 10
W_DELTA = 11
W_SLOPE = 12  # d delta / d F
W_CAP = 13
W_RW = 14  # water: mid = (RW + GW mid_wire)/DW
W_DW = 15
W_GW = 16
W_GD = 17
W_POWER = 18
W_GF = 19
W_UA = 20
W_CWATER = 21
W_SIZE = 32
SCRATCH_SIZE = 2 * W_SIZE

# Slots of the feeds: measured series that replace inner signals, at start and end of a sample.
F_CURRENT = 0  # flag, x, y
F_TEMPERATURE = 3  # flag, x start, y start, x end, y end
F_FORCE = 8  # flag, start, end
F_DISPLACEMENT = 11  # flag, start, end
FEEDS_SIZE = 14

OK = 0
NOT_CONVERGED = 1
NOT_FINITE = 2

HALF_PI = 0.5 * math.pi
T_TOLERANCE = 1e-9
DELTA_TOLERANCE = 1e-12
ITERATIONS = 200


@njit(cache=True, nogil=True)
def clip01(value):
    if value <= 0.0:
        return 0.0
    if value >= 1.0:
        return 1.0
    return value


@njit(cache=True, nogil=True)
def remaining(progress):
    """f = (cos πa + 1)/2 of Eqs (11)-(13), as a square so that it stays exact near a = 1."""
    if progress <= 0.0:
        return 1.0
    if progress >= 1.0:
        return 0.0
    root = math.cos(HALF_PI * progress)
    return root * root


@njit(cache=True, nogil=True)
def remaining_slope(left):
    """df/da of `remaining`, from its value."""
    return -math.pi * math.sqrt(left * (1.0 - left))


@njit(cache=True, nogil=True)
def progress_a(T, tau, p):
    return clip01((T - p[P_A_S] - tau / p[P_C_A]) * p[P_A_INV])


@njit(cache=True, nogil=True)
def progress_b(T, tau, p):
    above = T - p[P_M_S]
    if above > 0.0:
        tau = tau - p[P_C_M] * above
    return clip01((tau - p[P_TAU_S]) * p[P_TAU_INV])


@njit(cache=True, nogil=True)
def progress_c(T, p):
    return clip01((p[P_M_S] - T) * p[P_M_INV])


@njit(cache=True, nogil=True)
def transform(T, F, s, o, w, q, p):
    """Fractions at (T, F) from those at the start of the substep, with their slopes.

    Returns (xi_S, xi_T, dxi/dT, dxi/dF, dxi_S/dT, dxi_S/dF). Rate forms of Eqs (11)-(13): a
    fraction that is left scales by f(new)/f(old) whenever its progress grows, and rests otherwise.
    """
    tau = p[P_C1] * F
    xs = s[o + S_XS]
    xt = s[o + S_XT]
    xs_T = 0.0
    xs_F = 0.0
    xt_T = 0.0
    xt_F = 0.0
    a = progress_a(T, tau, p)
    if a > s[o + S_A] and xs + xt > 0.0:
        left = remaining(a)
        ratio = left / w[q + W_FA]
        slope = 0.0
        if a < 1.0:
            slope = remaining_slope(left) / w[q + W_FA] * p[P_A_INV]
        slope_F = -slope * p[P_C1] / p[P_C_A]
        xs_T = xs * slope
        xs_F = xs * slope_F
        xt_T = xt * slope
        xt_F = xt * slope_F
        xs = xs * ratio
        xt = xt * ratio
    b = progress_b(T, tau, p)
    if b > s[o + S_B] and xs < 1.0:
        left = remaining(b)
        ratio = left / w[q + W_FB]
        new = 1.0 - (1.0 - xs) * ratio
        on_curve = w[q + W_HOT] == 0.0 and 1.0 - left < new
        if on_curve:
            new = 1.0 - left
        if new > xs:
            slope_F = 0.0
            slope_T = 0.0
            if b < 1.0:
                slope_F = remaining_slope(left) * p[P_TAU_INV] * p[P_C1]
                if T > p[P_M_S]:
                    slope_T = -slope_F / p[P_C1] * p[P_C_M]
            free = 1.0 - xs
            if on_curve:
                ratio = left / free
                ratio_T = (slope_T + ratio * xs_T) / free
                ratio_F = (slope_F + ratio * xs_F) / free
            else:
                ratio_T = slope_T / w[q + W_FB]
                ratio_F = slope_F / w[q + W_FB]
            xs_T = ratio * xs_T - free * ratio_T
            xs_F = ratio * xs_F - free * ratio_F
            xt_T = ratio * xt_T + xt * ratio_T
            xt_F = ratio * xt_F + xt * ratio_F
            xs = new
            xt = xt * ratio
    elif a >= 1.0 and s[o + S_A] >= 1.0 and b < s[o + S_B]:
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
    if c > s[o + S_C]:
        left = remaining(c)
        austenite = 1.0 - xs - xt
        if austenite > 0.0:
            ratio = left / w[q + W_FC]
            slope = 0.0
            if c < 1.0:
                slope = -remaining_slope(left) / w[q + W_FC] * p[P_M_INV]
            xt_T = -xs_T + ratio * (xs_T + xt_T) - austenite * slope
            xt_F = -xs_F + ratio * (xs_F + xt_F)
            xt = 1.0 - xs - austenite * ratio
    if xt > 1.0 - xs:
        xt = 1.0 - xs
    if xt < 0.0:
        xt = 0.0
    return xs, xt, xs_T + xt_T, xs_F + xt_F, xs_T, xs_F


@njit(cache=True, nogil=True)
def settle(F, s, o, w, q, p):
    """One spring at tension F: temperature, fractions, deflection and compliance, into scratch.

    The temperature solves T = T* + λ (ξ(T, F) − ξ_old), which has one root: ξ falls with T.
    Returns False when it is not found.
    """
    start = s[o + S_XS] + s[o + S_XT]
    star = w[q + W_T_STAR]
    low = star - w[q + W_LAM_H]
    high = star + w[q + W_LAM_C]
    T = w[q + W_GUESS]
    if T < low or T > high:
        T = star
    found = False
    for _ in range(ITERATIONS):
        xs, xt, xi_T, xi_F, xs_T, xs_F = transform(T, F, s, o, w, q, p)
        change = xs + xt - start
        lam = w[q + W_LAM_H] if change < 0.0 else w[q + W_LAM_C]
        miss = T - star - lam * change
        slope = 1.0 - lam * xi_T
        if abs(miss) <= T_TOLERANCE or high - low <= T_TOLERANCE:
            found = True
            break
        if miss > 0.0:
            high = T
        else:
            low = T
        T = T - miss / slope
        if not low < T < high:
            T = 0.5 * (low + high)
    w[q + W_T] = star + lam * change
    w[q + W_GUESS] = T
    w[q + W_XS] = xs
    w[q + W_XT] = xt
    T_F = lam * xi_F / slope
    xi = xs + xt
    soft = p[P_K_A] - p[P_K_M]
    stiffness = p[P_K_A] - soft * xi
    w[q + W_DELTA] = F / stiffness + p[P_DELTA_L] * xs
    w[q + W_SLOPE] = (
        1.0 / stiffness
        + F * soft / (stiffness * stiffness) * (xi_F + xi_T * T_F)
        + p[P_DELTA_L] * (xs_F + xs_T * T_F)
    )
    return found


@njit(cache=True, nogil=True)
def balance(target, guess, pair, s, o, w, q, p):
    """The tension at which the deflection is `target`: of the pair, or of one spring.

    The deflection grows with the tension, so there is one root, held in a bracket. No tension at
    all is the answer when the unloaded springs are already long enough: then the tendon is slack.
    Returns the tension, or -1 when it is not found.
    """
    low = 0.0
    high = 1e300
    F = guess if guess > 0.0 else 0.0
    for _ in range(ITERATIONS):
        found = settle(F, s, o, w, q, p)
        reach = w[q + W_DELTA]
        slope = w[q + W_SLOPE]
        if pair:
            found = settle(F, s, o + S_SIZE, w, q + W_SIZE, p) and found
            reach += w[q + W_SIZE + W_DELTA]
            slope += w[q + W_SIZE + W_SLOPE]
        s[G_ITERATIONS] += 1.0
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
        F = F - miss / slope
        if not F < high:
            F = 0.5 * (low + high)
        elif F <= low:
            F = 0.0 if low == 0.0 else 0.5 * (low + high)
    return -1.0


@njit(cache=True, nogil=True)
def film(T, T_water, speed, p, table):
    """Conductance from wire to water, W/(m K): the larger of free and forced convection.

    Free: Eqs (19)-(21) with the flow's hydraulic diameter. Forced: Eqs (24), (25).
    """
    where = 0.5 * (T + T_water) - p[P_TABLE_T0]
    last = table.shape[0] - 3
    cell = int(where) if where > 1.0 else 1
    if cell > last:
        cell = last
    x = where - cell
    if x < -1.0:
        x = -1.0
    if x > 2.0:
        x = 2.0
    w0 = -x * (x - 1.0) * (x - 2.0) / 6.0
    w1 = (x + 1.0) * (x - 1.0) * (x - 2.0) * 0.5
    w2 = -(x + 1.0) * x * (x - 2.0) * 0.5
    w3 = (x + 1.0) * x * (x - 1.0) / 6.0
    k = w0 * table[cell - 1, 0] + w1 * table[cell, 0]
    k = k + w2 * table[cell + 1, 0] + w3 * table[cell + 2, 0]
    rise = w0 * table[cell - 1, 1] + w1 * table[cell, 1]
    rise = rise + w2 * table[cell + 1, 1] + w3 * table[cell + 2, 1]
    root = 0.60 + rise * math.pow(abs(T - T_water), 1.0 / 6.0) * p[P_SQRT_DH]
    h = k / p[P_DH] * root * root
    if speed > 0.0:
        c2 = w0 * table[cell - 1, 2] + w1 * table[cell, 2]
        c2 = c2 + w2 * table[cell + 1, 2] + w3 * table[cell + 2, 2]
        c3 = w0 * table[cell - 1, 3] + w1 * table[cell, 3]
        c3 = c3 + w2 * table[cell + 1, 3] + w3 * table[cell + 2, 3]
        forced = (c2 + c3 * math.sqrt(speed * p[P_DH])) / p[P_DH]
        if forced > h:
            h = forced
    return h * p[P_PERIMETER]


@njit(cache=True, nogil=True)
def bare(T, T_air, p):
    """Conductance from a bare wire to still air, W/(m K): Eq. (20) with the wire's diameter."""
    root = 0.60 + p[P_AIR_C] * math.pow(abs(T - T_air), 1.0 / 6.0)
    return p[P_AIR_K] * root * root


@njit(cache=True, nogil=True)
def heat(s, o, w, q, p, table, dt):
    """Set up the heat balance of one spring over the substep: Eqs (15)-(18) and the water node.

    Implicit midpoint in both temperatures with film coefficients at the extrapolated midpoint.
    The water is eliminated, so that what is left is T = T* + λ Δξ.
    """
    T = s[o + S_T]
    T_water = s[o + S_TW]
    middle = T + 0.5 * dt * s[o + S_RATE]
    middle_water = T_water + 0.5 * dt * s[o + S_RATE_W]
    power = s[o + S_I] * s[o + S_I] * s[o + S_OHM] / p[P_LENGTH]
    gain_work = s[o + S_WORK_Q] / dt
    g_water = 0.0
    g_dry = 0.0
    fill = s[o + S_FILL]
    flow = s[o + S_FLOW]
    if p[P_WET] > 0.0:
        g_water = fill * film(middle, middle_water, flow * p[P_AREA_INV], p, table)
        g_dry = (1.0 - fill) * p[P_GAP]
    else:
        g_dry = bare(middle, s[G_T_AIR], p)
    T_air = s[G_T_AIR]
    T_in = s[G_T_IN]
    net = power + gain_work - g_water * (T - T_water) - g_dry * (T - T_air)
    capacity = p[P_MC_H] if net >= 0.0 else p[P_MC_C]
    stiff = 2.0 * capacity / dt + g_water + g_dry
    right = 2.0 * capacity / dt * T + power + gain_work + g_dry * T_air
    w[q + W_DW] = 0.0
    if p[P_WET] > 0.0:
        if p[P_WARMS] > 0.0:
            c_water = fill * p[P_SHARE] * p[P_CW]
            g_flow = flow * p[P_FLOW_G]
            ua = fill * p[P_UA]
            d_water = 2.0 * c_water / dt + g_water + g_flow + ua
            r_water = 2.0 * c_water / dt * T_water + g_flow * T_in + ua * T_air
            stiff -= g_water * g_water / d_water
            right += g_water * r_water / d_water
            w[q + W_DW] = d_water
            w[q + W_RW] = r_water
            w[q + W_GF] = g_flow
            w[q + W_UA] = ua
            w[q + W_CWATER] = c_water
        else:
            right += g_water * T_in
    w[q + W_T_STAR] = 2.0 * right / stiff - T
    w[q + W_LAM_H] = 2.0 * p[P_ML_H] / (dt * stiff)
    w[q + W_LAM_C] = 2.0 * p[P_ML_C] / (dt * stiff)
    w[q + W_CAP] = capacity
    w[q + W_GW] = g_water
    w[q + W_GD] = g_dry
    w[q + W_POWER] = power


@njit(cache=True, nogil=True)
def prepare(s, o, w, q, p, dt):
    """What `transform` and `settle` need of the start of the substep."""
    w[q + W_FA] = remaining(s[o + S_A])
    w[q + W_FB] = remaining(s[o + S_B])
    w[q + W_FC] = remaining(s[o + S_C])
    w[q + W_HOT] = 1.0 if s[o + S_T] > p[P_M_S] else 0.0
    w[q + W_GUESS] = w[q + W_T_STAR]
    if s[o + S_ACTIVE] > 0.0:
        w[q + W_GUESS] = s[o + S_T] + dt * s[o + S_RATE]


@njit(cache=True, nogil=True)
def elastic(F, xi, p):
    """Elastic energy of a spring, J."""
    return 0.5 * F * F / (p[P_K_A] - (p[P_K_A] - p[P_K_M]) * xi)


@njit(cache=True, nogil=True)
def accept(s, o, w, q, p, F_spring, F_phase, fed, dt):
    """Take over the end of the substep for one spring and write its energy books."""
    T_old = s[o + S_T]
    T = w[q + W_T]
    xi_old = s[o + S_XS] + s[o + S_XT]
    xs = w[q + W_XS]
    xt = w[q + W_XT]
    change = xs + xt - xi_old
    length = p[P_LENGTH]
    middle = 0.5 * (T + T_old)
    if not fed:
        T_water = s[o + S_TW]
        middle_water = s[G_T_IN]
        if w[q + W_DW] > 0.0:
            middle_water = (w[q + W_RW] + w[q + W_GW] * middle) / w[q + W_DW]
            new_water = 2.0 * middle_water - T_water
            s[o + S_RATE_W] = (new_water - T_water) / dt
            s[o + S_TW] = new_water
            s[o + S_WATER_J] += length * dt * w[q + W_GF] * (middle_water - s[G_T_IN])
            s[o + S_AIR_J] += length * dt * w[q + W_UA] * (middle_water - s[G_T_AIR])
        else:
            s[o + S_WATER_J] += length * dt * w[q + W_GW] * (middle - middle_water)
        s[o + S_AIR_J] += length * dt * w[q + W_GD] * (middle - s[G_T_AIR])
        s[o + S_IN_J] += length * dt * w[q + W_POWER]
        latent = p[P_ML_H] if change < 0.0 else p[P_ML_C]
        s[o + S_UNEQUAL_J] += length * (
            (p[P_MC_H] - w[q + W_CAP]) * (T - T_old) - (p[P_ML_H] - latent) * change
        )
    work = 0.5 * (F_spring + s[o + S_F]) * (w[q + W_DELTA] - s[o + S_DELTA])
    inelastic = work - elastic(F_spring, xs + xt, p) + elastic(s[o + S_F], xi_old, p)
    s[o + S_WORK_J] += work
    s[o + S_OMITTED_J] += (1.0 - p[P_WORK_SHARE]) * inelastic
    s[o + S_WORK_Q] = p[P_WORK_SHARE] * inelastic / length
    s[o + S_RATE] = (T - T_old) / dt
    s[o + S_ACTIVE] = 1.0 if change != 0.0 else 0.0
    s[o + S_T] = T
    s[o + S_XS] = xs
    s[o + S_XT] = xt
    s[o + S_F] = F_spring
    s[o + S_DELTA] = w[q + W_DELTA]
    tau = p[P_C1] * F_phase
    # At the temperature of the last evaluation, so that progress and fractions belong together.
    s[o + S_A] = progress_a(w[q + W_GUESS], tau, p)
    s[o + S_B] = progress_b(w[q + W_GUESS], tau, p)
    s[o + S_C] = progress_c(w[q + W_GUESS], p)


@njit(cache=True, nogil=True)
def water_inventory(s, o, p, drain, dt):
    """Drain or refill the tube; heat that leaves or enters with the water goes to the books."""
    fill = s[o + S_FILL]
    new = fill
    if s[o + S_FLOW] > 0.0:
        new = fill + dt * s[o + S_FLOW] * p[P_FILL_RATE]
        if new > 1.0:
            new = 1.0
    elif drain > 0.0 and fill > p[P_FILM]:
        new = p[P_FILM] + (fill - p[P_FILM]) * math.exp(-dt * p[P_DRAIN_RATE])
    if new != fill:
        moved = (fill - new) * p[P_SHARE] * p[P_CW] * p[P_LENGTH] * p[P_WARMS]
        s[o + S_WATER_J] += moved * (s[o + S_TW] - p[P_T_REF])
        s[o + S_FILL] = new


@njit(cache=True, nogil=True)
def rest(F, delta, s, o, w, q, p):
    """Deflection of a spring at tension F with frozen fractions, into scratch."""
    xi = w[q + W_XS] + w[q + W_XT]
    stiffness = p[P_K_A] - (p[P_K_A] - p[P_K_M]) * xi
    w[q + W_DELTA] = F / stiffness + p[P_DELTA_L] * w[q + W_XS]
    return stiffness


@njit(cache=True, nogil=True)
def from_deflection(delta, s, o, w, q, p):
    """Tension of a spring at a deflection with frozen fractions, Eq. (9); never below zero."""
    xi = w[q + W_XS] + w[q + W_XT]
    stiffness = p[P_K_A] - (p[P_K_A] - p[P_K_M]) * xi
    F = stiffness * (delta - p[P_DELTA_L] * w[q + W_XS])
    w[q + W_DELTA] = delta
    return F if F > 0.0 else 0.0


@njit(cache=True, nogil=True)
def slack_position(u, s, w, p):
    """Where the encoder stands when the tendon is slack: where it was, between the spring ends."""
    low = p[P_DELTA_0] - w[W_DELTA]
    high = w[W_SIZE + W_DELTA] - p[P_DELTA_0]
    if u < low:
        return low
    if u > high:
        return high
    return u


@njit(cache=True, nogil=True)
def mechanics(s, w, p, feeds, stage, share, dt):
    """Find the tension and displacement at the end of the substep. Returns a status."""
    guess = s[G_F] + dt * s[G_F_RATE]
    fixture = p[P_FIXTURE]
    old = s[G_F]
    F_x = 0.0
    F_y = 0.0
    u = s[G_U]
    force_fed = feeds[F_FORCE] > 0.0
    moved = feeds[F_DISPLACEMENT] > 0.0
    if moved:
        u = feeds[F_DISPLACEMENT + 1]
        u += share * (feeds[F_DISPLACEMENT + 2] - feeds[F_DISPLACEMENT + 1])
    if force_fed:
        F = feeds[F_FORCE + 1] + share * (feeds[F_FORCE + 2] - feeds[F_FORCE + 1])
        if F < 0.0:
            F = 0.0
        ok = settle(F, s, 0, w, 0, p)
        F_other = F if fixture == 0.0 else 0.0
        ok = settle(F_other, s, S_SIZE, w, W_SIZE, p) and ok
        if not ok:
            return NOT_CONVERGED
        if fixture != 0.0:
            delta = stage if fixture == 1.0 else p[P_DELTA_0] + stage
            F_x = from_deflection(delta, s, 0, w, 0, p)
            u = stage
            rest(0.0, 0.0, s, S_SIZE, w, W_SIZE, p)
        elif moved:
            F_x = from_deflection(p[P_DELTA_0] - u, s, 0, w, 0, p)
            F_y = from_deflection(p[P_DELTA_0] + u, s, S_SIZE, w, W_SIZE, p)
        else:
            k_x = rest(0.0, 0.0, s, 0, w, 0, p)
            k_y = rest(0.0, 0.0, s, S_SIZE, w, W_SIZE, p)
            gap = 2.0 * p[P_DELTA_0] - w[W_DELTA] - w[W_SIZE + W_DELTA]
            F_x = gap / (1.0 / k_x + 1.0 / k_y) if gap > 0.0 else 0.0
            F_y = F_x
            rest(F_x, 0.0, s, 0, w, 0, p)
            rest(F_y, 0.0, s, S_SIZE, w, W_SIZE, p)
            u = slack_position(u, s, w, p) if F_x == 0.0 else p[P_DELTA_0] - w[W_DELTA]
        accept(s, 0, w, 0, p, F_x, F, feeds[F_TEMPERATURE] > 0.0, dt)
        accept(s, S_SIZE, w, W_SIZE, p, F_y, F_other, feeds[F_TEMPERATURE] > 0.0, dt)
    else:
        if fixture == 0.0 and not moved:
            F_x = balance(2.0 * p[P_DELTA_0], guess, True, s, 0, w, 0, p)
            F_y = F_x
            if F_x < 0.0:
                return NOT_CONVERGED
            u = slack_position(u, s, w, p) if F_x == 0.0 else p[P_DELTA_0] - w[W_DELTA]
        elif fixture == 0.0:
            F_x = balance(p[P_DELTA_0] - u, s[S_F], False, s, 0, w, 0, p)
            F_y = balance(p[P_DELTA_0] + u, s[S_SIZE + S_F], False, s, S_SIZE, w, W_SIZE, p)
        else:
            delta = stage if fixture == 1.0 else p[P_DELTA_0] + stage
            F_x = balance(delta, guess, False, s, 0, w, 0, p)
            if not settle(0.0, s, S_SIZE, w, W_SIZE, p):
                return NOT_CONVERGED
            u = stage
        if F_x < 0.0 or F_y < 0.0:
            return NOT_CONVERGED
        accept(s, 0, w, 0, p, F_x, F_x, feeds[F_TEMPERATURE] > 0.0, dt)
        accept(s, S_SIZE, w, W_SIZE, p, F_y, F_y, feeds[F_TEMPERATURE] > 0.0, dt)
    s[G_U] = u
    s[G_F] = 0.5 * (F_x + F_y) if fixture == 0.0 else F_x
    s[G_F_RATE] = (s[G_F] - old) / dt
    return OK


@njit(cache=True, nogil=True)
def substep(s, w, p, feeds, table, drive, share, dt):
    """One substep of both springs; `share` is how far into the sample its end is."""
    fed = feeds[F_TEMPERATURE] > 0.0
    for i in range(2):
        o = i * S_SIZE
        q = i * W_SIZE
        s[o + S_FLOW] = p[P_FLOW_MAX] * drive[2 + i] * p[P_WET]
        water_inventory(s, o, p, drive[4 + i], dt)
        current = drive[i]
        if feeds[F_CURRENT] > 0.0:
            current = feeds[F_CURRENT + 1 + i]
        s[o + S_I] = current
        if fed:
            first = feeds[F_TEMPERATURE + 1 + i]
            last = feeds[F_TEMPERATURE + 3 + i]
            w[q + W_T_STAR] = first + share * (last - first)
            w[q + W_LAM_H] = 0.0
            w[q + W_LAM_C] = 0.0
        else:
            heat(s, o, w, q, p, table, dt)
        prepare(s, o, w, q, p, dt)
    status = mechanics(s, w, p, feeds, drive[6], share, dt)
    s[G_TIME] += dt
    return status


@njit(cache=True, nogil=True)
def advance(s, w, p, feeds, table, drive, dt, steps):
    """Advance the state by `steps` substeps of `dt`. Returns a status.

    drive: currents x, y (A); pump duties x, y; drain x, y (0 or 1); stage (m).
    """
    for k in range(steps):
        status = substep(s, w, p, feeds, table, drive, (k + 1.0) / steps, dt)
        if status != OK:
            return status
    if not math.isfinite(s[S_T] + s[S_SIZE + S_T] + s[G_F] + s[G_U]):
        return NOT_FINITE
    return OK


@njit(cache=True, nogil=True)
def replay(s, w, p, feed_flags, feed_rows, table, drives, environment, times, dt_max, out):
    """Advance through recorded samples; row k of `drives` is in force up to times[k].

    out: (n, STATE_SIZE), the state after each sample. Returns (status, row it stopped at).
    """
    feeds = np.zeros(FEEDS_SIZE)
    n = times.shape[0]
    for k in range(n):
        s[G_T_IN] = environment[k, 0]
        s[G_T_AIR] = environment[k, 1]
        if k > 0:
            span = times[k] - times[k - 1]
            steps = int(math.ceil(span / dt_max - 1e-9))
            if steps < 1:
                steps = 1
            load_feeds(feeds, feed_flags, feed_rows, k)
            status = advance(s, w, p, feeds, table, drives[k], span / steps, steps)
            if status != OK:
                return status, k
        out[k, :] = s
    return OK, n


@njit(cache=True, nogil=True)
def load_feeds(feeds, flags, rows, k):
    """Feeds of the sample that ends at row k. Rows: i_x, i_y, T_x, T_y, F, u."""
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
