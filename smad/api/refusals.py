"""Why a command is refused, and how long a message may be."""

import enum
from typing import Annotated, Any

from msgspec import Meta, Struct

LARGEST_MESSAGE = 65_536
"""Bytes. A longer message is refused unread: decoding it would hold up the control loop."""
LARGEST_TAKEN_IN = 4 * LARGEST_MESSAGE
"""Bytes. A message beyond this is not taken into memory to be refused: it ends the connection."""


class Reason(enum.StrEnum):
    """Why a command was refused. A program decides by this, a person reads the message."""

    MALFORMED = "malformed"
    NO_REQUEST = "no_request"
    UNKNOWN_METHOD = "unknown_method"
    INVALID = "invalid"
    NOT_IN_CONTROL = "not_in_control"
    NOT_CONNECTED = "not_connected"
    NOT_ARMED = "not_armed"
    ARMED = "armed"
    FAULTED = "faulted"
    DISAGREEMENT = "disagreement"
    BOARD_REFUSED = "board_refused"
    NO_REPLY = "no_reply"
    STOPPED = "stopped"
    BUSY = "busy"
    RECORDER = "recorder"
    INTERNAL = "internal"


ERROR_CODES: dict[Reason, int] = {
    Reason.MALFORMED: -32700,
    Reason.NO_REQUEST: -32600,
    Reason.UNKNOWN_METHOD: -32601,
    Reason.INVALID: -32602,
    Reason.INTERNAL: -32603,
}
REFUSED = -32000
"""Code of every reason for which JSON-RPC 2.0 does not fix one (`ERROR_CODES`)."""


class ErrorData(Struct, frozen=True, kw_only=True):
    """What an error reply says beside its message."""

    reason: Annotated[Reason, Meta(description="why, for a program")]
    cause: Annotated[str, Meta(description="what went wrong")]
    value: Annotated[Any, Meta(description="the value that was refused")] = None
    limit: Annotated[Any, Meta(description="what would have been allowed")] = None
    action: Annotated[str, Meta(description="what to do next")] = ""
