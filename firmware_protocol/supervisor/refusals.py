"""Why a command was refused, as a sentence with the value, the limit and what to do."""

from __future__ import annotations

from firmware_protocol.enums import BoardState, Channel, ErrorCode, Fault

_TEXT: dict[ErrorCode, str] = {
    ErrorCode.WRONG_STATE: "the board is in {state}, it must be in {needed}",
    ErrorCode.NO_SESSION: "no session is open; connect first",
    ErrorCode.SCHEMA_DIFFERS: "host and board use different message tables; update one of them",
    ErrorCode.PARAMETERS_DIFFER: "host and board disagree on the parameters; read them again",
    ErrorCode.CLOCK_UNLOCKED: "the clock of the board does not run steadily; wait a second",
    ErrorCode.SENSOR_INVALID: "{channel} reads {value}, which is no reading; check its wires",
    ErrorCode.TOO_HOT: "{channel} is at {value} cC, must be below {limit} cC; let it cool",
    ErrorCode.CURRENT_FLOWING: (
        "{channel} carries {value} mA, must be below {limit} mA; the driver may have failed short"
    ),
    ErrorCode.FAULT_PRESENT: "the fault {fault} is latched; clear it first",
    ErrorCode.SUPPLY_LOW: (
        "the supply is at {value} mV, must be above {limit} mV; check the power supply"
    ),
    ErrorCode.TOKEN_WRONG: "the arming token {value} is not the one issued; ask for a new one",
    ErrorCode.TOKEN_EXPIRED: (
        "the arming token is {value} us old, valid for {limit} us; ask for a new one"
    ),
    ErrorCode.WRONG_FAULT: "{fault} is not the first fault; clear {needed_fault}",
    ErrorCode.CAUSE_REMAINS: "the cause of {fault} on {channel} is still there; remove it first",
    ErrorCode.SETPOINT_STALE: (
        "the setpoint is {value} us old, at most {limit} us are taken; the link or the host is slow"
    ),
    ErrorCode.OUT_OF_RANGE: (
        "the stage was sent to {value} um, which is beyond its end at {limit} um; send it less far"
    ),
}


def _name(kind: type[BoardState] | type[Fault], number: int) -> str:
    try:
        return kind(number).name
    except ValueError:
        return str(number)


def refusal_text(code: ErrorCode | None, channel: Channel, value: int, limit: int) -> str:
    """Return one line for a refusal of the supervisor; codes of the session give their name."""
    if code is None:
        return "accepted"
    return _TEXT.get(code, code.name).format(
        channel=channel.name,
        value=value,
        limit=limit,
        state=_name(BoardState, value),
        needed=_name(BoardState, limit),
        fault=_name(Fault, value),
        needed_fault=_name(Fault, limit),
    )
