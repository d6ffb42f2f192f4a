"""The daemon put together: link, control task, command server, telemetry, recorder, housekeeping.

Everything runs on one loop. What follows a sample (`_publish`) and what no sample waits for
(`_housekeep`) comes in small pieces between samples.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Coroutine, Mapping, Sequence
from pathlib import Path
from typing import Any

from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState
from firmware_protocol.mirror import STOPPED
from smad.config import Config
from smad.daemon.arming import Arming
from smad.daemon.axis import Axis, AxisDependencies
from smad.daemon.boardstop import BoardStop
from smad.daemon.command.bench import Bench, CommandCounts
from smad.daemon.command.dispatcher import RequestDispatcher
from smad.daemon.command.lease import DeadMan, Lease
from smad.daemon.command.rejections import RejectionLog
from smad.daemon.command.server import CommandServer, Handlers
from smad.daemon.command.service import Service
from smad.daemon.command.status import StatusReport
from smad.daemon.errors import Refusal
from smad.daemon.link.port import Opener
from smad.daemon.process import Process
from smad.daemon.realtime import IdleCollector
from smad.daemon.services import Services
from smad.daemon.stops import Stops
from smad.daemon.telemetry.blackbox import BlackBox
from smad.daemon.telemetry.publisher import Publisher
from smad.daemon.telemetry.recorder import Recorder
from smad.daemon.telemetry.runheader import run_header
from smad.daemon.together import Groups
from smad.errors import PortError
from smad.runlog.header import RunHeader
from smad.runlog.schema import Event, EventKind, LinkSample

HOUSEKEEPING_S = 0.02
STALL_S = 0.1
"""As long as the board waits for a setpoint before it takes the current away."""

LAST_REPLIES_S = 1.0
"""How long an ending daemon waits for boards to show what it stopped, if anybody is to be told."""

_SECOND_US = 1_000_000
_AT_ONCE = 8
_SPARE_SHARE = 0.3


class Daemon:
    """All parts of a daemon, and its axes by name; the one of a bench of one has the empty name.

    `openers` open the port of each axis that `config.by_axis()` has. `failure` gets the name and
    error of a part that died.
    """

    def __init__(self, config: Config, openers: Mapping[str, Opener], process: Process) -> None:
        self.config = config
        self.loop = process.loop
        self.journal = process.journal
        self.notifier = process.notifier
        self.failure: asyncio.Future[tuple[str, BaseException]] = self.loop.create_future()
        self._clock_us = process.clocks.us
        self._wall_clock = process.clocks.wall_s
        self._tasks: set[asyncio.Task[Any]] = set()
        self._publishing = False
        self._second_us = 0
        self._housekeeping: asyncio.TimerHandle | None = None
        self._recorder_error = ""
        self._housekept_s = time.monotonic()
        self._left_hot_us: int | None = None
        services = Services(process.clocks, self.say, self.spawn)
        by_axis = config.by_axis()
        alone = frozenset(axis.name for axis in config.axes if axis.fault_holds == "own")
        arming = Arming(tuple(by_axis), alone, process.nonce)
        self.stops = Stops(
            self.say,
            arming,
            on_begin=self._on_stop_begun,
            on_failure=lambda why: self.black_box.want(why),  # noqa: PLW0108 (made below)
        )
        dependencies = AxisDependencies(
            services, self.stops, config.turns(), {}, self._guarded, self._on_finished
        )
        self.axes = {
            name: Axis(name, axis_config, openers[name], process, dependencies)
            for name, axis_config in by_axis.items()
        }
        self.groups = Groups(self.axes, self.say)
        self._at_once = max(1, _AT_ONCE // len(self.axes))
        self._period_ns = int(1e9 / max(a.config.link.rate_hz for a in self.axes.values()))

        def header(name: str) -> RunHeader:
            return run_header(
                config,
                name,
                {name: axis.watch.ident for name, axis in self.axes.items()},
                parameter_text=process.options.parameter_text,
                now_s=self._wall_clock(),
            )

        self.recorder = Recorder(config.recorder, header, self._wall_clock)
        self.black_box = BlackBox(
            config.recorder.black_box_s,
            Path(config.recorder.folder).absolute(),
            header,
            process.clocks,
            lambda text: self.say("record", text, {}),
        )
        self.publisher = Publisher(self.loop, config.telemetry)
        self.collector = IdleCollector(enabled=False)
        self._dead_man = DeadMan(int(config.daemon.dead_man_lease_s * 1e6))
        self._towards_clients(process, services)

    def _towards_clients(self, process: Process, services: Services) -> None:
        counts = CommandCounts()
        bench = Bench(
            config=self.config,
            axes=self.axes,
            stops=self.stops,
            groups=self.groups,
            recorder=self.recorder,
            black_box=self.black_box,
            lease=Lease(secrets.token_urlsafe),
            dead_man=self._dead_man,
            journal=self.journal,
            collector=self.collector,
            counts=counts,
            services=services,
        )
        self.status = StatusReport(bench)
        self.service = Service(bench, self.status)
        self.dispatcher = RequestDispatcher(
            self.service,
            counts,
            spawn=self.spawn,
            journal=self.journal,
            waiting=lambda: len(self._tasks),
        )
        self.server = CommandServer(
            process.context,
            Handlers(self.dispatcher.command, self.dispatcher.stop, self._look_at_ports),
            loop=self.loop,
            queue=self.config.daemon.command_queue,
            reserve=process.reserve,
        )
        self._rejections = RejectionLog(self.server, counts, self.say)

    def start(self, *, without_missing: bool = False) -> None:
        """Open the ports and begin. Raises PortError when one cannot be opened.

        `without_missing`: unless none can; those that cannot are tried again and again.
        """
        missing: list[PortError] = []
        for axis in self.axes.values():
            try:
                axis.link.open()
            except PortError as error:
                missing.append(error)
                if not without_missing or len(missing) == len(self.axes):
                    raise
                axis.services.say("warning", f"begun without its board: {error}", {})
                axis.link.open_later()
        self._housekept_s = time.monotonic()
        self._housekeep()

    def say(self, kind: EventKind, text: str, data: dict[str, Any]) -> None:
        """Put an event into the run log and, unless it is a mere command, into the journal."""
        if kind not in ("command", "note"):
            self.journal.say(text, kind)
        event = Event(
            t_s=self._board_time_s(),
            host_time_s=self._wall_clock(),
            kind=kind,
            text=text,
            data=data,
        )
        self.recorder.note(event)
        self.black_box.note(event)

    def _board_time_s(self) -> float | None:
        """Board time, where there is one board to tell it."""
        lasts = [axis.control.last for axis in self.axes.values()]
        return lasts[0].sample.t_us * 1e-6 if len(lasts) == 1 and lasts[0] is not None else None

    def _look_at_ports(self) -> None:
        for axis in self.axes.values():
            axis.link.read()

    def spawn(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        """Run something beside the loop; if it dies, the daemon does."""
        task = self.loop.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(self._task_done)

    def fail(self, name: str, error: BaseException) -> None:
        """A part died: no step is taken any more, and `failure` is set."""
        for axis in self.axes.values():
            axis.control.stepping = False
        if not self.failure.done():
            self.failure.set_result((name, error))

    async def disarm(self) -> str:
        """End heating for good; return what came of it, in words. Never raises."""
        self.service.stopping = True
        quiet = {name: _needs_no_stop(axis) for name, axis in self.axes.items()}
        hot = [axis for axis in self.axes.values() if axis.hot]
        if not all(quiet.values()):
            self.stops.begin("the daemon is ending", by="the end of the daemon")
        outcomes = {
            name: quiet[name] or await _disarmed(axis, armed=axis in hot)
            for name, axis in self.axes.items()
        }
        await self.dispatcher.until_replied(LAST_REPLIES_S)
        if len(set(outcomes.values())) == 1:
            return next(iter(outcomes.values()))
        return "; ".join(f"{name}: {came_of_it}" for name, came_of_it in outcomes.items())

    async def close(self) -> None:
        """Give everything back. The board must have been disarmed."""
        if self._housekeeping is not None:
            self._housekeeping.cancel()
        await self.recorder.stop()
        self.dispatcher.give_up()
        self.server.close()
        self.recorder.close()
        self.black_box.close()
        for axis in self.axes.values():
            axis.link.close()
        self.publisher.close()
        # What is cancelled may begin more: an arming that is taken back asks the board to disarm.
        while self._tasks:
            for task in tuple(self._tasks):
                task.cancel()
            # Not `gather`: since Python 3.12 it returns before the loop calls `_task_done`.
            await asyncio.wait(self._tasks)

    def _task_done(self, task: asyncio.Task[Any]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self.fail(task.get_name(), error)

    def _guarded(self, name: str, work: Callable[..., None], *arguments: Any) -> None:
        try:
            work(*arguments)
        except Exception as error:
            self.fail(name, error)

    def _on_stop_begun(self, stopped: Sequence[BoardStop]) -> None:
        names = [board.label for board in stopped]
        self.groups.forget(names)
        self._dead_man.forget(names)
        self.server.mark()

    def _on_finished(self) -> None:
        if not self._publishing:
            self._publishing = True
            self.loop.call_soon(self._guarded, "telemetry", self._publish)

    def _publish(self) -> None:
        self._publishing = False
        for name, axis in self.axes.items():
            for row, stamp_s in axis.finished(self._at_once):
                self.publisher.publish(row, stamp_s, name)
                self.recorder.row(row, name, stamp_s)
                self.black_box.row(row, name, stamp_s)
        self.groups.look()
        self.notifier.alive(self._clock_us())
        if any(axis.control.finished for axis in self.axes.values()):
            self._on_finished()
        else:
            armed = any(a.session.state is HostState.RUNNING for a in self.axes.values())
            self.collector.run(int(self._period_ns * _SPARE_SHARE), at_rest=not armed)

    def _housekeep(self) -> None:
        self._housekeeping = self.loop.call_later(HOUSEKEEPING_S, self._housekeep)
        self._guarded("housekeeping", self._housekeep_once)

    def _housekeep_once(self) -> None:
        now_us = self._clock_us()
        self._notice_stall()
        for axis in self.axes.values():
            axis.tick()
        self.server.wake()
        if not any(axis.connected for axis in self.axes.values()):
            self.notifier.alive(now_us)
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

    def _each_second(self) -> None:
        self.status.refresh()
        self.status.telemetry_dropped = self.publisher.dropped
        counters = LinkSample(host_time_s=self._wall_clock(), counters=self.status.link_counters())
        self.recorder.note(counters)
        self.black_box.note(counters)
        if self.black_box.due:
            self.spawn("black box", self.black_box.write_wanted())
        self._rejections.report()
        self.recorder.look()
        error = self.recorder.failure()
        if error and error != self._recorder_error:
            self.journal.say(f"recording failed: {error}")
        self._recorder_error = error

    def _end_automatic_log(self, now_us: int) -> None:
        at_rest = all(
            not axis.hot and axis.watch.mode in (None, BoardState.SAFE, *STOPPED)
            for axis in self.axes.values()
        )
        if not self.recorder.ends_by_itself or not at_rest:
            self._left_hot_us = None
        elif self._left_hot_us is None:
            self._left_hot_us = now_us
        elif now_us - self._left_hot_us > 2 * _SECOND_US:
            self._left_hot_us = None
            self.spawn("recorder", self.recorder.stop())


def _needs_no_stop(axis: Axis) -> str:
    """Say why a board is not told to stop when the daemon ends; nothing where it is."""
    if not axis.connected:
        return "the board is not connected; its own watchdog ends heating"
    if axis.watch.incompatible is not None:
        return "the board was only watched, nothing was armed"
    return "the board has stopped already" if axis.session.state is HostState.FAULTED else ""


async def _disarmed(axis: Axis, *, armed: bool) -> str:
    """Wait for the stop of a board; return what came of it, in words. Never raises."""
    try:
        # Whatever died may be what lets the time of the wait itself run out.
        await asyncio.wait_for(axis.stop.until_confirmed(), 2.0)
        # Without a session nothing is waited for, and nothing was confirmed.
        unconfirmed = "" if axis.connected else "the link was lost"
    except Refusal as refusal:
        unconfirmed = refusal.cause
    except TimeoutError:
        unconfirmed = "no answer within 2 s"
    if not armed:
        return "nothing was armed"
    if unconfirmed:
        return f"the board did not confirm the disarm ({unconfirmed}); its watchdog ends heating"
    return "disarmed, the board cools by itself"
