"""The board's parameters: one table, and a store that keeps values within it.

A parameter belongs to an axis, except those marked `shared`, of which axis 0 holds the only copy.
All values are whole numbers (i32) in the unit named. The bounds are compiled into the board: a
stored soft limit may only tighten what the supervisor enforces anyway.
"""

from __future__ import annotations

import enum
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

from firmware_protocol.enums import ErrorCode
from firmware_protocol.errors import ParameterError


class ParameterKind(enum.IntEnum):
    """Type of a parameter's value."""

    NUMBER = 0
    CHOICE = 1
    SWITCH = 2


@dataclass(frozen=True)
class Parameter:
    """One row of the table."""

    number: int
    name: str
    default: int
    minimum: int
    maximum: int
    unit: str
    doc: str
    choices: tuple[int, ...] = ()
    shared: bool = False

    @property
    def kind(self) -> ParameterKind:
        """Type, as PARAM_VALUE tells it."""
        if self.choices:
            return ParameterKind.CHOICE
        if (self.minimum, self.maximum) == (0, 1):
            return ParameterKind.SWITCH
        return ParameterKind.NUMBER


PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        1, "state_rate_hz", 100, 100, 500, "Hz", "rate of STATE", (100, 250, 500), shared=True
    ),
    Parameter(
        10, "encoder_nm_per_count", 1000, -1_000_000, 1_000_000, "nm", "scale of the encoder"
    ),
    Parameter(11, "encoder_offset_counts", 0, -(2**30), 2**30, "counts", "encoder at zero"),
    Parameter(
        12, "force_uN_per_count", 1000, -1_000_000, 1_000_000, "uN", "scale of the force cell"
    ),
    Parameter(13, "force_offset_counts", 0, -(2**30), 2**30, "counts", "force cell at zero"),
    Parameter(20, "current_limit_mA", 4000, 0, 4000, "mA", "most current in a spring"),
    Parameter(21, "temperature_limit_cC", 9000, 3000, 9000, "cC", "trip of a spring's RTD"),
    Parameter(22, "cold_cC", 4500, 2000, 4500, "cC", "cold enough to arm or to end COOL"),
    Parameter(23, "on_time_limit_s", 3600, 1, 7200, "s", "longest time of one arming"),
    Parameter(24, "force_limit_mN", 20000, 0, 20000, "mN", "trip of the tendon force"),
    Parameter(25, "travel_limit_um", 20000, 0, 20000, "um", "trip of the displacement, both ways"),
    Parameter(26, "setpoint_ttl_ms", 100, 10, 100, "ms", "longest time without a fresh setpoint"),
)
"""All parameters. Numbers are never used again for another meaning."""

BY_NUMBER: Mapping[int, Parameter] = {p.number: p for p in PARAMETERS}
BY_NAME: Mapping[str, Parameter] = {p.name: p for p in PARAMETERS}


class ParameterRefusedError(ParameterError):
    """A value was refused: `code` for the wire, and the limit that it broke."""

    def __init__(self, message: str, code: ErrorCode, value: int, limit: int) -> None:
        super().__init__(message)
        self.code = code
        self.value = value
        self.limit = limit


def crc_of(values: Mapping[tuple[int, int], int]) -> int:
    """Return the CRC-32 of values by (axis, number): each as u8, u16, i32 in rising order."""
    crc = 0
    for (axis, number), value in sorted(values.items()):
        crc = zlib.crc32(struct.pack("<BHi", axis, number, value), crc)
    return crc


class ParameterStore:
    """The values in use, by (axis, number)."""

    def __init__(self, axes: int = 1) -> None:
        self.axes = axes
        self.values: dict[tuple[int, int], int] = {
            (axis, p.number): p.default
            for axis in range(axes)
            for p in PARAMETERS
            if axis == 0 or not p.shared
        }

    @property
    def crc(self) -> int:
        """CRC-32 of all values."""
        return crc_of(self.values)

    def get(self, name: str, axis: int = 0) -> int:
        """Return a value by its name."""
        parameter = BY_NAME[name]
        return self.values[0 if parameter.shared else axis, parameter.number]

    def find(self, axis: int, number: int) -> Parameter:
        """Return the row; raises ParameterRefusedError if axis or number do not exist."""
        if axis >= self.axes:
            raise ParameterRefusedError(
                f"axis {axis} does not exist; this board has {self.axes}",
                ErrorCode.NO_SUCH_AXIS,
                axis,
                self.axes - 1,
            )
        if (axis, number) not in self.values:
            raise ParameterRefusedError(
                f"axis {axis} has no parameter {number}; docs/protocol.md lists them",
                ErrorCode.UNKNOWN_PARAMETER,
                number,
                0,
            )
        return BY_NUMBER[number]

    def set(self, axis: int, number: int, value: int) -> None:
        """Change a value; raises ParameterRefusedError if it is out of range."""
        parameter = self.find(axis, number)
        low, high = parameter.minimum, parameter.maximum
        if not low <= value <= high or (parameter.choices and value not in parameter.choices):
            allowed = parameter.choices or f"{low}…{high}"
            raise ParameterRefusedError(
                f"{parameter.name} = {value} {parameter.unit} is not allowed; give {allowed}",
                ErrorCode.OUT_OF_RANGE,
                value,
                low if value < low else high,
            )
        self.values[axis, number] = value
