"""The Python board beside the image for the Mega on its emulated chip.

The chip keeps its own time: its timer says when a sample is taken, bytes take theirs on the line,
and an answer may come after the next STATE. So events arrive when the chip is done with a sample,
the Python board samples at the chip's ticks and gets each frame at the time at which the chip's
core looked at its clock for it, and answers are compared in their order, each with its like.
"""

from __future__ import annotations

import subprocess
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from firmware.twin import Build, Ear, Fed, Twins
from firmware_protocol import messages as wire
from firmware_protocol.enums import ResetCause
from firmware_protocol.supervisor import Measurements, Memory, Supervisor
from sim_device.board import Board
from sim_device.errors import BenchError
from sim_device.firmware.board import FirmwareBoard
from sim_device.firmware.build import OUTPUT, PROTOCOL, SOURCES
from sim_device.firmware.frontend import encode
from sim_device.hardware import Hardware
from sim_device.plant import Readings

DONE_AFTER_us = 4500
"""Sample and STATE are out so long after the tick."""
SHOWN_BEFORE_us = 300
"""The parts have come to rest at the next readings so long before it."""
HANG_PAST_us = 500
"""A hanging loop goes on so long after the tick of the sample that ends it."""
BYTE_us = 20
MHZ = 16
PERIOD_us = 10_000
HANDLED_us = 1500
"""From an event's last byte to the last one of its answer; a session or token takes longer."""
LAST_us = 7000
"""What would be handled later after the tick waits for the next sample."""
ANSWER_STEP_us = 250
ANSWER_MOST_us = 1500
MOST_COUNTS = 100
"""A sample, of the encoder: 10 mm/s. A driver that is shorted moves the spring faster than edges
can be put on the pins between two samples."""
BOOT_MOST_us = 200_000
LATE_MOST = 4
"""So many messages of a kind may still be on the line."""

Heard = defaultdict[type[wire.Message], deque[wire.Message]]


@dataclass(slots=True)
class Seen(Fed):
    """As Fed, with the speeds of the pumps as the chip measured them from pulse to pulse."""

    pump_rpm: tuple[int, int] = (0, 0)

    def measure(self, readings: Readings, s: Memory, m: Measurements, dt_s: float) -> None:
        """Decode the codes."""
        Fed.measure(self, readings, s, m, dt_s)
        m.pump_rpm[:] = self.pump_rpm


class ChipTwins(Twins):
    """Both boards, with the firmware on the emulated chip."""

    most_junk = 60
    """A longer burst would still be on the line at the next tick."""
    rates = False
    fed: Seen

    def __init__(self, program: Sequence[str], folder: Path, seed: int) -> None:
        symbols = _symbols(OUTPUT / "smad-mega.elf")
        speeds = symbols["now"][0] + _offset_of_speeds(folder)
        words = (symbols["last_time_us"][0], speeds, speeds + 4)
        watches = [word for address in words for word in ("--watch", hex(address & 0xFFFF))]
        super().__init__([*program, *watches], folder, seed)

    def power_up(self, cause: ResetCause = ResetCause.POWER_ON) -> None:
        """Reset both boards, up to the chip's first sample."""
        before = self._before_reset(cause)
        if self._boots:
            self._image = self.python.image
            self.c.close()
        self._boots += 1
        self.saving = False
        self._waiting: tuple[Heard, Heard] = (defaultdict(deque), defaultdict(deque))
        self.ears = (Ear(), Ear())
        self._origin = self._codes.encoder
        codes = replace(self._codes, encoder=0)
        self.c = FirmwareBoard(
            self._program, self._path, hardware=Hardware(), cause=cause, noinit=before[1]
        )
        born_us = sampled_us = 0
        while self.c.line.state is None:
            self.c.step(ANSWER_STEP_us, codes=codes)
            born_us = born_us or self.c.watched[0]
            if self.c.clock_us < PERIOD_us:
                self.c.sample_cycles = 0  # the pins' first level is no sample
            elif self.c.sample_cycles and not sampled_us:
                sampled_us = self.c.clock_us - self.c.sample_cycles // MHZ
            _give_up(self.c)
        self.now_us = self.c.line.state.t_us
        # The clock is started after memory is cleared, which takes more than a millisecond.
        self._ahead_us = sampled_us - self.now_us
        self._encoder = 0
        self.fed = Seen(codes)
        self.python = Board(
            supervisor=Supervisor(),
            seed=self._seed,
            boot_count=self._boots,
            cause=cause,
            latched=before[0],
            image=self._image,
            hardware=self.fed,  # type: ignore[arg-type]
            now_us=born_us,
        )
        self._sample_python()
        self._run_to(DONE_AFTER_us)
        self._listen()

    def deliver(self, build: Build, at_us: int) -> None:
        """Hand the bytes of one event to both boards, and let the chip act on them.

        Not at `at_us`, but when the chip is done with what it is doing.
        """
        while self.saving:
            self.sample()  # what the core did with its clock last would be a write, not the frame
        sizes = (len(build(ear.session, ear.token)) for ear in self.ears)
        if self._chip_us() + max(sizes) * BYTE_us + HANDLED_us > self.now_us + LAST_us:
            self.sample()
        first, second = (build(ear.session, ear.token) for ear in self.ears)
        self.c.step(0, second)
        self.c.step(len(second) * BYTE_us + HANDLED_us)
        self.python.receive(first, self.c.watched[0])
        self._listen()
        self._await_keys()

    def sample(self, *, missed: int = 0) -> None:
        """Advance to the next sample; `missed` samples before it are lost in a hanging loop."""
        span_us = self.period_us * (missed + 1)
        s = self.python.outputs
        self.plant.advance(self.hardware.drive(s, self.python.drain, 0.0), span_us * 1e-6)
        self.hardware.measure(self.plant.read(), s, self._seen, span_us * 1e-6)
        self._codes = encode(self._seen, self.hardware)
        if missed:
            self._move_encoder(missed * MOST_COUNTS)
        self.fed.codes = replace(self._codes, encoder=self._encoder)
        self.now_us += span_us
        if missed:
            self.c.stall_us = self._until(HANG_PAST_us)
        self.c.step(self._until(-SHOWN_BEFORE_us), codes=self.fed.codes)
        self._run_to(DONE_AFTER_us + (HANG_PAST_us if missed else 0))
        self._sample_python()
        self._listen()
        # It moves now, in time for the next sample: edges crowded before the tick would be lost.
        self._move_encoder(MOST_COUNTS)
        self.c.step(0, codes=replace(self.fed.codes, encoder=self._encoder))

    def _sample_python(self) -> None:
        self.fed.pump_rpm = (self.c.watched[1], self.c.watched[2])
        self.python.sample(self.plant.read(), self.now_us)

    def _move_encoder(self, most: int) -> None:
        behind = self._codes.encoder - self._origin - self._encoder
        self._encoder += max(-most, min(most, behind))

    def differences(self) -> list[str]:
        """Return what the boards said or do differently since the last call, one line each."""
        for waiting, ear in zip(self._waiting, self.ears, strict=True):
            for message in ear.take():
                waiting[type(message)].append(message)
        first, second = self._waiting
        differing: list[str] = []
        for kind in {**first, **second}:
            while first[kind] and second[kind]:
                p, q = first[kind].popleft(), second[kind].popleft()
                differing += [
                    f"{kind.__name__}.{name}: Python {getattr(p, name)}, C {getattr(q, name)}"
                    for name in p.__struct_fields__
                    if getattr(p, name) != getattr(q, name)
                ]
            for who, waiting in (("Python", first), ("C", second)):
                if len(waiting[kind]) > LATE_MOST:
                    differing.append(f"{kind.__name__}: {LATE_MOST + 1} that only {who} sent")
        return differing + self._pins()

    def last_differences(self) -> list[str]:
        """Return what is still different when nothing more happens."""
        self.sample()
        self._run_to(PERIOD_us - SHOWN_BEFORE_us)
        self._listen()
        differing = self.differences()
        for who, waiting in zip(("Python", "C"), self._waiting, strict=True):
            differing += [
                f"{kind.__name__}: only {who} sent it" for kind in waiting if waiting[kind]
            ]
        return differing

    def _await_keys(self) -> None:
        """Run the chip until it has given a session and a token as often as the Python board."""
        python, c = self.ears
        for _ in range(ANSWER_MOST_us // ANSWER_STEP_us):
            if python.keys == c.keys:
                return
            self.c.step(ANSWER_STEP_us)
            self._listen()

    def _chip_us(self) -> int:
        """Return the chip's own time, which begins later than its power; to a quarter of a ms."""
        return self.c.clock_us - self._ahead_us

    def _until(self, after_us: int) -> int:
        """Return the time to so long after the tick; before it, if negative."""
        return max(self.now_us + after_us - self._chip_us(), 0)

    def _run_to(self, after_us: int) -> None:
        self.c.step(self._until(after_us))


def _give_up(board: FirmwareBoard) -> None:
    if board.clock_us > BOOT_MOST_us:
        raise BenchError(f"the chip has not started in {BOOT_MOST_us} us")


def _offset_of_speeds(folder: Path) -> int:
    """Return where in the core's record of a sample the speeds of the pumps are."""
    source, probe = folder / "offset.c", folder / "offset.o"
    source.write_text(
        '#include <stddef.h>\n#include "sample.h"\n'
        "char offset[offsetof(struct sample, measured.pump_rpm)];\n"
    )
    places = [f"-I{place}" for place in (SOURCES / "core", PROTOCOL)]
    command = ["avr-gcc", "-mmcu=atmega2560", "-std=gnu99", *places, "-c", str(source)]
    subprocess.run([*command, "-o", str(probe)], check=True)
    return _symbols(probe)["offset"][1]


def _symbols(path: Path) -> dict[str, tuple[int, int]]:
    """Return address and size of each symbol of an object."""
    done = subprocess.run(["avr-nm", "-S", str(path)], check=True, capture_output=True, text=True)
    rows = (line.split() for line in done.stdout.splitlines())
    return {row[3]: (int(row[0], 16), int(row[1], 16)) for row in rows if len(row) == 4}
