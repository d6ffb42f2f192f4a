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
from typing import Any

import zmq

from firmware_protocol.events import BoardRestarted, HostEvent, HostState, LinkLost
from firmware_protocol.host import HostSession
from firmware_protocol.messages import State
from smad.config import Config
from smad.control.controller import Controller
from smad.daemon.answers import Answers
from smad.daemon.control import ControlTask
from smad.daemon.descriptors import Reserve
from smad.daemon.errors import Refusal
from smad.daemon.hoststop import HostStop, in_full
from smad.daemon.journal import Journal
from smad.daemon.lease import DeadMan, Lease
from smad.daemon.link import Link
from smad.daemon.notify import Notifier
from smad.daemon.port import Transport
from smad.daemon.realtime import IdleCollector
from smad.daemon.recorder import Recorder
from smad.daemon.requests import BoardRequests
from smad.daemon.runheader import run_header
from smad.daemon.server import CommandServer
from smad.daemon.service import Service
from smad.daemon.stamps import Stamps
from smad.daemon.status import CommandCounts, StatusReport
from smad.daemon.stops import Stops
from smad.daemon.telemetry import Publisher
from smad.daemon.trace import Trace
from smad.daemon.unwelcome import Unwelcome
from smad.daemon.watch import BoardWatch
from smad.runlog.schema import Event, EventKind, LinkSample

HOUSEKEEPING_S = 0.02
STALL_S = 0.1
"""As long as the board waits for a setpoint before it takes the current away."""

_SECOND_US = 1_000_000
_AT_ONCE = 8
_SPARE_SHARE = 0.3


def monotonic_us() -> int:
    """The daemon's clock, microseconds."""
    return time.monotonic_ns() // 1000


class Daemon:
    """All parts of a daemon on `loop`. `failed` gets the name and error of a part that died."""

    def __init__(
        self,
        config: Config,
        opener: Callable[[], Transport],
        *,
        loop: asyncio.AbstractEventLoop,
        context: zmq.Context[zmq.Socket[bytes]],
        journal: Journal,
        notifier: Notifier,
        nonce: int,
        reserve: Reserve = nullcontext,
        parameter_text: str | None = None,
        trace: Trace | None = None,
        clock_us: Callable[[], int] = monotonic_us,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        self.config = config
        self.loop = loop
        self.journal = journal
        self.notifier = notifier
        self.failure: asyncio.Future[tuple[str, BaseException]] = loop.create_future()
        self.commands = CommandCounts()
        self._clock_us = clock_us
        self._wall_clock = wall_clock
        self._tasks: set[asyncio.Task[Any]] = set()
        self._publishing = False
        self._stamps = Stamps()
        self._second_us = 0
        self._housekeeping: asyncio.TimerHandle | None = None
        self._recorder_error = ""
        self._housekept_s = time.monotonic()
        self._left_hot_us: int | None = None
        self._period_ns = int(1e9 / config.link.rate_hz)

        self.session = HostSession(nonce=nonce)
        self.link = Link(
            opener,
            loop=loop,
            retry_s=config.link.reconnect_interval_s,
            on_bytes=self._on_bytes,
            on_open=self._on_open,
            on_lost=self._on_lost,
        )
        self.control = ControlTask(
            self.session,
            Controller(config.control, config.limits),
            axis=config.link.axis,
            ttl_ms=config.link.setpoint_ttl_ms,
            write=self.link.write,
            on_event=self._on_event,
            on_finished=self._on_finished,
            clock_us=clock_us,
            wall_clock=wall_clock,
            trace=trace,
        )
        self.requests = BoardRequests(self.session, clock_us, self.control.flush)
        self.watch = BoardWatch(
            config.link,
            self.requests,
            say=self.say,
            spawn=self.spawn,
            on_scales=self._set_scales,
            on_found_armed=self._stop_found,
        )
        self._dead_man = DeadMan(int(config.daemon.dead_man_lease_s * 1e6))
        self.stops = Stops(
            self.session,
            self.control.controller,
            self.requests,
            self.watch,
            axis=config.link.axis,
            say=self.say,
            spawn=self.spawn,
            on_begin=self._dead_man.forget,
            clock_us=clock_us,
        )
        self.recorder = Recorder(
            config.recorder,
            lambda name: run_header(
                config,
                name,
                self.watch.ident,
                parameter_text=parameter_text,
                now_s=wall_clock(),
            ),
            wall_clock,
        )
        self.publisher = Publisher(loop, config.telemetry, reserve)
        self.collector = IdleCollector(enabled=False)
        self._lease = Lease(secrets.token_urlsafe)
        self._host_stop = HostStop(self.control.controller)
        self.status = StatusReport(
            config,
            control=self.control,
            watch=self.watch,
            link=lambda: self.link,
            recorder=self.recorder,
            lease=self._lease,
            host_stop=self._host_stop,
            stops=self.stops,
            journal=journal,
            collector=self.collector,
            commands=self.commands,
            clock_us=clock_us,
        )
        self.service = Service(
            config,
            control=self.control,
            requests=self.requests,
            watch=self.watch,
            recorder=self.recorder,
            status=self.status,
            lease=self._lease,
            host_stop=self._host_stop,
            dead_man=self._dead_man,
            stops=self.stops,
            say=self.say,
            clock_us=clock_us,
        )
        self.answers = Answers(
            self.service, self.commands, spawn=self.spawn, journal=journal, waiting=self._waiting
        )
        self.server = CommandServer(
            context,
            loop=loop,
            on_command=self.answers.command,
            on_stop=self.answers.stop,
            look_at_port=self.link.read,
            queue=config.daemon.command_queue,
            reserve=reserve,
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
            self.journal.say(text)
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
        self.stops.begin("the daemon is ending")
        try:
            # Whatever died may be what lets the time of the wait itself run out.
            await asyncio.wait_for(self.stops.until_confirmed(), 2.0)
        except (Refusal, TimeoutError) as error:
            if not hot:
                return "nothing was armed"
            reason = error.cause if isinstance(error, Refusal) else "no answer within 2 s"
            return f"the board did not confirm the disarm ({reason}); its watchdog ends heating"
        return "disarmed, the board cools by itself" if hot else "nothing was armed"

    async def close(self) -> None:
        """Give everything back. The board must have been disarmed."""
        if self._housekeeping is not None:
            self._housekeeping.cancel()
        self.server.close()
        await self.recorder.stop()
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
            self.stops.link_lost("the board fell silent")
        self.watch.on_event(event)

    def _stop_found(self) -> None:
        text = "the board was found armed by somebody else; telling it to disarm"
        self.stops.order("the board was found armed", text, {})

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
            self.publisher.publish(row, stamp_s)
            self.recorder.row(row)
            self.watch.on_state(item.state)
            self.stops.on_sample(item.state)
        self._tell_of_host_stop()
        self.notifier.alive(self._clock_us())
        if finished:
            self._on_finished()
        else:
            armed = self.session.state is HostState.RUNNING
            self.collector.run(int(self._period_ns * _SPARE_SHARE), at_rest=not armed)

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
