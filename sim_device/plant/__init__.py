"""The physics of the bench: springs, heat, water, sensors, and the candidate effects.

Start with `load_parameters`, `Plant` and `simulate`; everything is SI.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim_device.plant.parameters import ParameterSet, load_parameters
    from sim_device.plant.plant import Plant
    from sim_device.plant.records import Drive, PlantTruth, Readings
    from sim_device.plant.replay import Inputs, Replay, simulate

# Loaded on first use: numba takes a second to import, and most commands never need it.
_HOMES = {
    "Drive": "records",
    "Inputs": "replay",
    "ParameterSet": "parameters",
    "Plant": "plant",
    "PlantTruth": "records",
    "Readings": "records",
    "Replay": "replay",
    "load_parameters": "parameters",
    "simulate": "replay",
}

__all__ = [
    "Drive",
    "Inputs",
    "ParameterSet",
    "Plant",
    "PlantTruth",
    "Readings",
    "Replay",
    "load_parameters",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
