"""Which channel a column of a foreign log is, told from its name: a quantity and a unit.

`temp_x_degC`, `T_x_K`, `Displacement [m]` and `current_x (mA)` are understood. What is not
understood is left out and listed; what is half understood (a known quantity without a unit, or with
one that does not fit) is refused, because a guess would be a factor of a thousand.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated

import msgspec

from firmware_protocol.nearest import instead
from smad.errors import LogImportError
from smad.records.units import converts
from smad.runlog.schema import CHANNELS
from smad.units import (
    BRACKETED,
    WITHOUT,
    alternatives,
    known,
    parted_name,
    spelt,
    unit_of,
    units_for,
)

_PER_SPRING = {
    "i_cmd_{}_A": ("i_cmd", "current_cmd", "current_command", "current_set"),
    "i_applied_{}_A": ("i_applied", "current_applied"),
    "i_meas_{}_A": ("i_meas", "i", "current", "current_meas"),
    "v_{}_V": ("v", "u", "voltage"),
    "duty_{}": ("duty", "pump", "pump_duty"),
    "rtd_{}_degC": ("rtd", "t", "temp", "temperature"),
}
_SINGLE = {
    "t_s": ("t", "time", "board_time"),
    "host_time_s": ("host_time", "unix_time", "timestamp"),
    "rtd_inlet_degC": ("rtd_inlet", "t_inlet", "temp_inlet", "temp_water", "t_w"),
    "rtd_ambient_degC": ("rtd_ambient", "t_ambient", "temp_ambient", "temp_room", "t_a"),
    "displacement_mm": ("displacement", "disp", "position", "x"),
    "angle_deg": ("angle",),
    "force_N": ("force", "f", "load"),
    "supply_V": ("supply", "vbus", "bus_voltage"),
    "stage_mm": ("stage",),
    "reference_mm": ("reference", "ref", "target"),
    "setpoint_age_ms": ("setpoint_age",),
}
_NO_UNIT = ("_C", "_F")
"""Ends of names that are degrees of a temperature only."""


def _aliases() -> dict[str, str]:
    aliases = {stem: channel for channel, stems in _SINGLE.items() for stem in stems}
    for pattern, stems in _PER_SPRING.items():
        for spring in ("x", "y"):
            aliases |= {f"{stem}_{spring}": pattern.format(spring) for stem in stems}
    return aliases


ALIASES: Mapping[str, str] = _aliases()
"""Quantity, in small letters and without its unit, to channel."""


_Factor = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]

_ALL = "docs/guide/run-logs.md has them all"


class ColumnRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What one column is. Value in `column_unit` = number in the file · `scale` + `offset`.

    `column_unit` empty: that which the name ends with, or with a scale (no sign) or offset, or
    without one in the name, the channel's. `hold`: a number is in force until the next one, as in a
    log that is written on change.
    """

    channel: str
    column_unit: str = ""
    scale: _Factor = 1.0
    offset: _Factor = 0.0
    hold: bool = False


@dataclass(frozen=True)
class Assignment:
    """Which column feeds which channel, and the columns that feed none."""

    rules: dict[str, ColumnRule]
    ignored: list[str]


def assign(names: Iterable[str], given_rules: Mapping[str, ColumnRule]) -> Assignment:
    """Find the channel of each column; `given_rules` come first.

    Raises LogImportError for a unit that is missing or does not fit, a rule without its column, and
    two columns for one channel.
    """
    names = list(names)
    absent = [name for name in given_rules if name not in names]
    if absent:
        raise LogImportError(
            f"the mapping names column {absent[0]!r}, which the file does not have",
            action="correct the mapping file: "
            + instead(absent[0], names, f"the first are {', '.join(names[:5])}"),
        )
    rules: dict[str, ColumnRule] = {}
    ignored = []
    exact = {name for name in names if name in CHANNELS and name not in given_rules}
    for name in names:
        rule = _checked(name, given_rules[name]) if name in given_rules else _from_name(name, exact)
        if rule is None:
            ignored.append(name)
            continue
        twin = next((n for n, other in rules.items() if other.channel == rule.channel), None)
        if twin is not None:
            raise LogImportError(
                f"columns {twin!r} and {name!r} are both {rule.channel}",
                action="rename one, or say in a mapping file what it is",
            )
        rules[name] = rule
    return Assignment(rules, ignored)


def _from_name(name: str, exact: Collection[str]) -> ColumnRule | None:
    """The rule of a column by its name; None where it says nothing, or the channel is in `exact`.

    What has just the name of a channel is that channel, whatever others look like it.
    """
    if name in CHANNELS:
        return ColumnRule(name, CHANNELS[name].unit)
    stem, unit = (_plain(name), "") if _plain(name) in ALIASES else parted(name)
    channel = ALIASES.get(stem)
    if channel is None or channel in exact:
        return None
    channel_unit = CHANNELS[channel].unit
    if unit in ("", *WITHOUT) and channel_unit == "1":
        unit = "1"
    if unit not in units_for(channel_unit):
        raise LogImportError(
            f"column {name!r} looks like {channel}, but "
            + (f"{unit!r} is not a unit for it" if unit else "its unit is missing"),
            limit=alternatives(channel_unit),
            action=f"rename it (for example {stem}_{channel_unit}) or use a mapping file",
        )
    return ColumnRule(channel, unit)


def is_time(name: str) -> bool:
    """Whether a name is that of the board time, in whatever unit."""
    return "t_s" in (name, ALIASES.get(parted(name)[0]), ALIASES.get(_plain(name)))


def parted(name: str) -> tuple[str, str]:
    """The quantity in a name, in small letters, and its unit: `Force [mN]`, `force mN`, `T_x_K`."""
    bracketed = BRACKETED.match(name.strip())
    if bracketed:
        stem, unit = bracketed["stem"], spelt(bracketed["unit"])
        # `t_s [s]`: a row of units repeats that of the name.
        quantity, named = parted_name(stem)
        return _plain(quantity if named == unit else stem), unit
    stem, _, unit = re.sub(r"\s+", "_", name.strip()).rpartition("_")
    return _plain(stem), spelt(unit)


def quantity_in(name: str) -> tuple[str, str]:
    """The quantity in a name, in small letters, and the unit that it ends with.

    That is one of the table, `torque_N_m`, or a compound of such, `Inflow [L/min]`; it is empty
    where the name has none.
    """
    if BRACKETED.match(name.strip()) or not unit_of(name):
        stem, unit = parted(name)
    else:
        stem, unit = parted_name(name)
    has_unit = known(unit) is not None and unit != "1" and not name.endswith(_NO_UNIT)
    return (_plain(stem), unit) if has_unit else (_plain(name), "")


def unit_in(name: str) -> str:
    """The unit that a name ends with, as `quantity_in` has it; empty where it ends with none."""
    return quantity_in(name)[1]


def _checked(name: str, rule: ColumnRule) -> ColumnRule:
    channel = CHANNELS.get(rule.channel)
    if channel is None:
        raise LogImportError(
            f"the mapping of column {name!r} names an unknown channel",
            value=rule.channel,
            action=f"correct the mapping file: {instead(rule.channel, CHANNELS, _ALL)}",
        )
    named = parted(name)[1]
    by_name = not converts(rule.scale, rule.offset) and named in units_for(channel.unit)
    taken = named if by_name else channel.unit
    unit = spelt(rule.column_unit) or taken
    if unit not in units_for(channel.unit):
        raise LogImportError(
            f"the mapping of column {name!r} gives {rule.channel} an unknown unit",
            value=unit,
            limit=alternatives(channel.unit),
            action="correct the mapping file",
        )
    return msgspec.structs.replace(rule, column_unit=unit)


def _plain(name: str) -> str:
    return re.sub(r"[\s\-]+", "_", name.strip()).lower()
