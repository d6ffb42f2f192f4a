"""The improved model as a file, so that the simulator itself becomes the better one."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.diagnosis.verdict import Verdict


@runtime_checkable
class SavesModel(Protocol):
    """A plant that can write a model file."""

    def save_model(self, point: ModelPoint, path: Path, note: str) -> None: ...


@runtime_checkable
class SavesUncertainty(Protocol):
    """What such a plant has beside, if its model files say how uncertain their values are."""

    def save_uncertain(
        self, point: ModelPoint, uncertainty: Uncertainty, path: Path, note: str
    ) -> None: ...


def apply(verdict: Verdict, path: Path, first: int | None = None) -> None:
    """Writes the model of a verdict: with its first places, or all.

    Raises PlantMismatch where the verdict has no model, or not as many places.
    """
    if not verdict.models:
        raise PlantMismatch(
            "this verdict has no model to write",
            value=f"{verdict.outcome}, plant {verdict.plant}",
            action="mend what it refuses, or ask a plant that writes model files",
        )
    most = len(verdict.models) - 1
    if first is not None and not 0 <= first <= most:
        raise PlantMismatch(
            "the verdict has fewer places",
            value=first,
            limit=f"0 (parameters alone) to {most}",
            action="give a number of places that it lists",
        )
    path.write_text(verdict.models[most if first is None else first], "utf-8")


def write_model(
    plant: SavesModel, point: ModelPoint, uncertainty: Uncertainty | None, path: Path, note: str
) -> None:
    """Writes a model file, with what is uncertain of it where that is known and can be kept."""
    if uncertainty is not None and isinstance(plant, SavesUncertainty):
        plant.save_uncertain(point, uncertainty, path, note)
    else:
        plant.save_model(point, path, note)
