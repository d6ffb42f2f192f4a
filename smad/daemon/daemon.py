"""The daemon put together: link, control task, command server, telemetry, recorder, housekeeping.

Everything runs on one loop. What follows a sample (`_publish`) and what no sample waits for
(`_housekeep`) comes in small pieces between samples.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable, Coroutine
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import zmq

from firmware_protocol.events import BoardRestarted, HostEvent, HostState, LinkLost
from firmware_protocol.host import HostSession
from firmware_protocol.messages import State
from smad.config import Config
from smad.control.controller import Controller
from smad.control.inputs import Departure
from smad.daemon.boardside import BoardSide
from smad.daemon.command.answers import Answers
from smad.daemon.command.lease import DeadMan, Lease
from smad.daemon.command.server import CommandServer, Handlers
from smad.daemon.command.service import Claims, Service
from smad.daemon.command.status import CommandCounts, Own, StatusReport
from smad.daemon.command.unwelcome import Unwelcome
from smad.daemon.control import ControlTask, Outlets
from smad.daemon.errors import Refusal
from smad.daemon.hoststop import HostStop, in_full
from smad.daemon.journal import Journal
from smad.daemon.link.link import Link
from smad.daemon.link.port import Transport
from smad.daemon.link.requests import BoardRequests
from smad.daemon.link.watch import BoardWatch
from smad.daemon.means import Clocks, Means
from smad.daemon.notify import Notifier
from smad.daemon.realtime import IdleCollector
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.stops import Stops
from smad.daemon.telemetry.publisher import Publisher
from smad.daemon.telemetry.recorder import Recorder
from smad.daemon.telemetry.runheader import run_header
from smad.daemon.telemetry.stamps import Stamps
from smad.daemon.trace import Trace
from smad.runlog.header import RunHeader
from smad.runlog.schema import Event, EventKind, LinkSample

HOUSEKEEPING_S = 0.02
STALL_S = 0.1
"""As long as the board waits for a setpoint before it takes the current away."""

_SECOND_US = 1_000_000
_AT_ONCE = 8
_SPARE_SHARE = 0.3


@dataclass(frozen=True)
class Process:
    """What the process gives its daemon.

    `nonce` tells the board's answers to this daemon from those to an earlier one. `reserve` is a
    block in which descriptors of the reserve may be used. `parameter_text` is the parameter file
    of a simulated bench, None on a real one. `patience` is that of the session with the board.
    """

    loop: asyncio.AbstractEventLoop
    context: zmq.Context[zmq.Socket[bytes]]
    journal: Journal
    notifier: Notifier
    nonce: int
    reserve: Reserve = nullcontext
    parameter_text: str | None = None
    patience: int = 1
    trace: Trace | None = None
    clocks: Clocks = field(default_factory=Clocks)


class Daemon:
    """All parts of a daemon. `failure` gets the name and error of a part that died."""

    def __init__(self, config: Config, opener: Callable[[], Transport], process: Process) -> None:
        self.config = config
        self.loop = process.loop
        self.journal = process.journal
        self.notifier = process.notifier
        self.failure: asyncio.Future[tuple[str, BaseException]] = self.loop.create_future()
        self.commands = CommandCounts()
        self._clock_us = process.clocks.us
        self._wall_clock = process.clocks.wall_s
        self._means = Means(process.clocks, self.say, self.spawn)
        self._tasks: set[asyncio.Task[Any]] = set()
        self._publishing = False
        self._stamps = Stamps()
        self._second_us = 0
        self._housekeeping: asyncio.TimerHandle | None = None
        self._recorder_error = ""
        self._housekept_s = time.monotonic()
        self._left_hot_us: int | None = None
        self._period_ns = int(1e9 / config.link.rate_hz)
        self._claims = Claims(
            Lease(secrets.token_urlsafe), DeadMan(int(config.daemon.dead_man_lease_s * 1e6))
        )
        board = self._towards_the_board(opener, process)
        self.recorder = self._recorder_of(process)
        self.publisher = Publisher(self.loop, config.telemetry)
        self.collector = IdleCollector(enabled=False)
        self._towards_clients(board, process)

    def _towards_the_board(self, opener: Callable[[], Transport], process: Process) -> BoardSide:
        config = self.config
        self.session = HostSession(nonce=process.nonce, patience=process.patience)
        self.link = Link(
            opener,
            loop=self.loop,
            retry_s=config.link.reconnect_interval_s,
            on_bytes=self._on_bytes,
            on_open=self._on_open,
            on_lost=self._on_lost,
        )
        self.control = ControlTask(
            self.session,
            Controller(config.control, config.limits),
            config.link,
            Outlets(self.link.write, self._on_event, self._on_finished),
            process.clocks,
            trace=process.trace,
        )
        self.requests = BoardRequests(self.session, self._clock_us, self.control.flush)
        self.watch = BoardWatch(
            config.link,
            self.requests,
            self._means,
            baud=lambda: 0 if self.link.transport is None else self.link.transport.baud,
            on_scales=self._set_scales,
            on_found_armed=self._stop_found,
        )
        self.stops = Stops(
            self.control,
            self.requests,
            self.watch,
            self._means,
            on_begin=self._on_stop_begun,
        )
        self._host_stop = HostStop(self.control.controller)
        self._told_departure: Departure | None = None
        return BoardSide(
            self.link, self.control, self.requests, self.watch, self.stops, self._host_stop
        )

    def _recorder_of(self, process: Process) -> Recorder:
        def header(name: str) -> RunHeader:
            return run_header(
                self.config,
                name,
                self.watch.ident,
                parameter_text=process.parameter_text,
                now_s=self._wall_clock(),
            )

        return Recorder(self.config.recorder, header, self._wall_clock)

    def _towards_clients(self, board: BoardSide, process: Process) -> None:
        self.status = StatusReport(
            self.config,
            board,
            self.recorder,
            lease=self._claims.lease,
            own=Own(self.journal, self.collector, self.commands),
            clock_us=self._clock_us,
        )
        self.service = Service(
            self.config, board, self.recorder, self.status, claims=self._claims, means=self._means
        )
        self.answers = Answers(
            self.service,
            self.commands,
            spawn=self.spawn,
            journal=self.journal,
            waiting=self._waiting,
        )
        self.server = CommandServer(
            process.context,
            Handlers(self.answers.command, self.answers.stop, self.link.read),
            loop=self.loop,
            queue=self.config.daemon.command_queue,
            reserve=process.reserve,
        )
        self._unwelcome = Unwelcome(self.server, self.commands, self.say)

    def start(self) -> None:
        """Open the port and begin. Raises PortError when it cannot be opened."""
        self.link.open()
        self._housekept_s = time.monotonic()
        self._housekeep()

    def say(self, kind: EventKind, text: str, data: dict[str, Any]) -> None:
        """Put an event into the run log and, unless it is a mere command, into the journal."""
        if kind not in ("command", "note"):
            self.journal.say(text, kind)
        last = self.control.last
        self.recorder.note(
            Event(
                t_s=None if last is None else last.sample.t_us * 1e-6,
                host_time_s=self._wall_clock(),
                kind=kind,
                text=text,
                data=data,
            )
        )

    def _waiting(self) -> int:
        return len(self._tasks)

    def spawn(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        """Run something beside the loop; if it dies, the daemon does."""
        task = self.loop.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._task_done)

    def fail(self, name: str, error: BaseException) -> None:
        """A part died: no step is taken any more, and whoever waits for `failure` is told."""
        self.control.stepping = False
        if not self.failure.done():
            self.failure.set_result((name, error))

    async def disarm(self) -> str:
        """End heating for good; return what came of it, in words. Never raises."""
        self.service.stopping = True
        state = self.session.state
        if state in (HostState.DISCONNECTED, HostState.SYNC):
            return "the board is not connected; its own watchdog ends heating"
        if self.watch.incompatible is not None:
            return "the board was only watched, nothing was armed"
        if state is HostState.FAULTED:
            return "the board has stopped already"
        hot = state in (HostState.RUNNING, HostState.READY)
        self.stops.begin("the daemon is ending", by="the end of the daemon")
        try:
            # Whatever died may be what lets the time of the wait itself run out.
            await asyncio.wait_for(self.stops.until_confirmed(), 2.0)
            # Without a session nothing is waited for, and nothing was confirmed.
            lost = self.session.state in (HostState.DISCONNECTED, HostState.SYNC)
            unconfirmed = "the link was lost" if lost else ""
        except Refusal as refusal:
            unconfirmed = refusal.cause
        except TimeoutError:
            unconfirmed = "no answer within 2 s"
        if not hot:
            return "nothing was armed"
        if unconfirmed:
            return (
                f"the board did not confirm the disarm ({unconfirmed}); its watchdog ends heating"
            )
        return "disarmed, the board cools by itself"

    async def close(self) -> None:
        """Give everything back. The board must have been disarmed."""
        if self._housekeeping is not None:
            self._housekeeping.cancel()
        await self.recorder.stop()
        self.answers.give_up()
        self.server.close()
        self.recorder.close()
        self.link.close()
        self.publisher.close()
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _task_done(self, task: asyncio.Task[Any]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self.fail(task.get_name(), error)

    def _guarded(self, name: str, work: Callable[..., None], *arguments: Any) -> None:
        try:
            work(*arguments)
        except Exception as error:
            self.fail(name, error)

    def _on_bytes(self, data: bytes) -> None:
        self._guarded("control", self.control.receive, data)

    def _on_open(self) -> None:
        self._stamps.restart()
        self.control.opened()
        transport = self.link.transport
        if self.link.counts.opens > 1 and transport is not None:
            self.say("link", f"reopened {transport.name}; monitoring, not armed", {})

    def _on_lost(self, reason: str) -> None:
        self.control.lost()
        self.stops.link_lost("the link was lost")
        self.watch.port_lost(reason)

    def _on_event(self, event: HostEvent) -> None:
        if isinstance(event, BoardRestarted):
            self.stops.link_lost("the board restarted")
        elif isinstance(event, LinkLost):
            self.stops.link_lost(f"the board fell silent for {event.silent_us / 1000:.0f} ms")
        self.watch.on_event(event)

    def _on_stop_begun(self) -> None:
        self._claims.dead_man.forget()
        self.server.mark()

    def _stop_found(self) -> None:
        text = "the board was found armed by somebody else; telling it to disarm"
        self.stops.order(
            "the board was found armed", text, {}, by="the daemon, which found it armed"
        )

    def _set_scales(self, scales: Any) -> None:
        self.control.scales = scales

    def _on_finished(self) -> None:
        if not self._publishing:
            self._publishing = True
            self.loop.call_soon(self._guarded, "telemetry", self._publish)

    def _publish(self) -> None:
        self._publishing = False
        finished = self.control.finished
        for _ in range(min(len(finished), _AT_ONCE)):
            item = finished.popleft()
            row = self.status.row(item)
            stamp_s = self._stamps.stamp(row.t_s, item.host_s, self._taken_s(item.state))
            if self._stamps.returned_s:
                self._tell_of_return(self._stamps.returned_s)
            self.publisher.publish(row, stamp_s)
            self.recorder.row(row)
            self.watch.on_state(item.state)
            self.stops.on_sample(item.state)
        self._tell_of_host_stop()
        self._tell_of_departure()
        self.notifier.alive(self._clock_us())
        if finished:
            self._on_finished()
        else:
            armed = self.session.state is HostState.RUNNING
            self.collector.run(int(self._period_ns * _SPARE_SHARE), at_rest=not armed)

    def _tell_of_return(self, returned_s: float) -> None:
        text = (
            "the computer's clock had leapt ahead and is back; "
            f"timestamps of telemetry went back by {returned_s:.0f} s"
        )
        self.say("warning", text, {"returned_s": returned_s})

    def _taken_s(self, state: State) -> float | None:
        """Unix time when a sample was taken, by the fit of the clocks; None while unknown."""
        # In this order: a pause between the two readings makes the time too early, and no jump.
        wall_s, now_us = self._wall_clock(), self._clock_us()
        host_us = self.session.host_us(state.t_us)
        return None if host_us is None else wall_s + (host_us - now_us) * 1e-6

    def _housekeep(self) -> None:
        self._housekeeping = self.loop.call_later(HOUSEKEEPING_S, self._housekeep)
        self._guarded("housekeeping", self._housekeep_once)

    def _housekeep_once(self) -> None:
        now_us = self._clock_us()
        self._notice_stall()
        # What waits in the port must count before the session is asked whether anything came.
        self.link.read()
        self.control.tick()
        self.server.wake()
        if self.session.state in (HostState.DISCONNECTED, HostState.SYNC):
            self.notifier.alive(now_us)
        self.stops.tick()
        self.service.end_what_lapsed(now_us)
        self._end_automatic_log(now_us)
        if now_us - self._second_us >= _SECOND_US:
            self._second_us = now_us
            self._each_second()

    def _notice_stall(self) -> None:
        now_s = time.monotonic()
        away_s = now_s - self._housekept_s - HOUSEKEEPING_S
        self._housekept_s = now_s
        if away_s > STALL_S:
            text = f"this computer kept the daemon from running for {away_s * 1000:.0f} ms"
            self.say("warning", text, {"away_s": away_s})

    def _tell_of_host_stop(self) -> None:
        fault = self._host_stop.news()
        if fault is not None:
            data = {name: getattr(fault, name) for name in fault.__struct_fields__}
            self.say("fault", f"the host stopped: {in_full(fault)}", data)
            self.stops.begin(f"a limit of the host: {fault.name}")

    def _tell_of_departure(self) -> None:
        departure = self.control.controller.departure
        if departure is not None and departure is not self._told_departure:
            self.say("warning", f"repeated inputs were ended: {departure.in_words()}", {})
        self._told_departure = departure

    def _each_second(self) -> None:
        self.status.refresh()
        self.status.telemetry_dropped = self.publisher.dropped
        self.recorder.note(
            LinkSample(host_time_s=self._wall_clock(), counters=self.status.link_counters())
        )
        self._unwelcome.tell()
        error = self.recorder.failure()
        if error and error != self._recorder_error:
            self.journal.say(f"recording failed: {error}")
        self._recorder_error = error

    def _end_automatic_log(self, now_us: int) -> None:
        mode = self.watch.mode
        resting = mode is None or mode.name in ("SAFE", "FAULT", "ESTOP")
        busy = self.session.state in (HostState.RUNNING, HostState.READY)
        if not self.recorder.ends_by_itself or busy or not resting:
            self._left_hot_us = None
        elif self._left_hot_us is None:
            self._left_hot_us = now_us
        elif now_us - self._left_hot_us > 2 * _SECOND_US:
            self._left_hot_us = None
            self.spawn("recorder", self.recorder.stop())
