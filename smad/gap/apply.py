"""The improved model as a file, so that the simulator itself becomes the better one."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from smad.gap.errors import PlantMismatch
from smad.gap.plant import ModelPoint, Uncertainty
from smad.gap.records import Diagnosis


class SavesModel(Protocol):
    """A plant that can write a model file."""

    def save_model(self, point: ModelPoint, path: Path, note: str) -> None: ...


class Savable(SavesModel, Protocol):
    """A plant that can write a model file, and read it back."""

    @property
    def name(self) -> str: ...
    def load_model(self, path: Path) -> ModelPoint: ...


@runtime_checkable
class SavesUncertainty(Protocol):
    """What such a plant has beside, if its model files say how uncertain their values are."""

    def save_uncertain(
        self, point: ModelPoint, uncertainty: Uncertainty, path: Path, note: str
    ) -> None: ...


def uncertainty_of(diagnosis: Diagnosis) -> Uncertainty | None:
    """What the diagnosis left uncertain; None for one that was made without it."""
    known: dict[str, Any] | None = diagnosis.model.get("covariance")
    if not known:
        return None
    return Uncertainty(tuple(known["names"]), np.array(known["matrix"], dtype=np.float64))


def model_point(diagnosis: Diagnosis) -> ModelPoint:
    """The final model: the refit, with the effects when a cause was named.

    Raises PlantMismatch for a diagnosis that refused its runs.
    """
    model: dict[str, Any] = diagnosis.model
    if not model:
        raise PlantMismatch(
            "this diagnosis has no model: no run could be used",
            value=diagnosis.verdict.outcome.value,
            action="mend what the report refuses, and diagnose again",
        )
    return ModelPoint(model["theta"], model["effects"])


def apply(diagnosis: Diagnosis, plant: Savable, path: Path) -> ModelPoint:
    """Writes the model file and returns the point it holds.

    Raises PlantMismatch when the diagnosis is of another plant.
    """
    if diagnosis.plant != plant.name:
        raise PlantMismatch(
            "the diagnosis is of another plant",
            value=diagnosis.plant,
            limit=plant.name,
            action="apply it to the plant it was made with",
        )
    point = model_point(diagnosis)
    write_model(plant, point, uncertainty_of(diagnosis), path, diagnosis.verdict.plain)
    return point


def write_model(
    plant: SavesModel, point: ModelPoint, uncertainty: Uncertainty | None, path: Path, note: str
) -> None:
    """Writes a model file, with what is uncertain of it where that is known and can be kept."""
    if uncertainty is not None and isinstance(plant, SavesUncertainty):
        plant.save_uncertain(point, uncertainty, path, note)
    else:
        plant.save_model(point, path, note)
