"""The simulated bench around the firmware: the same plant, parts, line and faults."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from firmware_protocol import messages as wire
from firmware_protocol.enums import ResetCause
from sim_device.bench import SimulatedBench
from sim_device.errors import FaultSpecError
from sim_device.firmware import store
from sim_device.firmware.board import FirmwareBoard


class FirmwareBench(SimulatedBench):
    """A bench whose board is a process of the C firmware; `close` ends it.

    program: command line of the port, see `build`. store_path: file of the parameter memory
    (default: one that goes with the bench). Otherwise as SimulatedBench, but driven by bytes only.
    """

    board: FirmwareBoard  # type: ignore[assignment]

    def __init__(
        self, program: Sequence[str], *, store_path: Path | None = None, **options: Any
    ) -> None:
        self._program = tuple(program)
        self._folder = tempfile.TemporaryDirectory(prefix="smad-firmware-")
        self._store_path = store_path or Path(self._folder.name) / "store"
        self._to_stall = 0
        image = options.get("image") or store.initial_image(options.get("rate_hz", 100))
        if image is not None and not self._store_path.exists():
            store.write_image(self._store_path, image)
        super().__init__(**options)

    def close(self) -> None:
        """End the firmware's process."""
        self.board.close()
        self._folder.cleanup()

    def hang(self, seconds: float) -> None:
        """Let the firmware's loop hang; its own watchdog ends what lasts too long."""
        self.board.stall_us = round(seconds * 1e6)

    def advance(self) -> wire.State | None:
        """Advance by one sample; None where the firmware sent none."""
        scale, self.period_scale = self.period_scale, 1
        if scale > 1:
            self._to_stall -= 1
            if self._to_stall <= 0:
                self._to_stall = scale
                self.board.stall_us = (scale - 1) * self.board.period_us
        try:
            return super().advance()
        finally:
            # A fault that has just begun or ended has set it.
            if self.period_scale == 1:
                self.period_scale = scale

    def _power_up(self, cause: ResetCause, start_us: int) -> FirmwareBoard:  # type: ignore[override]
        if self.make:
            names = ", ".join(self.make)
            raise FaultSpecError(f"another {names} needs the Python board; take --firmware python")
        board = getattr(self, "board", None)
        if board is not None:
            board.close()
        return FirmwareBoard(
            self._program,
            self._store_path,
            hardware=self.hardware,
            cause=cause,
            start_us=start_us,
        )
