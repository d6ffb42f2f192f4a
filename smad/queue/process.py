"""The process of an item: begun with the runner's lock, its output kept up to a limit."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path

from smad.processes.stops import HandedOver
from smad.queue.states import Item

LONGEST_OUTPUT = 1_000_000
"""Bytes kept of what an item prints: one that floods must not fill the disk."""
_LONGEST_LINE = 500


class ItemProcess:
    """A command that runs in `folder` and writes what it prints to `output`, capped."""

    def __init__(
        self,
        command: Sequence[str],
        *,
        folder: Path,
        output: Path,
        environment: Mapping[str, str],
        descriptor: int,
        stops: int | None = None,
    ) -> None:
        self._stops = HandedOver(stops)
        inherited = (self._stops.descriptor, *((descriptor,) if descriptor >= 0 else ()))
        try:
            self._process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment, **self._stops.environment},
                # ctrl-C at the runner's terminal is for the runner, which ends its item in order.
                start_new_session=True,
                pass_fds=inherited,
            )
        finally:
            self._stops.close_descriptor()
        self.pid = self._process.pid
        self._lines: deque[str] = deque(maxlen=20)
        self._reader = threading.Thread(target=self._read, args=(output,), daemon=True)
        self._reader.start()

    def poll(self) -> int | None:
        """Return the exit status (negative: a signal), or None while it runs."""
        return self._process.poll()

    def end(self) -> None:
        """Ask it to disarm and end."""
        self._process.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it and what it began at once: its lease lapses, and the daemon disarms."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)

    def known_stops(self) -> int | None:
        """The last stop that it knew of, once it has ended; see `HandedOver.returned`."""
        return self._stops.returned()

    def last_line(self) -> str:
        """Return what it printed last."""
        self._reader.join(timeout=1.0)
        return next((line for line in reversed(self._lines) if line), "")

    def _read(self, output: Path) -> None:
        bytes_left = LONGEST_OUTPUT
        assert self._process.stdout is not None
        with contextlib.ExitStack() as stack:
            file = None
            # A full disk costs what was printed, not the item.
            with contextlib.suppress(OSError):
                output.parent.mkdir(parents=True, exist_ok=True)
                file = stack.enter_context(output.open("wb", buffering=0))
            for line in iter(lambda: self._process.stdout.readline(_LONGEST_LINE), b""):  # type: ignore[union-attr]
                self._lines.append(line.decode(errors="replace").strip().removeprefix("smad: "))
                if file is not None and bytes_left > 0:
                    with contextlib.suppress(OSError):
                        file.write(line)
                    bytes_left -= len(line)


def begin_item(
    item: Item, stops: int | None, *, folder: Path, bench: str, descriptor: int
) -> ItemProcess:
    """Begin the command of an item, which knows of the `stops` up to that generation.

    `descriptor` is the runner's lock.
    """
    output = folder / "queue" / f"item-{item.id:06d}.txt"
    words = list(item.words)
    if item.kind == "checkup" and not any(word.startswith("--json") for word in words):
        # For the record of the bench (smad health).
        output.parent.mkdir(exist_ok=True)
        words.append(f"--json={output.with_suffix('.json')}")
    return ItemProcess(
        [sys.executable, "-m", "smad.cli.queue_child", str(os.getpid()), bench, *words],
        folder=Path(item.folder),
        output=output,
        environment={"SMAD_BENCH": bench, "PYTHONUNBUFFERED": "1"},
        descriptor=descriptor,
        stops=stops,
    )
