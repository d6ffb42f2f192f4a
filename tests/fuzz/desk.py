"""The daemon's command side without sockets: real service and control task, a board, no plant.

Made once and used for many inputs, because a handshake takes longer than most of them; an input
that leaves the board changed costs the next one a new desk. What a client can set (lease, gains,
motion) is new for each.
"""

from __future__ import annotations

import asyncio
import io
from collections.abc import Coroutine
from typing import Any

from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState
from firmware_protocol.framing import FrameDecoder
from firmware_protocol.host import HostSession
from sim_device.board import Board
from sim_device.plant import Readings
from smad.config import Config, RecorderConfig
from smad.control.controller import Controller
from smad.daemon.answers import Answers
from smad.daemon.control import ControlTask
from smad.daemon.journal import Journal
from smad.daemon.lease import DeadMan, Lease
from smad.daemon.link import Link
from smad.daemon.port import Transport
from smad.daemon.realtime import IdleCollector
from smad.daemon.recorder import Recorder
from smad.daemon.requests import BoardRequests
from smad.daemon.runheader import run_header
from smad.daemon.service import Service
from smad.daemon.status import CommandCounts, StatusReport
from smad.daemon.watch import BoardWatch
from smad.errors import PortError
from tests.fuzz.setpoints import check_setpoints

_PERIOD_US = 10_000
_LONGEST_HANDSHAKE_SAMPLES = 400
_NOWHERE = "/dev/null/runs"


class Desk:
    """A connected bench; `fresh` says whether the next input finds it as the first one did."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.now_us = 1_000_000
        self.board = Board(seed=3)
        self.config = Config(recorder=RecorderConfig(folder=_NOWHERE, automatic=False))
        self.journal = Journal(stream=io.StringIO())
        self.tasks: set[asyncio.Task[Any]] = set()
        self._tap = FrameDecoder()
        self.control = ControlTask(
            HostSession(nonce=9),
            Controller(self.config.control, self.config.limits),
            axis=0,
            ttl_ms=100,
            write=self._written,
            on_event=lambda event: self.watch.on_event(event),
            on_finished=lambda: None,
            clock_us=lambda: self.now_us,
            wall_clock=lambda: 0.0,
            stopwatch_ns=lambda: self.now_us * 1000,
        )
        self.requests = BoardRequests(
            self.control.session, lambda: self.now_us, self.control.flush
        )
        self.watch = BoardWatch(
            self.config.link,
            self.requests,
            say=lambda kind, text, data: None,
            spawn=self.spawn,
            on_scales=lambda scales: None,
        )
        self._link = Link(
            _no_port,
            loop=loop,
            retry_s=1.0,
            on_bytes=lambda data: None,
            on_open=lambda: None,
            on_lost=lambda reason: None,
        )
        self._parameters_crc = 0

    async def connect(self) -> None:
        """Shake hands and read the parameters, as the daemon does."""
        self.control.opened()
        for _ in range(_LONGEST_HANDSHAKE_SAMPLES):
            await self.sample()
            if self.watch.parameters.agree and not self.tasks:
                break
        self._parameters_crc = self.board.parameters.crc

    def clerk(self) -> Answers:
        """Return what answers commands, with a lease and a controller that nobody used yet."""
        self.control.controller = Controller(self.config.control, self.config.limits)
        lease, dead_man = Lease(), DeadMan(0)
        counts = CommandCounts()
        recorder = Recorder(
            self.config.recorder,
            lambda name: run_header(
                self.config, name, self.watch.ident, parameter_text="", now_s=0.0
            ),
            lambda: 0.0,
        )
        status = StatusReport(
            self.config,
            control=self.control,
            watch=self.watch,
            link=lambda: self._link,
            recorder=recorder,
            lease=lease,
            journal=self.journal,
            collector=IdleCollector(enabled=False),
            commands=counts,
            clock_us=lambda: self.now_us,
        )
        service = Service(
            self.config,
            control=self.control,
            requests=self.requests,
            watch=self.watch,
            recorder=recorder,
            status=status,
            lease=lease,
            dead_man=dead_man,
            say=lambda kind, text, data: None,
            clock_us=lambda: self.now_us,
        )
        return Answers(
            service,
            counts,
            spawn=self.spawn,
            journal=self.journal,
            waiting=lambda: len(self.tasks),
        )

    @property
    def fresh(self) -> bool:
        """Whether the board is as it was after the handshake."""
        return (
            self.board.state in (BoardState.SAFE, BoardState.ARMED)
            and self.control.session.state in (HostState.MONITOR, HostState.RUNNING)
            and self.board.parameters.crc == self._parameters_crc
            and not self.tasks
        )

    def spawn(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        """Run something beside; its error is raised where the sample is taken."""
        task = self.loop.create_task(work, name=name)
        self.tasks.add(task)

    async def sample(self) -> None:
        """Let one sample pass: the board measures what it drives, and the host answers."""
        self.now_us += _PERIOD_US
        currents = self.board.outputs.applied_mA
        readings = Readings(
            i_A=(currents[0] / 1000, currents[1] / 1000),
            v_V=(currents[0] * 1.2e-3, currents[1] * 1.2e-3),
            rtd_degC=(21.0, 21.5, 20.0, 20.1),
            displacement_m=0.0,
            force_N=1.0,
            supply_V=12.0,
        )
        state = self.board.sample(readings, self.now_us)
        for _ in range(3):
            self.control.receive(self.board.session.data_to_send())
            self.control.tick()
            await asyncio.sleep(0)
        self.watch.on_state(state)
        self.control.finished.clear()
        for task in [task for task in self.tasks if task.done()]:
            self.tasks.discard(task)
            task.result()

    def _written(self, data: bytes) -> bool:
        check_setpoints(self._tap.feed(data), self.control.session)
        self.board.receive(data, self.now_us)
        return True


def _no_port() -> Transport:
    raise PortError("there is no port")
