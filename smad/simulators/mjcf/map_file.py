"""The map file of a MuJoCo model (TOML): which column is which part, what may be refitted."""

from pathlib import Path
from typing import Annotated

import msgspec

from smad.config.toml_file import read_toml
from smad.simulators.by_map import ColumnMap, ColumnRow, Held, ModelParameterRow, Positive
from smad.simulators.errors import SimulatorError

PAGE = "your-simulator"


class InputRow(ColumnRow, frozen=True, kw_only=True):
    """An input: control of the `actuator`, or torque at the `joint` = scale · column + offset.

    `held`: the row's value was in force *until* its time, or *from* it on. `exact` inputs are no
    places.
    """

    actuator: str = ""
    joint: str = ""
    held: Held | None = None
    exact: bool = False


class ChannelRow(ColumnRow, frozen=True, kw_only=True):
    """What was measured: position of the `joint`, `velocity_of` one, or number `index` of a
    `sensor`; channel = scale · value + offset."""

    joint: str = ""
    velocity_of: str = ""
    sensor: str = ""
    index: Annotated[int, msgspec.Meta(ge=0)] = 0
    noise: Positive | None = None


class ParameterRow(ModelParameterRow, frozen=True, kw_only=True):
    """The `field` of the part `of` that the refit may move; it begins where the model has it."""

    field: str
    of: str = ""


class MjcfMap(ColumnMap, frozen=True, kw_only=True):
    """A map file. `payload_at` are the bodies that may carry one (default: all that move).

    `shortest_s`: how long a run must be.
    """

    channels: dict[str, ChannelRow]
    parameters: dict[str, ParameterRow]
    inputs: dict[str, InputRow] = msgspec.field(default_factory=dict)
    payload_at: tuple[str, ...] | None = None
    observed: tuple[str, ...] = ()
    shortest_s: Positive | None = None


def read_map(path: Path) -> MjcfMap:
    """Read a map file. Raises SimulatorError for one that cannot be read, by the key's name."""
    action = f"smad docs {PAGE} shows a map file"
    mapped = read_toml(path, MjcfMap, "map file", SimulatorError, action)
    for table in ("channels", "parameters"):
        if not getattr(mapped, table):
            raise SimulatorError(f"map file {path} has no {table}", action=f"add [{table}.NAME]")
    for name, drive in mapped.inputs.items():
        if bool(drive.actuator) == bool(drive.joint):
            raise SimulatorError(
                f"map file {path}, inputs.{name} is neither of an actuator nor of a joint",
                action="give one of actuator, joint",
            )
    for name, row in mapped.channels.items():
        if sum(map(bool, (row.joint, row.velocity_of, row.sensor))) != 1:
            raise SimulatorError(
                f"map file {path}, channels.{name} is not of one part of the model",
                action="give one of joint, velocity_of, sensor",
            )
    return mapped
