"""One axis: port, session, control task, what is known of its board, its stop; and its samples.

Nothing here knows how many axes there are. The one of a bench without `[[axes]]` has no name.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from msgspec import structs

from firmware_protocol.events import (
    BoardRestarted,
    Connected,
    FaultReported,
    HostEvent,
    HostState,
    LinkLost,
)
from firmware_protocol.host import HostSession
from firmware_protocol.messages import State
from smad.config import Config
from smad.control.controller import Controller
from smad.control.inputs import Departure
from smad.control.sample import Scales
from smad.daemon.boardstop import BoardStop
from smad.daemon.control import ControlOutputs, ControlTask, Finished
from smad.daemon.hoststop import HostStop, in_full
from smad.daemon.link.link import Link
from smad.daemon.link.port import Opener
from smad.daemon.link.requests import BoardRequests
from smad.daemon.link.watch import BoardWatch
from smad.daemon.process import Process
from smad.daemon.services import Services
from smad.daemon.stops import Stops
from smad.daemon.telemetry.stamps import Stamps
from smad.errors import CommandError
from smad.runlog.schema import Row

HOT = (HostState.RUNNING, HostState.READY)
AWAY = (HostState.DISCONNECTED, HostState.SYNC)


@dataclass(frozen=True)
class AxisDependencies:
    """What an axis needs from its bench.

    `turns` says by how many degrees 1 mm of each tendon turns each joint, `standing_mm` where each
    tendon was at its last sample; by axis. `guarded` carries work out under the name of a part,
    whose death ends the daemon; `on_finished` is called when a sample waits to be published.
    """

    services: Services
    stops: Stops
    turns: Mapping[str, Mapping[str, float]]
    standing_mm: dict[str, float]
    guarded: Callable[..., None]
    on_finished: Callable[[], None]


class Axis:
    """An antagonistic pair with its board: the parts put together."""

    def __init__(
        self, name: str, config: Config, opener: Opener, process: Process, bench: AxisDependencies
    ) -> None:
        self.name = name
        self.lead = f"{name}: " if name else ""
        """Begins what is said of it; empty for the only one."""
        self.config = config
        self.services = services = bench.services.named(name)
        self._guarded = bench.guarded
        self._turns = bench.turns[name]
        self._standing_mm = bench.standing_mm
        self._stamps = Stamps()
        self._reported_departure: Departure | None = None
        self.session = HostSession(
            nonce=process.nonce, patience=process.options.patience, axis=config.link.axis
        )
        self._other_axes = 0
        self.link = Link(
            opener,
            loop=process.loop,
            retry_s=config.link.reconnect_interval_s,
            on_bytes=self._on_bytes,
            on_open=self._on_open,
            on_lost=self._on_lost,
        )
        self.control = ControlTask(
            self.session,
            Controller(config.control, config.limits),
            config.link,
            ControlOutputs(self.link.write, self._on_event, bench.on_finished),
            process.clocks,
            trace=process.options.trace,
        )
        self.controller = self.control.controller
        self.requests = BoardRequests(self.session, services.clocks.us, self.control.flush)
        self.watch = BoardWatch(
            config.link,
            self.requests,
            services,
            baud=lambda: 0 if self.link.transport is None else self.link.transport.baud,
            on_scales=self._set_scales,
        )
        self.stop = BoardStop(
            bench.stops.arming,
            self.control,
            self.requests,
            self.watch,
            services,
            on_failure=bench.stops.board_failed,
        )
        bench.stops.boards.append(self.stop)
        self.host_stop = HostStop(self.controller)

    @property
    def connected(self) -> bool:
        """Whether a session with its board is open."""
        return self.session.state not in AWAY

    @property
    def hot(self) -> bool:
        """Whether its board is armed by us, or about to be."""
        return self.session.state in HOT

    def row(self, item: Finished) -> Row:
        """Return a sample as a row of the run log."""
        standing_mm = self._standing_mm
        standing_mm[self.name] = item.sample.displacement_m * 1e3
        row = item.row(self._turns.get(self.name, 0.0))
        if len(self._turns) > 1:
            turned = (k * standing_mm.get(name, math.nan) for name, k in self._turns.items())
            row.angle_deg = sum(turned)
        return row

    @contextmanager
    def naming_axis(self) -> Iterator[None]:
        """Name this axis, once, in what is refused inside the block."""
        try:
            yield
        except CommandError as error:
            if not error.cause.startswith(self.lead):
                error.cause = self.lead + error.cause
            raise

    def tick(self) -> None:
        """Let session and stop repeat what was not answered."""
        # What waits in the port must count before the session is asked whether anything came.
        self.link.read()
        self.control.tick()
        self.watch.tick(self.services.clocks.us())
        self.stop.tick()

    def finished(self, most: int) -> Iterator[tuple[Row, float]]:
        """Yield what was sampled and not published yet, `most` samples, with their Unix times."""
        for _ in range(min(len(self.control.finished), most)):
            item = self.control.finished.popleft()
            row = self.row(item)
            stamp_s = self._stamps.stamp(row.t_s, item.host_s, self._taken_s(item.state))
            if self._stamps.returned_s:
                self._report_clock_return(self._stamps.returned_s)
            yield row, stamp_s
            self.watch.on_state(item.state)
            self.stop.on_sample(item.state)
        self._report_host_stop()
        self._report_departure()

    def _on_bytes(self, data: bytes) -> None:
        self._guarded("control", self.control.receive, data)

    def _on_open(self) -> None:
        self._stamps.restart()
        self.control.opened()
        transport = self.link.transport
        if self.link.counts.opens > 1 and transport is not None:
            self.services.say("link", f"reopened {transport.name}; monitoring, not armed", {})

    def _on_lost(self, reason: str) -> None:
        self.control.lost()
        self.stop.link_lost("the link was lost")
        self.watch.port_lost(reason)

    def _on_event(self, event: HostEvent) -> None:
        if isinstance(event, BoardRestarted):
            self.stop.link_lost("the board restarted")
        elif isinstance(event, LinkLost):
            self.stop.link_lost(self._why_silent(event))
        self.watch.on_event(event)
        if isinstance(event, Connected):
            self.stop.connected()
        elif isinstance(event, FaultReported):
            self.stop.reported()

    def _why_silent(self, event: LinkLost) -> str:
        before, self._other_axes = self._other_axes, self.session.stats.other_axes
        if self._other_axes > before:
            why = f"the board sends samples of another axis than link.axis {self.config.link.axis}"
            self.services.say("warning", why, {"samples": self._other_axes - before})
            return why
        return f"the board sent nothing for {event.silent_us / 1000:.0f} ms"

    def _set_scales(self, scales: Scales) -> None:
        self.control.scales = scales

    def _taken_s(self, state: State) -> float | None:
        """Unix time when a sample was taken, by the fit of the clocks; None while unknown."""
        # In this order: a pause between the two readings makes the time too early, and no jump.
        wall_s, now_us = self.services.clocks.wall_s(), self.services.clocks.us()
        host_us = self.session.host_us(state.t_us)
        return None if host_us is None else wall_s + (host_us - now_us) * 1e-6

    def _report_clock_return(self, returned_s: float) -> None:
        text = (
            "the computer's clock had leapt ahead and is back; "
            f"timestamps of telemetry went back by {returned_s:.0f} s"
        )
        self.services.say("warning", text, {"returned_s": returned_s})

    def _report_host_stop(self) -> None:
        fault = self.host_stop.new_reason()
        if fault is not None:
            self.services.say("fault", f"the host stopped: {in_full(fault)}", structs.asdict(fault))
            self.stop.stop_after_failure(f"a limit of the host: {fault.name}")

    def _report_departure(self) -> None:
        departure = self.controller.departure
        if departure is not None and departure is not self._reported_departure:
            self.services.say("warning", f"repeated inputs were ended: {departure.in_words()}", {})
        self._reported_departure = departure
