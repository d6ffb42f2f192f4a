"""What `smad status` shows, put together from the parts; percentiles once a second."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable
from dataclasses import dataclass

from firmware_protocol.enums import Limiter, faults_in, warnings_in
from firmware_protocol.events import HostState
from smad import api
from smad.config import Config
from smad.control.limits import HostLimit
from smad.daemon.boardside import BoardSide
from smad.daemon.command.lease import Lease
from smad.daemon.control import Finished
from smad.daemon.journal import Journal
from smad.daemon.link.board import board_of
from smad.daemon.realtime import IdleCollector
from smad.daemon.telemetry.recorder import Recorder
from smad.runlog.rows import row_of
from smad.runlog.schema import Row
from smad.version import VERSION

_MIB = 2**20
_PAGE = os.sysconf("SC_PAGE_SIZE")


class CommandCounts:
    """Commands carried out and refused."""

    def __init__(self) -> None:
        self.done = 0
        self.refused = 0
        self.malformed = 0
        """Of those refused, messages that were no command at all."""


@dataclass(frozen=True)
class Own:
    """What the daemon knows of itself."""

    journal: Journal
    collector: IdleCollector
    commands: CommandCounts


class StatusReport:
    """Builds replies about the state of the bench; changes nothing."""

    def __init__(
        self,
        config: Config,
        board: BoardSide,
        recorder: Recorder,
        *,
        lease: Lease,
        own: Own,
        clock_us: Callable[[], int],
    ) -> None:
        self.measures: tuple[api.Measure, ...] = ()
        self.notes: list[str] = []
        self.telemetry_dropped = 0
        self._config = config
        self._control = board.control
        self._watch = board.watch
        self._link = board.link
        self._recorder = recorder
        self._lease = lease
        self._host_stop = board.host_stop
        self._stops = board.stops
        self._journal = own.journal
        self._collector = own.collector
        self._commands = own.commands
        self._clock_us = clock_us
        self._started_us = clock_us()
        self._resident_MiB = 0.0
        self._timing = self._measured_timing()

    def refresh(self) -> api.Timing:
        """Work the percentiles out anew."""
        self._timing = self._measured_timing()
        return self._timing

    def motion(self) -> api.Motion:
        """Return what the controller is doing."""
        controller = self._control.controller
        last = self._control.last
        # The host stops first: what the board finds afterwards follows from it.
        fault = self._host_stop.fault or self._watch.fault
        return api.Motion(
            running=controller.mode,
            done=controller.done and fault is None,
            armed=self._control.session.state is HostState.RUNNING,
            mode=self._watch.mode.name if self._watch.mode is not None else "UNKNOWN",
            reference_mm=_mm(controller.reference_m),
            displacement_mm=None if last is None else _mm(last.sample.displacement_m),
            board_time_s=0.0 if last is None else last.sample.t_us * 1e-6,
            ended=self._stops.ended
            or ("" if controller.departure is None else controller.departure.in_words()),
            fault=fault,
            generation=self._stops.generation,
        )

    def lease(self, secret: str) -> api.Control:
        """Return who has exclusive control."""
        now_us = self._clock_us()
        holder = self._lease.holder(now_us)
        if holder is None:
            return api.Control()
        return api.Control(
            holder=holder.name,
            left_s=(holder.until_us - now_us) * 1e-6,
            yours=holder.secret == secret,
        )

    def full(self, secret: str) -> api.Status:
        """Return everything."""
        last = self._control.last
        state = None if last is None else last.state
        return api.Status(
            bench=self._config.daemon.bench,
            version=VERSION,
            pid=os.getpid(),
            uptime_s=(self._clock_us() - self._started_us) * 1e-6,
            memory_MiB=self._memory_MiB(),
            link=self._link_status(),
            board=self._board(),
            motion=self.motion(),
            gains=self._control.controller.gains,
            limiter=self._limiter(),
            faults=() if state is None else tuple(f.name for f in faults_in(state.faults)),
            warnings=() if state is None else tuple(w.name for w in warnings_in(state.warnings)),
            sample=None if last is None else self.row(last),
            counts=self._counts(),
            timing=self._timing,
            realtime=self.measures,
            recorder=self._recorder.status(),
            control=self.lease(secret),
            events=tuple(self._journal.recent),
        )

    @staticmethod
    def row(finished: Finished) -> Row:
        """Return a finished sample as a row of the run log."""
        return row_of(
            finished.sample,
            finished.state,
            finished.setpoint,
            host_time_s=finished.host_s,
            reference_m=finished.reference_m,
            reference_degC=finished.reference_degC,
            pump_starts=finished.pump_starts,
        )

    def _board(self) -> api.Board | None:
        ident = self._watch.ident
        if ident is None:
            return None
        return board_of(
            ident, self._watch.parameters, schema_agrees=self._watch.incompatible is None
        )

    def _limiter(self) -> str:
        last = self._control.last
        board = "none" if last is None else Limiter(last.state.limiter).name.lower()
        acting = self._control.controller.limiting
        if acting is HostLimit.NONE:
            return board
        names = ", ".join(str(limit.name).lower() for limit in HostLimit if limit & acting)
        return f"{board}; host: {names}"

    def _counts(self) -> api.Counts:
        counts = self._control.counts
        return api.Counts(
            samples=counts.samples,
            missed=self._control.session.stats.missed_states,
            skipped=counts.skipped,
            setpoints=counts.setpoints,
            setpoints_dropped=counts.setpoints_dropped,
            setpoints_refused=self._watch.stats.get("stale_setpoints", 0),
            commands=self._commands.done,
            refused=self._commands.refused,
            telemetry_dropped=counts.finished_dropped + self.telemetry_dropped,
        )

    def _measured_timing(self) -> api.Timing:
        control = self._control
        fit = control.session.clock
        return api.Timing(
            own_share=control.own_share.percentiles(),
            setpoint_age=control.setpoint_age.percentiles(),
            jitter=control.jitter.percentiles(),
            round_trip_us=None if fit is None else float(fit.round_trip_us),
            collections=self._collector.collections,
        )

    def _memory_MiB(self) -> float:
        # Without a descriptor to look with, it is what it was.
        with contextlib.suppress(OSError):
            self._resident_MiB = _resident_bytes() / _MIB
        return self._resident_MiB

    def link_counters(self) -> dict[str, float]:
        """Return what the run log keeps about the link once a second: host's and board's counts."""
        timing, counts = self._timing, self._control.counts
        return {
            **{f"host_{name}": float(value) for name, value in self._frames().items()},
            **{f"board_{name}": float(value) for name, value in self._watch.stats.items()},
            "missed_samples": float(self._control.session.stats.missed_states),
            "skipped_samples": float(counts.skipped),
            "setpoints_dropped": float(counts.setpoints_dropped),
            "commands_refused": float(self._commands.refused),
            "setpoint_age_p99_us": timing.setpoint_age.p99_us,
            "own_share_p99_us": timing.own_share.p99_us,
        }

    def _frames(self) -> dict[str, int]:
        stats = self._control.session.stats
        return {
            name: value
            for part in (stats.decoder, stats)
            for name in part.__struct_fields__
            if isinstance(value := getattr(part, name), int)
        }

    def _link_status(self) -> api.LinkStatus:
        link, config = self._link, self._config.link
        notes = () if link.transport is None else link.transport.notes
        return api.LinkStatus(
            port=config.port,
            baud=config.baud,
            rate_hz=config.rate_hz,
            state=self._control.session.state.name.lower(),
            notes=(*notes, *self.notes),
            bytes_in=link.counts.bytes_in,
            bytes_out=link.counts.bytes_out,
            short_writes=link.counts.short_writes,
            losses=link.counts.losses,
            frames=self._frames(),
            board_stats=self._watch.stats,
        )


def _mm(metres: float) -> float | None:
    return None if math.isnan(metres) else metres * 1e3


def _resident_bytes() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * _PAGE
