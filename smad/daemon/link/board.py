"""What the daemon knows of the board: who it is, its parameters, its latched fault.

Everything is learnt anew in each session; nothing is carried over a reconnection.
"""

from collections.abc import Awaitable, Callable
from dataclasses import replace

from firmware_protocol.enums import Capability
from firmware_protocol.messages import FaultReport, Ident, Message, ParamGet, ParamSet, ParamValue
from firmware_protocol.nearest import instead
from firmware_protocol.parameters import (
    BY_NAME,
    LIMIT_PARAMETERS,
    PARAMETERS,
    Parameter,
    crc_of,
)
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from firmware_protocol.supervisor.limits import Limits, compiled_limits
from smad import api
from smad.api import Reason
from smad.daemon.errors import Refusal

Ask = Callable[[Message], Awaitable[Message]]


class Parameters:
    """The board's parameters as read in this session, and whether they are all of its."""

    def __init__(self, axis: int) -> None:
        self._axis = axis
        self.values: dict[tuple[int, int], int] = {}
        self._ranges: dict[tuple[int, int], tuple[int, int]] = {}
        self.board_crc: int | None = None
        self.complete = False

    @property
    def crc(self) -> int:
        """CRC of the values read: what arming needs the board to agree with."""
        return crc_of(self.values)

    @property
    def agree(self) -> bool | None:
        """Whether the board's CRC is that of the values read; None while they are being read."""
        return self.crc == self.board_crc if self.complete else None

    async def read(self, ident: Ident, ask: Ask) -> None:
        """Read every parameter of every axis. Raises Refusal when the board does not answer."""
        self.values.clear()
        self.complete = False
        self.board_crc = ident.param_crc
        for axis in range(ident.axes):
            for parameter in PARAMETERS:
                if axis == 0 or not parameter.shared:
                    self._note(await ask(ParamGet(axis, parameter.number)))
        self.complete = True

    async def set(self, name: str, value: float, ask: Ask) -> api.Param:
        """Change one; returns it as the board has it now. Raises Refusal."""
        parameter = _named(name)
        if value != int(value):
            raise Refusal(
                Reason.INVALID,
                f"{name} is a whole number of {parameter.unit}",
                value=value,
                action="round it",
            )
        if not parameter.takes(int(value)):
            raise Refusal(
                Reason.INVALID,
                f"{name}: the value is out of range",
                value=value,
                limit=f"{parameter.allowed} {parameter.unit}",
                action="nothing was changed; choose one within the limit",
            )
        axis = 0 if parameter.shared else self._axis
        try:
            reply = await ask(ParamSet(axis, parameter.number, int(value)))
        except Refusal as refusal:
            raise _with_range(refusal, parameter) from refusal
        self._note(reply)
        return self.value_of(name)

    def value(self, parameter: Parameter) -> int:
        """Return a value as read from the board, or its default while it was not."""
        key = (0 if parameter.shared else self._axis, parameter.number)
        return self.values.get(key, parameter.default)

    def limits(self) -> Limits:
        """Return the board's limits in force, as far as they were read."""
        return replace(compiled_limits(), **{p.name: self.value(p) for p in LIMIT_PARAMETERS})

    def value_of(self, name: str) -> api.Param:
        """Return one parameter. Raises Refusal when it does not exist or was not read yet."""
        parameter = _named(name)
        key = (0 if parameter.shared else self._axis, parameter.number)
        if key not in self.values:
            raise Refusal(
                Reason.NOT_CONNECTED,
                "the parameters have not been read from the board",
                value=name,
                action="connect the board (smad status)",
            )
        low, high = self._ranges.get(key, (parameter.minimum, parameter.maximum))
        return api.Param(
            name=name,
            value=self.values[key],
            minimum=low,
            maximum=high,
            unit=parameter.unit,
            description=parameter.doc,
        )

    def all(self) -> api.ParamList:
        """Return all parameters of our axis. Raises Refusal when they were not read yet."""
        return api.ParamList(params=tuple(self.value_of(p.name) for p in PARAMETERS))

    def _note(self, reply: Message) -> None:
        if isinstance(reply, ParamValue):
            key = (reply.axis, reply.param)
            self.values[key] = reply.value
            self._ranges[key] = (reply.minimum, reply.maximum)
            self.board_crc = reply.param_crc


def _named(name: str) -> Parameter:
    parameter = BY_NAME.get(name)
    if parameter is None:
        raise Refusal(
            Reason.INVALID,
            "there is no parameter of this name",
            value=name,
            action=instead(name, BY_NAME, "smad params list shows them"),
        )
    return parameter


def _with_range(refusal: Refusal, parameter: Parameter) -> Refusal:
    return Refusal(
        refusal.reason,
        f"{parameter.name}: {refusal.cause}",
        value=refusal.value,
        limit=f"{parameter.allowed} {parameter.unit}",
        action=refusal.action,
    )


def fault_of(report: FaultReport) -> api.Fault:
    """Return a fault report as a client gets it."""
    # The wire always carries both numbers; a button that was pressed has neither.
    has_values = report.measured != 0 or report.limit != 0
    return api.Fault(
        number=int(report.fault),
        name=report.fault.name,
        channel=report.channel.name,
        measured=float(report.measured) if has_values else None,
        limit=float(report.limit) if has_values else None,
        unit=FAULT_TEXTS[report.fault].unit,
    )


def board_of(ident: Ident, parameters: Parameters, *, schema_agrees: bool) -> api.Board:
    """Return who the board says it is."""
    return api.Board(
        uid=ident.uid.hex(),
        firmware=ident.firmware,
        protocol=f"{ident.major}.{ident.minor}",
        reset_cause=ident.reset_cause.name.lower().replace("_", " "),
        boot_count=ident.boot_count,
        capabilities=tuple(
            part.name.lower() for part in Capability(ident.capabilities) if part.name
        ),
        schema_agrees=schema_agrees,
        params_agree=parameters.agree,
    )
