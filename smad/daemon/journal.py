"""What the daemon tells a person: one line an event, on standard error, and the last ones kept.

A thread prints, because a terminal that does not read must not hold the loop up.
"""

import queue
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO

from smad.api import Entry

_KEPT = 50
_WAITING = 1000


class Journal:
    """Says things in order, never blocks the caller; a line too many is dropped and counted."""

    def __init__(
        self, stream: TextIO | None = None, wall_clock: Callable[[], float] = time.time
    ) -> None:
        self.recent: deque[Entry] = deque(maxlen=_KEPT)
        self.dropped = 0
        self._stream = stream if stream is not None else sys.stderr
        self._clock = wall_clock
        self._lines: queue.Queue[str | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._print, name="journal", daemon=True)
        self._thread.start()

    def say(self, text: str, kind: str = "") -> None:
        """Keep and print one line; `kind` is that of the run log's event, if it is one."""
        self.recent.append(Entry(self._clock(), text, kind))
        try:
            self._lines.put_nowait(text)
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Print what is waiting and stop; gives up after a second if nobody reads."""
        try:
            self._lines.put(None, timeout=1.0)
        except queue.Full:
            return
        self._thread.join(timeout=1.0)

    def _print(self) -> None:
        while (text := self._lines.get()) is not None:
            try:
                print(f"smad: {text}", file=self._stream, flush=True)
            except (OSError, ValueError):
                # The terminal is gone; the daemon goes on, and `smad status` shows the lines.
                continue
