"""What `smad status` shows, put together from the parts; percentiles once a second."""

import contextlib
import math
import os
from collections.abc import Sequence

from msgspec import UNSET
from msgspec.structs import asdict, replace

from firmware_protocol.enums import Limiter, faults_in, warnings_in
from firmware_protocol.events import HostState
from smad import api
from smad.control.limits import HostLimit
from smad.daemon.axis import Axis
from smad.daemon.command.bench import Bench
from smad.daemon.command.conditions import obstacle_to_arming
from smad.daemon.link.board import board_of
from smad.runlog.rows import millimetres
from smad.version import VERSION

_MIB = 2**20
_PAGE = os.sysconf("SC_PAGE_SIZE")


class StatusReport:
    """Builds replies about the state of the bench; changes nothing."""

    def __init__(self, bench: Bench) -> None:
        self.measures: tuple[api.Measure, ...] = ()
        self.notes: list[str] = []
        self.telemetry_dropped = 0
        self._bench = bench
        self._clock_us = bench.services.clocks.us
        self._started_us = self._clock_us()
        self._resident_MiB = 0.0
        self._timing: dict[str, api.Timing] = {}
        self.refresh()

    def refresh(self) -> None:
        """Work the percentiles out anew."""
        for name, axis in self._bench.axes.items():
            self._timing[name] = self._measured_timing(axis)

    def timing(self, axis: Axis) -> api.Timing:
        """Return the percentiles of an axis, as last worked out."""
        return self._timing[axis.name]

    def motion(self, axes: Sequence[Axis]) -> api.Motion:
        """Return what the controllers are doing: of one axis, or of several with each by name."""
        if len(axes) == 1:
            return self._motion(axes[0])
        return api.of_the_bench({axis.name: self._motion(axis) for axis in axes})

    def _motion(self, axis: Axis) -> api.Motion:
        controller = axis.controller
        last = axis.control.last
        # The host stops first: what the board finds afterwards follows from it.
        fault = axis.host_stop.fault or axis.watch.fault
        return api.Motion(
            running=controller.mode,
            done=controller.done and fault is None and not self._bench.groups.wait_for(axis.name),
            armed=axis.session.state is HostState.RUNNING,
            mode=axis.watch.mode.name if axis.watch.mode is not None else "UNKNOWN",
            reference_mm=_mm(controller.reference_m),
            displacement_mm=None if last is None else _mm(last.sample.displacement_m),
            board_time_s=0.0 if last is None else last.sample.t_us / 1e6,
            sample_age_s=None if last is None else (self._clock_us() - axis.control.last_us) * 1e-6,
            ended=axis.stop.ended
            or ("" if controller.departure is None else controller.departure.in_words()),
            fault=fault,
            generation=self._bench.stops.generation,
            number=self._bench.groups.ended[axis.name],
        )

    def recorder(self) -> api.RecorderStatus:
        """Return the state of the run log, and where the last minute was written last."""
        bench = self._bench
        return replace(bench.recorder.status(), last=bench.black_box.path)

    def lease(self, secret: str) -> api.Control:
        """Return who has exclusive control."""
        now_us = self._clock_us()
        holder = self._bench.lease.holder(now_us)
        if holder is None:
            return api.Control()
        return api.Control(
            holder=holder.name,
            left_s=(holder.until_us - now_us) * 1e-6,
            yours=holder.secret == secret,
        )

    def full(self, secret: str, axes: Sequence[Axis]) -> api.Status:
        """Return everything; of several axes each by name, too."""
        parts = {axis.name: self._of(axis) for axis in axes}
        several = len(parts) > 1
        return api.Status(
            bench=self._bench.config.daemon.bench,
            version=VERSION,
            pid=os.getpid(),
            uptime_s=(self._clock_us() - self._started_us) * 1e-6,
            memory_MiB=self._memory_MiB(),
            realtime=self.measures,
            recorder=self.recorder(),
            control=self.lease(secret),
            events=tuple(self._bench.journal.recent),
            **{**asdict(parts[axes[0].name]), "motion": self.motion(axes)},
            axes=parts if several else UNSET,
            skew=self._bench.groups.skew.percentiles() if several else UNSET,
        )

    def _of(self, axis: Axis) -> api.AxisStatus:
        last = axis.control.last
        state = None if last is None else last.state
        return api.AxisStatus(
            link=self._link_status(axis),
            board=_board(axis),
            motion=self._motion(axis),
            gains=axis.controller.gains,
            limiter=_limiter(axis),
            faults=() if state is None else tuple(f.name for f in faults_in(state.faults)),
            warnings=() if state is None else tuple(w.name for w in warnings_in(state.warnings)),
            sample=None if last is None else axis.row(last),
            counts=self._counts(axis),
            timing=self._timing[axis.name],
            obstacle=obstacle_to_arming(axis, self._bench.axes) or self._bench.recorder.obstacle,
        )

    def _counts(self, axis: Axis) -> api.Counts:
        counts = axis.control.counts
        return api.Counts(
            samples=counts.samples,
            missed=axis.session.stats.missed_states,
            skipped=counts.skipped,
            setpoints=counts.setpoints,
            setpoints_dropped=counts.setpoints_dropped,
            setpoints_refused=axis.watch.stats.get("stale_setpoints", 0),
            commands=self._bench.counts.done,
            refused=self._bench.counts.refused,
            telemetry_dropped=counts.finished_dropped + self.telemetry_dropped,
        )

    def _measured_timing(self, axis: Axis) -> api.Timing:
        control, fit = axis.control, axis.session.clock
        return api.Timing(
            own_share=control.own_share.percentiles(),
            setpoint_age=control.setpoint_age.percentiles(),
            jitter=control.jitter.percentiles(),
            round_trip_us=None if fit is None else float(fit.round_trip_us),
            collections=self._bench.collector.collections,
        )

    def _memory_MiB(self) -> float:
        # Without a descriptor to look with, it is what it was.
        with contextlib.suppress(OSError):
            self._resident_MiB = _resident_bytes() / _MIB
        return self._resident_MiB

    def link_counters(self) -> dict[str, float]:
        """Return what the run log keeps about the links once a second."""
        counters: dict[str, float] = {}
        for name, axis in self._bench.axes.items():
            counts, timing = self._counts(axis), self._timing[name]
            counters |= api.link_counters(name, _frames(axis), axis.watch.stats, counts, timing)
        return counters

    def _link_status(self, axis: Axis) -> api.LinkStatus:
        link, config = axis.link, axis.config.link
        notes = () if link.transport is None else link.transport.notes
        return api.LinkStatus(
            port=config.port,
            baud=config.baud,
            rate_hz=config.rate_hz,
            state=axis.session.state.name.lower(),
            notes=(*notes, *self.notes),
            bytes_in=link.counts.bytes_in,
            bytes_out=link.counts.bytes_out,
            short_writes=link.counts.short_writes,
            losses=link.counts.losses,
            frames=_frames(axis),
            board_stats=axis.watch.stats,
        )


def _board(axis: Axis) -> api.Board | None:
    ident = axis.watch.ident
    if ident is None:
        return None
    agrees = axis.watch.incompatible is None
    return board_of(ident, axis.watch.parameters, schema_agrees=agrees)


def _limiter(axis: Axis) -> str:
    last = axis.control.last
    board = "none" if last is None else Limiter(last.state.limiter).name.lower()
    acting = axis.controller.limiting
    if acting is HostLimit.NONE:
        return board
    names = ", ".join(str(limit.name).lower() for limit in HostLimit if limit & acting)
    return f"{board}; host: {names}"


def _frames(axis: Axis) -> dict[str, int]:
    stats = axis.session.stats
    return {
        name: value
        for part in (stats.decoder, stats)
        for name in part.__struct_fields__
        if isinstance(value := getattr(part, name), int)
    }


def _mm(metres: float) -> float | None:
    return None if math.isnan(metres) else millimetres(metres)


def _resident_bytes() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * _PAGE
