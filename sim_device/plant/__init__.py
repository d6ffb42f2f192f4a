"""The physics of the bench: springs, heat, water, sensors, and the candidate effects.

Start with `load_parameters`, `Plant` and `simulate`; everything is SI. `Law`, `Term` and what
computes them hold for any plant.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim_device.plant.laws import (
        Law,
        Term,
        basis,
        joined,
        own_states,
        terms_over,
        unit_of_state,
    )
    from sim_device.plant.parameters import ParameterSet, load_parameters
    from sim_device.plant.plant import Plant
    from sim_device.plant.records import Drive, PlantTruth, Readings
    from sim_device.plant.replay import Inputs, Replay, simulate

# Loaded on first use: numba takes a second to import, and most commands never need it.
_HOMES = {
    "laws": ("Law", "Term", "basis", "joined", "own_states", "terms_over", "unit_of_state"),
    "parameters": ("ParameterSet", "load_parameters"),
    "plant": ("Plant",),
    "records": ("Drive", "PlantTruth", "Readings"),
    "replay": ("Inputs", "Replay", "simulate"),
}

__all__ = [
    "Drive",
    "Inputs",
    "Law",
    "ParameterSet",
    "Plant",
    "PlantTruth",
    "Readings",
    "Replay",
    "Term",
    "basis",
    "joined",
    "load_parameters",
    "own_states",
    "simulate",
    "terms_over",
    "unit_of_state",
]


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
