"""Where a run begins: displacement, and how warm the springs are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from smad.runlog.reader import Column
    from smad.runlog.schema import Row

NEAR_MM, NEAR_K = 0.5, 1.5
"""A rest is that of the recorded run within these: what springs at rest keep of the run before is
0.35 mm at most after strokes to 45 °C, in the simulated bench."""


@dataclass(frozen=True)
class Start:
    """Displacement, and how much warmer than the water each spring is; None where not measured."""

    displacement_mm: float | None
    over_water_K: tuple[float | None, float | None]

    def mismatch(self, other: Start) -> str:
        """What keeps `other` from being this start, in words; empty when nothing does."""
        pairs = (
            ("displacement", self.displacement_mm, other.displacement_mm, NEAR_MM, "mm"),
            ("spring X over water", self.over_water_K[0], other.over_water_K[0], NEAR_K, "K"),
            ("spring Y over water", self.over_water_K[1], other.over_water_K[1], NEAR_K, "K"),
        )
        return ", ".join(
            f"{name} {here:.2f} {unit} instead of {then:.2f}"
            for name, then, here, allowed, unit in pairs
            if then is not None and here is not None and not abs(here - then) <= allowed
        )


def start_of_row(row: Row) -> Start:
    """The start that a sample would be."""
    return _start(lambda name: getattr(row, name))


def start_of_columns(columns: dict[str, Column], first: int = 0) -> Start:
    """The start of a recorded run at sample `first`: medians over a tenth of a second."""

    def shown(name: str) -> float | None:
        values = np.asarray(columns[name], float)[first : first + 10]
        values = values[np.isfinite(values)]
        return float(np.median(values)) if len(values) else None

    return _start(shown)


def _start(shown: Callable[[str], float | None]) -> Start:
    """The start by what each channel shows."""
    water = shown("rtd_inlet_degC")

    def over(spring: float | None) -> float | None:
        return None if spring is None or water is None else spring - water

    springs = over(shown("rtd_x_degC")), over(shown("rtd_y_degC"))
    return Start(shown("displacement_mm"), springs)
