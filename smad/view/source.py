"""The bench as all pages see it: samples into feeds, the status twice a second, who is there."""

import time
from collections import deque
from collections.abc import Callable

from smad.api import Status
from smad.client.following import follow
from smad.client.wire import telemetry_of
from smad.config import Config
from smad.style import strips
from smad.view.feed import Feed
from smad.view.replies import Mark
from smad.view.state import MODES, NO_WORD, BenchState, Tile, bench_state

STATUS_EVERY_S = 0.5
SILENT_AFTER_S = 1.5
MOST_MARKS = 200


class Axis:
    """What is known of one axis; the only one has no name.

    `log_first_s` is when its samples in the run log begin, once that was read.
    """

    def __init__(self, name: str, clock_s: Callable[[], float]) -> None:
        self.name = name
        self.config = Config()
        self.feed = Feed(len(strips.CHANNELS), strips.MOTION)
        self.shown: BenchState | None = None
        self.now: tuple[float | None, ...] = ()
        self.mode: int | None = None
        self.reference_mm = 0.0
        self.log_first_s: float | None = None
        self._clock_s = clock_s
        self._last_sample_s = clock_s()

    @property
    def silent_s(self) -> float:
        """Seconds since the last sample, once they are too many; else 0."""
        silent = self._clock_s() - self._last_sample_s
        return silent if silent > SILENT_AFTER_S else 0.0

    @property
    def first_s(self) -> float | None:
        """Since when there is something to look back at; None while nothing has come."""
        return min(
            (t for t in (self.feed.first_s, self.log_first_s) if t is not None), default=None
        )

    @property
    def mode_name(self) -> str:
        """State of the board: that of the newest sample, as long as samples come."""
        if self.mode is not None and not self.silent_s:
            return MODES.get(self.mode, "")
        return "" if self.shown is None else self.shown.mode

    @property
    def tile(self) -> Tile:
        """What a bench of several axes shows of each."""

        def newest(channel: str) -> float | None:
            return self.now[strips.PLACES[channel]] if self.now and not self.silent_s else None

        return Tile(
            axis=self.name,
            mode=self.mode_name,
            running="" if self.shown is None else self.shown.running,
            trouble="" if self.shown is None or not (t := self.shown.trouble) else t.what,
            displacement_mm=newest("displacement_mm"),
            rtd_x_degC=newest("rtd_x_degC"),
            rtd_y_degC=newest("rtd_y_degC"),
        )

    def heard(self) -> None:
        """It is there now."""
        self._last_sample_s = self._clock_s()

    def on_sample(self, data: bytes) -> None:
        """Take over a sample. Raises msgspec.ValidationError for one that is none of ours."""
        sample = telemetry_of(data)
        self.now, self.mode = strips.values(sample), sample.mode
        self.heard()
        self.feed.add(sample.timestamp, self.now)


class Source:
    """One bench, seen by any number of pages. `axes` by name, the only one by the empty name.

    `why_away` says in a line why the daemon cannot be reached, and is empty while it can.
    `version` grows with every status, and with every failure to get one. `log_path` is the run log
    that is written or was last, `folder` where run logs are; both are empty until a status came.
    """

    def __init__(self, bench: str, clock_s: Callable[[], float] = time.monotonic) -> None:
        self.bench = bench
        self.axes = {"": Axis("", clock_s)}
        self.marks: deque[Mark] = deque(maxlen=MOST_MARKS)
        self.marks_set = 0
        self.log_path = self.folder = ""
        self.version = 0
        self.why_away = "the daemon has not answered yet"
        self.config = Config()
        self.clock_s = clock_s

    def axis(self, name: str) -> Axis:
        """Return the axis of a name, or else the first."""
        return self.axes.get(name) or next(iter(self.axes.values()))

    @property
    def several(self) -> bool:
        """Whether the axes have names."""
        return "" not in self.axes

    @property
    def armed(self) -> bool:
        """Whether any axis was armed at the last status."""
        return any(axis.shown is not None and axis.shown.armed for axis in self.axes.values())

    def mark(self, text: str) -> None:
        """Mark the newest sample on the strips of all pages."""
        last_s = max(axis.feed.last_s for axis in self.axes.values())
        if last_s > 0.0:
            self.marks.append(Mark(round(last_s, 3), text))
            self.marks_set += 1

    async def run(self) -> None:
        """Follow the bench for ever."""
        await follow(self.bench, self, STATUS_EVERY_S)

    def on_config(self, config: Config) -> None:
        """Take over a configuration; axes that stay keep their past."""
        self.config = config
        axis_configs = config.by_axis()
        self.axes = {name: self.axes.get(name) or Axis(name, self.clock_s) for name in axis_configs}
        for name, axis in self.axes.items():
            axis.config = axis_configs[name]
            axis.heard()

    def on_sample(self, axis: str, data: bytes) -> None:
        """Take over a sample. Raises msgspec.ValidationError for one that is none of ours."""
        self.axes[axis].on_sample(data)

    def on_status(self, status: Status) -> None:
        """Take over what the daemon says of itself."""
        recorder = status.recorder
        for name, axis in self.axes.items():
            axis_status = status.of(name)
            axis.shown = bench_state(axis_status)
            if axis.shown.mode == NO_WORD:
                # The daemon missed the board sooner than we miss its samples.
                axis.mode = None
            motion = axis_status.motion
            followed = motion.reference_mm is not None
            axis.reference_mm = (motion.reference_mm if followed else motion.displacement_mm) or 0.0
            if recorder.path != self.log_path:
                axis.log_first_s = None
        self.log_path, self.folder = recorder.path, recorder.folder
        self.why_away = ""
        self.version += 1

    def on_unreachable(self, why: str) -> None:
        """Take over why the daemon cannot be reached."""
        self.why_away = why
        self.version += 1
