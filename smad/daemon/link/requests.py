"""Requests to the board that a command waits for, and what its refusals mean to a person."""

import asyncio
import enum
from collections.abc import Callable

from firmware_protocol.enums import BoardState, Channel, ErrorCode
from firmware_protocol.errors import ProtocolError
from firmware_protocol.events import FailureReason, HostEvent, RequestDone, RequestFailed
from firmware_protocol.host import HostSession
from firmware_protocol.messages import Error, Message
from smad.api import Reason, as_read
from smad.daemon.errors import Refusal

_UPDATE = "update the older of board and smad"

REFUSALS: dict[ErrorCode, tuple[str, str]] = {
    ErrorCode.WRONG_STATE: (
        "the board's state does not allow this",
        "see smad status; disarm, or wait until it has cooled",
    ),
    ErrorCode.NO_SESSION: ("the board knows no session with us", "try again"),
    ErrorCode.SCHEMA_DIFFERS: ("the board's messages differ from ours", _UPDATE),
    ErrorCode.PARAMETERS_DIFFER: (
        "the board's parameters differ from what was read from it",
        "unplug it and plug it in again, so that they are read anew",
    ),
    ErrorCode.CLOCK_UNLOCKED: (
        "the clock of the board does not run steadily",
        "wait a second and try again",
    ),
    ErrorCode.SENSOR_INVALID: (
        "a sensor does not read",
        "look at the readings and their cables (smad status)",
    ),
    ErrorCode.TOO_HOT: (
        "a spring is not cold enough",
        "wait until it is below the limit (smad status --watch)",
    ),
    ErrorCode.CURRENT_FLOWING: (
        "current flows although none is commanded",
        "switch the supply off and look for a shorted transistor",
    ),
    ErrorCode.FAULT_PRESENT: ("a fault is latched", "read it (smad status), then smad clear"),
    ErrorCode.SUPPLY_LOW: ("the supply voltage is too low", "check the power supply"),
    ErrorCode.TOKEN_WRONG: ("the arming token was not the one given", "arm again"),
    ErrorCode.TOKEN_EXPIRED: ("the arming token came too late", "arm again"),
    ErrorCode.WRONG_FAULT: ("that is not the fault that is latched", "see smad status"),
    ErrorCode.CAUSE_REMAINS: (
        "the cause of the fault is still there, or the springs are not cold",
        "see smad faults explain for what to do about it",
    ),
    ErrorCode.SETPOINT_STALE: (
        "setpoints reach the board too late",
        "check the load of this computer (smad link test)",
    ),
    ErrorCode.UNKNOWN_TYPE: ("the board does not know this request", _UPDATE),
    ErrorCode.BAD_PAYLOAD: ("the board could not read the request", _UPDATE),
    ErrorCode.MAJOR_DIFFERS: ("the board speaks another version of the protocol", _UPDATE),
    ErrorCode.NO_SUCH_AXIS: ("the board has no such axis", "set link.axis"),
    ErrorCode.OUT_OF_RANGE: ("the value is out of range", "choose one within the limit"),
    ErrorCode.UNKNOWN_PARAMETER: ("the board has no such parameter", "see smad params list"),
    ErrorCode.NO_SUCH_REPORT: ("the board has no such fault report", "see smad status"),
    ErrorCode.RATE_TOO_HIGH: (
        "the line, or the board's own time, does not carry this rate",
        "lower link.rate_hz to the limit",
    ),
    ErrorCode.SAVE_FAILED: ("the board could not store its parameters", "try again"),
}
"""What each refusal of the board means, and what to do next."""
_MEASURED = {
    ErrorCode.SENSOR_INVALID: "",
    ErrorCode.TOO_HOT: "cC",
    ErrorCode.CURRENT_FLOWING: "mA",
    ErrorCode.SUPPLY_LOW: "mV",
}
"""Refusals of a reading, whose place is told, and the unit of value and limit; empty: no value."""

_FAILURES: dict[FailureReason, tuple[str, str]] = {
    FailureReason.TIMEOUT: (
        "the board did not answer three requests",
        "check the cable (smad link test)",
    ),
    FailureReason.LINK_LOST: (
        "the port went away before the board answered",
        "plug it in; the daemon reconnects by itself",
    ),
    FailureReason.BOARD_RESTARTED: (
        "the board restarted before it answered",
        "look at its supply; then try again",
    ),
    FailureReason.WITHDRAWN: (
        "the bench was stopped before the board answered",
        "see smad status for what stopped it; then arm again",
    ),
}


class BoardRequests:
    """Asks the board, and wakes whoever waits when its answer comes."""

    def __init__(
        self,
        session: HostSession,
        clock_us: Callable[[], int],
        flush: Callable[[], bool],
    ) -> None:
        self._session = session
        self._clock_us = clock_us
        self._flush = flush
        self._waiting: dict[int, asyncio.Future[Message]] = {}

    @property
    def watch_only(self) -> bool:
        """Whether the board's messages differ from ours, so that it takes no requests."""
        return self._session.incompatible is not None

    async def ask(self, message: Message) -> Message:
        """Return the board's reply. Raises Refusal when it refuses or does not answer."""
        future = self.start(message)
        return await future

    def start(self, message: Message) -> asyncio.Future[Message]:
        """Send a request now; the future has its reply. Raises Refusal when it cannot be sent."""
        try:
            number = self._session.request(message, self._clock_us())
        except ProtocolError as error:
            raise Refusal(
                Reason.NOT_CONNECTED,
                str(error),
                action="see smad status for the link's state",
            ) from error
        future: asyncio.Future[Message] = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        self._flush()
        return future

    def handle(self, event: HostEvent) -> bool:
        """Take an event; return whether it ended a request."""
        if isinstance(event, RequestDone):
            future = self._waiting.pop(event.id, None)
            if future is not None and not future.done():
                future.set_result(event.reply)
            return True
        if isinstance(event, RequestFailed):
            future = self._waiting.pop(event.id, None)
            if future is not None and not future.done():
                future.set_exception(failure(event))
                # Nobody may be waiting any more; then the failure is not worth a warning.
                future.exception()
            return True
        return False


def failure(event: RequestFailed) -> Refusal:
    """Return what a failed request means."""
    if event.error is not None:
        return refusal(event.error)
    cause, action = _FAILURES[event.reason]
    withdrawn = event.reason is FailureReason.WITHDRAWN
    return Refusal(
        Reason.STOPPED if withdrawn else Reason.NO_REPLY,
        cause,
        value=type(event.request).__name__,
        action=action,
    )


def refusal(error: Error) -> Refusal:
    """Return what the board's ERROR means."""
    cause, action = REFUSALS.get(
        error.code, (f"the board refused with code {int(error.code)}", _UPDATE)
    )
    unit = _MEASURED.get(error.code)
    if unit is not None and error.field != Channel.BOARD:
        cause += f" ({_name(Channel, error.field)})"
    # A token, or what stands in place of a reading, means nothing to a person.
    meaningless = error.code is ErrorCode.TOKEN_WRONG or unit == ""
    has_values = not meaningless and (error.value != 0 or error.limit != 0)
    if error.code is ErrorCode.WRONG_STATE and error.value == BoardState.ESTOP:
        action = "power-cycle the board: nothing else ends ESTOP"

    def worded(number: int) -> int | str:
        if error.code is ErrorCode.WRONG_STATE:
            return _name(BoardState, number)
        return as_read(number, unit) if unit else number

    return Refusal(
        Reason.BOARD_REFUSED,
        cause,
        value=worded(error.value) if has_values else None,
        limit=worded(error.limit) if has_values else None,
        action=action,
    )


def _name(kind: type[enum.IntEnum], number: int) -> str | int:
    return kind(number).name if number in set(kind) else number
