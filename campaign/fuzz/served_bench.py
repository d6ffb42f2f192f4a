"""The daemon's command side: the real daemon without its sockets for commands, on virtual time.

Made once and used for many inputs, because a handshake takes longer than most of them. What a
client can set is put back by the client's own commands; an input that leaves anything else changed
costs the next one a new bench.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import msgspec

from campaign.fuzz.files import folder
from campaign.fuzz.setpoints import check_setpoints
from campaign.virtual import Rig
from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState
from firmware_protocol.framing import FrameDecoder
from sim_device.bench import SimulatedBench
from smad.config import Config, DaemonConfig, LinkConfig, RecorderConfig, TelemetryConfig

CLIENTS = (b"one", b"two")
_HANDSHAKE_SAMPLES = 150
_MOST_SAMPLES = 60
_THREAD_S = 0.0005
_NOWHERE = "/dev/null/runs"

Send = Callable[[bytes], None]


class ServedBench:
    """A connected bench and a daemon; only within a running loop."""

    def __init__(self) -> None:
        bench = SimulatedBench(seed=1)
        self._rig = Rig(
            Config(
                link=LinkConfig(reconnect_interval_s=0.05),
                recorder=RecorderConfig(folder=_NOWHERE, automatic=False),
                telemetry=TelemetryConfig(enabled=False),
                daemon=DaemonConfig(ipc_dir=str(folder())),
            ),
            bench,
        )
        self._tap = FrameDecoder()
        self._receive = bench.receive
        bench.receive = self._heard  # type: ignore[method-assign]
        self._was = HostState.SYNC
        self._begun: tuple[int, bytes] | None = None

    async def connect(self) -> None:
        """Shake hands and read the parameters, as the daemon does."""
        self._rig.daemon.start()
        await self.run(_HANDSHAKE_SAMPLES)
        self._begun = await self._settings()

    async def close(self) -> None:
        """End the daemon."""
        await self._rig.daemon.close()
        self._rig.context.destroy(linger=0)
        self._rig.journal.close()

    @property
    def state(self) -> HostState:
        """Where the host stands with the board."""
        return self._rig.axis.session.state

    def say(self, client: bytes, line: bytes, send: Send, *, stop: bool = False) -> None:
        """Give the daemon a message on one of its two channels."""
        answers = self._rig.daemon.dispatcher
        (answers.stop if stop else answers.command)(client, line, send)

    async def run(self, samples: int) -> None:
        """Let samples pass."""
        for _ in range(samples):
            self._was = self.state
            await self._rig.run(1)

    async def ask(self, client: bytes, method: str) -> bytes:
        """Return the reply to a command without parameters; empty when there is none in time."""
        replies: list[bytes] = []
        self.say(client, msgspec.json.encode({"method": method, "id": 1}), replies.append)
        await self.until(lambda: bool(replies))
        return replies[0] if replies else b""

    async def until(self, done: Callable[[], bool]) -> None:
        """Let samples pass until something is done, or for long enough that it never will be."""
        for _ in range(_MOST_SAMPLES):
            if done():
                return
            await self.run(1)
            # A run log is opened by a thread; leave it the processor.
            await asyncio.sleep(_THREAD_S)

    async def tidy(self) -> bool:
        """Put back what clients can set; return whether everything is as it was at first."""
        for client in CLIENTS:
            await self.ask(client, "control.release")
        await self.ask(CLIENTS[0], "idle")
        return (
            self._rig.bench.board.state in (BoardState.SAFE, BoardState.ARMED)
            and self.state in (HostState.MONITOR, HostState.RUNNING)
            and await self._settings() == self._begun
        )

    async def _settings(self) -> tuple[int, bytes]:
        return self._rig.bench.board.parameters.crc, await self.ask(CLIENTS[0], "params.list")

    def _heard(self, data: bytes, at_us: int | None = None) -> None:
        # What was sent while armed may arrive when the host is not any more.
        if HostState.RUNNING not in (self._was, self.state):
            check_setpoints(self._tap.feed(data), self._rig.axis.session)
        else:
            self._tap.feed(data)
        self._receive(data, at_us)


_benches: list[ServedBench] = []


async def served_bench() -> ServedBench:
    """Return the bench of this process, a new one if there is none."""
    if not _benches:
        made = ServedBench()
        await made.connect()
        _benches.append(made)
    return _benches[0]


async def discard() -> None:
    """Let the next input have a bench of its own."""
    while _benches:
        await _benches.pop().close()
