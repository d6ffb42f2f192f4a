"""What runs inside the exported unit: the plant of a model file, set and read by variable name."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from pathlib import Path

import msgspec

from sim_device.plant import Drive, Plant
from sim_device.plant import kernel as k
from sim_device.plant.models import read_model
from sim_device.plant.replay import OUTPUTS
from smad.fmi.errors import FmiError
from smad.fmi.variables import INPUTS, Variable, variables

MODEL = "model.toml"
MOUNTED = "mounted.json"
_PLACES = {name: (k.place_of(k.State, place), off) for name, (place, off) in OUTPUTS.items()}


class Mounted(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a model file does not say: the fixture, and what cools."""

    fixture: str = "antagonistic"
    cooling: str = "water"


class UnitOfPair:
    """The spring pair of a folder with `model.toml` and `mounted.json`, by names of variables.

    `values` holds inputs and parameters; parameters count until `start`. Outputs are SI but for
    those that end in `_degC`. There is no noise: what is read depends on what was set only.
    """

    def __init__(self, folder: Path) -> None:
        self._model = read_model(folder / MODEL)
        self._mounted = msgspec.json.decode((folder / MOUNTED).read_bytes(), type=Mounted)
        self.variables: list[Variable] = variables(self._model.parameters)
        self.values = {v.name: v.start for v in self.variables if v.start is not None}
        self._inputs = {name: (low, high) for name, _, _, low, high in INPUTS}
        self._plant: Plant | None = None

    def set(self, name: str, value: float) -> None:
        """Set an input or, before the start, a parameter.

        Raises FmiError for NaN and infinity, a value out of range, and a parameter while running.
        """
        if not isfinite(value):
            raise FmiError(f"{name} is not finite", value=value, action="set a finite number")
        if name in self._inputs:
            low, high = self._inputs[name]
            if (low is not None and value < low) or (high is not None and value > high):
                limit = f"at least {low:g}" if high is None else f"{low:g} to {high:g}"
                raise FmiError(f"{name} is out of range", value=value, limit=limit)
        elif self._plant is not None and value != self.values[name]:
            raise FmiError(
                f"parameter {name} cannot be changed while the unit runs",
                value=value,
                action="set it before initialisation ends",
            )
        self.values[name] = value

    def get(self, name: str) -> float:
        """An input, a parameter or an output, as it is now."""
        if name in self.values:
            return self.values[name]
        place, off = _PLACES[name]
        return float(self.started().numbers[place]) - off

    def started(self) -> Plant:
        """The plant at rest at the temperature of its inlet, made when first asked for.

        Raises ParameterError for parameters that do not fit together.
        """
        if self._plant is None:
            given = {name: self.values[name] for name in self._model.parameters.names}
            warm = "inlet_K" if self._mounted.cooling == "water" else "ambient_K"
            model = replace(self._model, parameters=self._model.parameters.replace(**given))
            self._plant = Plant(
                **model.physics,
                fixture=self._mounted.fixture,
                cooling=self._mounted.cooling,
                temperature_K=self.values[warm],
            )
            self._surround(self._plant)
        return self._plant

    def step(self, duration_s: float) -> None:
        """Hold the inputs for so long. Raises PlantError for what the plant cannot do."""
        v, plant = self.values, self.started()
        self._surround(plant)
        drive = Drive(
            (v["i_applied_x_A"], v["i_applied_y_A"]),
            (v["duty_x"], v["duty_y"]),
            (v["drain_x"] >= 0.5, v["drain_y"] >= 0.5),
            v["stage_m"],
        )
        plant.advance(drive, duration_s)

    def _surround(self, plant: Plant) -> None:
        plant.set_environment(inlet_K=self.values["inlet_K"], ambient_K=self.values["ambient_K"])
