"""Hysteresis of the wire: a Preisach operator with a smooth density, one for each cell.

The density is carried by generalised plays (Visintin 1994, ch. III; Krasnosel'skii & Pokrovskii
1989): each play holds its share of martensite between a heating and a cooling curve.
"""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.layout import PLAY, PLAYS
from evaluation.plant.parameters import index

Array = NDArray[np.float64]

HEAT_CENTRE = index("heat_centre_degC")
HEAT_SPREAD = index("heat_spread_K")
COOL_CENTRE = index("cool_centre_degC")
COOL_SPREAD = index("cool_spread_K")
TURN_ONSET = index("turn_onset_MPa")
TURN_SCALE = index("turn_scale_MPa")
TURN_POWER = index("turn_power")
COOL_SLOPE = index("cool_slope_MPa_K")

ON_HEATING = np.array([-0.62, -0.36, -0.10, 0.14, 0.40, 0.66])
ON_COOLING = np.array([-0.30, 0.50, -0.60, 0.10, 0.65, -0.10])
WEIGHT = np.array([0.12, 0.18, 0.22, 0.20, 0.16, 0.12])
HALF_WIDTH = 0.5  # of one play's curves, in units of the spread
COOL_HALF_WIDTH = 0.75


@compiled
def falling(z: float) -> float:
    """1 below −1, 0 above 1, a cubic between."""
    if z <= -1.0:
        return 1.0
    if z >= 1.0:
        return 0.0
    return 0.5 - 0.25 * z * (3.0 - z * z)


@compiled
def martensite(
    plays: Array, temperature: float, shift_heat: float, shift_cool: float, p: Array, out: Array
) -> tuple[float, float]:
    """Martensite fraction and its slope dξ/dT at `temperature`; the plays' new values in `out`.

    `shift_heat`, `shift_cool` (K) move the two curves upward, as stress does.
    """
    fraction = 0.0
    slope = 0.0
    width_heat = HALF_WIDTH * p[HEAT_SPREAD]
    width_cool = COOL_HALF_WIDTH * p[COOL_SPREAD]
    for k in range(PLAYS):
        z = (
            temperature - shift_heat - p[HEAT_CENTRE] - ON_HEATING[k] * p[HEAT_SPREAD]
        ) / width_heat
        upper = falling(z)
        zc = (temperature - shift_cool - p[COOL_CENTRE] - ON_COOLING[k] * p[COOL_SPREAD]) / (
            width_cool
        )
        lower = falling(zc)
        upper = max(upper, lower)
        value = plays[PLAY + k]
        if value > upper:
            value = upper
            if -1.0 < z < 1.0:
                slope -= WEIGHT[k] * 0.75 * (1.0 - z * z) / width_heat
        elif value < lower:
            value = lower
            if -1.0 < zc < 1.0:
                slope -= WEIGHT[k] * 0.75 * (1.0 - zc * zc) / width_cool
        out[k] = value
        fraction += WEIGHT[k] * value
    return fraction, slope


@compiled
def turned_by(stress_MPa: float, p: Array) -> float:
    """Share of martensite that a stress turns (Weibull law in the excess stress)."""
    excess = stress_MPa - p[TURN_ONSET]
    if excess <= 0.0:
        return 0.0
    return 1.0 - math.exp(-((excess / p[TURN_SCALE]) ** p[TURN_POWER]))


@compiled
def cooling_shift(stress_MPa: float, p: Array) -> float:
    """How far (K) stress lifts the cooling curve: nothing below the onset of turning."""
    excess = stress_MPa - p[TURN_ONSET]
    return float(0.5 * (excess + math.sqrt(excess * excess + 9.0)) / p[COOL_SLOPE])
