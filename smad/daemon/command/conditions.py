"""What must hold before a command is carried out; a refusal says why not and what to do."""

import asyncio
import functools
from collections.abc import Callable, Collection, Iterable
from typing import Concatenate, ParamSpec

from firmware_protocol.enums import BoardState, Capability, ErrorCode, ValidBit
from firmware_protocol.events import HostState
from firmware_protocol.messages import ArmRequest, Error
from firmware_protocol.parameters import BENCH_PARAMETERS, BY_NAME, axis_name_crc
from firmware_protocol.supervisor import Link, Measurements, Memory
from firmware_protocol.supervisor.machine import arming_obstacle
from smad.api import Reason
from smad.config import Config
from smad.config.hostlimits import looser_than
from smad.daemon.arming import Phase
from smad.daemon.axis import Axis
from smad.daemon.boardstop import BoardStop
from smad.daemon.errors import Refusal
from smad.daemon.link.board import Parameters
from smad.daemon.link.requests import refusal
from smad.daemon.link.watch import disagreement

_POLLS = 100
_POLL_S = 0.02
P = ParamSpec("P")


def _names_axis(
    require: Callable[Concatenate[Axis, P], None],
) -> Callable[Concatenate[Axis, P], None]:
    """Let what is refused name the axis."""

    @functools.wraps(require)
    def require_naming_axis(axis: Axis, /, *rest: P.args, **more: P.kwargs) -> None:
        with axis.naming_axis():
            require(axis, *rest, **more)

    return require_naming_axis


@_names_axis
def require_connected(axis: Axis) -> None:
    """Raise Refusal unless there is a board, and one that takes requests."""
    if axis.watch.incompatible is not None:
        use = "can only be watched" if axis.connected else "cannot be used"
        raise Refusal(
            Reason.DISAGREEMENT,
            f"board and smad disagree, so the board {use}",
            value=disagreement(axis.watch.incompatible),
            action="update the older of the two",
        )
    if not axis.connected:
        raise not_connected(
            "the board is not connected",
            "plug it in; the daemon reconnects by itself (smad status)",
        )


@_names_axis
def require_disarmed(axis: Axis) -> None:
    """Raise Refusal while the board is armed, or may be."""
    if axis.hot:
        raise Refusal(Reason.ARMED, "the bench is armed", action="disarm first (smad disarm)")


async def first_samples(boards: Iterable[BoardStop]) -> None:
    """Wait for the first sample of each board: right after a connection it is on its way."""
    for _ in range(_POLLS):
        if not any(board.phase is Phase.NEW_SESSION for board in boards):
            return
        await asyncio.sleep(_POLL_S)


async def parameters_read(axis: Axis) -> None:
    """Wait for the parameters: right after a connection they are on their way."""
    for _ in range(_POLLS):
        if axis.watch.parameters.agree is not None or not axis.watch.reading:
            return
        await asyncio.sleep(_POLL_S)


@_names_axis
def require_armable(axis: Axis, names: Collection[str]) -> None:
    """Raise Refusal unless the board can be asked to arm. `names` are those of all axes."""
    require_connected(axis)
    require_not_faulted(axis)
    require_disarmed(axis)
    agree = axis.watch.parameters.agree
    if agree is None:
        raise Refusal(
            Reason.BUSY,
            "the board's parameters are still being read",
            action="try again in a second",
        )
    if not agree:
        raise Refusal(
            Reason.DISAGREEMENT,
            "the board's parameters are not those that were read from it",
            action="unplug it and plug it in again, so that they are read anew",
        )
    require_name_of_axis(axis.name, names, axis.watch.parameters)
    require_tighter(axis.config, axis.watch.parameters)


def obstacle_to_arming(axis: Axis, names: Collection[str]) -> str:
    """Return what arming would be refused for now, as far as it is known; empty: nothing."""
    try:
        require_armable(axis, names)
        _require_granted(axis)
    except Refusal as refused:
        return str(refused).removeprefix(axis.lead)
    return ""


def _require_granted(axis: Axis) -> None:
    """Raise Refusal where the board's own function refuses by its last sample."""
    last, ident = axis.control.last, axis.watch.ident
    if last is None or ident is None:
        raise not_connected("no sample has come yet", "try again in a second")
    state = last.state
    absent = ~state.valid
    measured = Measurements(
        i_mA=list(state.i_meas_mA),
        rtd_cC=list(state.rtd_cC),
        vbus_mV=state.vbus_mV,
        encoder_invalid=bool(ident.capabilities & Capability.ENCODER and absent & ValidBit.ENCODER),
        force_invalid=bool(
            ident.capabilities & Capability.FORCE_SENSOR and absent & ValidBit.FORCE
        ),
    )
    # The board also looks at a filtered current, which it does not report.
    memory = Memory(0, state=state.mode, i_uA=[1000 * i_mA for i_mA in state.i_meas_mA])
    link = Link(clock=axis.session.clock is not None)
    code = arming_obstacle(memory, measured, axis.watch.parameters.limits(), link.word)
    if code:
        number = ArmRequest.info.number
        error = Error(number, 0, ErrorCode(code), memory.channel, memory.value, memory.limit)
        raise refusal(error)


def require_name_of_axis(name: str, names: Collection[str], parameters: Parameters) -> None:
    """Raise Refusal unless the board stores the name of this axis: cables may be swapped.

    `names` are those of all axes; of a bench of one axis, which has no name, nothing is asked.
    """
    stored = parameters.value(BY_NAME["axis_name_crc"])
    if not name or stored == axis_name_crc(name):
        return
    if stored == 0:
        raise Refusal(
            Reason.DISAGREEMENT,
            "the board stores no name of an axis",
            limit=name,
            action=f"if it is the board of this axis: smad params name --axis {name}",
        )
    of_another = next((other for other in names if stored == axis_name_crc(other)), "")
    raise Refusal(
        Reason.DISAGREEMENT,
        "the board belongs to another axis",
        value=of_another or f"the CRC {stored}",
        limit=name,
        action="swap the cables, or correct the ports in [[axes]]; smad params name renames it",
    )


def require_tighter(config: Config, parameters: Parameters) -> None:
    """Raise Refusal when a limit of the host is looser than the board's, or a scale is zero."""
    for parameter in BENCH_PARAMETERS:
        if parameter.never_zero and parameters.value(parameter) == 0:
            raise Refusal(
                Reason.INVALID,
                f"the board's {parameter.name} is zero, so nothing can be measured with it",
                value=0,
                limit=f"{parameter.allowed} {parameter.unit}",
                action=f"set it first (smad params set {parameter.name} VALUE)",
            )
    for loose in looser_than(config, parameters.limits()):
        raise Refusal(
            Reason.INVALID,
            f"{loose.key} is looser than the board's {loose.board}",
            value=loose.value,
            limit=f"at most {loose.limit:g}",
            action="tighten it in the configuration and start the daemon again, or loosen the "
            f"board's (smad params set {loose.board} VALUE)",
        )


@_names_axis
def require_not_faulted(axis: Axis) -> None:
    """Raise Refusal while a fault of board or host is latched."""
    by_host = axis.host_stop.fault
    if by_host is not None:
        raise Refusal(
            Reason.FAULTED,
            "a limit of the host stopped the bench",
            value=by_host.in_words(),
            action="smad faults explain says what to do; then smad clear",
        )
    if axis.session.state is not HostState.FAULTED:
        return
    fault = axis.watch.fault
    stopped = axis.watch.mode is BoardState.ESTOP
    raise Refusal(
        Reason.STOPPED if stopped else Reason.FAULTED,
        f"the board is in {'ESTOP' if stopped else 'FAULT'}",
        value=None if fault is None else fault.in_words(),
        action="power-cycle the board: nothing else ends ESTOP"
        if stopped
        else "smad faults explain says what to do; then smad clear",
    )


@_names_axis
def require_stage(axis: Axis) -> None:
    """Raise Refusal unless the board moves a stretching stage."""
    # Displacement is the stage's doing once one is used, and not limited until the next arming.
    ident = axis.watch.ident
    if ident is None or not ident.capabilities & Capability.STAGE:
        raise Refusal(
            Reason.INVALID,
            "this board moves no stretching stage",
            limit="a board with the capability `stage`",
            action="nothing was changed; smad status --json lists what the board has",
        )


@_names_axis
def require_armed(axis: Axis) -> None:
    """Raise Refusal unless the board is armed, by us."""
    require_connected(axis)
    require_not_faulted(axis)
    if axis.session.state is not HostState.RUNNING:
        raise Refusal(Reason.NOT_ARMED, "the bench is not armed", action="arm it first (smad arm)")


def not_connected(cause: str, action: str) -> Refusal:
    """Return the refusal of a command that needs a board."""
    return Refusal(Reason.NOT_CONNECTED, cause, action=action)
