"""The improved model as a file, so that the simulator itself becomes the better one."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.diagnosis.verdict import Verdict


@runtime_checkable
class SavesModel(Protocol):
    """A plant that can write a model file, with what is uncertain of it where that is known."""

    def save_model(
        self, point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
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
