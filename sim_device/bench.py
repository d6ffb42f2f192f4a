"""Board and plant in lockstep on virtual time: the bench that is not there.

Two ways to use it, with the same samples: bytes (`receive`, `step`) as on a port, and typed
(`step_typed`) for closed-loop simulation without a host session. The same seed, parameters and
commands give the same bytes, always.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState, ResetCause
from firmware_protocol.parameters import BY_NAME, ParameterStore, axis_name_crc
from firmware_protocol.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Disarmed,
    Link,
    Outcome,
    Stopped,
)
from firmware_protocol.supervisor.ranges import COMMAND
from sim_device.board import SELF_TEST_SAMPLES, WRAP, Board
from sim_device.errors import RefusedError
from sim_device.faults import NEVER, Injection, Scheduler
from sim_device.line import Line
from sim_device.plant import Drive, ParameterSet, Plant, load_parameters
from sim_device.plant.errors import InputError
from sim_device.plant.laws import Law

_CURRENT, _DUTY, _TTL, _STAGE = (COMMAND[n] for n in ("i_mA", "duty", "ttl_us", "stage_um"))
WATCHDOG_US = 120_000
UART_BYTES = 512
"""What the receive buffer of the chip holds while its loop hangs."""
SPLIT_LEAST_US = 200
"""A setpoint that comes later than this after the sample is applied at its own time."""


class SimulatedBench:
    """A bench on virtual time; `now_us` is the time that the plant has lived.

    parameters: of the plant (None: the built-in set A). variant, effects, laws, fixture, cooling:
    as for Plant. rate_hz: samples per second. seed: of noise, tokens and damage on the line.
    faults: injections, see `sim_device.faults`. clock_start_us: board time at power-up.
    axis_name: of the axis whose board it is, stored in its parameters; empty: none is stored.
    board_type: another board than this class has.
    """

    board_type: type[Board] = Board

    def __init__(
        self,
        *,
        parameters: ParameterSet | None = None,
        variant: str = "extended",
        effects: Mapping[str, Mapping[str, float]] | None = None,
        laws: Sequence[Law] = (),
        fixture: str = "antagonistic",
        cooling: str = "water",
        rate_hz: int = 100,
        seed: int = 0,
        faults: Sequence[Injection] = (),
        clock_start_us: int = 0,
        image: bytes | None = None,
        axis_name: str = "",
        board_type: type[Board] | None = None,
    ) -> None:
        if board_type is not None:
            self.board_type = board_type
        self.plant = Plant(
            load_parameters("A") if parameters is None else parameters,
            variant=variant,
            fixture=fixture,
            cooling=cooling,
            effects=effects or {},
            laws=laws,
            seed=seed,
        )
        self.now_us = 0
        self.rng = random.Random(f"bench {seed}")
        self.uplink = Line(random.Random(f"up {seed}"))
        self.downlink = Line(random.Random(f"down {seed}"))
        self.echo = False
        self.hardware = self.board_type.hardware_type()
        self.clock_ppm = 0
        self.period_scale = 1
        """Samples take so many periods: a slow loop."""
        self.make: dict[str, Any] = {}
        """What is unusual about this make of board: `codec`, `major`."""
        self.on_unplug: Callable[[bool], None] | None = None
        """Called when the port goes away (True: to come back under another name)."""
        self.on_plug: Callable[[], None] | None = None
        """Called when the port comes back."""
        self._fixture = fixture
        self._seed = seed
        self._rate_hz = rate_hz
        self._image = named_image(
            image, axis_name, {**self.board_type.initial_parameters, "state_rate_hz": rate_hz}
        )
        self._boots = 0
        self._board_start_us = clock_start_us
        self._typed_seq = 0
        self._quiet = False
        self._plant_us = 0
        self._skipped_us = 0
        self._hung_from_us = 0
        self._hung_until_us = 0
        self._plugged_at_us = NEVER
        self._late_bytes = bytearray()
        self._to_send = bytearray()
        self.board = self._power_up(ResetCause.POWER_ON, clock_start_us)
        self.faults = Scheduler(self, faults)

    def close(self) -> None:
        """Give up what the board holds outside of this process; a Python board holds nothing."""

    # Bytes

    def receive(self, data: bytes, at_us: int | None = None) -> None:
        """Take bytes from the host, at `at_us` (default: at the time of the last sample)."""
        if self.echo:
            self._to_send += data
        self._deliver(self.uplink.carry(data, self.now_us), at_us)

    def step(self) -> bytes:
        """Advance by one sample; return what the host receives."""
        self.advance()
        return self.data_to_send()

    def data_to_send(self) -> bytes:
        """Return the bytes for the host that are ready now."""
        self._to_send += self.board.session.data_to_send()
        data = bytes(self._to_send)
        self._to_send.clear()
        return self.downlink.carry(data, self.now_us)

    def junk_to_host(self, data: bytes) -> None:
        """Put bytes that are no frames on the way to the host."""
        self._to_send += data

    # Typed

    def step_typed(self, setpoint: wire.Setpoint | None) -> wire.State:
        """Apply a setpoint at the last sample's time, advance by one sample, return the STATE.

        The session is left out, so no bytes are made; stale setpoints are refused as by it.
        Raises InputError for a setpoint that the wire cannot carry.
        """
        board = self.board
        self._quiet = True
        if setpoint is not None:
            _require_on_the_wire(setpoint)
            self._typed_seq = (self._typed_seq + 1) & 0xFF
            age_us = (board.now_us - setpoint.t_ref_us) % WRAP
            board.apply_setpoint(setpoint, self._typed_seq, age_us, board.now_us)
        state = self.advance()
        while state is None:
            state = self.advance()
        return state

    def arm(self) -> None:
        """Arm as a host with a session would; steps through the self-test first if need be.

        Raises RefusedError with the supervisor's reason.
        """
        for _ in range(SELF_TEST_SAMPLES + 1):
            if self.board.state is not BoardState.BOOT:
                break
            self.step_typed(None)
        token = self.board.commands.new_token()
        for event in (ArmRequested(Link(), token), ArmConfirmed(Link(), token)):
            self._require(self.board.command(event, self.board.now_us))

    def disarm(self) -> None:
        """End heating: COOL, then SAFE."""
        self._require(self.board.command(Disarmed(), self.board.now_us))

    def stop(self) -> None:
        """ESTOP."""
        self._require(self.board.command(Stopped(), self.board.now_us))

    @staticmethod
    def _require(outcome: Outcome) -> None:
        if not outcome.accepted:
            raise RefusedError(outcome.message)

    # Time

    @property
    def period_us(self) -> int:
        """Time from this sample to the next."""
        return self.board.period_us * self.period_scale

    @property
    def heater_J(self) -> float:
        """Electrical heat that both springs have taken in so far."""
        return self.plant.heat_in_J

    def board_time_us(self, at_us: int) -> int:
        """Return the board's clock at a time at or after the last sample."""
        return self.board.now_us + (at_us - self.now_us)

    def advance(self) -> wire.State | None:
        """Advance by one sample; None for one that the board did not take (it hangs)."""
        if self.faults.due_us <= self.now_us:
            self.faults.run()
        if self.uplink.spoilt:
            self._deliver(self.uplink.carry(b"", self.now_us), None)
        board = self.board
        period_us = board.period_us * self.period_scale
        self.now_us += period_us
        self._move_plant(self.now_us)
        if self.now_us >= self._plugged_at_us:
            self._plug_in()
        if self._hung_until_us and self._hangs(period_us):
            return None
        board_us = board.now_us + period_us + self._skipped_us
        self._skipped_us = 0
        if self.clock_ppm:
            # Whole microseconds of the drift, spread evenly over the samples.
            board_us += self.now_us * self.clock_ppm // 1_000_000
            board_us -= (self.now_us - period_us) * self.clock_ppm // 1_000_000
        if self._late_bytes:
            # By now they are as old as the loop hung; the board must see that.
            late = bytes(self._late_bytes)
            self._late_bytes.clear()
            board.receive(late, board_us)
        return board.sample(self.plant.read(), board_us, talk=not self._quiet)

    def reboot(self, cause: ResetCause, *, start_us: int = 0) -> None:
        """Restart the board at once; the plant goes on, the session and its memory are gone."""
        self._image = self.board.image
        self.board = self._power_up(cause, start_us)
        self._hung_until_us = 0
        self._skipped_us = 0
        self._late_bytes.clear()

    def hang(self, seconds: float) -> None:
        """Let the board's loop hang; what it applied stays applied."""
        self._hung_from_us = self.now_us
        self._hung_until_us = self.now_us + round(seconds * 1e6)

    def unplug(self, seconds: float, *, renamed: bool = False) -> None:
        """Take the port away for some board time; what was on the way is lost."""
        self._plugged_at_us = self.now_us + round(seconds * 1e6)
        self.uplink.spoil(lost=True)
        self.downlink.spoil(lost=True)
        if self.on_unplug is not None:
            self.on_unplug(renamed)

    def _plug_in(self) -> None:
        self._plugged_at_us = NEVER
        self.uplink.spoil(lost=False)
        self.downlink.spoil(lost=False)
        if self.on_plug is not None:
            self.on_plug()

    def _power_up(self, cause: ResetCause, start_us: int) -> Board:
        self._boots += 1
        return self.board_type(
            fixture=self._fixture,
            rate_hz=self._rate_hz,
            seed=self._seed,
            image=self._image,
            boot_count=self._boots,
            cause=cause,
            latched=() if cause is ResetCause.POWER_ON else self.board.latched,
            now_us=start_us,
            hardware=self.hardware,
            **self.make,
        )

    def _hangs(self, period_us: int) -> bool:
        """Return whether this sample is not taken; the watchdog ends what lasts too long."""
        bites_us = self._hung_from_us + WATCHDOG_US
        if min(self.now_us, self._hung_until_us) >= bites_us:
            self.reboot(ResetCause.WATCHDOG)
        elif self.now_us >= self._hung_until_us:
            self._hung_until_us = 0
            return False
        else:
            self._skipped_us += period_us
        return True

    def _deliver(self, data: bytes, at_us: int | None) -> None:
        """Hand bytes to the board; a drive they change takes effect at `at_us`."""
        if not data:
            return
        if self._hung_until_us:
            room = UART_BYTES - len(self._late_bytes)
            self._late_bytes += data[:room]
            return
        arrival_us = self.now_us if at_us is None else max(at_us, self.now_us)
        before = self.drive()
        self.board.receive(data, self.board_time_us(arrival_us))
        if arrival_us - self.now_us >= SPLIT_LEAST_US and self.drive() is not before:
            self._move_plant(arrival_us, before)

    def drive(self) -> Drive:
        """Return what the springs and pumps get at this moment."""
        board = self.board
        return self.hardware.drive(board.outputs, board.drain, board.stage_m)

    def _move_plant(self, until_us: int, drive: Drive | None = None) -> None:
        if until_us > self._plant_us:
            self.plant.advance(drive or self.drive(), (until_us - self._plant_us) * 1e-6)
            self._plant_us = until_us


def named_image(image: bytes | None, axis_name: str, initial: Mapping[str, int]) -> bytes | None:
    """Return an image of stored parameters that holds the name of the axis, if there is one.

    `initial` are the parameters of a board without an image, where they are not the table's.
    """
    if not axis_name:
        return image
    store = ParameterStore(1)
    for name, value in initial.items():
        store.set(0, BY_NAME[name].number, value)
    if image is not None:
        store.load(image)
    store.set(0, BY_NAME["axis_name_crc"].number, axis_name_crc(axis_name))
    return store.image()


def _require_on_the_wire(setpoint: wire.Setpoint) -> None:
    """Raise InputError for a setpoint that is not in the ranges of the supervisor's commands."""
    i_mA, duty, stage_um = setpoint.i_mA, setpoint.pump_duty, setpoint.stage_um
    within = (
        _CURRENT.low <= min(i_mA)
        and max(i_mA) <= _CURRENT.high
        and _DUTY.low <= min(duty)
        and max(duty) <= _DUTY.high
        and _TTL.low <= setpoint.ttl_ms * 1000 <= _TTL.high
        and _STAGE.low <= stage_um <= _STAGE.high
    )
    if not within:
        raise InputError(
            f"currents of {i_mA} mA, duties of {duty}, a life of {setpoint.ttl_ms} ms and a stage "
            f"at {stage_um} um are no setpoint: the wire has {_CURRENT.low} to {_CURRENT.high} mA, "
            f"{_DUTY.low} to {_DUTY.high}, {_TTL.low} to {_TTL.high // 1000} ms and 32 bits; "
            "correct the one beyond"
        )
