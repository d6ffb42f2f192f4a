"""What the two ends of a session tell their users."""

from __future__ import annotations

import enum

import msgspec

from firmware_protocol.messages import (
    ArmConfirm,
    ArmRequest,
    ClearFault,
    Disarm,
    Error,
    FaultReport,
    Ident,
    LinkStats,
    Message,
    ParamSave,
    Setpoint,
    State,
)
from firmware_protocol.timesync import ClockFit


class HostState(enum.Enum):
    """Where the host stands with its board."""

    DISCONNECTED = "no port"
    SYNC = "port open, the board has not answered yet"
    MONITOR = "samples come; nothing is armed by this host"
    READY = "the board granted a token; it waits for the confirmation"
    RUNNING = "armed by this host"
    FAULTED = "the board is in FAULT or ESTOP"


class FailureReason(enum.Enum):
    """Why a request came to nothing."""

    TIMEOUT = "no answer after all tries"
    REFUSED = "the board refused"
    LINK_LOST = "the port went away or fell silent"
    BOARD_RESTARTED = "the board restarted"
    WITHDRAWN = "taken back by the host: a stop came first"


class IncompatibleReason(enum.Enum):
    """Why board and host cannot work together."""

    MAJOR = "another major version of the protocol: identify only"
    SCHEMA = "another table of messages: monitor only"


class HostEvent(msgspec.Struct, frozen=True, gc=False):
    """Base of what `HostSession` returns."""


class Connected(HostEvent, frozen=True, gc=False):
    """The board answered; a new session has begun."""

    ident: Ident


class StateReceived(HostEvent, frozen=True, gc=False):
    """One sample.

    `board_us` is `state.t_us` without its wrap. `setpoints_pending` counts the setpoints sent that
    this sample does not acknowledge yet; None if it acknowledges one that was not sent, or none.
    """

    state: State
    board_us: int
    setpoints_pending: int | None


class RequestDone(HostEvent, frozen=True, gc=False):
    """A request was answered."""

    id: int
    request: Message
    reply: Message


class RequestFailed(HostEvent, frozen=True, gc=False):
    """A request was refused (then `error` says why) or not answered."""

    id: int
    request: Message
    reason: FailureReason
    error: Error | None = None


class FaultReported(HostEvent, frozen=True, gc=False):
    """The board stopped; told once for each fault."""

    report: FaultReport


class BoardRestarted(HostEvent, frozen=True, gc=False):
    """The board started anew; the old session is over. `ident` is None if only its frames tell."""

    ident: Ident | None


class LinkLost(HostEvent, frozen=True, gc=False):
    """Nothing came for `silent_us`; the session begins again."""

    silent_us: int


class StatsReceived(HostEvent, frozen=True, gc=False):
    """The board's own counters."""

    stats: LinkStats


class TimeSynced(HostEvent, frozen=True, gc=False):
    """A new relation of board time to host time."""

    fit: ClockFit


class Incompatible(HostEvent, frozen=True, gc=False):
    """Board and host differ; `fields` names each difference."""

    reason: IncompatibleReason
    fields: tuple[str, ...]


class ErrorReceived(HostEvent, frozen=True, gc=False):
    """The board refused something that was no request, such as a setpoint."""

    error: Error


class Request(msgspec.Struct, frozen=True, gc=False):
    """A request as the board received it; its sequence number finds the answer's way back."""

    message: Message
    seq: int
    session: int


class BoardEvent(msgspec.Struct, frozen=True, gc=False):
    """Base of what `BoardSession` returns."""


class SessionStarted(BoardEvent, frozen=True, gc=False):
    """A host said HELLO; whatever an earlier one armed is nobody's now.

    `schema_agrees` is False for a host that may only look.
    """

    session: int
    schema_agrees: bool


class SetpointReceived(BoardEvent, frozen=True, gc=False):
    """A fresh setpoint; `seq` goes into STATE.sp_seq once it is applied."""

    setpoint: Setpoint
    seq: int
    age_us: int


class ArmRequested(BoardEvent, frozen=True, gc=False):
    """Answer with ARM_TOKEN or a refusal."""

    request: Request
    message: ArmRequest


class ArmConfirmed(BoardEvent, frozen=True, gc=False):
    """Answer with DONE or a refusal."""

    request: Request
    message: ArmConfirm


class DisarmRequested(BoardEvent, frozen=True, gc=False):
    """Answer with DONE or a refusal."""

    request: Request
    message: Disarm


class ClearFaultRequested(BoardEvent, frozen=True, gc=False):
    """Answer with DONE or a refusal."""

    request: Request
    message: ClearFault


class ParameterSaveRequested(BoardEvent, frozen=True, gc=False):
    """Store the parameters, then answer with DONE, or SAVE_FAILED."""

    request: Request
    message: ParamSave


class ParameterChanged(BoardEvent, frozen=True, gc=False):
    """A parameter has a new value. Already answered."""

    axis: int
    name: str
    value: int


class EstopReceived(BoardEvent, frozen=True, gc=False):
    """Switch everything off now. Comes up to three times."""
