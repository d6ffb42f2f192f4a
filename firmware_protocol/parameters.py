"""The board's parameters: one table, and a store that keeps values within it.

A parameter belongs to an axis, except those marked `shared`, of which axis 0 holds the only copy.
All values are whole numbers (i32) in the unit named. What describes the bench stands here; the
limits come from the supervisor's table, where a stored value may only tighten the compiled one.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

from firmware_protocol.enums import ErrorCode, ParameterKind
from firmware_protocol.errors import ParameterError
from firmware_protocol.supervisor.limits import LIMIT_ROWS, Limits, compiled_limits, tighten

_ENTRY = struct.Struct("<BHi")
_CRC = struct.Struct("<I")


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
    never_zero: bool = False

    @property
    def allowed(self) -> str:
        """What is taken, in words."""
        if self.choices:
            return ", ".join(map(str, self.choices))
        return f"{self.minimum} … {self.maximum}{', not 0' if self.never_zero else ''}"

    def takes(self, value: int) -> bool:
        """Whether `value` is allowed."""
        if self.choices:
            return value in self.choices
        return self.minimum <= value <= self.maximum and (value != 0 or not self.never_zero)

    @property
    def kind(self) -> ParameterKind:
        """Type, as PARAM_VALUE tells it."""
        if self.choices:
            return ParameterKind.CHOICE
        if (self.minimum, self.maximum) == (0, 1):
            return ParameterKind.SWITCH
        return ParameterKind.NUMBER


BENCH_PARAMETERS: tuple[Parameter, ...] = (
    Parameter(
        1, "state_rate_hz", 100, 100, 500, "Hz", "rate of STATE", (100, 250, 500), shared=True
    ),
    Parameter(
        10,
        "encoder_nm_per_count",
        1000,
        -1_000_000,
        1_000_000,
        "nm",
        "displacement of one encoder count; negative if it counts the other way",
        never_zero=True,
    ),
    Parameter(11, "encoder_offset_counts", 0, -(2**30), 2**30, "counts", "encoder reading at 0 mm"),
    Parameter(
        12,
        "force_uN_per_count",
        1000,
        -1_000_000,
        1_000_000,
        "uN",
        "force of one count; negative if it counts the other way",
        never_zero=True,
    ),
    Parameter(13, "force_offset_counts", 0, -(2**30), 2**30, "counts", "force reading at 0 N"),
    Parameter(
        14,
        "axis_name_crc",
        0,
        0,
        2**30 - 1,
        "",
        "low 30 bits of the CRC-32 of the name of its axis; 0: none is stored",
    ),
)

LIMIT_PARAMETERS: tuple[Parameter, ...] = tuple(
    Parameter(
        number=row.number,
        name=name,
        default=row.compiled,
        minimum=min(row.compiled, row.tightest),
        maximum=max(row.compiled, row.tightest),
        unit=row.unit,
        doc=row.reason,
    )
    for name, row in sorted(LIMIT_ROWS.items(), key=lambda item: item[1].number)
    if row.number
)

PARAMETERS: tuple[Parameter, ...] = BENCH_PARAMETERS + LIMIT_PARAMETERS
"""All parameters. A number is never used again for another meaning."""

BY_NUMBER: Mapping[int, Parameter] = {p.number: p for p in PARAMETERS}
BY_NAME: Mapping[str, Parameter] = {p.name: p for p in PARAMETERS}


class ParameterRefusedError(ParameterError):
    """A value was refused: `code` for the wire, and the limit that it broke."""

    def __init__(self, message: str, code: ErrorCode, value: int, limit: int) -> None:
        super().__init__(message)
        self.code = code
        self.value = value
        self.limit = limit


class DamagedImageError(ParameterError):
    """Stored parameters do not match their CRC."""


def axis_name_crc(name: str) -> int:
    """Return what a board stores of the name of its axis, never 0: that stands for none."""
    return zlib.crc32(name.encode()) & 0x3FFF_FFFF or 1


def crc_of(values: Mapping[tuple[int, int], int]) -> int:
    """Return the CRC-32 of values by (axis, number): each as u8, u16, i32 in rising order."""
    return zlib.crc32(_packed(values))


def _packed(values: Mapping[tuple[int, int], int]) -> bytes:
    return b"".join(
        _ENTRY.pack(axis, number, value) for (axis, number), value in sorted(values.items())
    )


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

    def limits(self, axis: int = 0) -> Limits:
        """Return the supervisor's limits as the stored values tighten them."""
        stored = {p.name: self.get(p.name, axis) for p in LIMIT_PARAMETERS}
        return tighten(compiled_limits(), stored)

    def find(self, axis: int, number: int) -> Parameter:
        """Return the row; raises ParameterRefusedError if axis or number do not exist."""
        if axis >= self.axes:
            raise ParameterRefusedError(
                f"axis {axis} does not exist; the last one of this board is {self.axes - 1}",
                ErrorCode.NO_SUCH_AXIS,
                axis,
                self.axes - 1,
            )
        if (axis, number) not in self.values:
            raise ParameterRefusedError(
                f"axis {axis} has no parameter {number}; smad docs protocol lists them",
                ErrorCode.UNKNOWN_PARAMETER,
                number,
                0,
            )
        return BY_NUMBER[number]

    def set(self, axis: int, number: int, value: int) -> None:
        """Change a value; raises ParameterRefusedError if it is out of range."""
        parameter = self.find(axis, number)
        if not parameter.takes(value):
            raise ParameterRefusedError(
                f"{parameter.name} = {value} {parameter.unit} is not allowed; "
                f"give {parameter.allowed}",
                ErrorCode.OUT_OF_RANGE,
                value,
                parameter.minimum if value < parameter.minimum else parameter.maximum,
            )
        self.values[axis, number] = value

    def image(self) -> bytes:
        """Return the values as the board stores them: entries, then their CRC-32."""
        packed = _packed(self.values)
        return packed + _CRC.pack(zlib.crc32(packed))

    def load(self, image: bytes) -> None:
        """Take over a stored image; entries that no longer exist or fit keep their defaults.

        Raises DamagedImageError, and changes nothing, if the CRC is wrong.
        """
        packed, crc = image[: -_CRC.size], image[-_CRC.size :]
        if len(packed) % _ENTRY.size or crc != _CRC.pack(zlib.crc32(packed)):
            raise DamagedImageError(
                f"the stored parameters ({len(image)} bytes) do not match their CRC; "
                "set them again and save them"
            )
        for axis, number, value in _ENTRY.iter_unpack(packed):
            try:
                self.set(axis, number, value)
            except ParameterRefusedError:
                continue
