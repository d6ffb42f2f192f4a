"""The supervisor as Python uses it: typed commands in, outcomes and outputs out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from firmware_protocol.enums import BoardState, Channel, ErrorCode, Fault, Limiter
from firmware_protocol.supervisor import machine
from firmware_protocol.supervisor.faults import FAULT_TEXTS
from firmware_protocol.supervisor.limits import Limits, compiled_limits
from firmware_protocol.supervisor.memory import Command, Measurements, Memory
from firmware_protocol.supervisor.refusals import refusal_text
from firmware_protocol.supervisor.table import LINE_COUNT, LINES


@dataclass(frozen=True, slots=True)
class Link:
    """What host and board have agreed on; arming needs all of it."""

    session: bool = True
    schema: bool = True
    parameters: bool = True
    clock: bool = True

    @property
    def word(self) -> int:
        """As bits."""
        return (
            machine.LINK_SESSION * self.session
            + machine.LINK_SCHEMA * self.schema
            + machine.LINK_PARAMETERS * self.parameters
            + machine.LINK_CLOCK * self.clock
        )


@dataclass(frozen=True, slots=True)
class FirstFault:
    """The first cause, as latched. `measured` and `limit` are in the fault's unit."""

    fault: Fault
    channel: Channel
    measured: int
    limit: int
    t_us: int

    def __str__(self) -> str:
        unit = FAULT_TEXTS[self.fault].unit
        return (
            f"{self.fault.name} on {self.channel.name}: {self.measured} {unit}, "
            f"limit {self.limit} {unit}".replace("  ", " ")
        )


@dataclass(frozen=True, slots=True)
class Restarted:
    """The board was reset with this first fault latched."""

    first: FirstFault


@dataclass(frozen=True, slots=True)
class SelfTest:
    """The self-test of BOOT ended."""

    passed: bool


@dataclass(frozen=True, slots=True)
class ArmRequested:
    """First step of arming; `token` is the one to hand out if it is granted."""

    link: Link
    token: int


@dataclass(frozen=True, slots=True)
class ArmConfirmed:
    """Second step of arming, with the token that came back."""

    link: Link
    token: int


@dataclass(frozen=True, slots=True)
class SetpointArrived:
    """A setpoint; its age is by board time, from the sample it was computed from."""

    i_mA: tuple[int, int]
    duty: tuple[int, int]
    age_us: int
    ttl_us: int
    stage_um: int = 0


@dataclass(frozen=True, slots=True)
class Disarmed:
    """DISARM."""


@dataclass(frozen=True, slots=True)
class FaultCleared:
    """CLEAR_FAULT of one fault."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class Stopped:
    """ESTOP."""


HostCommand = ArmRequested | ArmConfirmed | SetpointArrived | Disarmed | FaultCleared | Stopped
Event = Restarted | SelfTest | HostCommand


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a command. A refusal names the cause, the value and the limit."""

    code: ErrorCode | None
    """None when accepted."""
    channel: Channel = Channel.BOARD
    value: int = 0
    limit: int = 0

    @property
    def accepted(self) -> bool:
        """Whether the command was carried out."""
        return self.code is None

    @property
    def message(self) -> str:
        """One line: what is in the way, the value, the limit, and what to do."""
        return refusal_text(self.code, self.channel, self.value, self.limit)


ACCEPTED = Outcome(None)


class Supervisor:
    """Decides, sample by sample and command by command, what the board lets out.

    `sample` returns the memory, in which these fields are the outputs: `state`, `gate`,
    `ceiling_mA`, `applied_mA` (after ceiling and slew), `duty`, `limiter`, `faults`, `warnings`.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self.memory, self.measurements, self._command = self._records()
        self.set_limits(compiled_limits() if limits is None else limits)
        self._handlers: dict[type, Callable[..., int]] = {
            Restarted: self._restart,
            SelfTest: self._self_test,
            ArmRequested: self._arm_request,
            ArmConfirmed: self._arm_confirm,
            SetpointArrived: self._setpoint,
            Disarmed: self._disarm,
            FaultCleared: self._clear_fault,
            Stopped: self._estop,
        }

    def _records(self) -> tuple[Memory, Measurements, Command]:
        return Memory(LINE_COUNT), Measurements(), Command()

    def set_limits(self, limits: Limits) -> None:
        """Put limits in force; the debounce of each check is read from them once, here."""
        self.limits = limits
        self.memory.paced_us = -1
        for number, line in enumerate(LINES):
            self.memory.need_samples[number] = getattr(limits, line.check.samples)
            self.memory.need_us[number] = getattr(limits, line.check.time) if line.check.time else 0

    @property
    def state(self) -> BoardState:
        """The state the board is in."""
        return BoardState(self.memory.state)

    @property
    def limiter(self) -> Limiter:
        """The most severe limiter of the two springs."""
        return Limiter(max(self.memory.limiter))

    @property
    def first_fault(self) -> FirstFault | None:
        """The first fault since the last power-up or clearing; stays readable after clearing."""
        s = self.memory
        if not s.first_fault:
            return None
        return FirstFault(
            Fault(s.first_fault), Channel(s.first_channel), s.first_value, s.first_limit, s.first_us
        )

    def sample(self, measurements: Measurements, now_us: int) -> Memory:
        """Take one sample at board time `now_us`; return the memory with the outputs."""
        self.measurements = measurements
        self._decide_sample(measurements, now_us)
        return self.memory

    def _decide_sample(self, m: Measurements, now_us: int) -> None:
        machine.sample(self.memory, m, self.limits, now_us)

    def event(self, event: Event, now_us: int) -> Outcome:
        """Carry out one command at board time `now_us`, or refuse it with the reason."""
        code = self._handlers[type(event)](event, now_us)
        if code == 0:
            return ACCEPTED
        s = self.memory
        return Outcome(ErrorCode(code), Channel(s.channel), s.value, s.limit)

    def setpoint(
        self,
        i_mA: Sequence[int],
        duty: Sequence[int],
        age_us: int,
        ttl_us: int,
        now_us: int,
        *,
        stage_um: int = 0,
    ) -> int:
        """Take a setpoint, as `event` does, at less cost; return the refusal's code or 0.

        A refusal leaves what was found and what is allowed in `memory.value` and `memory.limit`.
        """
        c = self._command
        c.i_mA[0], c.i_mA[1] = i_mA
        c.duty[0], c.duty[1] = duty
        # A clock that is far off is refused as the wire can tell it.
        c.age_us = min(age_us, machine.I32_MOST)
        c.ttl_us = ttl_us
        c.stage_um = stage_um
        return self._decide_setpoint(c, now_us)

    def _decide_setpoint(self, c: Command, now_us: int) -> int:
        return machine.on_setpoint(self.memory, self.limits, c, now_us)

    def _restart(self, event: Restarted, now_us: int) -> int:
        s, first = self.memory, event.first
        s.channel, s.value, s.limit = int(first.channel), first.measured, first.limit
        return machine.on_restart(s, Command(fault=int(first.fault)))

    def _self_test(self, event: SelfTest, now_us: int) -> int:
        return machine.on_self_test(self.memory, self.limits, Command(passed=int(event.passed)))

    def _arm_request(self, event: ArmRequested, now_us: int) -> int:
        c = Command(link=event.link.word, token=event.token)
        return machine.on_arm_request(self.memory, self.measurements, self.limits, c, now_us)

    def _arm_confirm(self, event: ArmConfirmed, now_us: int) -> int:
        c = Command(link=event.link.word, token=event.token)
        return machine.on_arm_confirm(self.memory, self.measurements, self.limits, c, now_us)

    def _setpoint(self, event: SetpointArrived, now_us: int) -> int:
        return self.setpoint(
            event.i_mA, event.duty, event.age_us, event.ttl_us, now_us, stage_um=event.stage_um
        )

    def _disarm(self, event: Disarmed, now_us: int) -> int:
        return machine.on_disarm(self.memory, self.limits)

    def _clear_fault(self, event: FaultCleared, now_us: int) -> int:
        return machine.on_clear_fault(self.memory, self.limits, Command(fault=int(event.fault)))

    def _estop(self, event: Stopped, now_us: int) -> int:
        return machine.on_estop(self.memory, self.limits)
