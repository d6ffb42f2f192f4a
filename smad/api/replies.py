"""What the daemon answers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType, structs

from smad.control.commands import Tune
from smad.runlog.schema import Row
from smad.units import in_words


class Percentiles(Struct, frozen=True):
    """Percentiles of a duration over `count` samples."""

    count: Annotated[int, Meta(description="number of samples")] = 0
    p50_us: Annotated[float, Meta(description="median, microseconds")] = 0.0
    p99_us: Annotated[float, Meta(description="99th percentile, microseconds")] = 0.0
    p999_us: Annotated[float, Meta(description="99.9th percentile, microseconds")] = 0.0
    max_us: Annotated[float, Meta(description="longest, microseconds")] = 0.0


class Measure(Struct, frozen=True):
    """One real-time measure: whether it was asked for and granted, and what exactly was got."""

    name: Annotated[str, Meta(description="what it is")]
    asked: Annotated[bool, Meta(description="wanted by the configuration")]
    granted: Annotated[bool, Meta(description="in force")]
    detail: Annotated[str, Meta(description="what was got, or why not")]


class Entry(Struct, frozen=True):
    """One event of the daemon's journal."""

    time_s: Annotated[float, Meta(description="Unix time, seconds")]
    text: Annotated[str, Meta(description="what happened")]
    kind: Annotated[
        str, Meta(description="what sort of event, as in a run log; empty: none of them")
    ] = ""


READ_AS = {
    "cC": ("°C", 0.01), "cC/s": ("°C/s", 0.01), "mA": ("A", 1e-3), "mV": ("V", 1e-3),
    "mJ": ("J", 1e-3), "us": ("s", 1e-6), "uN": ("mN", 1e-3), "nm": ("µm", 1e-3)
}  # fmt: skip
"""Units of the wire, what a person reads in their place, and how many of these one of them is."""


def as_read(value: float, unit: str) -> str:
    """Return a value in a unit of the wire as a person reads it."""
    read_unit, scale = READ_AS.get(unit, (in_words(unit), 1.0))
    return f"{value * scale:g} {read_unit}".rstrip()


class Fault(Struct, frozen=True, kw_only=True):
    """What stopped the bench: the fault that the board latched first, or a limit of the host."""

    number: Annotated[int, Meta(description="its number, for `clear`")]
    name: Annotated[str, Meta(description="its name, for `smad faults explain`")]
    by: Annotated[Literal["board", "host"], Meta(description="who stopped the bench")] = "board"
    channel: Annotated[str, Meta(description="where it was measured")] = ""
    measured: Annotated[float | None, Meta(description="what was measured")] = None
    limit: Annotated[float | None, Meta(description="the limit it went beyond")] = None
    unit: Annotated[str, Meta(description="unit of both")] = ""

    def in_words(self) -> str:
        """Return it in one line: name, place, value, limit."""
        seen = "" if self.measured is None else f": {as_read(self.measured, self.unit)}"
        limit = "" if self.limit is None else f", limit {as_read(self.limit, self.unit)}"
        where = f" at {self.channel}" if self.channel else ""
        return f"{self.name}{where}{seen}{limit}"


class Board(Struct, frozen=True, kw_only=True):
    """Who answers at the other end of the cable."""

    uid: Annotated[str, Meta(description="serial number")]
    firmware: Annotated[str, Meta(description="version text")]
    protocol: Annotated[str, Meta(description="version of the wire protocol")]
    reset_cause: Annotated[str, Meta(description="why it last started")]
    boot_count: Annotated[int, Meta(description="how often it has started")]
    capabilities: Annotated[
        tuple[str, ...], Meta(description="sensors and parts it has, as in docs/protocol.md")
    ]
    schema_agrees: Annotated[bool, Meta(description="same messages as ours; needed to arm")]
    params_agree: Annotated[
        bool | None, Meta(description="same parameters as ours; empty: not read yet")
    ]


class LinkStatus(Struct, frozen=True, kw_only=True):
    """The serial link."""

    port: Annotated[str, Meta(description="device, as configured")]
    baud: Annotated[int, Meta(description="bits per second")]
    rate_hz: Annotated[int, Meta(description="samples per second, as configured")]
    state: Annotated[str, Meta(description="disconnected, sync, monitor, ready, running, faulted")]
    notes: Annotated[tuple[str, ...], Meta(description="what the port did not grant")]
    bytes_in: Annotated[int, Meta(description="bytes read")]
    bytes_out: Annotated[int, Meta(description="bytes written")]
    short_writes: Annotated[int, Meta(description="writes the port took only in part, or not")]
    losses: Annotated[int, Meta(description="times the port went away")]
    frames: Annotated[dict[str, int], Meta(description="the session's counts of frames and errors")]
    board_stats: Annotated[
        dict[str, int], Meta(description="the board's own counts, about once a second")
    ]


class Counts(Struct, frozen=True, kw_only=True):
    """Totals since the daemon started."""

    samples: Annotated[int, Meta(description="samples received")]
    missed: Annotated[int, Meta(description="samples of a session that never reached us")]
    skipped: Annotated[int, Meta(description="samples passed over because a newer one was there")]
    setpoints: Annotated[int, Meta(description="setpoints written")]
    setpoints_dropped: Annotated[int, Meta(description="setpoints the port did not take")]
    setpoints_refused: Annotated[
        int, Meta(description="setpoints too old for the board since it booted; they have no age")
    ]
    commands: Annotated[int, Meta(description="commands carried out")]
    refused: Annotated[int, Meta(description="commands refused")]
    telemetry_dropped: Annotated[int, Meta(description="samples not published, queue full")]


class Timing(Struct, frozen=True, kw_only=True):
    """How quick and how steady the control loop is; refreshed once a second."""

    own_share: Annotated[Percentiles, Meta(description="from STATE read to SETPOINT written")]
    setpoint_age: Annotated[
        Percentiles, Meta(description="age of a setpoint when the board applied it, board clock")
    ]
    jitter: Annotated[
        Percentiles, Meta(description="deviation of the interval between samples, host clock")
    ]
    round_trip_us: Annotated[float | None, Meta(description="last time exchange with the board")]
    collections: Annotated[int, Meta(description="garbage collections, all in idle time")]


def named(axis: str, name: str) -> str:
    """Return the name of something of an axis among those of all; of the only one, as it is."""
    return f"{axis}.{name}" if axis else name


def link_counters(
    axis: str, frames: dict[str, int], board_stats: dict[str, int], counts: Counts, timing: Timing
) -> dict[str, float]:
    """Return what the run log keeps about a link once a second: host's and board's counts."""
    counters = {
        **{f"host_{name}": float(value) for name, value in frames.items()},
        **{f"board_{name}": float(value) for name, value in board_stats.items()},
        "missed_samples": float(counts.missed),
        "skipped_samples": float(counts.skipped),
        "setpoints_dropped": float(counts.setpoints_dropped),
        "commands_refused": float(counts.refused),
        "setpoint_age_p99_us": timing.setpoint_age.p99_us,
        "own_share_p99_us": timing.own_share.p99_us,
    }
    return {named(axis, name): value for name, value in counters.items()}


class RecorderStatus(Struct, frozen=True, kw_only=True):
    """The run log being written."""

    recording: Annotated[bool, Meta(description="a log is open and takes rows")]
    path: Annotated[str, Meta(description="the file, or the last one; absolute")] = ""
    folder: Annotated[str, Meta(description="where run logs are written; absolute")] = ""
    rows: Annotated[int, Meta(description="samples written or waiting")] = 0
    dropped: Annotated[int, Meta(description="samples lost because the disk was too slow")] = 0
    error: Annotated[str, Meta(description="why recording stopped, if it failed")] = ""
    last: Annotated[str, Meta(description="the last minute, written after a fault; absolute")] = ""


class Control(Struct, frozen=True, kw_only=True):
    """Who has exclusive control."""

    holder: Annotated[str, Meta(description="name given with `control.take`; empty: nobody")] = ""
    left_s: Annotated[float, Meta(description="until the lease ends")] = 0.0
    yours: Annotated[bool, Meta(description="whether it is you")] = False
    lease: Annotated[
        str, Meta(description="secret of the client that took it: send it with each request")
    ] = ""


class Motion(Struct, frozen=True, kw_only=True):
    """What the controller is doing."""

    running: Annotated[str, Meta(description="idle, displacement, temperature, current, inputs")]
    done: Annotated[bool, Meta(description="everything commanded has been carried out")]
    armed: Annotated[bool, Meta(description="the daemon armed the board and has not disarmed it")]
    mode: Annotated[str, Meta(description="state of the board in its last sample")]
    reference_mm: Annotated[float | None, Meta(description="where displacement should be")]
    displacement_mm: Annotated[float | None, Meta(description="where it is")]
    board_time_s: Annotated[float, Meta(description="board time of the last sample")]
    sample_age_s: Annotated[
        float | None, Meta(description="seconds since the last sample; empty: none came yet")
    ] = None
    ended: Annotated[
        str,
        Meta(description='why the motion ended early, such as "stopped by …"; empty: it did not'),
    ] = ""
    fault: Annotated[Fault | None, Meta(description="the latched fault")] = None
    generation: Annotated[
        int,
        Meta(
            description="names the last stop; a request that carries it is refused after the next"
        ),
    ] = 0
    number: Annotated[
        int, Meta(description="names the motion of an axis; another one has been ended or replaced")
    ] = 0
    axes: Annotated[
        dict[str, Motion] | UnsetType, Meta(description="of a bench of several axes: each by name")
    ] = UNSET

    def in_words(self) -> str:
        """Return what runs, and whether it has ended, or what ended it early."""
        how = self.ended or ("stopped" if self.fault else "done")
        return f"{self.running}, {how if self.done or self.fault else 'under way'}"


def of_the_bench(motions: dict[str, Motion]) -> Motion:
    """Return what several axes do as one motion: done when all are, armed while one is."""

    def common(name: str) -> str:
        return ", ".join(dict.fromkeys(getattr(motion, name) for motion in motions.values()))

    def first(name: str) -> Any:
        return next((value for m in motions.values() if (value := getattr(m, name))), None)

    return Motion(
        running=common("running"),
        done=all(motion.done for motion in motions.values()),
        armed=any(motion.armed for motion in motions.values()),
        mode=common("mode"),
        reference_mm=None,
        displacement_mm=None,
        board_time_s=max(motion.board_time_s for motion in motions.values()),
        sample_age_s=max(
            (m.sample_age_s for m in motions.values() if m.sample_age_s is not None), default=None
        ),
        ended=first("ended") or "",
        fault=first("fault"),
        generation=max(motion.generation for motion in motions.values()),
        axes=motions,
    )


class AxisStatus(Struct, frozen=True, kw_only=True):
    """What concerns one axis: a part of the status of the bench."""

    link: Annotated[LinkStatus, Meta(description="the serial link")]
    board: Annotated[Board | None, Meta(description="the board; empty before the handshake")]
    motion: Annotated[Motion, Meta(description="what the controller is doing")]
    limiter: Annotated[str, Meta(description="what holds the current down")]
    faults: Annotated[tuple[str, ...], Meta(description="faults present")]
    warnings: Annotated[tuple[str, ...], Meta(description="warnings present")]
    sample: Annotated[Row | None, Meta(description="the last sample")]
    counts: Annotated[Counts, Meta(description="totals")]
    timing: Annotated[Timing, Meta(description="the loop's timing")]
    gains: Annotated[Tune, Meta(description="gains and options in force")] = Tune()
    obstacle: Annotated[
        str, Meta(description="what arming would be refused for now; empty: nothing known")
    ] = ""


class Status(AxisStatus, frozen=True, kw_only=True):
    """Everything about the bench now; facts of one axis are those of the first of several."""

    bench: Annotated[str, Meta(description="name of the bench")]
    version: Annotated[str, Meta(description="version of smad")]
    pid: Annotated[int, Meta(description="process of the daemon")]
    uptime_s: Annotated[float, Meta(description="seconds since it started")]
    memory_MiB: Annotated[float, Meta(description="resident memory of the daemon")]
    realtime: Annotated[tuple[Measure, ...], Meta(description="real-time measures")]
    recorder: Annotated[RecorderStatus, Meta(description="the run log")]
    control: Annotated[Control, Meta(description="exclusive control")]
    events: Annotated[tuple[Entry, ...], Meta(description="what happened last, oldest first")]
    axes: Annotated[
        dict[str, AxisStatus] | UnsetType, Meta(description="of a bench of several: each by name")
    ] = UNSET
    skew: Annotated[
        Percentiles | UnsetType,
        Meta(description="how far apart the boards began motions that begin together"),
    ] = UNSET

    def parts(self) -> dict[str, AxisStatus]:
        """Return what concerns each axis by its name; of a bench of one, all by the empty name."""
        return self.axes or {"": self}

    def of(self, axis: str) -> Status:
        """Return it as the status of a bench of this axis alone. Raises KeyError."""
        part = self.parts()[axis]
        shared = {name: getattr(part, name) for name in AxisStatus.__struct_fields__}
        return structs.replace(self, **shared, axes=UNSET)

    def _repr_html_(self) -> str:
        from smad import notebook

        row, motion, recorder = self.sample, self.motion, self.recorder
        readings = [
            (name, "" if (value := getattr(row, column, None)) is None else form.format(value))
            for name, column, form in _READINGS
        ]
        rows = [
            ("board", f"{motion.mode}, {'armed' if motion.armed else 'not armed'}"),
            ("fault", motion.fault.in_words() if motion.fault else ""),
            ("warnings", ", ".join(self.warnings)),
            ("motion", motion.in_words()),
            *readings,
            ("link", f"{self.link.state}, {self.link.rate_hz} Hz, {self.counts.missed} missed"),
            ("run log", recorder.path),
            ("in control", self.control.holder),
        ]
        return notebook.facts(f"Bench {self.bench}", rows)


_READINGS = (
    ("displacement", "displacement_mm", "{:.2f} mm"),
    ("force", "force_N", "{:.2f} N"),
    ("temperature X", "rtd_x_degC", "{:.1f} °C"),
    ("temperature Y", "rtd_y_degC", "{:.1f} °C"),
    ("current X", "i_meas_x_A", "{:.2f} A"),
    ("current Y", "i_meas_y_A", "{:.2f} A"),
    ("pump X", "duty_x", "{:.0%}"),
    ("pump Y", "duty_y", "{:.0%}"),
)


class ConfigText(Struct, frozen=True, kw_only=True):
    """The configuration in force."""

    toml: Annotated[str, Meta(description="as a file that `smad start --config` takes")]


class Param(Struct, frozen=True, kw_only=True):
    """One parameter of the board."""

    name: Annotated[str, Meta(description="its name")]
    value: Annotated[float, Meta(description="its value")]
    minimum: Annotated[float, Meta(description="smallest value the board takes")]
    maximum: Annotated[float, Meta(description="largest value the board takes")]
    unit: Annotated[str, Meta(description="unit of all three")] = ""
    description: Annotated[str, Meta(description="what it does")] = ""

    def in_words(self) -> str:
        """Return its value as it is named and set, and as a person reads it."""
        raw = f"{self.value:.10g} {in_words(self.unit)}".rstrip()
        if self.unit not in READ_AS:
            return raw
        unit, scale = READ_AS[self.unit]
        return f"{raw} = {self.value * scale:g} {unit}"


class ParamList(Struct, frozen=True, kw_only=True):
    """All parameters of the board."""

    params: Annotated[tuple[Param, ...], Meta(description="one entry each")]
