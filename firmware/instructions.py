"""Instructions that the core takes on a Cortex-M4, counted by QEMU.

QEMU has no chip whose converters and timers are real enough to run a port on. So the host port runs
a scene first; the steps of its link are recorded, and the core compiled for the Cortex-M4 runs
through them again under QEMU, which counts instructions (-icount), not cycles. Both must answer the
same.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.framing import FrameDecoder
from sim_device.errors import BenchError
from sim_device.firmware import store
from sim_device.firmware.bench import FirmwareBench
from sim_device.firmware.board import FirmwareBoard
from sim_device.firmware.frontend import Codes
from sim_device.firmware.link import Outputs, pack, unpack

MACHINE = ("-M", "mps2-an386", "-icount", "shift=10", "-nographic", "-monitor", "none")
SEMIHOSTED = ("-semihosting-config", "enable=on,target=native", "-kernel")
PATIENCE_S = 300.0


class Counted(NamedTuple):
    """What a step took: the sample in it, and everything; `state` is what it told, if anything."""

    state: wire.State | None
    sample: int
    step: int


class RecordedBoard(FirmwareBoard):
    """Keeps the memory that it started with, each step and each answer."""

    def __init__(self, program: Sequence[str], path: Path, **options: Any) -> None:
        memory = path.read_bytes() if path.exists() else b""
        self.steps = [memory.ljust(store.SIZE, b"\xff")]
        self.answers: list[Outputs] = []
        super().__init__(program, path, **options)

    def step(self, dt_us: int, data: bytes = b"", codes: Codes | None = None) -> None:
        """Run for so long."""
        self.steps.append(pack(codes or self._codes, max(dt_us, 0), data))
        super().step(dt_us, data, codes)

    def _take(self, out: Outputs) -> None:
        self.answers.append(out)
        super()._take(out)


class RecordedBench(FirmwareBench):
    """A bench around such a board."""

    board: RecordedBoard
    board_type = RecordedBoard


def replay(program: Sequence[str], board: RecordedBoard) -> list[Counted]:
    """Run the core through the steps of `board`; return what each took.

    Raises BenchError if QEMU fails or the core answers differently.
    """
    emulator, image = program
    with tempfile.TemporaryDirectory(prefix="smad-qemu-") as folder:
        (Path(folder) / "steps").write_bytes(b"".join(board.steps))
        command = [emulator, *MACHINE, *SEMIHOSTED, image]
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        if done.returncode != 0:
            raise BenchError(f"{emulator} ended with {done.returncode}: {done.stderr.strip()}")
        data = memoryview((Path(folder) / "answers").read_bytes())
    answers = []
    while data:
        out, data = unpack(data)
        answers.append(out)
    return _counted(board.answers, answers)


def _counted(host: Sequence[Outputs], chip: Sequence[Outputs]) -> list[Counted]:
    counted = []
    ears = FrameDecoder(), FrameDecoder()
    for number, (host_value, chip_value) in enumerate(zip(host, chip, strict=True)):
        lines = [
            [frame for frame in ear.feed(out.data) if frame.type != wire.Ident.info.number]
            for ear, out in zip(ears, (host_value, chip_value), strict=True)
        ]
        pins = [
            (out.t_us, out.current_mA, out.pump, out.gate, out.drain, out.noinit)
            for out in (host_value, chip_value)
        ]
        if lines[0] != lines[1] or pins[0] != pins[1]:
            raise BenchError(f"step {number}: host port and Cortex-M4 differ: {pins}, {lines}")
        messages = [CODEC.unpack(frame.type, frame.payload) for frame in lines[1]]
        state = next((m for m in messages if isinstance(m, wire.State)), None)
        counted.append(Counted(state, chip_value.sample_cycles, chip_value.watched[0]))
    return counted
