"""Recorded runs on the grid: what the model replays, and the readings that it should show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from smad.diagnosis.data.played import Played
from smad.diagnosis.data.rows import binned
from smad.diagnosis.plant import Array, Mask, PlantModel
from smad.diagnosis.runs import GapRun


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Runs on the grid: what the model replays, and readings (bins, channels) that are valid."""

    played: tuple[Played, ...]
    values: tuple[Array, ...]
    valid: tuple[Mask, ...]

    @classmethod
    def of(cls, plant: PlantModel, runs: Sequence[GapRun], period_s: float) -> Measured:
        """The runs, each on a grid of `period_s` that begins with it."""
        played = tuple(Played.of(r, plant.inputs, float(r.t_s[0] - r.dt_s), period_s) for r in runs)
        measured = [
            binned(r, p.bins, plant, p.start_s, period_s) for r, p in zip(runs, played, strict=True)
        ]
        return cls(
            played=played,
            values=tuple(b.values for b in measured),
            valid=tuple(b.valid for b in measured),
        )
