"""The sections of the configuration: names with units, ranges, defaults and what each is for.

The descriptions here and in `control` are the only ones: the commented default file, the guide's
sections and the error messages are made from them. Every float has both bounds, because it is the
bounds that keep NaN and infinity out.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field, structs

from smad.config.axes import (
    DEGREES_PER_MM,
    OF_THE_BENCH,
    USUAL_NAMES,
    AxisConfig,
    SegmentConfig,
    coupling_of,
    inverse,
)
from smad.config.control import ControlConfig, LimitsConfig
from smad.config.curve_key import KEY_CHARACTERS, is_curve_key
from smad.config.hooks import HooksConfig
from smad.config.section import HOST, Section, about, between
from smad.errors import ConfigError


class LinkConfig(Section, frozen=True, kw_only=True):
    """The serial link to the board."""

    port: Annotated[
        str, about("device of the board, best /dev/serial/by-id/…; empty: ask for it")
    ] = ""
    baud: Annotated[int, between(9600, 12_000_000, "bits per second")] = 115200
    rate_hz: Annotated[Literal[100, 250, 500], about("samples, and control steps, per second")] = (
        100
    )
    axis: Annotated[
        int,
        between(0, 15, "which antagonistic pair of the board to drive; several boards: `[[axes]]`"),
    ] = 0
    setpoint_ttl_ms: Annotated[
        int,
        between(20, HOST.setpoint_ttl_ms, "the board holds current 0 after so long without one"),
    ] = 100
    connect_timeout_s: Annotated[
        float, between(0.1, 60.0, "give up on the first handshake after so long")
    ] = 5.0
    reconnect_interval_s: Annotated[
        float, between(0.05, 60.0, "wait between two attempts to reopen the port")
    ] = 0.5


class TcpConfig(Section, frozen=True, kw_only=True):
    """Commands from other machines, encrypted (CURVE) and only for the keys listed."""

    enabled: Annotated[bool, about("listen on TCP as well as on ipc")] = False
    host: Annotated[str, Meta(min_length=1, description="address to listen on")] = "127.0.0.1"
    command_port: Annotated[int, between(1024, 65535, "TCP port, commands")] = 5581
    stop_port: Annotated[int, between(1024, 65535, "TCP port, stop channel")] = 5582
    secret_key_file: Annotated[
        str, about("file with the server's CURVE keys; empty: in the ipc folder")
    ] = ""
    allowed_keys: Annotated[
        tuple[str, ...], about("public keys (Z85, 40 characters) of the clients let in")
    ] = ()

    def __post_init__(self) -> None:
        Section.__post_init__(self)
        for number, key in enumerate(self.allowed_keys, start=1):
            if not is_curve_key(key):
                raise ValueError(
                    f"`allowed_keys`, entry {number} of {len(self.allowed_keys)} is not a key; "
                    f"got {key!r}; allowed: {KEY_CHARACTERS} characters of Z85; "
                    "copy the public key that `smad keys` printed"
                )
        if self.enabled and not self.allowed_keys:
            raise ValueError("`enabled` with an empty `allowed_keys` lets nobody in; list a key")
        if self.command_port == self.stop_port:
            raise ValueError(f"`command_port` and `stop_port` are both {self.stop_port}")


class DaemonConfig(Section, frozen=True, kw_only=True):
    """Where the daemon answers commands, and when it stops by itself."""

    ipc_dir: Annotated[str, about("folder of sockets and lock; empty: $XDG_RUNTIME_DIR/smad")] = ""
    bench: Annotated[
        str,
        Meta(
            pattern=r"^[A-Za-z0-9_-]{1,32}\Z",
            description="name of this bench, in the names of its sockets",
        ),
    ] = "bench"
    dead_man_lease_s: Annotated[
        float, between(0.0, 3600.0, "disarm when the arming client is silent; 0: never")
    ] = 0.0
    command_queue: Annotated[
        int, between(1, 100_000, "commands waiting before clients are held back")
    ] = 1000
    tcp: TcpConfig = field(default_factory=TcpConfig)


class TelemetryConfig(Section, frozen=True, kw_only=True):
    """The stream for PlotJuggler and other viewers."""

    enabled: Annotated[bool, about("publish samples")] = True
    endpoint: Annotated[
        str, about("tcp://host:port to publish on as well as on ipc; empty: ipc only")
    ] = "tcp://127.0.0.1:9872"
    every_nth_sample: Annotated[int, between(1, 1000, "1 publishes all, 10 every tenth")] = 1
    high_water_mark: Annotated[
        int, between(1, 1_000_000, "samples kept for a slow viewer, then dropped")
    ] = 1000


class RecorderConfig(Section, frozen=True, kw_only=True):
    """The run log."""

    folder: Annotated[str, Meta(min_length=1, description="where the logs go")] = "runs"
    automatic: Annotated[bool, about("record from arming to disarming")] = True
    max_file_MB: Annotated[float, between(1.0, 100_000.0, "start a new file at this size")] = 512.0
    max_file_min: Annotated[float, between(0.1, 60.0, "start a new file after so many minutes")] = (
        60.0
    )
    flush_interval_s: Annotated[float, between(0.05, 10.0, "what a crash can cost at most")] = 0.25
    queue_rows: Annotated[
        int, between(100, 1_000_000, "rows kept for a slow disk, then dropped")
    ] = 20_000
    black_box_s: Annotated[
        float, between(0.0, 600.0, "kept in memory, written after a fault; 0: nothing")
    ] = 60.0


class RealtimeConfig(Section, frozen=True, kw_only=True):
    """Real-time measures. smad takes each that the system grants; `smad status` lists them."""

    fifo_priority: Annotated[int, between(0, 95, "SCHED_FIFO priority; 0: ordinary scheduling")] = (
        80
    )
    lock_memory: Annotated[bool, about("keep all memory resident (mlockall)")] = True
    timer_slack_ns: Annotated[
        int, between(1, 50_000_000, "how late the kernel may fire a timer")
    ] = 1
    freeze_gc: Annotated[bool, about("collect garbage only while idle, never during a step")] = True
    hold_cpu_latency: Annotated[
        bool, about("keep the processor out of deep sleep (/dev/cpu_dma_latency)")
    ] = False


class PlantConfig(Section, frozen=True, kw_only=True):
    """The simulated bench of `smad start --sim` and `smad sim`."""

    parameter_file: Annotated[str, about("TOML parameter file; empty: the built-in set A")] = ""
    variant: Annotated[
        Literal["extended", "printed"], about("thermal model: with tube water, or not")
    ] = "extended"
    fixture: Annotated[
        Literal["antagonistic", "stretch", "blocked"], about("how springs are mounted")
    ] = "antagonistic"
    seed: Annotated[int, between(0, 2**32 - 1, "of all noise")] = 0
    speed_ratio: Annotated[float, between(0.01, 100.0, "board time over wall time")] = 1.0
    effects: Annotated[
        dict[str, dict[str, Annotated[float, Meta(ge=-1e12, le=1e12)]]],
        about("effects switched on: a table each, [plant.effects.NAME]"),
    ] = field(default_factory=dict)


class Config(Section, frozen=True, kw_only=True):
    """The whole configuration. `Config()` is complete: every key has a default."""

    link: LinkConfig = field(default_factory=LinkConfig)
    control: ControlConfig = field(default_factory=ControlConfig)
    limits: LimitsConfig = field(default_factory=LimitsConfig)
    daemon: DaemonConfig = field(default_factory=DaemonConfig)
    telemetry: TelemetryConfig = field(default_factory=TelemetryConfig)
    recorder: RecorderConfig = field(default_factory=RecorderConfig)
    realtime: RealtimeConfig = field(default_factory=RealtimeConfig)
    plant: PlantConfig = field(default_factory=PlantConfig)
    hooks: HooksConfig = field(default_factory=HooksConfig)
    axes: tuple[AxisConfig, ...] = ()
    segments: tuple[SegmentConfig, ...] = ()

    def __post_init__(self) -> None:
        for key in ("name", "port"):
            values = [getattr(axis, key) for axis in self.axes if getattr(axis, key)]
            twice = next((value for value in values if values.count(value) > 1), None)
            if twice is not None:
                board = ": a board drives one axis" if key == "port" else ""
                raise ValueError(f"`axes`: two have the {key} {twice!r}; give each its own{board}")

    def by_axis(self) -> dict[str, Config]:
        """Return the configuration of each axis by its name; of a bench of one, itself by ""."""
        return {axis.name: self._of(axis) for axis in self.axes} or {"": self}

    def turns(self) -> dict[str, dict[str, float]]:
        """Return by how many degrees 1 mm of each tendon turns the joint of each axis; no zeros.

        Raises ConfigError for a coupling that does not fit or has no inverse.
        """
        gains: dict[str, float] = {}
        for segment in self.segments:
            gains[segment.pitch] = segment.pitch_sign * segment.gain_deg_per_mm
            gains[segment.yaw] = segment.yaw_sign * segment.gain_deg_per_mm
        names = [axis.name for axis in self.axes]
        rows = zip(names, inverse(coupling_of(self.axes)), strict=True)
        return {
            name: {
                other: gains.get(name, DEGREES_PER_MM) * share
                for other, share in zip(names, row, strict=True)
                if share
            }
            for name, row in rows
        } or {"": {"": DEGREES_PER_MM}}

    def with_axes(self, count: int | None) -> Config:
        """Return it with so many axes: the first that it has, or those of MINIR-II.

        None leaves it as it is, and so does 1 where it has none. Raises ConfigError when it has
        fewer.
        """
        if count is None or (count == 1 and not self.axes):
            return self
        axes = self.axes or tuple(AxisConfig(name=name) for name in USUAL_NAMES)
        if count > len(axes):
            raise ConfigError(
                "the configuration has too few axes",
                value=count,
                limit=len(axes),
                action="add an [[axes]] table for each missing axis",
            )
        first_axes = [
            structs.replace(axis, coupling=axis.coupling[:count]) for axis in axes[:count]
        ]
        return structs.replace(self, axes=tuple(first_axes))

    def _of(self, axis: AxisConfig) -> Config:
        changed: dict[str, dict[str, object]] = {}
        for name, (section, key) in OF_THE_BENCH.items():
            if (value := getattr(axis, name)) is not None:
                changed.setdefault(section, {})[key] = value
        sections = {
            section: structs.replace(getattr(self, section), **values)
            for section, values in changed.items()
        }
        return structs.replace(self, axes=(axis,), **sections)
