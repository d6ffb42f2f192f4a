"""The one table of the variables that the exported unit has, and the units they are in."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from sim_device.plant.fields import FIELDS
from sim_device.plant.parameters import ParameterSet
from sim_device.plant.replay import OUTPUTS
from sim_device.plant.units import ZERO_C
from smad.units import unit_of


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One variable of the unit. `unit` is a key of BASE_UNITS, "" for a pure number."""

    name: str
    causality: str
    unit: str
    description: str
    start: float | None = None
    low: float | None = None
    high: float | None = None
    relative: bool = False


BASE_UNITS: Mapping[str, Mapping[str, float]] = {
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "Ohm m": {"kg": 1, "m": 3, "s": -3, "A": -2},
    "K": {"K": 1},
    "1/K": {"K": -1},
    "degC": {"K": 1, "offset": ZERO_C},
    "m": {"m": 1},
    "m2/s": {"m": 2, "s": -1},
    "m3/s": {"m": 3, "s": -1},
    "s": {"s": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "J/kg": {"m": 2, "s": -2},
    "J/(kg K)": {"m": 2, "s": -2, "K": -1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Pa/K": {"kg": 1, "m": -1, "s": -2, "K": -1},
    "W/(m K)": {"kg": 1, "m": 1, "s": -3, "K": -1},
    "kg/m3": {"kg": 1, "m": -3},
    "deg/m": {"rad": 1, "m": -1, "factor": pi / 180},
}
"""Unit -> exponents of the SI base units, with factor and offset to them, as FMI has it."""

_COUNTERS = ("kinetics_evaluations",)

INPUTS = (
    ("i_applied_x_A", "A", "current that the driver of spring X is given", 0.0, None),
    ("i_applied_y_A", "A", "current that the driver of spring Y is given", 0.0, None),
    ("duty_x", "", "duty of the pump that cools X", 0.0, 1.0),
    ("duty_y", "", "duty of the pump that cools Y", 0.0, 1.0),
    ("drain_x", "", "1 while the tube of X is being drained", 0.0, 1.0),
    ("drain_y", "", "1 while the tube of Y is being drained", 0.0, 1.0),
    ("stage_m", "m", "position of the motor stage", -1.0, 1.0),
    ("inlet_K", "K", "temperature of the water at the inlet", 200.0, 400.0),
    ("ambient_K", "K", "temperature of the air", 200.0, 400.0),
)
"""Name, unit, what it is, least, most; those of `sim_device.plant.replay.Inputs`."""


def outputs() -> list[Variable]:
    """Every output: what the sensors give without noise, and the states behind it (`true_…`)."""
    return [
        Variable(name=name, causality="output", unit=_base_unit(unit_of(name)), description=name)
        for name in OUTPUTS
        if name not in _COUNTERS
    ]


def variables(parameters: ParameterSet) -> list[Variable]:
    """Inputs, outputs and parameters of the unit; a parameter starts at its value in the set."""
    starts = {
        "inlet_K": parameters["water_temperature"],
        "ambient_K": parameters["ambient_temperature"],
    }
    inputs = [
        Variable(
            name=name,
            causality="input",
            unit=unit,
            description=text,
            low=low,
            high=high,
            start=starts.get(name, 0.0),
        )
        for name, unit, text, low, high in INPUTS
    ]
    fixed = [
        Variable(
            name=field.name,
            causality="parameter",
            unit=_base_unit(field.unit),
            description=f"{field.symbol}: {field.meaning}",
            start=parameters[field.name],
            low=field.low,
            high=field.high,
            relative=field.unit == "K difference",
        )
        for field in FIELDS
    ]
    return [*inputs, *outputs(), *fixed]


def _base_unit(unit: str) -> str:
    """A unit of a parameter file or a name, as BASE_UNITS has it."""
    return {"1": "", "K difference": "K", "m³/s": "m3/s"}.get(unit, unit)
