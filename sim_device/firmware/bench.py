"""The simulated bench around the firmware: the same plant, parts, line and faults."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from firmware_protocol import messages as wire
from firmware_protocol.enums import ResetCause
from sim_device.bench import SimulatedBench, named_image
from sim_device.errors import BenchError, FaultSpecError
from sim_device.firmware import store
from sim_device.firmware.board import ChipBoard, FirmwareBoard
from sim_device.firmware.build import build

STEP_US = 1000
"""An emulated chip and the plant exchange what they have this often."""


class FirmwareBench(SimulatedBench):
    """A bench whose board is a process of the C firmware; `close` ends it.

    program: command line of the port, see `build`. store_path: file of the parameter memory
    (default: one that goes with the bench). Otherwise as SimulatedBench, but driven by bytes only.
    """

    board: FirmwareBoard  # type: ignore[assignment]
    board_type: type[FirmwareBoard] = FirmwareBoard  # type: ignore[assignment]

    def __init__(
        self, program: Sequence[str], *, store_path: Path | None = None, **options: Any
    ) -> None:
        self._program = tuple(program)
        self._to_remove = ExitStack()
        if store_path is None:
            folder = tempfile.TemporaryDirectory(prefix="smad-firmware-")
            store_path = Path(self._to_remove.enter_context(folder)) / "store"
        self._store_path = store_path
        self._to_stall = 0
        self._slow_by = 1
        if not self._store_path.parent.is_dir():
            raise BenchError(
                f"the store {self._store_path} cannot be made: there is no such folder; make it "
                "first"
            )
        rate_hz = options.get("rate_hz", 100)
        image = named_image(
            options.get("image") or store.initial_image(rate_hz),
            options.get("axis_name", ""),
            {"state_rate_hz": rate_hz},
        )
        if image is not None and not self._store_path.exists():
            store.write_image(self._store_path, image)
        super().__init__(**options)

    def close(self) -> None:
        """End the firmware's process."""
        self.board.close()
        self._to_remove.close()

    def hang(self, seconds: float) -> None:
        """Let the firmware's loop hang; its own watchdog ends what lasts too long."""
        self.board.stall_us = round(seconds * 1e6)

    def advance(self) -> wire.State | None:
        """Advance by one sample; None where the firmware sent none."""
        if self._slow_by > 1:
            self._to_stall -= 1
            if self._to_stall <= 0:
                self._to_stall = self._slow_by
                self.board.stall_us = (self._slow_by - 1) * self.board.period_us
        return self._run()

    def _run(self) -> wire.State | None:
        return super().advance()

    @property
    def period_scale(self) -> int:
        """Samples take one period of the bench's time, whatever the board's loop does."""
        return 1

    @period_scale.setter
    def period_scale(self, times: int) -> None:
        # A slow loop is one that hangs again and again.
        self._slow_by = times

    def _power_up(self, cause: ResetCause, start_us: int) -> FirmwareBoard:  # type: ignore[override]
        if self.make:
            names = ", ".join(self.make)
            raise FaultSpecError(f"another {names} needs the Python board; take --firmware python")
        board = getattr(self, "board", None)
        noinit = () if cause is ResetCause.POWER_ON else self.board.noinit
        if board is not None:
            board.close()
        return self.board_type(
            self._program,
            self._store_path,
            hardware=self.hardware,
            cause=cause,
            noinit=noinit,
            start_us=start_us,
        )


class ChipBench(FirmwareBench):
    """A bench around an emulated chip, in steps of a millisecond.

    The chip samples when its own timer says so, somewhere inside a step. A sample of the bench
    ends with the step in which the chip's STATE has been sent.
    """

    board: ChipBoard
    board_type = ChipBoard

    def _run(self) -> wire.State | None:
        if self.faults.due_us <= self.now_us:
            self.faults.run()
        if self.uplink.spoilt:
            self._deliver(self.uplink.carry(b"", self.now_us), None)
        state = None
        most_us = self.now_us + 2 * self.board.period_us
        while state is None and self.now_us < most_us:
            self.now_us += STEP_US
            self._move_plant(self.now_us)
            state = self.board.advance(self.plant.read(), STEP_US)
            if self.now_us >= self._plugged_at_us:
                self._plug_in()
        return state


def firmware_bench(port: str, **options: Any) -> FirmwareBench:
    """Return a bench with the firmware of a port ("host" or "avr"), compiled if need be.

    Raises BuildError, LinkError and what SimulatedBench does.
    """
    kind = ChipBench if port == "avr" else FirmwareBench
    return kind(build(port), **options)
