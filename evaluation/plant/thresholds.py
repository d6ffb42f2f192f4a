"""At what temperature one cell transforms: how far its curves stand off the stress-free ones."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    CHARGED,
    COOLED_FROM,
    DRAGGED,
    FRACTION,
    GRAINS,
    HEATED_FROM,
    INNER_STRESS,
    STRETCHED,
    TRAINED,
    WALLS,
    WORK_DONE,
    T,
    W,
)
from evaluation.plant.parameters import index
from evaluation.plant.phase import cooling_shift

Array = NDArray[np.float64]

HEAT_SLOPE = index("heat_slope_MPa_K")
STRESS = index("stress_MPa_N")

MINOR_LOOP = slot("minor_loop")
DRIFT = slot("transformation_drift")
LINGERING = slot("lingering_stress")
DRAGS = slot("dragging_interfaces")
ON_AUSTENITE = slot("load_on_austenite")
HYDROGEN = slot("hydrogen_of_flow")
TRAINS = slot("training_under_load")
COAT = slot("mismatched_coat")
DRAWN_OUT = slot("drawn_out_once")
NEIGHBOUR = slot("crackling_neighbour")
GRAINS_PLAY = slot("grains_with_play")
PINNED = slot("walls_pinned_at_rest")

GRAINS_K_N = 12.0  # what a newton that grains hold back does to the thresholds


@compiled
def shifts(
    s: int, i: int, stress: float, p: Array, e: Array, cells: Array, side: Array
) -> tuple[float, float]:
    """How far (K) the heating and cooling curves of one cell stand above the stress-free ones."""
    heat = stress / p[HEAT_SLOPE]
    cool = cooling_shift(stress, p)
    if e[s, MINOR_LOOP] > 0.0:
        heat += e[s, MINOR_LOOP] * (1.0 - cells[s, i, HEATED_FROM])
        cool -= 0.6 * e[s, MINOR_LOOP] * cells[s, i, COOLED_FROM]
    if e[s, DRIFT] > 0.0:
        fallen = e[s, DRIFT] * (1.0 - math.exp(-side[s, WORK_DONE] / 3.0))
        heat -= fallen
        cool -= fallen
    if e[s, LINGERING] > 0.0:
        lifted = e[s, LINGERING] * max(side[s, INNER_STRESS] - 1.35, 0.0) / 0.4
        heat += lifted
        cool += lifted
    left = e[s, ON_AUSTENITE] * (1.0 - cells[s, i, FRACTION]) * (stress / p[STRESS] - 1.24) / 0.4
    dragged = e[s, DRAGS] * side[s, DRAGGED]
    dragged += e[s, PINNED] * side[s, WALLS]
    dragged -= e[1 - s, NEIGHBOUR] * side[1 - s, DRAGGED]
    left -= e[s, DRAWN_OUT] * side[s, STRETCHED]
    left -= e[s, HYDROGEN] * side[s, CHARGED]
    load = stress / p[STRESS]
    half = 0.5 * e[s, GRAINS_PLAY]
    left += GRAINS_K_N * (min(max(side[s, GRAINS], load - half), load + half) - load)
    left += e[s, COAT] * (cells[s, i, T] - cells[s, i, W]) / 10.0
    cool += e[s, TRAINS] * (1.0 - math.exp(-side[s, TRAINED]))
    return heat + left + dragged, cool + left - dragged
