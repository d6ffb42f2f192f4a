"""A daemon in this process on virtual time: a simulated bench at the other end of a socket pair.

`run` lets the bench take samples one by one; the daemon answers each before the next. On a
`VirtualLoop` nothing waits for the wall clock, timers included, except for threads that open and
close run logs.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, TypeVar

import msgspec
import zmq

from sim_device.bench import SimulatedBench
from smad.config import Config
from smad.daemon.axis import Axis
from smad.daemon.daemon import Daemon
from smad.daemon.journal import Journal
from smad.daemon.link.port import SocketTransport, Transport
from smad.daemon.notify import Notifier
from smad.daemon.process import Options, Process
from smad.daemon.services import Clocks
from smad.errors import PortError
from smad.runlog.schema import Event, LinkSample

T = TypeVar("T")
LONGEST_RUN_SAMPLES = 100_000
_TURNS = 4
"""Turns of the loop in which a sample is answered, published, and what follows is sent."""
_BREATH_S = 0.0001
_EPOCH_S = 1_700_000_000.0


class VirtualLoop(asyncio.SelectorEventLoop):
    """A loop whose timers go by `now_us`; who lets that pass must let the loop turn."""

    def __init__(self) -> None:
        super().__init__()
        self.now_us: Callable[[], int] = lambda: 0

    def time(self) -> float:
        return self.now_us() * 1e-6


class Line:
    """One board and the line to it. Its samples fall `phase_us` after those of the first."""

    def __init__(self, bench: SimulatedBench, phase_us: int = 0) -> None:
        self.bench = bench
        self.phase_us = phase_us
        self.plugged = True
        self.end: socket.socket | None = None
        bench.on_unplug = lambda _: self.pull_the_plug()
        bench.on_plug = self.plug_in

    @property
    def due_us(self) -> int:
        """When its next sample is, by the rig's time."""
        return self.phase_us + self.bench.now_us + self.bench.period_us

    def open(self) -> Transport:
        """Open the port, as the daemon does."""
        if not self.plugged:
            raise PortError("there is no such port")
        ours, self.end = socket.socketpair()
        self.end.setblocking(False)
        return SocketTransport(ours)

    def step(self) -> None:
        """Take a sample and send what the board says."""
        data = self.bench.step()
        if self.end is not None and data:
            with contextlib.suppress(OSError):
                self.end.send(data)

    def receive(self) -> None:
        """Let the board hear what the daemon said."""
        if self.end is not None:
            with contextlib.suppress(OSError):
                self.bench.receive(self.end.recv(65_536))

    def pull_the_plug(self) -> None:
        """The port goes away, and stays away until it is plugged in."""
        self.plugged = False
        if self.end is not None:
            self.end.close()
            self.end = None

    def plug_in(self) -> None:
        """The port can be opened again."""
        self.plugged = True


class Rig:
    """A bench and a daemon, with a client's view of it. `lines` are by axis.

    Only within a running loop; a `VirtualLoop` gets its time from here.
    """

    def __init__(
        self, config: Config, bench: SimulatedBench | Mapping[str, Line], nonce: int = 7
    ) -> None:
        self.lines = {"": Line(bench)} if isinstance(bench, SimulatedBench) else bench
        self._phases = [(line.phase_us, line.bench) for line in self.lines.values()]
        self.lost_us = 0
        """By how much the board's clock is behind: add to it to let the board stand still."""
        self.wall_off_s = 0.0
        """By how much the host's wall clock is wrong."""
        self.stalled_until_us = 0
        """Until then the daemon does not run; bytes wait in the line."""
        self.journal = Journal(stream=io.StringIO())
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.events: list[Event] = []
        """All of them, those of the run log alone included."""
        self._last_id = 0
        loop = asyncio.get_running_loop()
        if isinstance(loop, VirtualLoop):
            loop.now_us = self.now_us
        self.daemon = Daemon(
            config,
            {name: line.open for name, line in self.lines.items()},
            Process(
                loop=loop,
                context=self.context,
                journal=self.journal,
                notifier=Notifier({}),
                nonce=nonce,
                options=Options(parameter_text=""),
                clocks=Clocks(self.now_us, self._wall_s),
            ),
        )

        note = self.daemon.recorder.note

        def listen(record: Event | LinkSample) -> None:
            if isinstance(record, Event):
                self.events.append(record)
            note(record)

        self.daemon.recorder.note = listen  # type: ignore[method-assign]

    @property
    def bench(self) -> SimulatedBench:
        """The bench of the first axis."""
        return next(iter(self.lines.values())).bench

    @property
    def axis(self) -> Axis:
        """The first axis."""
        return next(iter(self.daemon.axes.values()))

    def now_us(self) -> int:
        """The host's clock."""
        # Asked for at every turn of the loop.
        latest_us = 0
        for phase_us, bench in self._phases:
            at_us = phase_us + bench.now_us
            if at_us > latest_us:  # noqa: PLR1730
                latest_us = at_us
        return latest_us + self.lost_us

    def _wall_s(self) -> float:
        return _EPOCH_S + self.now_us() * 1e-6 + self.wall_off_s

    def stall(self, seconds: float) -> None:
        """Let the daemon not run for a while."""
        self.stalled_until_us = self.now_us() + round(seconds * 1e6)

    def jump_wall_clock(self, seconds: float) -> None:
        """Set the host's wall clock forward or back."""
        self.wall_off_s += seconds

    async def run(self, samples: int) -> None:
        """Let the bench take samples, and the daemon answer."""
        for _ in range(samples):
            await self.sample()

    async def run_until(self, done: Awaitable[T]) -> T:
        """Let samples pass until something is done."""
        task = asyncio.ensure_future(done)
        for _ in range(LONGEST_RUN_SAMPLES):
            if task.done():
                return task.result()
            await self.sample()
            # A run log is opened by a thread; leave it the processor.
            time.sleep(_BREATH_S)
        raise AssertionError("it never came to an end")

    async def run_for(self, seconds: float) -> None:
        """Let board time pass."""
        until_us = self.now_us() - self.lost_us + round(seconds * 1e6)
        while self.now_us() - self.lost_us < until_us:
            await self.sample()

    async def sample(self) -> None:
        """Let the boards whose turn it is take a sample, and the daemon answer unless stalled."""
        due_us = min(line.due_us for line in self.lines.values())
        due = [line for line in self.lines.values() if line.due_us == due_us]
        for line in due:
            line.step()
        if self.now_us() < self.stalled_until_us:
            return
        for _ in range(_TURNS):
            await asyncio.sleep(0)
        for line in due:
            line.receive()

    async def ask(
        self,
        method: str,
        client: bytes = b"me",
        *,
        members: dict[str, Any] | None = None,
        **params: Any,
    ) -> Any:
        """Send a command and return its result. Raises Refused with the error reply.

        Samples pass until it is there, as many as the threads take wall time for. `members` go
        beside the parameters: the secret of a lease, a generation.
        """
        return result_of(
            await self.run_until(self.begin(method, client, members=members, **params))
        )

    def begin(
        self,
        method: str,
        client: bytes = b"me",
        *,
        members: dict[str, Any] | None = None,
        **params: Any,
    ) -> asyncio.Future[bytes]:
        """Send a command, the two that stop over the stop channel; the future has its reply."""
        reply: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._last_id += 1
        request = {"jsonrpc": "2.0", "id": self._last_id, "method": method, "params": params}
        answers = self.daemon.dispatcher
        answer = answers.stop if method in ("disarm", "estop") else answers.command
        answer(client, msgspec.json.encode({**request, **(members or {})}), reply.set_result)
        return reply

    async def arm(self) -> None:
        """Connect, wait for the clocks to align, arm."""
        await self.run_for(2.0)
        await self.ask("arm")

    async def close(self) -> None:
        """End the daemon, the boards being as they are."""
        await self.daemon.close()
        self.context.destroy(linger=0)
        self.journal.close()


def result_of(reply: bytes) -> Any:
    """The result in a reply. Raises Refused for an error reply."""
    decoded = msgspec.json.decode(reply)
    if "error" in decoded:
        raise Refused(decoded["error"])
    return decoded["result"]


class Refused(Exception):
    """An error reply."""

    def __init__(self, error: dict[str, Any]) -> None:
        super().__init__(error["message"])
        self.code: int = error["code"]
        self.data: dict[str, Any] = error["data"]
        self.reason: str = error["data"]["reason"]
