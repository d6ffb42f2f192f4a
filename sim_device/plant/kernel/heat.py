"""The heat balance of one spring and its water over a substep: Eqs (15)-(18), and its books.

Implicit midpoint in both temperatures with film coefficients at the extrapolated midpoint. The
water is eliminated, so that what is left is T = T* + λ Δξ.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import compiled, inlined
from sim_device.plant.kernel.film import (
    air_conductance,
    convection_factor,
    film_conductance,
    mean_conductance,
)
from sim_device.plant.kernel.front import move_front
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.parts import count_parts, memory_of, work_of
from sim_device.plant.kernel.state import CELLS, Shared, Spring, SpringWork

STRESS_REF_PA = 1e8


@inlined
def set_conductances(
    s: Spring,
    w: SpringWork,
    g: Shared,
    p: Constants,
    e: Effects,
    table: npt.NDArray[np.float64],
    forces: bool,
    dt: float,
) -> None:
    """Conductances from the wire to water and air at the extrapolated midpoint, into scratch."""
    middle = s.T_wire + 0.5 * dt * s.T_wire_rate
    w.g_water = 0.0
    if p.wet > 0.0:
        middle_water = s.T_water + 0.5 * dt * s.T_water_rate
        surround = middle_water if p.warms > 0.0 else g.T_inlet
        g_water = s.mean_filled * film_conductance(
            middle, surround, s.flow * p.per_annulus, p, table
        )
        g_water = g_water * s.wetted
        g_dry = (1.0 - s.mean_filled) * p.gap_conductance
        if e.film_exponent != 0.0:
            g_water = g_water * convection_factor(
                middle - surround, e.film_exponent, e.film_reference
            )
        if forces:
            g_water = g_water * w.forced_film
        w.g_water = g_water
    else:
        g_dry = air_conductance(middle, g.T_air, p)
        if e.film_exponent != 0.0:
            g_dry = g_dry * convection_factor(middle - g.T_air, e.film_exponent, e.film_reference)
        if forces:
            g_dry = g_dry * w.forced_film
    if e.end_loss > 0.0:
        g_dry += e.end_loss * p.per_length
    w.g_dry = g_dry


@inlined
def eliminate_water(
    s: Spring, w: SpringWork, g: Shared, p: Constants, e: Effects, dt: float
) -> tuple[float, float]:
    """The water node over the substep, into scratch.

    Returns what it takes off the stiffness of the wire's equation, and adds to its right side.
    """
    middle_water = s.T_water + 0.5 * dt * s.T_water_rate
    inertia = 2.0 * s.mean_filled * p.warming_share * p.water_capacity * (1.0 / dt)
    g_flow = s.flow * p.flow_conductance
    g_loss = s.mean_filled * p.tube_loss
    if e.loss_exponent != 0.0:
        g_loss = g_loss * convection_factor(
            middle_water - g.T_air, e.loss_exponent, e.loss_reference
        )
    stiff = inertia + w.g_water + g_flow + g_loss
    right = inertia * s.T_water + g_flow * g.T_inlet + g_loss * g.T_air + w.forced_water
    w.g_wall = 0.0
    if e.wall_ratio > 0.0:
        wall = e.wall_ratio * p.water_capacity
        w.g_wall = mean_conductance(s.mean_filled * e.wall_conductance, wall, dt)
        stiff += w.g_wall
        right += w.g_wall * s.T_wall
    w.g_flow = g_flow
    w.g_loss = g_loss
    w.leaves_warmer = 0.0
    if e.front > 0.0:
        left = s.water_off[CELLS - 1]
        move_front(s, w, p, middle_water - g.T_inlet, dt)
        w.leaves_warmer = 0.5 * e.front * (left + s.water_off[CELLS - 1])
        right -= g_flow * w.leaves_warmer
    w.per_water = 1.0 / stiff
    w.water_right = right
    return w.g_water * w.g_water * w.per_water, w.g_water * right * w.per_water


@inlined
def set_up_heat_balance(
    s: Spring,
    other: Spring,
    w: SpringWork,
    g: Shared,
    p: Constants,
    e: Effects,
    table: npt.NDArray[np.float64],
    forces: bool,
    dt: float,
) -> None:
    """T* and λ of one spring over the substep, Eqs (15)-(18), into scratch."""
    T = s.T_wire
    power = s.square_current * s.resistance * p.per_length
    per_dt = 1.0 / dt
    gain = s.work_heat * per_dt + w.forced_heat
    if e.crosstalk > 0.0:
        gain += e.crosstalk * p.per_length * (other.T_wire - T)
    set_conductances(s, w, g, p, e, table, forces, dt)
    warms = p.warms > 0.0
    net = power + gain - w.g_dry * (T - g.T_air)
    net = net - w.g_water * (T - (s.T_water if warms else g.T_inlet))
    w.capacity = p.capacity_heating if net >= 0.0 else p.capacity_cooling
    inertia = 2.0 * w.capacity * per_dt
    stiff = inertia + w.g_water + w.g_dry
    right = inertia * T + power + gain + w.g_dry * g.T_air
    w.per_water = 0.0
    if warms:
        less, more = eliminate_water(s, w, g, p, e, dt)
        stiff -= less
        right += more
    else:
        right += w.g_water * g.T_inlet
    w.latent_factor = 1.0
    if e.latent_slope != 0.0:
        stress = p.C1 * (s.tension - p.F0) / STRESS_REF_PA
        # Of a slack spring a steep slope would make it negative: the step would have no one root.
        w.latent_factor = max(1.0 + e.latent_slope * stress, 0.0)
    soft = 2.0 / stiff
    w.T_star = right * soft - T
    soft = soft * per_dt * w.latent_factor
    w.lam_heating = p.latent_heating * soft
    w.lam_cooling = p.latent_cooling * soft
    w.power = power


@inlined
def prepare_parts(s: Spring, w: SpringWork, p: Constants, e: Effects, dt: float) -> None:
    """What the kinetics need of the start of the substep, and first guesses of temperature."""
    w.T_shift = e.fatigue_shift * s.cycles + w.forced_shift
    w.rounds = 0.0
    guess = w.T_star
    if s.transforms > 0.0:
        guess = s.T_wire + dt * s.T_wire_rate
    parts = count_parts(e)
    w.front_share = e.front if parts > 1 else 1.0
    for i in range(parts):
        m, c = memory_of(i, parts, s), work_of(i, parts, w)
        off = 0.0
        c.T_wire = guess
        if parts > 1:
            off = e.front * s.wire_off[i]
            c.T_wire = off + w.T_star
            if s.transforms > 0.0:
                c.T_wire = off + s.T_wire + dt * s.cell_rate[i]
        if e.unified > 0.0:
            c.heating.begin = -1.0
            c.heating.turn = -1.0
            c.cooling.begin = -1.0
            c.cooling.turn = -1.0
            continue
        c.f_a = -1.0
        c.f_b = -1.0
        c.f_c = -1.0
        start = s.T_wire + off - w.T_shift - p.M_S
        end = guess + off - w.T_shift - p.M_S
        c.above_M_S = 1.0 if start > 0.0 else 0.0
        c.crossing = 0.0
        if start * end < 0.0:
            c.crossing = start / (start - end)
        if e.minor_kappa != 0.0:
            xi = m.xi_S + m.xi_T
            c.xi_back = m.xi_turn if m.direction < 0.0 else xi
            c.xi_forth = m.xi_turn if m.direction > 0.0 else xi


@compiled
def prepare_spring(
    s: Spring,
    other: Spring,
    w: SpringWork,
    g: Shared,
    p: Constants,
    e: Effects,
    table: npt.NDArray[np.float64],
    forces: bool,
    dt: float,
) -> None:
    """Heat balance of one spring over the substep, or its fed temperature, into scratch."""
    if w.fed == 0.0 or e.front > 0.0:
        set_up_heat_balance(s, other, w, g, p, e, table, forces, dt)
    if e.front > 0.0:
        # A cell has its own latent heat for half the step, on average, and loses some of it.
        soft = 2.0 * w.latent_factor / (2.0 * w.capacity + dt * (w.g_water + w.g_dry))
        w.cell_lam_heating = p.latent_heating * soft
        w.cell_lam_cooling = p.latent_cooling * soft
    else:
        w.cell_lam_heating = 0.0 if w.fed > 0.0 else w.lam_heating
        w.cell_lam_cooling = 0.0 if w.fed > 0.0 else w.lam_cooling
    if w.fed > 0.0:
        w.T_star = w.T_fed
        w.lam_heating = 0.0
        w.lam_cooling = 0.0
    prepare_parts(s, w, p, e, dt)


@inlined
def book_heat(
    s: Spring, w: SpringWork, g: Shared, p: Constants, e: Effects, change: float, dt: float
) -> None:
    """Water and wall temperatures at the end of the substep, and where the heat went.

    `s.T_wire` is still that at the start, `change` that of the martensite fraction.
    """
    length = p.length
    per_dt = 1.0 / dt
    middle = 0.5 * (w.T_end + s.T_wire)
    if w.per_water > 0.0:
        T_water = s.T_water
        middle_water = (w.water_right + w.g_water * middle) * w.per_water
        new_water = 2.0 * middle_water - T_water
        s.T_water_rate = (new_water - T_water) * per_dt
        s.T_water = new_water
        carried = length * dt * w.g_flow * (middle_water + w.leaves_warmer - g.T_inlet)
        # As the tube fills or drains: the share changes by twice the way from its mean to its end.
        entered = 2.0 * (s.filled - s.mean_filled) * p.warming_share * p.water_capacity
        s.heat_to_water -= length * entered * (middle_water - p.T_ref)
        s.heat_forced += length * dt * w.forced_water
        s.heat_to_air += length * dt * w.g_loss * (middle_water - g.T_air)
        if w.g_wall > 0.0:
            given = dt * w.g_wall * (middle_water - s.T_wall)
            s.T_wall += given / (e.wall_ratio * p.water_capacity)
    else:
        carried = length * dt * w.g_water * (middle - g.T_inlet)
    s.heat_to_water += carried
    g.reservoir_rise += e.inverse_reservoir * carried
    s.heat_to_air += length * dt * w.g_dry * (middle - g.T_air)
    s.heat_in += length * dt * w.power
    s.heat_forced += length * dt * w.forced_heat
    latent = (p.latent_heating if change < 0.0 else p.latent_cooling) * w.latent_factor
    s.unequal_heat += length * (
        (p.capacity_heating - w.capacity) * (w.T_end - s.T_wire)
        - (p.latent_heating - latent) * change
    )
