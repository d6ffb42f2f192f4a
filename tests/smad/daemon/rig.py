"""A daemon in this process on virtual time: a simulated bench at the other end of a socket pair.

`run` lets the bench take samples one by one; the daemon answers each before the next. Nothing
waits for the wall clock, except for threads that open and close run logs.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
from collections.abc import AsyncIterator, Awaitable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import zmq

from sim_device.bench import SimulatedBench
from smad.config import Config, DaemonConfig, LinkConfig, RecorderConfig
from smad.daemon.axis import Axis
from smad.daemon.daemon import Daemon
from smad.daemon.journal import Journal
from smad.daemon.link.port import SocketTransport, Transport
from smad.daemon.means import Clocks
from smad.daemon.notify import Notifier
from smad.daemon.process import Process
from smad.errors import PortError

T = TypeVar("T")
LONGEST_RUN_SAMPLES = 100_000
_TURNS = 4
_PATIENCE_S = 300.0


class Rig:
    """A bench and a daemon, with a client's view of it."""

    def __init__(self, config: Config, bench: SimulatedBench) -> None:
        self.bench = bench
        self.plugged = True
        self.lost_us = 0
        """By how much the board's clock is behind: add to it to let the board stand still."""
        self.wall_off_s = 0.0
        """By how much the host's wall clock is wrong."""
        self.journal = Journal(stream=io.StringIO())
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._board_end: socket.socket | None = None
        self._last_id = 0
        self.daemon = Daemon(
            config,
            {"": self._open},
            Process(
                loop=asyncio.get_running_loop(),
                context=self.context,
                journal=self.journal,
                notifier=Notifier({}),
                nonce=7,
                parameter_text="",
                clocks=Clocks(self.now_us, self._wall_s),
            ),
        )

    @property
    def axis(self) -> Axis:
        """The only axis."""
        return self.daemon.axes[""]

    def now_us(self) -> int:
        """The host's clock."""
        return self.bench.now_us + self.lost_us

    def _wall_s(self) -> float:
        return 1_700_000_000.0 + self.now_us() * 1e-6 + self.wall_off_s

    def _open(self) -> Transport:
        if not self.plugged:
            raise PortError("there is no such port")
        ours, self._board_end = socket.socketpair()
        self._board_end.setblocking(False)
        return SocketTransport(ours)

    async def run(self, samples: int) -> None:
        """Let the bench take samples, and the daemon answer."""
        for _ in range(samples):
            await self._sample()

    async def run_until(self, done: Awaitable[T]) -> T:
        """Let samples pass until something is done."""
        task = asyncio.ensure_future(done)
        for _ in range(LONGEST_RUN_SAMPLES):
            if task.done():
                return task.result()
            await self._sample()
            # A run log is opened by a thread; leave it the processor.
            await asyncio.sleep(0.0001)
        raise AssertionError("it never came to an end")

    async def wait_for(self, done: Awaitable[T]) -> T:
        """Wait for something that a thread does while board time stands still."""
        return await asyncio.wait_for(done, _PATIENCE_S)

    async def run_for(self, seconds: float) -> None:
        """Let board time pass."""
        await self.run(round(seconds * 1e6 / self.bench.period_us))

    async def _sample(self) -> None:
        data = self.bench.step()
        end = self._board_end
        if end is not None and data:
            with contextlib.suppress(OSError):
                end.send(data)
        for _ in range(_TURNS):
            await asyncio.sleep(0)
        if end is not None:
            with contextlib.suppress(OSError):
                self.bench.receive(end.recv(65_536))

    def pull_the_plug(self) -> None:
        """The port goes away, and stays away until `plug_in`."""
        self.plugged = False
        if self._board_end is not None:
            self._board_end.close()
            self._board_end = None

    def plug_in(self) -> None:
        """The port can be opened again."""
        self.plugged = True

    async def ask(
        self,
        method: str,
        client: bytes = b"me",
        *,
        still: bool = False,
        told: dict[str, Any] | None = None,
        **params: Any,
    ) -> Any:
        """Send a command and return its result. Raises Refused with the error reply.

        Samples pass until it is there, as many as the threads take wall time for; `still` stops
        board time meanwhile, so that what follows begins at the same sample every time. `told`
        has what goes beside the parameters: the secret of a lease, a generation.
        """
        asked = self.begin(method, client, told=told, **params)
        return result_of(await (self.wait_for if still else self.run_until)(asked))

    def begin(
        self,
        method: str,
        client: bytes = b"me",
        *,
        told: dict[str, Any] | None = None,
        **params: Any,
    ) -> asyncio.Future[bytes]:
        """Send a command, the two that stop over the stop channel; the future has its reply."""
        reply: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._last_id += 1
        request = {"jsonrpc": "2.0", "id": self._last_id, "method": method, "params": params}
        answers = self.daemon.answers
        answer = answers.stop if method in ("disarm", "estop") else answers.command
        answer(client, msgspec.json.encode({**request, **(told or {})}), reply.set_result)
        return reply

    async def arm(self) -> None:
        """Connect, wait for the clocks to align, arm."""
        await self.run_for(2.0)
        await self.ask("arm")

    @property
    def said(self) -> str:
        """Everything in the journal."""
        return "\n".join(entry.text for entry in self.journal.recent)


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


def config_in(folder: Path, **sections: Any) -> Config:
    """A configuration that writes into `folder` and reopens the port at once."""
    defaults: dict[str, Any] = {
        "link": LinkConfig(reconnect_interval_s=0.05),
        "recorder": RecorderConfig(folder=str(folder / "runs"), automatic=False),
        "daemon": DaemonConfig(ipc_dir=str(folder)),
    }
    return Config(**{**defaults, **sections})


@contextlib.asynccontextmanager
async def rig_in(
    folder: Path, bench: SimulatedBench | None = None, **sections: Any
) -> AsyncIterator[Rig]:
    """A rig whose daemon is started, and closed at the end."""
    rig = Rig(config_in(folder, **sections), bench or SimulatedBench(seed=1))
    rig.daemon.start()
    try:
        yield rig
    finally:
        await rig.daemon.close()
        rig.context.destroy(linger=0)
        rig.journal.close()
