"""Programs of the blocking client beside a daemon on virtual time.

The program runs in a thread of its own with the real client and the real daemon: only sockets and
sleeps are replaced. Each request and each sleep lets board time pass, and nothing else does.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
import pytest

import smad.client
import smad.client.async_commands
import smad.client.commands
from sim_device.faults import FAULT_KINDS
from smad.client.endpoints import Connection
from smad.client.wire import Conversation
from smad.experiments.live import LiveDriver
from tests.smad.daemon.rig import Rig

T = TypeVar("T")
POLL_SAMPLES = 5
FROZEN_S = 3.0
"""Longer than a lease."""


class Stage:
    """A rig, a program, and the stop that comes in one of its phases."""

    def __init__(self, rig: Rig, phase: str, stop: str) -> None:
        self.rig = rig
        self.phase = phase
        self.stop = stop
        self.stopped = False
        self.asked: list[str] = []
        self.leases: set[str] = set()
        self.loop = asyncio.get_running_loop()
        self._program_thread: threading.Thread | None = None

    async def play(self, program: Callable[..., T], *arguments: object) -> T:
        """Run a program in a thread of its own, and return what it returns."""

        def played() -> T:
            self._program_thread = threading.current_thread()
            return program(*arguments)

        return await self.loop.run_in_executor(None, played)

    def do(self, work: Any) -> Any:
        """Let the loop do something for the program's thread, and wait for it."""
        return asyncio.run_coroutine_threadsafe(work, self.loop).result()

    def sleep(self, seconds: float) -> None:
        """Let board time pass, and renew the leases as the client's thread does.

        Other threads sleep as ever: that of the run log must not renew a frozen program's lease.
        """
        if threading.current_thread() is not self._program_thread:
            _really_sleep(seconds)
            return
        self.do(self._pass(max(1, round(seconds * 1e6 / self.rig.bench.period_us))))

    async def _pass(self, samples: int) -> None:
        for lease in self.leases:
            self.rig.begin("motion", b"renewal", members={"lease": lease})
        await self.rig.run(samples)

    async def ask(self, data: bytes, *, stop: bool) -> bytes:
        """Serve a request of the program, and stop the bench where its phase is."""
        method = msgspec.json.decode(data)["method"]
        self.asked.append(method)
        here = not self.stopped and PHASES[self.phase](self.asked)
        if here and self.phase != "arming":
            await self._stop()
        for lease in self.leases:
            self.rig.begin("motion", b"renewal", members={"lease": lease})
        reply: asyncio.Future[bytes] = self.loop.create_future()
        dispatcher = self.rig.daemon.dispatcher
        (dispatcher.stop if stop else dispatcher.command)(b"program", data, reply.set_result)
        if here and self.phase == "arming":
            await self._stop()
        if method in ("motion", "status"):
            await self.rig.run(POLL_SAMPLES)
        return await self.rig.run_until(reply)

    async def _stop(self) -> None:
        self.stopped = True
        rig = self.rig
        match self.stop:
            case "disarm" | "estop":
                # A second of board time: by then the board must have confirmed it.
                asked = rig.begin(self.stop, b"somebody else")
                await rig.run_until(asked)
            case "lapse":
                await rig.run_for(FROZEN_S)
            case "link loss":
                rig.pull_the_plug()
                await rig.run_for(0.3)
                rig.plug_in()
                await rig.run_for(2.0)
            case "board fault":
                FAULT_KINDS["sensor_open"].begin(rig.bench, {"channel": 0.0})
                await rig.run_for(1.0)


_really_sleep = time.sleep


def _nth(asked: list[str], method: str, n: int) -> bool:
    return asked[-1] == method and asked.count(method) == n


def _polls_since(asked: list[str], method: str, polls: int) -> bool:
    if asked[-1] != "motion" or method not in asked:
        return False
    return asked[asked.index(method) :].count("motion") == polls


def _last(asked: list[str]) -> bool:
    return asked[-1] == "idle" and "record.start" in asked


PHASES: dict[str, Callable[[list[str]], bool]] = {
    "never": lambda asked: False,
    "before arming": lambda asked: _nth(asked, "arm", 1),
    "arming": lambda asked: _nth(asked, "arm", 1),
    "warm-up": lambda asked: "record.start" not in asked and _polls_since(asked, "arm", 1),
    "recording": lambda asked: _polls_since(asked, "record.start", 4),
    "moving": lambda asked: _polls_since(asked, "move", 2),
    "last phase": _last,
    "between runs": lambda asked: _nth(asked, "arm", 2),
}


class _Channel:
    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self.connection = Connection(
            bench="bench", pid=0, version="0", command="", stop="", telemetry=""
        )
        self.conversation = Conversation()

    def close(self) -> None:
        """Nothing is open."""

    def call(self, params: Any, kind: Any, limit_s: float, *, stop: bool, axes: Any = None) -> Any:
        call_id, data = self.conversation.request(params, axes)
        reply = self.conversation.reply(
            self._stage.do(self._stage.ask(data, stop=stop)), call_id, kind
        )
        assert reply is not None
        return reply


class _AsyncChannel(_Channel):
    async def call(
        self, params: Any, kind: Any, limit_s: float, *, stop: bool, axes: Any = None
    ) -> Any:
        return super().call(params, kind, limit_s, stop=stop, axes=axes)


class _Renewal:
    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._lease = ""

    def begin(self, lease: str, lease_s: float) -> None:
        self.end()
        self._lease = lease
        self._stage.leases.add(lease)

    def end(self) -> None:
        self._stage.leases.discard(self._lease)


def _on(stage: Stage, real: Any, channel: type[_Channel]) -> type:
    class StageClient(real):  # type: ignore[misc]
        def __init__(
            self, *names: Any, axis: str = "", lease_s: float | None = 2.0, **options: Any
        ) -> None:
            self.name = axis
            self.timeout_s = 5.0
            self.lease_s = lease_s
            self._leased = self._may_be_armed = False
            self._control_lease_s = None
            self._channel = channel(stage)
            self._conversation = self._channel.conversation
            self._renewal = _Renewal(stage)

    return StageClient


def set_up(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every client that the program makes talk to the stage's daemon."""
    for name, channel in (("Client", _Channel), ("AsyncClient", _AsyncChannel)):
        monkeypatch.setattr(smad.client, name, _on(stage, getattr(smad.client, name), channel))

    async def pause(seconds: float) -> None:
        stage.sleep(seconds)

    monkeypatch.setattr(smad.client.commands, "pause", stage.sleep)
    monkeypatch.setattr(smad.client.async_commands, "pause", pause)
    monkeypatch.setattr(time, "sleep", stage.sleep)
    defaults = LiveDriver.__init__.__kwdefaults__
    assert defaults is not None
    monkeypatch.setitem(defaults, "sleep", stage.sleep)
