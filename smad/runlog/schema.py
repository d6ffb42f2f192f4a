"""The one table of what a run log holds: the channels of a sample, events, and link statistics.

`Row` is that table: each field is a channel, with its unit, where it comes from and what it means.
The JSON schema in the log file, the columns of an export, the units an import accepts and the
table in the guide are made from it. A value that was not measured is None (NaN counts as None), and
the message in the file lacks it.
"""

import functools
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct
from msgspec import inspect as types

from firmware_protocol.enums import BoardState, Limiter
from smad.config.fields import bare, info_of

ROW_TOPIC = "/smad/row"
EVENT_TOPIC = "/smad/events"
LINK_TOPIC = "/smad/link"

_AXIS_TOPIC = "/smad/axis/"


def row_topic(axis: str) -> str:
    """Return the topic of the samples of an axis; the one of a bench of one has no name."""
    return f"{_AXIS_TOPIC}{axis}/row" if axis else ROW_TOPIC


def axis_of(topic: str) -> str:
    """Return the name of the axis whose samples have this topic; empty for any other topic."""
    name = topic.removeprefix(_AXIS_TOPIC).removesuffix("/row")
    return name if topic == row_topic(name) and name != topic else ""


MISSING_INTEGER = -1
"""Stands for "not recorded" in the integer columns of a run that was read back."""


def _of(unit: str, source: str, description: str) -> Meta:
    return Meta(description=description, extra={"unit": unit, "source": source})


class Row(Struct, kw_only=True, gc=False, omit_defaults=True):
    """One sample: what was measured, what was commanded because of it, and when.

    Spring order is X, Y; displacement is positive when X pulls. `source` names the field of the
    wire message, or who computed the value.
    """

    t_s: Annotated[float, _of("s", "STATE.t_us", "board time of the sample, unwrapped")]
    host_time_s: Annotated[
        float | None, _of("s", "host clock", "Unix time at which the sample arrived")
    ] = None
    tick: Annotated[int | None, _of("", "STATE.tick", "sample counter of the board, wraps")] = None
    i_cmd_x_A: Annotated[
        float | None, _of("A", "SETPOINT.i_mA", "current commanded because of this sample, X")
    ] = None
    i_cmd_y_A: Annotated[
        float | None, _of("A", "SETPOINT.i_mA", "current commanded because of this sample, Y")
    ] = None
    i_applied_x_A: Annotated[
        float | None, _of("A", "STATE.i_applied_mA", "setpoint in force on the board, X")
    ] = None
    i_applied_y_A: Annotated[
        float | None, _of("A", "STATE.i_applied_mA", "setpoint in force on the board, Y")
    ] = None
    i_meas_x_A: Annotated[float | None, _of("A", "STATE.i_meas_mA", "current measured, X")] = None
    i_meas_y_A: Annotated[float | None, _of("A", "STATE.i_meas_mA", "current measured, Y")] = None
    v_x_V: Annotated[float | None, _of("V", "STATE.v_mV", "voltage across spring X")] = None
    v_y_V: Annotated[float | None, _of("V", "STATE.v_mV", "voltage across spring Y")] = None
    duty_x: Annotated[
        float | None, _of("1", "STATE.pump_duty", "duty of the pump that cools X, 0 to 1")
    ] = None
    duty_y: Annotated[
        float | None, _of("1", "STATE.pump_duty", "duty of the pump that cools Y, 0 to 1")
    ] = None
    pump_starts_x: Annotated[
        int | None,
        _of("", "STATE.pump_duty", "starts of the pump that cools X, since the daemon started"),
    ] = None
    pump_starts_y: Annotated[
        int | None,
        _of("", "STATE.pump_duty", "starts of the pump that cools Y, since the daemon started"),
    ] = None
    drain_x: Annotated[
        int | None, _of("", "SETPOINT.flags", "1 while the tube of X is being drained")
    ] = None
    drain_y: Annotated[
        int | None, _of("", "SETPOINT.flags", "1 while the tube of Y is being drained")
    ] = None
    rtd_x_degC: Annotated[
        float | None, _of("degC", "STATE.rtd_cC", "temperature sensor of spring X")
    ] = None
    rtd_y_degC: Annotated[
        float | None, _of("degC", "STATE.rtd_cC", "temperature sensor of spring Y")
    ] = None
    rtd_inlet_degC: Annotated[
        float | None, _of("degC", "STATE.rtd_cC", "temperature sensor of the water inlet")
    ] = None
    rtd_ambient_degC: Annotated[
        float | None, _of("degC", "STATE.rtd_cC", "temperature sensor of the room")
    ] = None
    displacement_mm: Annotated[
        float | None, _of("mm", "STATE.encoder_counts", "displacement, positive when X pulls")
    ] = None
    angle_deg: Annotated[
        float | None, _of("deg", "displacement_mm", "angle of a MINIR-II segment (±4 mm ↔ ±25°)")
    ] = None
    force_N: Annotated[float | None, _of("N", "STATE.force_counts", "tendon force")] = None
    supply_V: Annotated[float | None, _of("V", "STATE.vbus_mV", "bus voltage")] = None
    stage_mm: Annotated[
        float | None, _of("mm", "experiment", "position of the stage of the stretch fixture")
    ] = None
    reference_mm: Annotated[
        float | None, _of("mm", "controller", "reference of the displacement loop")
    ] = None
    reference_degC: Annotated[
        float | None, _of("degC", "controller", "reference of the temperature loop")
    ] = None
    mode: Annotated[int | None, _of("", "STATE.mode", "state of the board, as a number")] = None
    limiter: Annotated[
        int | None, _of("", "STATE.limiter", "what holds the board's current down, as a number")
    ] = None
    faults: Annotated[int | None, _of("", "STATE.faults", "fault bits")] = None
    warnings: Annotated[int | None, _of("", "STATE.warnings", "warning bits")] = None
    valid: Annotated[
        int | None, _of("", "STATE.valid", "bits of the sensors whose reading is valid")
    ] = None
    setpoint_age_ms: Annotated[
        float | None, _of("ms", "STATE.sp_age_us", "age of the newest setpoint when applied")
    ] = None


EventKind = Literal[
    "command", "state", "arm", "disarm", "fault", "warning", "link", "record", "import", "note"
]

CUT = "cut: "
"""How the text of an event begins that says what cut a run: it is no example of anything."""


class Event(Struct, kw_only=True, omit_defaults=True):
    """Something that happened once: a command received, a fault, arming, a person's note."""

    t_s: Annotated[float | None, _of("s", "board", "board time, where there is one")] = None
    host_time_s: Annotated[float | None, _of("s", "host clock", "Unix time")] = None
    kind: Annotated[EventKind, _of("", "", "what sort of event")]
    text: Annotated[str, _of("", "", "one line for a person")]
    data: Annotated[dict[str, Any], _of("", "", "the details, for a program")] = {}


class LinkSample(Struct, kw_only=True, omit_defaults=True):
    """The counters of the link, about once a second."""

    t_s: Annotated[float | None, _of("s", "board", "board time, where there is one")] = None
    host_time_s: Annotated[float | None, _of("s", "host clock", "Unix time")] = None
    counters: Annotated[
        dict[str, float], _of("", "LINK_STATS and the host", "counters and round-trip times")
    ]


Record = Row | Event | LinkSample
TOPICS: Mapping[type[Struct], str] = {
    Row: ROW_TOPIC,
    Event: EVENT_TOPIC,
    LinkSample: LINK_TOPIC,
}


class ChannelSpec(Struct, frozen=True):
    """One channel of a sample. `kind` is "float" or "integer"; `unit` "1": a ratio, "": none."""

    name: str
    unit: str
    kind: Literal["float", "integer"]
    description: str
    source: str

    @property
    def dtype(self) -> str:
        """The numpy type of the column: float64 (NaN: missing) or int64 (-1: missing)."""
        return "float64" if self.kind == "float" else "int64"


def _channel(field: types.Field) -> ChannelSpec:
    kind, meta = bare(field.type)
    return ChannelSpec(
        name=field.name,
        unit=meta["unit"],
        kind="integer" if isinstance(kind, types.IntType) else "float",
        description=meta["description"],
        source=meta["source"],
    )


CHANNELS: Mapping[str, ChannelSpec] = {field.name: _channel(field) for field in info_of(Row).fields}
"""Every channel of a sample, by name, in the order of the columns."""


LEGENDS: Mapping[str, Mapping[int, str]] = {
    "mode": {state.value: state.name for state in BoardState},
    "limiter": {limiter.value: limiter.name.lower() for limiter in Limiter},
}
"""What the numbers of some channels stand for, in the words of `smad status`."""


def channel_of(column: str) -> ChannelSpec:
    """Return the channel of a column, which may have the name of its axis and a dot before it."""
    return CHANNELS[column.rpartition(".")[2]]


@functools.cache
def json_schema(record: type[Struct]) -> bytes:
    """The JSON schema of one of the three messages, as stored in the log file.

    As Foxglove and Lichtblick read it: each member has one plain type, and each object
    `properties`. A member without a value is absent from the message.
    """
    import inspect

    (_,), components = msgspec.json.schema_components([record])
    schema = components[record.__name__]
    schema["description"] = inspect.getdoc(record)
    for field in info_of(record).fields:
        member = schema["properties"][field.name]
        _make_plain(member)
        member["unit"] = bare(field.type)[1]["unit"]
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return msgspec.json.encode(schema)


def _make_plain(member: dict[str, Any]) -> None:
    choices = member.pop("anyOf", None)
    if choices is not None:
        (member["type"],) = (choice["type"] for choice in choices if choice["type"] != "null")
    if member.get("default", ...) is None:
        del member["default"]
    if "enum" in member:
        member["type"] = "string"
    if member["type"] == "object":
        member["properties"] = {}
