"""The commands of hooks as processes: one at a time for each hook, ended after their time.

A hook that hangs is killed, one that floods is not read into memory, one that fails is told of;
none of them holds up another, or whoever looks at the bench.
"""

import contextlib
import os
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import msgspec

from smad.hooks.events import Event
from smad.progress import Say

MOST_WAITING = 20
"""Events that wait for one hook; of more the oldest is dropped, and told of."""
_READ_BYTES = 4096
_LAST_BYTES = 300
_OUTPUT_S = 1.0
"""What a command said is awaited so long after its end: a child that it left may have the pipe."""


@dataclass
class _Running:
    """A hook's process, what it said last, and when its time is over."""

    process: subprocess.Popen[bytes]
    event: Event
    until_s: float
    said: bytearray = field(default_factory=bytearray)
    killed: bool = False
    reader: threading.Thread | None = None
    ended_s: float | None = None

    def is_over(self, now_s: float) -> bool:
        """Whether it has ended and what it said is known. Never waits."""
        if self.process.poll() is None:
            return False
        if self.ended_s is None:
            self.ended_s = now_s
        reads = self.reader is not None and self.reader.is_alive()
        return not reads or now_s >= self.ended_s + _OUTPUT_S


class HookCommands:
    """Begins, watches and ends the commands. `tick` never waits."""

    def __init__(
        self,
        commands: Mapping[str, Sequence[str]],
        *,
        timeout_s: float,
        say: Say,
        clock_s: Callable[[], float],
    ) -> None:
        self._commands = {name: tuple(words) for name, words in commands.items() if words}
        self._timeout_s = timeout_s
        self._say = say
        self._clock_s = clock_s
        self._waiting: dict[str, deque[Event]] = {name: deque() for name in self._commands}
        self._running: dict[str, _Running] = {}

    @property
    def busy(self) -> bool:
        """Whether a command runs or waits."""
        return bool(self._running) or any(self._waiting.values())

    def fire(self, event: Event) -> bool:
        """Let the hook of an event have it; False where the configuration has no such hook."""
        waiting = self._waiting.get(event.event)
        if waiting is None:
            return False
        if len(waiting) >= MOST_WAITING:
            dropped = waiting.popleft()
            self._say(f"{event.event}: dropped, the command is too slow: {dropped.text}")
        waiting.append(event)
        self.tick()
        return True

    def tick(self) -> None:
        """Begin what waits, take note of what ended, kill what takes too long."""
        for name, running in list(self._running.items()):
            if running.is_over(self._clock_s()):
                del self._running[name]
                self._tell(name, running, running.process.returncode)
            elif (
                running.process.returncode is None
                and self._clock_s() >= running.until_s
                and not running.killed
            ):
                running.killed = True
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(running.process.pid, signal.SIGKILL)
        for name, waiting in self._waiting.items():
            if waiting and name not in self._running:
                self._begin(name, waiting.popleft())

    def close(self) -> None:
        """Kill what runs."""
        self._waiting = {name: deque() for name in self._commands}
        for running in self._running.values():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.process.pid, signal.SIGKILL)
            running.process.wait()
        self._running = {}

    def _begin(self, name: str, event: Event) -> None:
        try:
            process = subprocess.Popen(
                self._commands[name],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except OSError as error:
            self._say(f"{name}: {self._commands[name][0]} cannot be started: {error.strerror}")
            return
        running = _Running(process, event, self._clock_s() + self._timeout_s)
        self._running[name] = running
        # A command that does not read, or does not end its output, holds up its own threads only.
        running.reader = threading.Thread(target=_read, args=(running,), daemon=True)
        running.reader.start()
        threading.Thread(target=_write, args=(running,), daemon=True).start()

    def _tell(self, name: str, running: _Running, status: int) -> None:
        if running.killed:
            self._say(f"{name}: killed, it took longer than {self._timeout_s:g} s")
        elif status:
            lines = running.said.decode(errors="replace").strip().splitlines() or [""]
            self._say(f"{name}: failed with status {status}: {lines[-1]}")
        else:
            self._say(f"{name}: done: {running.event.text}")


def _write(running: _Running) -> None:
    assert running.process.stdin is not None
    with contextlib.suppress(OSError), running.process.stdin as stream:
        stream.write(msgspec.json.encode(running.event) + b"\n")


def _read(running: _Running) -> None:
    assert running.process.stdout is not None
    with contextlib.suppress(OSError, ValueError), running.process.stdout as stream:
        while data := os.read(stream.fileno(), _READ_BYTES):
            running.said[:] = (running.said + data)[-_LAST_BYTES:]
