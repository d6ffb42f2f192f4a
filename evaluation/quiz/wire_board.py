"""The quiz's board: the withheld plant behind the wire protocol, on virtual time.

The only file here that knows the product, and of it only the protocol: a session, a supervisor
and the messages. Nothing of the plant crosses the wire but readings.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from evaluation.bank.recorder import COLOURED, STEPS, WHITE, COLOUR_s, today
from evaluation.plant.effects import Active, magnitudes
from evaluation.plant.kernel import at_rest, tick
from evaluation.plant.layout import AMBIENT, COLUMNS, INLET, INPUTS, LUCK_X, READINGS
from evaluation.plant.parameters import Bench
from firmware_protocol import events as e
from firmware_protocol import messages as m
from firmware_protocol import supervisor as sup
from firmware_protocol.board import BoardSession
from firmware_protocol.enums import BoardState, Capability, ResetCause, ValidBit
from firmware_protocol.wire import NO_VALUE

Array = NDArray[np.float64]

AXIS = 0
WRAP = 1 << 32
HEATING = (BoardState.ARMED, BoardState.HOLD)
ALL_VALID = int(sum(ValidBit) - ValidBit.SETPOINT)
HAS = (
    Capability.ENCODER
    | Capability.FORCE_SENSOR
    | Capability.VOLTAGE_SENSE
    | Capability.RTD_INLET
    | Capability.RTD_AMBIENT
    | Capability.PARAMETER_STORE
)


class Surroundings:
    """The room, the water and the noise of the readings, sample by sample."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._coloured: Array = rng.normal(0.0, 1.0, len(READINGS)) * COLOURED
        self.inlet_degC = 26.85 + float(rng.normal(0.0, 0.5))
        self.ambient_degC = 26.85 + float(rng.normal(0.0, 1.0))

    def inputs(self, i_A: tuple[float, float], duty: tuple[float, float]) -> Array:
        """The plant's inputs for one sample."""
        row = np.zeros(len(INPUTS))
        row[:4] = *i_A, *duty
        row[INLET] = self.inlet_degC
        row[AMBIENT] = self.ambient_degC
        row[LUCK_X:] = self._rng.uniform(size=2)
        return row

    def read(self, true: Array, dt_s: float) -> Array:
        """Noisy, rounded readings."""
        keep = np.exp(-dt_s / COLOUR_s)
        fresh = self._rng.normal(0.0, 1.0, len(READINGS))
        self._coloured = keep * self._coloured + np.sqrt(1 - keep**2) * COLOURED * fresh
        noisy = true + self._coloured + self._rng.normal(0.0, 1.0, len(READINGS)) * WHITE
        return np.asarray(STEPS * np.round(noisy / STEPS))


class WireBoard:
    """One axis. `receive` takes bytes at `now_us`, `step` advances one sample and gives bytes."""

    def __init__(self, bench: Bench, active: tuple[Active, ...], seed: int) -> None:
        rng = np.random.default_rng((seed, 91))
        self.now_us = 1_000_000
        self._rng = rng
        self._room = Surroundings(rng)
        self._bench = today(rng, bench).vector()
        self._effects = magnitudes(active)
        self._plant = at_rest(
            bench,
            self._effects,
            water_degC=self._room.inlet_degC,
            ambient_degC=self._room.ambient_degC,
        )
        self._session = BoardSession(ident=_identity(rng))
        self._supervisor = sup.Supervisor()
        self._supervisor.event(sup.SelfTest(passed=True), self.now_us)
        self._tick = 0
        self._sp_seq = 0
        self._sp_age_us: int | None = None
        self._reported: sup.FirstFault | None = None
        self._reported_mode = self.state
        self._answered_us: int | None = None
        self.setpoints = 0
        self._out: Array = np.zeros(len(COLUMNS))
        self._session.boot(self.now_us)

    @property
    def period_us(self) -> int:
        """Time between samples."""
        return round(1e6 / self._session.parameters.get("state_rate_hz"))

    @property
    def state(self) -> BoardState:
        """State of the board's machine."""
        return self._supervisor.state

    @property
    def unanswered(self) -> bool:
        """Whether the last sample went out armed, and its setpoint has not come.

        A board that was disarmed since then is not answered any more.
        """
        both = self._reported_mode in HEATING and self.state in HEATING
        return both and self._answered_us != self.now_us % WRAP

    @property
    def at_rest(self) -> bool:
        """Whether nothing happens on the bench before somebody arms it."""
        return self.state == BoardState.SAFE

    def receive(self, data: bytes) -> bytes:
        """Act on bytes from the host; what there is to answer at once."""
        for event in self._session.receive(data, self.now_us):
            self._act(event)
        self._session.safe = self.state == BoardState.SAFE
        return self._session.data_to_send()

    def step(self) -> bytes:
        """Advance plant and supervisor by one sample; the bytes that the board sends."""
        dt_us = self.period_us
        self.now_us += dt_us
        self._tick += 1
        memory = self._supervisor.memory
        applied = (memory.applied_mA[0], memory.applied_mA[1])
        duty = (memory.duty[0], memory.duty[1])
        inputs = self._room.inputs(
            (applied[0] / 1e3, applied[1] / 1e3), (duty[0] / 255, duty[1] / 255)
        )
        tick(self._bench, self._effects, inputs, dt_us / 1e6, *self._plant.arrays(), self._out)
        read = self._room.read(self._out[: len(READINGS)], dt_us / 1e6)
        self._supervisor.sample(_measurements(read, applied, duty), self.now_us)
        self._session.safe = self.state == BoardState.SAFE
        state = self._state(read, applied, duty)
        self._session.send_state(state)
        self._reported_mode = state.mode
        self._tell_fault(state)
        return self._session.data_to_send()

    def _state(self, read: Array, applied: tuple[int, int], duty: tuple[int, int]) -> m.State:
        memory = self._supervisor.memory
        valid = ALL_VALID | (ValidBit.SETPOINT if self._sp_age_us is not None else 0)
        age = NO_VALUE["u16"] if self._sp_age_us is None else min(self._sp_age_us, 65_534)
        return m.State(
            axis=AXIS,
            t_us=self.now_us % WRAP,
            tick=self._tick % 65_536,
            mode=self.state,
            limiter=self._supervisor.limiter,
            faults=memory.faults,
            warnings=memory.warnings,
            i_meas_mA=(_milli(read[0]), _milli(read[1])),
            i_applied_mA=applied,
            v_mV=(max(_milli(read[2]), 0), max(_milli(read[3]), 0)),
            pump_duty=duty,
            rtd_cC=(_centi(read[4]), _centi(read[5]), _centi(read[6]), _centi(read[7])),
            encoder_counts=_milli(read[8]),
            force_counts=_milli(read[9]),
            vbus_mV=_milli(read[10]),
            valid=int(valid),
            sp_seq=self._sp_seq,
            sp_age_us=age,
        )

    def _tell_fault(self, state: m.State) -> None:
        first = self._supervisor.first_fault
        if first is None or first == self._reported:
            return
        self._reported = first
        self._session.send_fault(
            m.FaultReport(
                axis=AXIS,
                index=0,
                fault=first.fault,
                channel=first.channel,
                t_us=first.t_us % WRAP,
                measured=first.measured,
                limit=first.limit,
                snapshot=state,
            )
        )

    def _act(self, event: e.BoardEvent) -> None:
        if isinstance(event, e.SetpointReceived):
            self._apply(event)
        elif isinstance(event, e.EstopReceived):
            self._supervisor.event(sup.Stopped(), self.now_us)
        elif isinstance(event, e.SessionStarted):
            self._supervisor.event(sup.Disarmed(), self.now_us)
            self._sp_age_us = None
        elif isinstance(event, e.ParameterChanged):
            self._supervisor.set_limits(self._session.parameters.limits(AXIS))
        elif isinstance(event, e.ParameterSaveRequested):
            self._session.done(event.request, self.now_us)
        else:
            self._command(event)

    def _apply(self, event: e.SetpointReceived) -> None:
        wish = event.setpoint
        self.setpoints += 1
        self._answered_us = wish.t_ref_us
        refused = self._supervisor.setpoint(
            wish.i_mA, wish.pump_duty, event.age_us, 1000 * wish.ttl_ms, self.now_us
        )
        if not refused:
            self._sp_seq = event.seq
            self._sp_age_us = event.age_us

    def _link(self) -> sup.Link:
        return sup.Link(
            session=self._session.session != 0,
            schema=self._session.schema_agrees,
            clock=self._session.clock_locked,
        )

    def _command(self, event: e.BoardEvent) -> None:
        """Arming, disarming and clearing: the supervisor decides, the session answers."""
        token = int(self._rng.integers(1, WRAP))
        if isinstance(event, e.ArmRequested):
            command: sup.Event = sup.ArmRequested(self._link(), token)
        elif isinstance(event, e.ArmConfirmed):
            command = sup.ArmConfirmed(self._link(), event.message.token)
        elif isinstance(event, e.DisarmRequested):
            command = sup.Disarmed()
        elif isinstance(event, e.ClearFaultRequested):
            command = sup.FaultCleared(event.message.fault)
        else:
            return
        outcome = self._supervisor.event(command, self.now_us)
        if outcome.code is not None:
            self._session.reject(
                event.request,
                outcome.code,
                int(outcome.channel),
                outcome.limit,
                self.now_us,
                value=outcome.value,
            )
        elif isinstance(event, e.ArmRequested):
            valid_ms = self._supervisor.limits.token_us // 1000
            answer = m.ArmToken(axis=AXIS, token=token, valid_ms=valid_ms)
            self._session.reply(event.request, answer, self.now_us)
        else:
            self._session.done(event.request, self.now_us)


def _milli(value: float) -> int:
    return round(1e3 * float(value))


def _centi(value: float) -> int:
    return round(1e2 * float(value))


def _measurements(read: Array, applied: tuple[int, int], duty: tuple[int, int]) -> sup.Measurements:
    return sup.Measurements(
        i_mA=[_milli(read[0]), _milli(read[1])],
        applied_mA=list(applied),
        v_mV=[max(_milli(read[2]), 0), max(_milli(read[3]), 0)],
        rtd_cC=[_centi(v) for v in read[4:8]],
        duty=list(duty),
        vbus_mV=_milli(read[10]),
    )


def _identity(rng: np.random.Generator) -> m.Ident:
    blank = m.Ident(
        major=m.PROTOCOL_MAJOR,
        minor=m.PROTOCOL_MINOR,
        schema_crc=0,
        param_crc=0,
        nonce=0,
        session=0,
        boot_count=1,
        reset_cause=ResetCause.POWER_ON,
        first_fault=0,
        axes=1,
        capabilities=int(HAS),
        state_rate_hz=100,
        baud=115_200,
        uid=b"mystery-unit",
        firmware="mystery 1.0",
    )
    return msgspec.structs.replace(blank, boot_count=int(rng.integers(1, 1000)))
