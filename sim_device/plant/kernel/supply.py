"""What a spring is supplied with: water from its pump, and current from its driver."""

from __future__ import annotations

import math

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.curves import clip01
from sim_device.plant.kernel.model import Constants, Effects
from sim_device.plant.kernel.state import Spring


@inlined
def scatter(count: float) -> float:
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
def lag_towards(goal: float, start: float, span: float, tau: float) -> tuple[float, float]:
    """A first-order lag from `start` after `span`, and its integral over that time."""
    if start == goal:
        return goal, goal * span
    gone = 1.0 - math.exp(-span / tau)
    return start + (goal - start) * gone, goal * span + (start - goal) * tau * gone


# In a shorter stop the water flows on. Control that switches at every sample makes dozens of them.
FLOWS_ON_S = 0.195


@inlined
def run_pump(s: Spring, p: Constants, e: Effects, duty: float, sign: float, dt: float) -> None:
    """Flow of one pump before leaks: linear in the duty, and what effects do to it."""
    if duty > 0.0:
        if s.pump_on <= -FLOWS_ON_S or s.pump_starts == 0.0:
            s.pump_starts += 1.0
        s.pump_on = max(s.pump_on, 0.0) + dt
    else:
        s.pump_on = min(s.pump_on, 0.0) - dt
    flow = p.flow_max * duty * p.wet
    # A dead time may end within the step.
    late = 1.0 - clip01((s.pump_on - e.pump_dead_time) / dt) if e.pump_dead_time > 0.0 else 0.0
    if e.flow_shortfall != 0.0:
        flow = flow * (1.0 - e.flow_shortfall)
    if e.uneven_flow != 0.0:
        flow = flow * (1.0 + sign * e.uneven_flow)
    s.wetted = 1.0
    if e.air_pockets > 0.0 and duty > 0.0:
        part = 1.0 - e.air_pockets * scatter(s.pump_starts)
        flow = flow * part
        s.wetted = part
    if e.pump_spinup > 0.0:
        start = s.pump_end_flow
        turn, before = lag_towards(0.0, start, late * dt, e.pump_spinup)
        end, after = lag_towards(flow, turn, (1.0 - late) * dt, e.pump_spinup)
        s.pump_flow = (before + after) / dt
        # What runs out ends; what spins up begins as slowly in a short step.
        s.pump_end_flow = end if flow > 0.0 or end >= 1e-3 * p.flow_max else 0.0
    else:
        s.pump_flow = (1.0 - late) * flow
        s.pump_end_flow = flow


@inlined
def fill_tube(s: Spring, p: Constants, e: Effects, drain: float, dt: float) -> None:
    """Drain or refill the tube."""
    filled = s.filled
    new = filled
    if s.flow > 0.0:
        new = filled + dt * s.flow * p.fill_rate
        new = min(new, 1.0)
    elif drain > 0.0:
        if filled > p.drain_film:
            new = p.drain_film + (filled - p.drain_film) * math.exp(-dt * p.drain_rate)
    elif e.drainage > 0.0:
        floor = p.wet * max(1.0 - e.drainage, p.drain_film)
        if filled > floor:
            new = floor + (filled - floor) * math.exp(-dt / e.drainage_time)
    s.mean_filled = 0.5 * (filled + new)
    s.filled = new


@inlined
def supply_water(
    s: Spring, other: Spring, p: Constants, e: Effects, drain: float, dt: float
) -> None:
    """Flow through the tube, leaks from the other side included, and how far the tube is filled."""
    s.flow = s.pump_flow
    if e.valve_leak > 0.0:
        s.flow += e.valve_leak * other.pump_flow
    fill_tube(s, p, e, drain, dt)


@inlined
def drive_current(
    s: Spring, p: Constants, e: Effects, command: float, dt: float
) -> tuple[float, float, float]:
    """Current that the driver makes of a command, and what effects do to it.

    Returns the current at the end of the substep, its mean and its variance over the substep.
    """
    current = command
    if e.driver_gain != 0.0:
        current = current * (1.0 + e.driver_gain)
    if e.driver_knee > 0.0 and current > 0.0:
        over = e.driver_knee * math.pow(current / p.I_max, e.driver_sharpness)
        current = current * math.pow(1.0 + over, -1.0 / e.driver_sharpness)
    if e.driver_lag > 0.0 and s.current != current:
        off = s.current - current
        left = math.exp(-dt / e.driver_lag)
        share = e.driver_lag * (1.0 - left) / dt  # mean of what is left over the substep
        variance = off * off * share * (0.5 * (1.0 + left) - share)
        return current + off * left, current + off * share, max(variance, 0.0)
    return current, current, 0.0


@inlined
def apply_current(
    s: Spring, p: Constants, e: Effects, current: float, mean: float, variance: float
) -> None:
    """Current and resistance of one spring: R = β_s L/A_c, and what effects add.

    `current` is that at the end of the substep; its mean and variance over it are what heats.
    """
    s.current = current
    s.square_current = mean * mean + variance
    if e.resistivity_T != 0.0 or e.resistivity_xi != 0.0 or e.r_resistivity != 0.0:
        xi = s.memory.xi_S + s.memory.xi_T
        factor = 1.0 + e.resistivity_T * (s.T_wire - p.T_ref)
        factor += e.resistivity_xi * (0.5 - xi) + e.r_resistivity * s.r_fraction
        s.resistance = p.resistance_per_m * p.length * factor
    else:
        # Anew: a forcing may have changed it.
        s.resistance = p.resistance_per_m * p.length
