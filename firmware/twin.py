"""Two boards side by side, the Python one and the C firmware, under the same stimulus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import ErrorCode, ResetCause
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.supervisor import Event, Measurements, Memory, Supervisor
from sim_device.board import Board
from sim_device.firmware.board import FirmwareBoard
from sim_device.firmware.frontend import Codes, decode, encode
from sim_device.hardware import Hardware
from sim_device.plant import Plant, Readings, load_parameters

SAVE_NUMBER = wire.ParamSave.info.number

Build = Callable[[int, int], bytes]
"""Makes the bytes of an event from the board's session number and its last arming token."""


@dataclass(slots=True)
class Fed:
    """In place of the Python board's hardware: its measurements are decoded from codes."""

    codes: Codes
    broken: bool = True
    encoder_counts: int = 0
    force_counts: int = 0

    def set_scales(self, **scales: int) -> None:
        """The codes are counts already."""

    def measure(self, readings: Readings, s: Memory, m: Measurements, dt_s: float) -> None:
        """Decode the codes, as the firmware does."""
        m.applied_mA[:] = s.applied_mA
        m.duty[:] = s.duty
        decode(self.codes, m)
        self.encoder_counts = self.codes.encoder
        self.force_counts = self.codes.bridge


@dataclass(slots=True)
class Ear:
    """What a host of one board knows: session, token, and the messages since last asked."""

    session: int = 0
    token: int = 0
    keys: int = 0
    """Sessions and tokens so far."""
    heard: list[wire.Message] = field(default_factory=list)
    decoder: FrameDecoder = field(default_factory=FrameDecoder)

    def hear(self, data: bytes) -> None:
        """Take in the board's bytes."""
        for frame in self.decoder.feed(data):
            message = CODEC.unpack(frame.type, frame.payload)
            if isinstance(message, wire.Ident):
                self.session = message.session
                self.keys += message.session != 0
            elif isinstance(message, wire.ArmToken):
                self.token = message.token
                self.keys += 1
            self.heard.append(message)

    def take(self) -> list[wire.Message]:
        """Return the messages since the last call, with what may differ blanked out."""
        heard, self.heard = self.heard, []
        return [_blanked(message) for message in heard if not _is_saved(message)]


def _is_saved(message: wire.Message) -> bool:
    # A real memory takes its time; when it is done is not compared, that it is done is.
    return isinstance(message, wire.Done) and message.request_type == SAVE_NUMBER


def _blanked(message: wire.Message) -> wire.Message:
    if isinstance(message, wire.Ident):
        return msgspec.structs.replace(message, uid=bytes(12), firmware="", baud=0)
    if isinstance(message, wire.ArmToken):
        return msgspec.structs.replace(message, token=0)
    if isinstance(message, wire.Error) and message.code is ErrorCode.TOKEN_WRONG:
        return msgspec.structs.replace(message, value=0)
    return message


class Twins:
    """A plant and its parts, with both boards on it. The Python board's outputs move the plant."""

    most_junk = 300
    """Bytes of rubbish at once."""
    rates = True
    """Whether other rates are asked for: the Mega refuses some that the Python board takes."""

    def __init__(self, program: Sequence[str], folder: Path, seed: int) -> None:
        self._program = tuple(program)
        self._path = folder / "store"
        self._path.unlink(missing_ok=True)
        self._seed = seed
        self._boots = 0
        self._image: bytes | None = None
        self.plant = Plant(load_parameters("A"), seed=seed)
        self.hardware = Hardware(broken=True)
        self.now_us = 0
        self._seen = Measurements()
        self._codes = encode(self._seen, self.hardware)
        self.saving = False
        self.python: Board
        self.c: FirmwareBoard
        self.power_up()

    def power_up(self, cause: ResetCause = ResetCause.POWER_ON) -> None:
        """Reset both boards."""
        before = self._before_reset(cause)
        if self._boots:
            self._image = self.python.image
            self.c.close()
        self._boots += 1
        self.now_us = 0
        self.saving = False
        self.fed = Fed(self._codes)
        self.python = Board(
            supervisor=Supervisor(),
            seed=self._seed,
            boot_count=self._boots,
            cause=cause,
            latched=before[0],
            image=self._image,
            hardware=self.fed,  # type: ignore[arg-type]
        )
        self.c = FirmwareBoard(
            self._program, self._path, hardware=Hardware(), cause=cause, noinit=before[1]
        )
        self.ears = (Ear(), Ear())
        self._listen()

    def _before_reset(self, cause: ResetCause) -> tuple[tuple[Event, ...], tuple[int, ...]]:
        """What both boards keep over a reset."""
        return ((), ()) if cause is ResetCause.POWER_ON else (self.python.latched, self.c.noinit)

    def close(self) -> None:
        """End the firmware's process."""
        self.c.close()

    @property
    def period_us(self) -> int:
        """Time from one sample to the next, as the Python board has it."""
        return self.python.period_us

    def deliver(self, build: Build, at_us: int) -> None:
        """Hand the bytes of one event to both boards at the same board time."""
        first, second = (build(ear.session, ear.token) for ear in self.ears)
        self.python.receive(first, at_us)
        self.c.receive(second, at_us)
        self._listen()

    def sample(self, *, missed: int = 0) -> None:
        """Advance to the next sample; `missed` samples before it are lost in a hanging loop."""
        period_us = self.period_us
        span_us = period_us * (missed + 1)
        s = self.python.outputs
        drive = self.hardware.drive(s, self.python.drain, 0.0)
        self.plant.advance(drive, span_us * 1e-6)
        self.hardware.measure(self.plant.read(), s, self._seen, span_us * 1e-6)
        self._codes = self.fed.codes = encode(self._seen, self.hardware)
        if missed:
            self.c.stall_us = self.now_us + span_us - self.c.clock_us
        self.now_us += span_us
        self.python.sample(self.plant.read(), self.now_us)
        self.c.run(self._codes, self.now_us)
        self._listen()

    def differences(self) -> list[str]:
        """Return what the boards said or do differently since the last call, one line each."""
        python, c = (ear.take() for ear in self.ears)
        differing = [
            f"{type(p).__name__}.{name}: Python {getattr(p, name)}, C {getattr(q, name, None)}"
            for p, q in zip(python, c, strict=False)
            if p != q
            for name in p.__struct_fields__
            if getattr(p, name) != getattr(q, name, None)
        ]
        if len(python) != len(c):
            names = ([type(message).__name__ for message in said] for said in (python, c))
            differing.append("messages: Python {}, C {}".format(*names))
        return differing + self._pins()

    def last_differences(self) -> list[str]:
        """Return what is still different when nothing more happens."""
        self.sample()
        return self.differences()

    def _pins(self) -> list[str]:
        s, out = self.python.outputs, self.c.outputs
        return [
            f"pins: {name}: Python {getattr(s, name)}, C {getattr(out, name)}"
            for name in ("gate", "applied_mA", "duty")
            if getattr(s, name) != getattr(out, name)
        ]

    def _listen(self) -> None:
        self.ears[0].hear(self.python.session.data_to_send())
        data = self.c.data_to_send()
        self.saving = self.saving and not _done_saving(data)
        self.ears[1].hear(data)


def _done_saving(data: bytes) -> bool:
    messages = (CODEC.unpack(f.type, f.payload) for f in FrameDecoder().feed(data))
    return any(_is_saved(message) for message in messages)
