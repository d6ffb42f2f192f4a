"""What the firmware does: sample, supervise, apply, and talk to the host.

The board has its own clock (`now_us`, virtual) and knows nothing of the plant: readings come in
with each sample, and the current and duty it wants are in `outputs`. One axis.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from typing import ClassVar

from firmware_protocol import messages as wire
from firmware_protocol.board import BoardSession
from firmware_protocol.codec import CODEC, Codec
from firmware_protocol.enums import (
    BoardState,
    Capability,
    Channel,
    Fault,
    Limiter,
    ResetCause,
    SetpointFlag,
    ValidBit,
)
from firmware_protocol.events import BoardEvent
from firmware_protocol.parameters import BY_NAME, DamagedImageError, ParameterStore
from firmware_protocol.supervisor import (
    Event,
    Memory,
    Outcome,
    Restarted,
    SelfTest,
    Stopped,
    Supervisor,
)
from firmware_protocol.supervisor.compiled import fastest_supervisor
from firmware_protocol.supervisor.observers import is_believed
from sim_device.commands import Commands
from sim_device.hardware import Hardware
from sim_device.plant import Readings

FIRMWARE = "smad-sim 1.0"
BAUD = 921_600
SELF_TEST_SAMPLES = 5
STATS_EVERY_US = 1_000_000
WRAP = 1 << 32
AGE_MOST_US = 0xFFFE
AGE_UNKNOWN = 0xFFFF

_COMMON = (
    Capability.ENCODER
    | Capability.FORCE_SENSOR
    | Capability.VOLTAGE_SENSE
    | Capability.RTD_INLET
    | Capability.RTD_AMBIENT
    | Capability.DRAIN
    | Capability.LEAK_SENSOR
    | Capability.PUMP_TACHO
    | Capability.PARAMETER_STORE
)
CAPABILITIES: dict[str, int] = {
    "antagonistic": int(_COMMON),
    "stretch": int(_COMMON | Capability.STAGE),
    "blocked": int(_COMMON | Capability.STAGE),
}
"""What a board says it has, by fixture."""

ALL_VALID = int(
    ValidBit.I_X
    | ValidBit.I_Y
    | ValidBit.V_X
    | ValidBit.V_Y
    | ValidBit.RTD_X
    | ValidBit.RTD_Y
    | ValidBit.RTD_INLET
    | ValidBit.RTD_AMBIENT
    | ValidBit.ENCODER
    | ValidBit.FORCE
    | ValidBit.VBUS
)
_READINGS_OF = {
    Capability.ENCODER: ValidBit.ENCODER,
    Capability.FORCE_SENSOR: ValidBit.FORCE,
    Capability.VOLTAGE_SENSE: ValidBit.V_X | ValidBit.V_Y,
    Capability.RTD_INLET: ValidBit.RTD_INLET,
    Capability.RTD_AMBIENT: ValidBit.RTD_AMBIENT,
}
_SETPOINT_VALID = int(ValidBit.SETPOINT)
_DRAIN_X, _DRAIN_Y = int(SetpointFlag.DRAIN_X), int(SetpointFlag.DRAIN_Y)
_STAGE = int(SetpointFlag.STAGE)
_RTD_BITS = (ValidBit.RTD_X, ValidBit.RTD_Y, ValidBit.RTD_INLET, ValidBit.RTD_AMBIENT)
_NO_COUNTS = -(2**31)
_STATES = tuple(BoardState)
_LIMITERS = tuple(Limiter)


class Board:
    """One board, from power-up to power-down. Power-cycling makes a new one.

    `image` is what the parameter memory holds (None: empty). If its checksum is wrong, the
    compiled limits are used and the board goes to FAULT. `latched` is that of the board before
    this reset: its first fault and ESTOP. `supervisor` decides (None: see `fastest_supervisor`).
    """

    capabilities: ClassVar[Mapping[str, int]] = CAPABILITIES
    hardware_type: ClassVar[type[Hardware]] = Hardware
    """Its drivers and converters."""
    initial_parameters: ClassVar[Mapping[str, int]] = {}
    """Its parameters that begin at other values than the table's."""

    def __init__(
        self,
        *,
        fixture: str = "antagonistic",
        rate_hz: int = 100,
        seed: int = 0,
        image: bytes | None = None,
        boot_count: int = 1,
        cause: ResetCause = ResetCause.POWER_ON,
        latched: Sequence[Event] = (),
        now_us: int = 0,
        hardware: Hardware | None = None,
        supervisor: Supervisor | None = None,
        codec: Codec = CODEC,
        major: int = wire.PROTOCOL_MAJOR,
    ) -> None:
        self.now_us = now_us
        self.hardware = hardware or self.hardware_type()
        has = self.capabilities[fixture]
        self._readings = ALL_VALID & ~sum(b for part, b in _READINGS_OF.items() if not has & part)
        self.parameters = ParameterStore(1)
        for name, value in {**self.initial_parameters, "state_rate_hz": rate_hz}.items():
            self.parameters.set(0, BY_NAME[name].number, value)
        self.image = image
        intact = self._load(image)
        self.supervisor = fastest_supervisor() if supervisor is None else supervisor
        self.outputs: Memory = self.supervisor.memory
        self.measurements = self.supervisor.measurements
        self.measurements.parameters_ok = int(intact)
        rng = random.Random(f"{seed} {boot_count}")
        self.session = BoardSession(
            ident=wire.Ident(
                major=major,
                minor=wire.PROTOCOL_MINOR,
                schema_crc=0,
                param_crc=0,
                nonce=0,
                session=0,
                boot_count=boot_count,
                reset_cause=cause,
                first_fault=0,
                axes=1,
                capabilities=self.capabilities[fixture],
                state_rate_hz=self.rate_hz,
                baud=BAUD,
                uid=random.Random(seed).randbytes(12),
                firmware=FIRMWARE,
            ),
            parameters=self.parameters,
            codec=codec,
        )
        self.commands = Commands(self, rng)
        self.drain = (False, False)
        self.stage_m = 0.0
        self.tick = 0
        self.sp_seq = 0
        self.sp_age_us = AGE_UNKNOWN
        self.sp_ref_us = -1
        """Board time (32 bits) of the sample that the last accepted setpoint answers."""
        self.last_mode = BoardState.BOOT
        """Mode that the last STATE told."""
        self.lying_sp_seq = 0
        """Added to STATE.sp_seq by a fault injection."""
        self.overruns = 0
        self.longest_loop_us = 0
        self._stats_due_us = now_us + STATS_EVERY_US
        self._reported = 0
        self.apply_parameters()
        for event in latched:
            self.supervisor.event(event, now_us)
        self.session.boot(now_us)

    @property
    def rate_hz(self) -> int:
        """Samples per second."""
        return self.parameters.get("state_rate_hz")

    @property
    def period_us(self) -> int:
        """Time from one sample to the next."""
        return 1_000_000 // self.rate_hz

    @property
    def state(self) -> BoardState:
        """State of the machine."""
        return _STATES[self.outputs.state]

    @property
    def latched(self) -> tuple[Event, ...]:
        """What outlives a reset: the latched fault and ESTOP."""
        first = self.supervisor.first_fault
        if first is None or not self.outputs.latched:
            return ()
        stops = (Stopped(),) if self.state is BoardState.ESTOP else ()
        return (Restarted(first), *stops)

    def receive(self, data: bytes, now_us: int) -> None:
        """Take in bytes from the host and act on them."""
        self.session.safe = self._may_set_parameters()
        for event in self.session.receive(data, now_us):
            self.act(event, now_us)

    def _may_set_parameters(self) -> bool:
        """SAFE, or stopped for damaged parameters: else nothing could ever mend those."""
        s = self.outputs
        if s.state == BoardState.FAULT:
            return bool(s.faults >> (Fault.PARAM_CRC - 1) & 1)
        return s.state == BoardState.SAFE

    def act(self, event: BoardEvent, now_us: int) -> None:
        """Act on one event of the session."""
        self.commands.act(event, now_us)

    def command(self, event: Event, now_us: int) -> Outcome:
        """Pass a command to the supervisor, and report the fault if it made one."""
        outcome = self.supervisor.event(event, now_us)
        self._report_fault()
        return outcome

    def apply_setpoint(self, setpoint: wire.Setpoint, seq: int, age_us: int, now_us: int) -> int:
        """Put a fresh setpoint in force, from this moment on; return the refusal's code or 0."""
        flags = int(setpoint.flags)
        refused = self.supervisor.setpoint(
            setpoint.i_mA,
            setpoint.pump_duty,
            age_us,
            setpoint.ttl_ms * 1000,
            now_us,
            stage_um=setpoint.stage_um if flags & _STAGE else 0,
        )
        if refused:
            return refused
        self.sp_seq = seq
        self.sp_ref_us = setpoint.t_ref_us
        self.sp_age_us = min(age_us, AGE_MOST_US)
        self.drain = ((flags & _DRAIN_X) != 0, (flags & _DRAIN_Y) != 0)
        if flags & _STAGE:
            self.stage_m = setpoint.stage_um * 1e-6
        return 0

    def sample(self, readings: Readings, now_us: int, *, talk: bool = True) -> wire.State:
        """Take one sample at board time `now_us`; return what the host is told.

        With `talk` False nothing is put on the line but faults.
        """
        dt_us = now_us - self.now_us
        self.now_us = now_us
        s, m = self.outputs, self.measurements
        self.hardware.measure(readings, s, m, dt_us * 1e-6)
        self.tick = (self.tick + 1) & 0xFFFF
        if s.state == BoardState.BOOT and self.tick >= SELF_TEST_SAMPLES:
            self.supervisor.event(SelfTest(True), now_us)
        self.supervisor.sample(m, now_us)
        if not s.gate:
            self.drain = (False, False)
        self._watch_loop(dt_us)
        state = self._state()
        self.last_mode = state.mode
        if talk:
            self.session.send_state(state)
        if s.latched != self._reported:
            self._report_fault()
        elif now_us >= self._stats_due_us:
            # Not in the sample of a fault, which is the longest of a chip as it is.
            self._stats_due_us += STATS_EVERY_US
            if talk:
                self.session.send_link_stats(now_us, self.overruns, self.longest_loop_us)
            self.longest_loop_us = 0
        return state

    def apply_parameters(self) -> None:
        """Put the parameters in force: limits that tighten the compiled ones, and scales."""
        self.supervisor.set_limits(self.parameters.limits())
        self.hardware.set_scales(
            encoder_nm=self.parameters.get("encoder_nm_per_count"),
            encoder_offset=self.parameters.get("encoder_offset_counts"),
            force_uN=self.parameters.get("force_uN_per_count"),
            force_offset=self.parameters.get("force_offset_counts"),
        )

    def save_parameters(self) -> None:
        """Write the parameters to the memory that survives a power cycle."""
        self.image = self.parameters.image()
        self.measurements.parameters_ok = 1

    def _load(self, image: bytes | None) -> bool:
        """Take over the stored parameters; return False if they are damaged."""
        if image is None:
            return True
        try:
            self.parameters.load(image)
        except DamagedImageError:
            return False
        return True

    def _watch_loop(self, dt_us: int) -> None:
        self.longest_loop_us = max(self.longest_loop_us, dt_us)
        if dt_us > 1.5 * self.period_us and self.tick > 1:
            self.overruns += 1

    def _report_fault(self) -> None:
        """Send a FAULT when the supervisor latched one; clearing lets the next one be sent."""
        s = self.outputs
        if not s.started:
            return  # the first sample reports it, with its readings
        if s.latched and not self._reported:
            self.session.send_fault(
                wire.FaultReport(
                    axis=0,
                    index=0,
                    fault=Fault(s.first_fault),
                    channel=Channel(s.first_channel),
                    t_us=s.first_us % WRAP,
                    measured=s.first_value,
                    limit=s.first_limit,
                    snapshot=self._state(),
                )
            )
        self._reported = s.latched

    def _state(self) -> wire.State:
        """Return the sample as the host is told it."""
        s, m, hardware = self.outputs, self.measurements, self.hardware
        r = m.rtd_cC
        valid = self._readings
        if not s.sensor_ok[0] or not s.sensor_ok[1] or hardware.broken:
            valid = self._valid()
        if self.sp_age_us != AGE_UNKNOWN:
            valid |= _SETPOINT_VALID
        limiter = s.limiter[0] if s.limiter[0] > s.limiter[1] else s.limiter[1]
        return wire.State(
            axis=0,
            t_us=self.now_us % WRAP,
            tick=self.tick,
            mode=_STATES[s.state],
            limiter=_LIMITERS[limiter],
            faults=s.faults,
            warnings=s.warnings,
            i_meas_mA=(m.i_mA[0], m.i_mA[1]),
            i_applied_mA=(s.applied_mA[0], s.applied_mA[1]),
            v_mV=(max(m.v_mV[0], 0), max(m.v_mV[1], 0)),
            pump_duty=(s.duty[0], s.duty[1]),
            rtd_cC=(r[0], r[1], r[2], r[3]),
            encoder_counts=_NO_COUNTS if m.encoder_invalid else hardware.encoder_counts,
            force_counts=hardware.force_counts,
            vbus_mV=m.vbus_mV,
            valid=valid,
            sp_seq=(self.sp_seq + self.lying_sp_seq) & 0xFF,
            sp_age_us=self.sp_age_us,
        )

    def _valid(self) -> int:
        """Return the valid bits when some part may be broken."""
        m, limits = self.measurements, self.supervisor.limits
        valid = self._readings
        for j, bit in enumerate(_RTD_BITS):
            if not is_believed(m, limits, j):
                valid &= ~bit
        if m.encoder_invalid:
            valid &= ~ValidBit.ENCODER
        if m.force_invalid:
            valid &= ~ValidBit.FORCE
        return valid
