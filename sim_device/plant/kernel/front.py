"""Effect cooling_front: five cells along the tube, stepped as deviations from the means."""

from __future__ import annotations

import math

from sim_device.plant.kernel.compiled import inlined
from sim_device.plant.kernel.model import Constants
from sim_device.plant.kernel.state import CELLS, Spring, SpringWork

SDIRK_PART = 1.0 - math.sqrt(0.5)
SDIRK_FURTHER = (1.0 - SDIRK_PART) / SDIRK_PART


@inlined
def mix_cells(s: Spring, w: SpringWork, p: Constants, warmer: float, dt: float) -> None:
    """One implicit Euler step of `move_front`; its cells need not be centred yet.

    What all cells lose to the outlet is such that their mean water stays: the row is solved
    without, and with nothing but a unit of it.
    """
    flow = w.g_flow
    capacity = w.capacity / dt
    wire = 1.0 / (capacity + w.g_water + w.g_dry)
    inertia = s.mean_filled * p.warming_share * p.water_capacity / dt
    water = 1.0 / (
        inertia + w.g_water + w.g_loss + w.g_wall + CELLS * flow - w.g_water * w.g_water * wire
    )
    upstream = -warmer
    unit = 0.0
    mean = 0.0
    unit_mean = 0.0
    for i in range(CELLS):
        right = inertia * s.water_off[i] + w.g_water * wire * capacity * s.wire_off[i]
        upstream = (right + CELLS * flow * upstream) * water
        unit = (1.0 + CELLS * flow * unit) * water
        s.water_off[i] = upstream
        w.cells[i].unit_water = unit
        mean += upstream
        unit_mean += unit
    leaving = -mean / unit_mean
    for i in range(CELLS):
        s.water_off[i] += leaving * w.cells[i].unit_water
        s.wire_off[i] = (capacity * s.wire_off[i] + w.g_water * s.water_off[i]) * wire


@inlined
def move_front(s: Spring, w: SpringWork, p: Constants, warmer: float, dt: float) -> None:
    """How far wire and water of each cell are from the means, one substep on.

    The cells are stirred tanks in a row; their means are what the heat balance solves, so that only
    the deviations are stepped. `warmer` is the mean of the water over the inlet. Of second order
    and damped where the step is long (SDIRK2, Alexander 1977): two steps of implicit Euler of a
    part of `dt`, the second from where the first leads to.
    """
    for i in range(CELLS):
        w.cells[i].wire_before = s.wire_off[i]
        w.cells[i].water_before = s.water_off[i]
    mix_cells(s, w, p, warmer, SDIRK_PART * dt)
    for i in range(CELLS):
        wire, water = w.cells[i].wire_before, w.cells[i].water_before
        s.wire_off[i] = wire + SDIRK_FURTHER * (s.wire_off[i] - wire)
        s.water_off[i] = water + SDIRK_FURTHER * (s.water_off[i] - water)
    mix_cells(s, w, p, warmer, SDIRK_PART * dt)


@inlined
def wire_off_at(place: float, s: Spring) -> float:
    """How far the wire at a place along the tube, 0 to 1 from the inlet, is from its mean, K."""
    where = place * CELLS - 0.5
    where = min(max(where, 0.0), CELLS - 1.0)
    cell = min(int(where), CELLS - 2)
    part = where - cell
    return float((1.0 - part) * s.wire_off[cell] + part * s.wire_off[cell + 1])


@inlined
def spread_latent_heat(s: Spring, w: SpringWork, p: Constants, released: float, dt: float) -> None:
    """What latent heat did to each cell beyond the mean, `released`, and what its water got of it.

    In scratch: how much warmer each cell ends for its own. It was so for half the step on average.
    """
    given = 0.0
    if w.per_water > 0.0:
        inertia = 2.0 * s.mean_filled * p.warming_share * p.water_capacity / dt
        given = w.g_water / (inertia + w.g_water + w.g_loss + w.g_wall + CELLS * w.g_flow)
    for i in range(CELLS):
        more = w.cells[i].own_rise - released
        s.wire_off[i] += more
        s.water_off[i] += given * more
