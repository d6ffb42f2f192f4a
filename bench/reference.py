"""The same equations a second time, as ordinary differential equations for scipy's solve_ivp.

Written apart from the kernel and sharing nothing with it but the parameter set: a yardstick for
its results (tests) and for its speed (bench). Antagonistic pair, extended variant, water cooling,
no effects. The force is algebraic; its rate and those of the temperatures follow from a small
piecewise linear system, since the fractions answer to rates.
"""

from __future__ import annotations

# Compiled functions take their arguments by position.
# ruff: noqa: PLR0917
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from sim_device.plant.parameters import ParameterSet, initial_detwinned
from sim_device.plant.water import interpolated, real_water

Array = npt.NDArray[np.float64]
CURVE_WIDTH = 1e-6
"""Detwinning sets in over this much of the fraction: a solver needs a rate that is continuous."""
_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compiled, so that the comparison of speed is between methods and not between languages."""
    return cast(_Function, njit(cache=True)(function))


@compiled
def fraction_left(x: float) -> float:
    if x <= 0.0:
        return 1.0
    if x >= 1.0:
        return 0.0
    return 0.5 * (math.cos(math.pi * x) + 1.0)


@compiled
def relative_slope(x: float) -> float:
    """f′/f of the cosine law; bounded just before the end, where it has a pole and f is 2e-8."""
    top = min(max(x, 0.0), 1.0 - 1e-4)
    return float(-math.pi * math.tan(0.5 * math.pi * top))


@compiled
def property_at(breaks: Array, spline: Array, T: float) -> float:
    n = min(max(int((T - breaks[0]) / (breaks[1] - breaks[0])), 0), breaks.size - 2)
    x = T - breaks[n]
    return float(((spline[0, n] * x + spline[1, n]) * x + spline[2, n]) * x + spline[3, n])


@compiled
def film_coefficient(
    T: float, Tw: float, flow: float, d: float, dt: float, breaks: Array, splines: Array
) -> float:
    """h by Eqs (19)-(25) from properties at the film temperature, W/(m² K)."""
    Tf = 0.5 * (T + Tw)
    rho = property_at(breaks, splines[0], Tf)
    cp = property_at(breaks, splines[1], Tf)
    k = property_at(breaks, splines[2], Tf)
    mu = property_at(breaks, splines[3], Tf)
    beta = property_at(breaks, splines[4], Tf)
    nu = mu / rho
    pr = mu * cp / k
    D = dt - d
    Ra = 9.81 * beta * abs(T - Tw) * D**3 / (nu * (k / (rho * cp)))
    nusselt = (
        0.60 + 0.387 * (Ra / (1.0 + (0.559 / pr) ** (9.0 / 16.0)) ** (16.0 / 9.0)) ** (1.0 / 6.0)
    ) ** 2
    if flow > 0.0:
        u = flow / (0.25 * math.pi * (dt * dt - d * d))
        forced = (0.255 + 0.699 * math.sqrt(u * D / nu)) * pr**0.29
        nusselt = max(nusselt, forced)
    return float(k * nusselt / D)


@compiled
def fraction_rates(
    T: float, F: float, xs: float, xt: float, rT: float, rF: float, m: Array
) -> tuple[float, float]:
    """(dξ_S/dt, dξ_T/dt) for rates of temperature and force: Eqs (11)-(13) in rate form."""
    c1, A_S, A_F, C_A, M_S, M_F, C_M, tau_s, tau_f = m[:9]
    tau = c1 * F
    a = (T - A_S - tau / C_A) / (A_F - A_S)
    ds = 0.0
    dt = 0.0
    speed = (rT - c1 * rF / C_A) / (A_F - A_S)
    if 0.0 <= a < 1.0 and speed > 0.0:
        ds += xs * relative_slope(a) * speed
        dt += xt * relative_slope(a) * speed
    elif a >= 1.0:
        ds -= 100.0 * xs
        dt -= 100.0 * xt
    hot = T > M_S
    b = (tau - (C_M * (T - M_S) if hot else 0.0) - tau_s) / (tau_f - tau_s)
    speed = (c1 * rF - (C_M * rT if hot else 0.0)) / (tau_f - tau_s)
    if 0.0 <= b < 1.0 and speed > 0.0:
        if not hot:
            above = xs - (1.0 - fraction_left(b))
            speed *= min(max(1.0 - above / CURVE_WIDTH, 0.0), 1.0)
        ds -= (1.0 - xs) * relative_slope(b) * speed
        dt += xt * relative_slope(b) * speed
    c = (M_S - T) / (M_S - M_F)
    speed = -rT / (M_S - M_F)
    if 0.0 <= c < 1.0 and speed > 0.0:
        dt -= (1.0 - xs - xt) * relative_slope(c) * speed
    return ds, dt


@compiled
def temperature_rate(
    T: float, F: float, xs: float, xt: float, q: float, rF: float, m: Array
) -> tuple[float, float, float]:
    """(dT/dt, dξ_S/dt, dξ_T/dt) at a rate of the force: m C Ṫ = q + m L ξ̇, by bracketing."""
    capacity = m[9] if q >= 0.0 else m[10]
    low = -abs(q) / capacity - 1e4
    high = abs(q) / capacity + 1e4
    rate = q / capacity
    ds = 0.0
    dt = 0.0
    for _ in range(200):
        ds, dt = fraction_rates(T, F, xs, xt, rate, rF, m)
        change = ds + dt
        miss = capacity * rate - q - (m[11] if change < 0.0 else m[12]) * change
        if abs(miss) < 1e-11 * (1.0 + abs(q)) or high - low < 1e-13 * (1.0 + abs(rate)):
            break
        if miss > 0.0:
            high = rate
        else:
            low = rate
        step = 1e-4 * (1.0 + abs(rate))
        ds2, dt2 = fraction_rates(T, F, xs, xt, rate + step, rF, m)
        change2 = ds2 + dt2
        miss2 = capacity * (rate + step) - q - (m[11] if change2 < 0.0 else m[12]) * change2
        trial = rate - miss * step / (miss2 - miss) if miss2 > miss else low
        rate = trial if low < trial < high else 0.5 * (low + high)
    return rate, ds, dt


@compiled
def right_side(t: float, y: Array, drive: Array, m: Array, breaks: Array, splines: Array) -> Array:
    """dy/dt. y: T, T_w, ξ_S, ξ_T of X, then of Y. drive: currents, duties."""
    k_M, k_A, delta_L, delta_0 = m[13], m[14], m[15], m[16]
    k_x = k_A + (k_M - k_A) * (y[2] + y[3])
    k_y = k_A + (k_M - k_A) * (y[6] + y[7])
    gap = 2.0 * delta_0 - delta_L * (y[2] + y[6])
    F = max(gap / (1.0 / k_x + 1.0 / k_y), 0.0)
    out = np.zeros(8)
    q = np.zeros(2)
    for i in range(2):
        T = y[4 * i]
        Tw = y[4 * i + 1]
        flow = drive[2 + i] * m[17]
        h = film_coefficient(T, Tw, flow, m[18], m[19], breaks, splines)
        passed = h * math.pi * m[18] * (T - Tw)
        q[i] = m[20] * drive[i] * drive[i] - passed
        out[4 * i + 1] = (passed - flow * m[21] * (Tw - m[22]) - m[23] * (Tw - m[24])) / m[25]
    low = -1e4
    high = 1e4
    rF = 0.0
    for step in range(200):
        total = 0.0
        for i in range(2):
            k = k_x if i == 0 else k_y
            rate, ds, dt = temperature_rate(y[4 * i], F, y[4 * i + 2], y[4 * i + 3], q[i], rF, m)
            out[4 * i] = rate
            out[4 * i + 2] = ds
            out[4 * i + 3] = dt
            total += rF / k + F * (k_A - k_M) / (k * k) * (ds + dt) + delta_L * ds
        if F <= 0.0 or abs(total) < 1e-13 or high - low < 1e-13:
            break
        if total > 0.0:
            high = rF
        else:
            low = rF
        if step == 0:
            rF = -total * min(k_x, k_y) * 0.5
            last, last_total = 0.0, total
            continue
        slope = (total - last_total) / (rF - last) if rF != last else 0.0
        last, last_total = rF, total
        trial = rF - total / slope if slope > 0.0 else low
        rF = trial if low < trial < high else 0.5 * (low + high)
    return out


@dataclass(frozen=True)
class Reference:
    """The pair as a system of ordinary differential equations, made from a parameter set."""

    constants: Array
    breaks: Array
    splines: Array
    start: Array

    @classmethod
    def make(cls, parameters: ParameterSet) -> Reference:
        v = {entry.name: entry.value for entry in parameters.entries}
        d, D, N = v["wire_diameter"], v["coil_diameter"], v["coils"]
        R = D / d
        wahl = (4 * R - 1) / (4 * R - 4) + 0.615 / R
        c1 = 8 * wahl * D / (math.pi * d**3)
        c2 = d / (math.pi * N * D**2)
        section = math.pi * d**2 / 4
        mass = v["density"] * section
        annulus = math.pi * (v["tube_diameter"] ** 2 - d**2) / 4
        at_300 = interpolated(real_water(), 300.0)
        per_volume = float(at_300.rho[0] * at_300.cp[0])
        m = np.array(
            [
                c1, v["austenite_start"], v["austenite_finish"], v["slope_austenite"],
                v["martensite_start"], v["martensite_finish"], v["slope_martensite"],
                v["stress_start"], v["stress_finish"],
                mass * v["heat_capacity_heating"], mass * v["heat_capacity_cooling"],
                mass * v["latent_heating"], mass * v["latent_cooling"],
                c2 * v["modulus_martensite"] / c1, c2 * v["modulus_austenite"] / c1,
                v["max_deflection"], v["initial_deflection"], v["flow_max"], d,
                v["tube_diameter"], v["resistivity"] / section,
                per_volume / (math.pi * D * N), v["water_temperature"], v["tube_loss"],
                v["ambient_temperature"], v["warming_share"] * annulus * per_volume,
            ]
        )  # fmt: skip
        water = real_water()
        splines = np.array(
            [
                CubicSpline(water.T_K, column).c
                for column in (water.rho, water.cp, water.k, water.mu, water.beta)
            ]
        )
        xs = initial_detwinned(parameters)
        T = v["water_temperature"]
        return cls(m, water.T_K, splines, np.array([T, T, xs, 1 - xs] * 2))

    def displacement(self, y: Array) -> Array:
        """Displacement, m, of states y (8, n) or (8,)."""
        k_M, k_A, delta_L, delta_0 = self.constants[13:17]
        k_x = k_A + (k_M - k_A) * (y[2] + y[3])
        return np.asarray(delta_0 - self.force(y) / k_x - delta_L * y[2])

    def force(self, y: Array) -> Array:
        """Tension, N, of states y (8, n) or (8,)."""
        k_M, k_A, delta_L, delta_0 = self.constants[13:17]
        k_x = k_A + (k_M - k_A) * (y[2] + y[3])
        k_y = k_A + (k_M - k_A) * (y[6] + y[7])
        gap = 2 * delta_0 - delta_L * (y[2] + y[6])
        return np.asarray(np.maximum(gap / (1 / k_x + 1 / k_y), 0.0))

    def solve(
        self,
        times: Array,
        drives: Array,
        *,
        method: str = "LSODA",
        rtol: float = 1e-9,
        atol: float = 1e-11,
        max_step: float = math.inf,
    ) -> Array:
        """States (8, n) at `times`; row k of `drives` (n, 4) is in force up to times[k].

        Runs of equal rows are integrated in one go. Raises RuntimeError if the solver fails.
        """
        y = self.start.copy()
        out = np.empty((8, times.size))
        out[:, 0] = y
        first = 0
        while first < times.size - 1:
            last = first + 1
            while last < times.size - 1 and np.array_equal(drives[last + 1], drives[last]):
                last += 1
            solution = solve_ivp(
                right_side,
                (times[first], times[last]),
                y,
                method=method,
                t_eval=times[first + 1 : last + 1],
                args=(drives[last], self.constants, self.breaks, self.splines),
                rtol=rtol,
                atol=atol,
                max_step=max_step,
            )
            if not solution.success:
                raise RuntimeError(f"{method} failed after {times[first]} s: {solution.message}")
            out[:, first + 1 : last + 1] = solution.y
            y = solution.y[:, -1]
            first = last
        return out
