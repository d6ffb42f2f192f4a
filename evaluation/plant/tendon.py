"""The tendon between the springs: how much longer it grows, and what it is tied to."""

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import KNOT, RUN_IN

Array = NDArray[np.float64]

COMPLIANCE = slot("tendon_compliance")
BIMETAL = slot("bimetal_tongue")
NOTCH = slot("ball_in_notch")
SHAKEN_KNOT = slot("shaken_knot")
TURNBUCKLE = slot("unwinding_turnbuckle")

UNWINDS_m = 4e-2  # way of the tendon over which a turnbuckle unwinds
NOTCH_m = 2e-3  # from the middle of a notch to where it holds its ball most


@compiled
def longer_tendon(force: float, e: Array, pair: Array) -> tuple[float, float]:
    """How much longer the tendon is than at assembly (m), and its slope in force."""
    stretch = 1e-3 * e[0, SHAKEN_KNOT] * (1.0 - math.exp(-pair[KNOT]))
    stretch += 1e-3 * e[0, TURNBUCKLE] * (1.0 - math.exp(-pair[RUN_IN] / UNWINDS_m))
    slope = 0.0
    tension = max(force, 0.0)
    if e[0, COMPLIANCE] > 0.0:
        scale = e[0, COMPLIANCE] * 1e-3 / math.log(4.1)
        stretch += scale * (math.log(1.0 + tension / 0.4) - math.log(4.1))
        slope += scale / (0.4 + tension)
    return stretch, slope


@compiled
def tied(x: float, e: Array) -> tuple[float, float]:
    """Force against `x` (N) of what the tendon is tied to, and its slope."""
    off = (x - 6e-3 * (e[2, NOTCH] - 0.5)) / NOTCH_m
    held = e[0, NOTCH] * math.exp(0.5 * (1.0 - off * off))
    # A notch that lets go would tell Newton the wrong way: the springs alone bound its step.
    return held * off, held * max(1.0 - off * off, 0.0) / NOTCH_m
