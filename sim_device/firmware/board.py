"""The firmware's process as a board: what SimulatedBench asks of one, over the lockstep link."""

from __future__ import annotations

import socket
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, ResetCause
from firmware_protocol.errors import PayloadError
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.parameters import BY_NAME, ParameterStore
from firmware_protocol.supervisor import Measurements, Memory
from sim_device.errors import BenchError, FaultSpecError
from sim_device.firmware import store
from sim_device.firmware.frontend import Codes, encode
from sim_device.firmware.link import MOST_BYTES, PATIENCE_S, Outputs, exchange
from sim_device.hardware import Hardware
from sim_device.plant import Readings

WRAP = 1 << 32
HEATING = (BoardState.ARMED, BoardState.HOLD)
_RATE = BY_NAME["state_rate_hz"].number


class Listener:
    """Reads along on the line: the last of what the board sent, and of what was sent to it."""

    def __init__(self) -> None:
        self.state: wire.State | None = None
        self.rate_hz = 0
        self.setpoint_ref_us = -1
        self.states = 0
        self._from_board = FrameDecoder()
        self._to_board = FrameDecoder()

    def from_board(self, data: bytes) -> None:
        """Take in bytes of the board."""
        for frame in self._from_board.feed(data):
            message = _read(frame.type, frame.payload)
            if isinstance(message, wire.State):
                self.state = message
                self.states += 1
            elif isinstance(message, wire.Ident):
                self.rate_hz = message.state_rate_hz
            elif isinstance(message, wire.ParamValue) and message.param == _RATE:
                self.rate_hz = message.value

    def to_board(self, data: bytes) -> None:
        """Take in bytes to the board."""
        for frame in self._to_board.feed(data):
            message = _read(frame.type, frame.payload)
            if isinstance(message, wire.Setpoint):
                self.setpoint_ref_us = message.t_ref_us


def _read(number: int, payload: bytes) -> wire.Message | None:
    try:
        return CODEC.unpack(number, payload)
    except PayloadError:
        return None


class FirmwareBoard:
    """One power-up of the firmware, as a process. `close` ends it.

    program: command line of the port. path: file of its store. noinit: what memory held
    before this reset that a reset leaves as it is. start_us: chip time at power-up.
    Raises LinkError when the process does not come up.
    """

    hardware_type = Hardware
    initial_parameters: ClassVar[Mapping[str, int]] = {}

    def __init__(
        self,
        program: Sequence[str],
        path: Path,
        *,
        hardware: Hardware,
        cause: ResetCause = ResetCause.POWER_ON,
        noinit: Sequence[int] = (),
        start_us: int = 0,
    ) -> None:
        self.hardware = hardware
        self.now_us = start_us
        self.session = self
        """The bytes to send are asked of `board.session`."""
        self.line = Listener()
        self.measurements = Measurements()
        self.outputs = Memory(0)
        """What the pins do, in the fields that the plant and the tests look at."""
        self.drain = (False, False)
        self.stage_m = 0.0
        self.stall_us = 0
        """The loop hangs for so long, from the next step on."""
        self.deaf = False
        """While it hangs an emulated chip's interrupts do not run either."""
        self.resets = 0
        self.clock_us = start_us
        """The chip's time at the end of the last step."""
        self.sample_cycles = 0
        """Cycles that an emulated chip took for its last sample."""
        self.watched: tuple[int, ...] = ()
        """Long words of an emulated chip's memory, where each `--watch` of its program says."""
        self.noinit: tuple[int, ...] = ()
        """What the chip's memory holds for the time after a reset."""
        self._path = path
        self._to_send = bytearray()
        self._codes = encode(self.measurements, hardware)
        self._end, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._end.settimeout(PATIENCE_S)
        arguments = ["--link", str(theirs.fileno()), "--store", str(path), "--time", str(start_us)]
        arguments += ["--noinit", ",".join(map(str, noinit))]
        try:
            self._process = subprocess.Popen(
                [*program, *arguments, "--cause", str(int(cause))], pass_fds=[theirs.fileno()]
            )
        except OSError as error:
            raise BenchError(f"cannot run {program[0]}: {error}; build it again") from error
        finally:
            theirs.close()
        self.step(0)
        self._set_scales()

    # What the bench asks

    @property
    def period_us(self) -> int:
        """Time from one sample to the next."""
        return 1_000_000 // (self.line.rate_hz or 100)

    @property
    def state(self) -> BoardState:
        """State that the last STATE told; past it, the gate tells whether heating has ended."""
        mode = self.last_mode
        return BoardState.COOL if mode in HEATING and not self.outputs.gate else mode

    @property
    def last_mode(self) -> BoardState:
        """Mode that the last STATE told."""
        return BoardState.BOOT if self.line.state is None else self.line.state.mode

    @property
    def sp_ref_us(self) -> int:
        """Board time (32 bits) of the sample that the last setpoint on the line answers."""
        return self.line.setpoint_ref_us

    @property
    def parameters(self) -> ParameterStore:
        """The parameters as the store has them."""
        return store.read_parameters(self._path)

    @property
    def image(self) -> bytes:
        """What the store holds, as one image."""
        return self.parameters.image()

    @image.setter
    def image(self, image: bytes) -> None:
        store.write_image(self._path, image)

    @property
    def lying_sp_seq(self) -> int:
        """The firmware tells the truth."""
        return 0

    @lying_sp_seq.setter
    def lying_sp_seq(self, value: int) -> None:
        raise FaultSpecError("lying_sp_seq changes the Python board's code; take --firmware python")

    def receive(self, data: bytes, now_us: int) -> None:
        """Let bytes arrive at board time `now_us`."""
        self.line.to_board(data)
        self.step(now_us - self.clock_us)
        for start in range(0, len(data), MOST_BYTES):
            self.step(0, data[start : start + MOST_BYTES])

    def sample(self, readings: Readings, now_us: int, *, talk: bool = True) -> wire.State | None:
        """Run to board time `now_us` with these readings; return the STATE sent, if one was."""
        if not talk:
            raise BenchError("a bench with firmware is driven by bytes: connect a host to it")
        return self.run(self.seen(readings, (now_us - self.now_us) * 1e-6), now_us)

    def seen(self, readings: Readings, dt_s: float) -> Codes:
        """Return what the chip reads, `dt_s` after the last time."""
        m = self.measurements
        self.hardware.measure(readings, self.outputs, m, dt_s)
        return encode(m, self.hardware)

    def run(self, codes: Codes, now_us: int) -> wire.State | None:
        """Run to board time `now_us` with these codes; return the STATE sent, if one was."""
        before = self.line.states
        self.now_us = now_us
        self.step(now_us - self.clock_us, codes=codes)
        return self.line.state if self.line.states > before else None

    def step(self, dt_us: int, data: bytes = b"", codes: Codes | None = None) -> None:
        """Run for so long; bytes (at most `MOST_BYTES`) arrive, and new codes show."""
        stall_us, self.stall_us = self.stall_us, 0
        self._codes = codes or self._codes
        self._take(exchange(self._end, self._codes, max(dt_us, 0), data, stall_us, deaf=self.deaf))

    def data_to_send(self) -> bytes:
        """Return all bytes to write now; a second call returns none."""
        data = bytes(self._to_send)
        self._to_send.clear()
        return data

    def close(self) -> None:
        """Take the power away."""
        self._process.kill()
        self._process.wait()
        self._end.close()

    def _set_scales(self) -> None:
        parameters = self.parameters
        self.hardware.set_scales(
            encoder_nm=parameters.get("encoder_nm_per_count"),
            encoder_offset=parameters.get("encoder_offset_counts"),
            force_uN=parameters.get("force_uN_per_count"),
            force_offset=parameters.get("force_offset_counts"),
        )

    def _take(self, out: Outputs) -> None:
        self.clock_us = out.t_us
        self.sample_cycles = out.sample_cycles or self.sample_cycles
        self.watched = out.watched
        self.noinit = out.noinit
        if out.resets != self.resets:
            self.resets = out.resets
            self.now_us = out.t_us
        s = self.outputs
        s.gate = out.gate
        s.applied_mA[:] = out.current_mA
        s.duty[:] = out.pump
        self.drain = (bool(out.drain & 1), bool(out.drain & 2))
        if out.data:
            self.line.from_board(out.data)
            self._to_send += out.data


class ChipBoard(FirmwareBoard):
    """A chip emulated to the cycle: bytes take their time on the line, and its clock is its own."""

    def __init__(self, program: Sequence[str], path: Path, **options: Any) -> None:
        self._inbox = bytearray()
        self._unseen_us = 0
        self._state_sent = False
        super().__init__(program, path, **options)

    def receive(self, data: bytes, now_us: int) -> None:
        """Let bytes arrive with the next step, one after the other."""
        self.line.to_board(data)
        self._inbox += data

    def advance(self, readings: Readings, dt_us: int) -> wire.State | None:
        """Run for `dt_us` with these readings; return the STATE sent, if one was.

        The parts convert once a sample, as on the Python board: what happens "every so many
        samples" counts on it. Only the encoder moves all the time.
        """
        before = self.line.states
        data = bytes(self._inbox[:MOST_BYTES])
        del self._inbox[:MOST_BYTES]
        self._unseen_us += dt_us
        if self._unseen_us >= self.period_us or self._state_sent:
            codes = self.seen(readings, self._unseen_us * 1e-6)
            self._unseen_us = 0
        else:
            codes = replace(self._codes, encoder=self.hardware.encoder_at(readings))
        self.step(dt_us, data, codes)
        self._state_sent = self.line.states > before
        state = self.line.state
        if state is None or self.line.states == before:
            return None
        self.now_us = state.t_us
        return state
