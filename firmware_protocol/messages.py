"""The one table of messages. Everything that knows a layout is made from these classes.

Numbers below 0x80 go from host to board, the rest from board to host, so that an echo is noticed.
A field's unit is in its name where it has one. (X, Y) is the order of the springs, always.
Docstrings of the classes and the `doc` of the fields appear in docs/protocol.md.

To add a message: see "Where a change belongs" in docs/architecture.md.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

import msgspec

from firmware_protocol.enums import (
    BoardState,
    Capability,
    Channel,
    ErrorCode,
    Fault,
    Limiter,
    ParameterKind,
    ResetCause,
    SetpointFlag,
    ValidBit,
    Warning,
)
from firmware_protocol.wire import NO_VALUE, Direction, MessageInfo, Wire

PROTOCOL_MAJOR: Final = 1
PROTOCOL_MINOR: Final = 0

FIRST_BOARD_NUMBER: Final = 0x80
NO_FIELD: Final = 0xFF
AXIS = Wire("u8", "actuator pair, counted from 0")


class Message(msgspec.Struct, frozen=True, gc=False):
    """Base of all messages."""

    info: ClassVar[MessageInfo]


class Hello(Message, frozen=True, gc=False):
    """Opens a session; the same nonce is a repeat."""

    info = MessageInfo(
        number=0x01,
        direction=Direction.TO_BOARD,
        pace="at connect, repeated until answered",
        replies=("Ident",),
        frozen=True,
    )
    major: Annotated[
        int, Wire("u8", "protocol version; another one: the board only identifies itself")
    ]
    minor: Annotated[int, Wire("u8", "protocol revision, for the log")]
    schema_crc: Annotated[int, Wire("u32", "CRC-32 of the host's message table")]
    nonce: Annotated[int, Wire("u32", "chosen by the host, echoed by IDENT")]


class Describe(Message, frozen=True, gc=False):
    """Asks for a slice of the board's own description of its messages."""

    info = MessageInfo(
        number=0x02,
        direction=Direction.TO_BOARD,
        pace="request",
        replies=("Description",),
        frozen=True,
    )
    offset: Annotated[int, Wire("u16", "first byte wanted", unit="B")]


class Estop(Message, frozen=True, gc=False):
    """Switches everything off until the power is cycled."""

    info = MessageInfo(
        number=0x03,
        direction=Direction.TO_BOARD,
        pace="three times, accepted in any session and state",
        frozen=True,
    )


class Setpoint(Message, frozen=True, gc=False):
    """The outputs that the board applies until the next SETPOINT."""

    info = MessageInfo(
        number=0x10,
        direction=Direction.TO_BOARD,
        pace="one for each STATE; acknowledged by STATE.sp_seq",
    )
    axis: Annotated[int, AXIS]
    t_ref_us: Annotated[
        int, Wire("u32", "t_us of the STATE it was computed from; its age counts from here")
    ]
    i_mA: Annotated[tuple[int, int], Wire("u16", "heating current", unit="mA", count=2)]
    pump_duty: Annotated[tuple[int, int], Wire("u8", "pump drive", unit="1/255", count=2)]
    flags: Annotated[int, Wire("u8", "drain valves; whether stage_um applies", bits=SetpointFlag)]
    ttl_ms: Annotated[int, Wire("u16", "how long it applies without a newer one", unit="ms")]
    stage_um: Annotated[
        int, Wire("i32", "position of the stretch fixture's stage, from 0", unit="um")
    ] = 0


class ArmRequest(Message, frozen=True, gc=False):
    """Asks whether the axis may be armed."""

    info = MessageInfo(
        number=0x11, direction=Direction.TO_BOARD, pace="request", replies=("ArmToken",)
    )
    axis: Annotated[int, AXIS]
    param_crc: Annotated[int, Wire("u32", "CRC of the parameters as the host knows them")]


class ArmConfirm(Message, frozen=True, gc=False):
    """Arms the axis. A token works once."""

    info = MessageInfo(number=0x12, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    axis: Annotated[int, AXIS]
    token: Annotated[int, Wire("u32", "from ARM_TOKEN")]


class Disarm(Message, frozen=True, gc=False):
    """Ends heating; the axis cools with its pumps on and goes to SAFE."""

    info = MessageInfo(number=0x13, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    axis: Annotated[int, AXIS]


class ClearFault(Message, frozen=True, gc=False):
    """Clears one fault by its id, once its cause is gone and the springs are cold."""

    info = MessageInfo(number=0x14, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    axis: Annotated[int, AXIS]
    fault: Annotated[Fault, Wire("u8", "the fault to clear")]


class FaultGet(Message, frozen=True, gc=False):
    """Reads a fault report again. Reports stay until the board restarts."""

    info = MessageInfo(
        number=0x15, direction=Direction.TO_BOARD, pace="request", replies=("FaultReport",)
    )
    axis: Annotated[int, AXIS]
    index: Annotated[int, Wire("u8", "0 is the first since boot")]


class ParamGet(Message, frozen=True, gc=False):
    """Reads one parameter."""

    info = MessageInfo(
        number=0x16, direction=Direction.TO_BOARD, pace="request", replies=("ParamValue",)
    )
    axis: Annotated[int, AXIS]
    param: Annotated[int, Wire("u16", "number of the parameter")]


class ParamSet(Message, frozen=True, gc=False):
    """Changes one parameter, in SAFE only."""

    info = MessageInfo(
        number=0x17, direction=Direction.TO_BOARD, pace="request", replies=("ParamValue",)
    )
    axis: Annotated[int, AXIS]
    param: Annotated[int, Wire("u16", "number of the parameter")]
    value: Annotated[int, Wire("i32", "in the parameter's unit")]


class ParamSave(Message, frozen=True, gc=False):
    """Makes the parameters of all axes survive a power cycle, in SAFE only."""

    info = MessageInfo(number=0x18, direction=Direction.TO_BOARD, pace="request", replies=("Done",))


class TimeRequest(Message, frozen=True, gc=False):
    """Asks for the board's time. Never repeated."""

    info = MessageInfo(number=0x19, direction=Direction.TO_BOARD, pace="about 1 Hz", per_s=1)
    t1_us: Annotated[int, Wire("u32", "host time of sending, low 32 bits", unit="us")]


class Ident(Message, frozen=True, gc=False):
    """Who the board is. At boot session and nonce are 0."""

    info = MessageInfo(
        number=0x81,
        direction=Direction.TO_HOST,
        pace="reply; unsolicited at boot",
        frozen=True,
    )
    major: Annotated[int, Wire("u8", "protocol version")]
    minor: Annotated[int, Wire("u8", "protocol revision")]
    schema_crc: Annotated[int, Wire("u32", "CRC-32 of the board's message table")]
    param_crc: Annotated[int, Wire("u32", "CRC-32 of the parameters in use")]
    nonce: Annotated[int, Wire("u32", "the HELLO's nonce")]
    session: Annotated[int, Wire("u16", "the session that begins; 0 is none")]
    boot_count: Annotated[int, Wire("u32", "starts of the board so far")]
    reset_cause: Annotated[ResetCause, Wire("u8", "why it started")]
    first_fault: Annotated[int, Wire("u8", "id of the first fault since boot, 0 is none")]
    axes: Annotated[int, Wire("u8", "actuator pairs")]
    capabilities: Annotated[int, Wire("u32", "what the board has", bits=Capability)]
    state_rate_hz: Annotated[int, Wire("u16", "rate of STATE for each axis", unit="Hz")]
    baud: Annotated[int, Wire("u32", "speed of the port", unit="Bd")]
    uid: Annotated[bytes, Wire("bytes", "unique number of the chip", count=12)]
    firmware: Annotated[str, Wire("char", "name and version", count=24)]


class Description(Message, frozen=True, gc=False):
    """A slice of the description: JSON, compressed with zlib."""

    info = MessageInfo(number=0x82, direction=Direction.TO_HOST, pace="reply", frozen=True)
    offset: Annotated[int, Wire("u16", "first byte of the slice", unit="B")]
    total: Annotated[int, Wire("u16", "bytes in the whole description", unit="B")]
    size: Annotated[int, Wire("u8", "valid bytes of data", unit="B")]
    data: Annotated[bytes, Wire("bytes", "the slice, zero bytes after it", count=96)]


class Error(Message, frozen=True, gc=False):
    """A request or setpoint was refused."""

    info = MessageInfo(
        number=0x83,
        direction=Direction.TO_HOST,
        pace="reply; at most ten a second for anything else",
        frozen=True,
    )
    request_type: Annotated[int, Wire("u8", "number of the message refused")]
    request_seq: Annotated[int, Wire("u8", "its sequence number")]
    code: Annotated[ErrorCode, Wire("u8", "the reason")]
    field: Annotated[
        int,
        Wire("u8", "codes below 32: the channel; others: index of the field", invalid=NO_FIELD),
    ]
    value: Annotated[int, Wire("i32", "what was found, clamped to the range of i32")]
    limit: Annotated[int, Wire("i32", "what is allowed, in the unit of the value")]


class State(Message, frozen=True, gc=False):
    """One sample. The host runs one control step for each."""

    info = MessageInfo(
        number=0x90, direction=Direction.TO_HOST, pace="100, 250 or 500 Hz for each axis"
    )
    axis: Annotated[int, AXIS]
    t_us: Annotated[int, Wire("u32", "board time of the sample, wraps every 71.6 min", unit="us")]
    tick: Annotated[int, Wire("u16", "samples since boot, wraps")]
    mode: Annotated[BoardState, Wire("u8", "state of the board's machine")]
    limiter: Annotated[Limiter, Wire("u8", "what holds the current below the setpoint")]
    faults: Annotated[
        int, Wire("u32", "faults since the last CLEAR_FAULT, fault n is bit n - 1", bits=Fault)
    ]
    warnings: Annotated[int, Wire("u16", "active warnings, warning n is bit n", bits=Warning)]
    i_meas_mA: Annotated[
        tuple[int, int],
        Wire("i16", "measured current", unit="mA", count=2, invalid=NO_VALUE["i16"]),
    ]
    i_applied_mA: Annotated[
        tuple[int, int], Wire("i16", "current asked of the driver, after all limits", "mA", 2)
    ]
    v_mV: Annotated[
        tuple[int, int],
        Wire("u16", "voltage across the spring", "mV", 2, invalid=NO_VALUE["u16"]),
    ]
    pump_duty: Annotated[tuple[int, int], Wire("u8", "pump drive as applied", "1/255", 2)]
    rtd_cC: Annotated[
        tuple[int, int, int, int],
        Wire("i16", "spring X, spring Y, water inlet, ambient", "cC", 4, NO_VALUE["i16"]),
    ]
    encoder_counts: Annotated[
        int,
        Wire(
            "i32",
            "displacement; one count is the parameter encoder_nm_per_count",
            unit="counts",
            invalid=NO_VALUE["i32"],
        ),
    ]
    force_counts: Annotated[
        int,
        Wire(
            "i32",
            "tendon force; less force_offset_counts, times force_uN_per_count",
            unit="counts",
            invalid=NO_VALUE["i32"],
        ),
    ]
    vbus_mV: Annotated[int, Wire("u16", "supply", unit="mV", invalid=NO_VALUE["u16"])]
    valid: Annotated[int, Wire("u16", "which readings are valid", bits=ValidBit)]
    sp_seq: Annotated[int, Wire("u8", "sequence number of the setpoint in use")]
    sp_age_us: Annotated[
        int,
        Wire(
            "u16",
            "age of that setpoint by board time when it was first applied",
            unit="us",
            invalid=NO_VALUE["u16"],
        ),
    ]


class FaultReport(Message, frozen=True, gc=False):
    """Why the board stopped, and the sample at that moment."""

    info = MessageInfo(
        number=0x91,
        direction=Direction.TO_HOST,
        pace="three times, with the next STATE frames; readable again",
    )
    axis: Annotated[int, AXIS]
    index: Annotated[int, Wire("u8", "counted since boot, 0 is the first; stops at 255")]
    fault: Annotated[Fault, Wire("u8", "the cause")]
    channel: Annotated[Channel, Wire("u8", "where it was seen")]
    t_us: Annotated[int, Wire("u32", "board time", unit="us")]
    measured: Annotated[int, Wire("i32", "in the fault's unit")]
    limit: Annotated[int, Wire("i32", "in the fault's unit")]
    snapshot: Annotated[State, Wire("record", "the sample")]


class ArmToken(Message, frozen=True, gc=False):
    """The axis may be armed: confirm with this token."""

    info = MessageInfo(number=0x92, direction=Direction.TO_HOST, pace="reply")
    axis: Annotated[int, AXIS]
    token: Annotated[int, Wire("u32", "for ARM_CONFIRM")]
    valid_ms: Annotated[int, Wire("u16", "how long it can be used", unit="ms")]


class Done(Message, frozen=True, gc=False):
    """The request was carried out."""

    info = MessageInfo(number=0x93, direction=Direction.TO_HOST, pace="reply")
    request_type: Annotated[int, Wire("u8", "number of the request")]
    t_us: Annotated[int, Wire("u32", "board time when it was carried out", unit="us")]


class ParamValue(Message, frozen=True, gc=False):
    """One parameter."""

    info = MessageInfo(number=0x94, direction=Direction.TO_HOST, pace="reply")
    axis: Annotated[int, AXIS]
    param: Annotated[int, Wire("u16", "number of the parameter")]
    kind: Annotated[ParameterKind, Wire("u8", "type of its value")]
    value: Annotated[int, Wire("i32", "in the parameter's unit")]
    minimum: Annotated[int, Wire("i32", "smallest value allowed")]
    maximum: Annotated[int, Wire("i32", "largest value allowed")]
    param_crc: Annotated[int, Wire("u32", "CRC-32 of all parameters as they now are")]


class TimeReply(Message, frozen=True, gc=False):
    """The time stamps t1 to t3."""

    info = MessageInfo(
        number=0x95, direction=Direction.TO_HOST, pace="answers TIME_REQUEST", per_s=1
    )
    t1_us: Annotated[int, Wire("u32", "as received", unit="us")]
    t2_us: Annotated[int, Wire("u32", "board time of reception", unit="us")]
    t3_us: Annotated[int, Wire("u32", "board time of sending", unit="us")]


class LinkStats(Message, frozen=True, gc=False):
    """What the board has counted since boot."""

    info = MessageInfo(number=0x96, direction=Direction.TO_HOST, pace="1 Hz", per_s=1)
    frames: Annotated[int, Wire("u32", "good frames")]
    crc_errors: Annotated[int, Wire("u32", "frames with a wrong CRC")]
    cobs_errors: Annotated[int, Wire("u32", "frames with invalid COBS")]
    length_errors: Annotated[int, Wire("u32", "frames too short or too long")]
    payload_errors: Annotated[int, Wire("u32", "good frames with an unknown type or bad payload")]
    session_errors: Annotated[int, Wire("u32", "frames of another session")]
    stale_setpoints: Annotated[int, Wire("u32", "setpoints too old or out of order")]
    repeated_requests: Annotated[int, Wire("u32", "copies of requests, not carried out again")]
    dropped_states: Annotated[int, Wire("u32", "STATE frames replaced before they were sent")]
    overruns: Annotated[int, Wire("u32", "samples late by more than half a period")]
    longest_loop_us: Annotated[
        int, Wire("u32", "longest time between samples since the last report", unit="us")
    ]


MESSAGES: tuple[type[Message], ...] = (
    Hello,
    Describe,
    Estop,
    Setpoint,
    ArmRequest,
    ArmConfirm,
    Disarm,
    ClearFault,
    FaultGet,
    ParamGet,
    ParamSet,
    ParamSave,
    TimeRequest,
    Ident,
    Description,
    Error,
    State,
    FaultReport,
    ArmToken,
    Done,
    ParamValue,
    TimeReply,
    LinkStats,
)
"""All messages, in the order of the document."""
