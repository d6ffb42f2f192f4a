"""The tendon between the springs: how much longer it grows, and what it is tied to."""

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import FLOW, KNOT, RUN_IN

Array = NDArray[np.float64]

COMPLIANCE = slot("tendon_compliance")
COGS = slot("cogging_wheel")
JETS = slot("jets_on_clip")
BIMETAL = slot("bimetal_tongue")
NOTCH = slot("ball_in_notch")
SHAKEN_KNOT = slot("shaken_knot")
TURNBUCKLE = slot("unwinding_turnbuckle")

COG_m = 10e-3  # travel from one cog of a wheel to the next
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
    turn = 2.0 * math.pi * (x / COG_m + e[2, COGS])
    total = e[0, COGS] * math.sin(turn)
    # A cog that lets go would tell Newton the wrong way: the springs alone bound its step.
    slope = 2.0 * math.pi * e[0, COGS] * max(math.cos(turn), 0.0) / COG_m
    off = (x - 6e-3 * (e[2, NOTCH] - 0.5)) / NOTCH_m
    held = e[0, NOTCH] * math.exp(0.5 * (1.0 - off * off))
    total += held * off
    slope += held * max(1.0 - off * off, 0.0) / NOTCH_m
    return total, slope


@compiled
def jets(full_flow: float, e: Array, side: Array) -> float:
    """Force against `x` (N) of the outlets' jets on what hangs on the tendon."""
    return float(e[0, JETS] * (side[1, FLOW] ** 2 - side[0, FLOW] ** 2) / full_flow**2)
