"""The table of everything that can be added to the plant, and effects at work."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evaluation.plant import listed, opened, sealed, spent, unlisted
from evaluation.plant.effect import Effect, Kind

EFFECTS: tuple[Effect, ...] = (
    listed.EFFECTS + unlisted.EFFECTS + opened.EFFECTS + spent.EFFECTS + sealed.EFFECTS
)

SIGNED = (
    frozenset(
        (
            "driver_gain",
            "rtd_offset",
            "force_offset",
            "force_gain",
            "ambient_drift",
            "convection_exponent",
            "stress_latent_heat",
            "motor_beside_sensor",
            "gradient_in_cell",
            "lever_on_encoder",
            "bimetal_tongue",
            "lifting_head",
            "unlike_crimp",
            "joined_scales",
            "quadratic_rtd",
            "settling_reference",
            "sagging_lead",
            "wavy_converter",
            "wrong_compensation",
            "joining_stage",
            "swaying_reference",
            "parting_rtd_joint",
            "charging_slide",
            "zeroed_at_rest",
        )
    )
    | sealed.SIGNED
)
"""Effects whose magnitude may be negative."""

BY_NAME = {effect.name: effect for effect in EFFECTS}
_SLOT = {effect.name: i for i, effect in enumerate(EFFECTS)}


def slot(name: str) -> int:
    """Column of one effect in the magnitude array of :func:`magnitudes`."""
    return _SLOT[name]


def names(kind: Kind) -> tuple[str, ...]:
    """Names of all effects of one kind, in the table's order."""
    return tuple(e.name for e in EFFECTS if e.kind == kind)


@dataclass(frozen=True)
class Active:
    """One effect at work: magnitude in the table's unit, the springs' shares, and a free shape."""

    name: str
    magnitude: float
    y_share: float = 1.0
    shape: float = 0.5
    x_share: float = 1.0

    @property
    def side(self) -> Literal["x", "y", "both"]:
        """On which spring it acts."""
        acts = BY_NAME[self.name].side
        if acts == "both" or (self.x_share and self.y_share):
            return "both"
        return "x" if (self.y_share == 0.0) == (acts != "across") else "y"


def magnitudes(active: tuple[Active, ...] = ()) -> NDArray[np.float64]:
    """Array (3, number of effects): magnitude on X, on Y, and the shape number in 0…1."""
    table = np.zeros((3, len(EFFECTS)))
    table[2] = 0.5
    for effect in active:
        on_x, on_y = effect.magnitude * effect.x_share, effect.magnitude * effect.y_share
        table[:, slot(effect.name)] = on_x, on_y, effect.shape
    return table
