"""What goes into the plant at a sample and what comes out of it."""

from __future__ import annotations

import msgspec

Pair = tuple[float, float]


class Drive(msgspec.Struct, frozen=True):
    """What the board applies. Springs in the order (X, Y).

    i_A: currents, A. pump_duty: 0 to 1. drain: air purge of the tube. stage_m: position of the
    motor stage; the deflection itself in fixture "stretch", added to δ0 in "blocked".
    """

    i_A: Pair = (0.0, 0.0)
    pump_duty: Pair = (0.0, 0.0)
    drain: tuple[bool, bool] = (False, False)
    stage_m: float = 0.0


class Readings(msgspec.Struct, frozen=True):
    """What the sensors give before quantisation, with their dynamics and noise.

    rtd_degC: spring X, spring Y, water inlet, ambient. displacement_m: positive when X contracts.
    """

    i_A: Pair
    v_V: Pair
    rtd_degC: tuple[float, float, float, float]
    displacement_m: float
    force_N: float
    supply_V: float


class PlantTruth(msgspec.Struct, frozen=True):
    """The state behind the readings, SI, springs in the order (X, Y)."""

    t_s: float
    T_K: Pair
    T_water_K: Pair
    xi: Pair
    xi_S: Pair
    xi_T: Pair
    spring_force_N: Pair
    deflection_m: Pair
    displacement_m: float
    force_N: float
    i_A: Pair
    resistance_Ohm: Pair
    flow_m3_s: Pair
    fill: Pair
    inlet_K: float
    ambient_K: float
