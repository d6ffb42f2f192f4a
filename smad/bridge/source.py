"""The bench, as a client sees it, in the messages of a run log."""

from collections.abc import Mapping
from typing import Protocol

import msgspec

from smad.api import Entry, Status, link_counters, named
from smad.bridge.foxglove import LINK, LOG, Channel, Value, log, rows_of
from smad.client.following import follow
from smad.client.wire import telemetry_of
from smad.config import Config
from smad.runlog.schema import LinkSample, Row

STATUS_EVERY_S = 1.0
_NS = 1e9
_SECTIONS = ("control", "limits")
"""Of the configuration, what a viewer is shown: not where files and keys lie."""
_encode = msgspec.json.Encoder().encode


_row = msgspec.json.Decoder(Row).decode


class Sink(Protocol):
    """Who gets the messages."""

    def wants(self, channel: Channel) -> bool:
        """Whether anybody reads that channel."""

    def publish(self, channel: Channel, time_ns: int, body: bytes) -> None:
        """Pass on a message of the channel."""

    def announce(self, why_away: str) -> None:
        """Say that channels, status and parameters are new, or why there are none."""


class Source:
    """One bench. `parameters` by name; `events` are the last ones of the daemon's journal.

    `rows` has the channel of each axis by its name. Names of parameters and counters begin with
    that of their axis, where it has one.
    """

    def __init__(self, bench: str) -> None:
        self.bench = bench
        self.rows = rows_of(("",))
        self.parameters: dict[str, Value] = {}
        self.events: tuple[Entry, ...] = ()
        self._sink: Sink

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What a viewer can subscribe to."""
        return (*self.rows.values(), LINK, LOG)

    async def run(self, sink: Sink) -> None:
        """Follow the bench for ever, and tell the sink."""
        self._sink = sink
        await follow(self.bench, self, STATUS_EVERY_S, self.on_params)

    def on_config(self, config: Config) -> None:
        """Take over the configuration: the axes, and what is shown of it."""
        self.rows = rows_of(tuple(config.by_axis()))
        self.parameters = {
            named(axis, name): value
            for axis, axis_config in config.by_axis().items()
            for name, value in _of_config(axis_config).items()
        }

    def on_sample(self, axis: str, data: bytes) -> None:
        """Pass a sample on; as in the run log, what was not measured is absent."""
        if self._sink.wants(self.rows[axis]):
            time_ns = round(telemetry_of(data).timestamp * _NS)
            self._sink.publish(self.rows[axis], time_ns, _encode(_row(data)))

    def on_params(self, axis: str, params: Mapping[str, float]) -> None:
        """Take over the parameters of an axis's board."""
        self.parameters |= {named(axis, f"board.{n}"): value for n, value in params.items()}

    def on_status(self, status: Status) -> None:
        """Pass on what is new in the status."""
        for axis, part in status.parts().items():
            gains = msgspec.structs.asdict(part.gains).items()
            self.parameters |= {named(axis, f"gains.{k}"): v for k, v in gains if v is not None}
        earlier, self.events = set(self.events), status.events
        for entry in status.events:
            if entry not in earlier:
                self._sink.publish(LOG, *log(entry.time_s, entry.kind, entry.text))
        sampled = (part.sample for part in status.parts().values() if part.sample is not None)
        now_s = max((row.host_time_s for row in sampled if row.host_time_s is not None), default=0)
        if now_s and self._sink.wants(LINK):
            sample = LinkSample(host_time_s=now_s, counters=counters(status))
            self._sink.publish(LINK, round(now_s * _NS), _encode(sample))
        self._sink.announce("")

    def on_unreachable(self, why: str) -> None:
        """Pass on why nothing comes."""
        self._sink.announce(why)


def counters(status: Status) -> dict[str, float]:
    """Return the counters of the links under the names that the run log has for them."""
    values: dict[str, float] = {}
    for axis, part in status.parts().items():
        link = part.link
        values |= link_counters(axis, link.frames, link.board_stats, part.counts, part.timing)
    return values


def _of_config(config: Config) -> Mapping[str, Value]:
    """Numbers, words and switches of the sections that are shown, by their keys."""
    sections = msgspec.to_builtins({name: getattr(config, name) for name in _SECTIONS})
    numbers: dict[str, Value] = {}
    waiting = [(name, value) for name, value in sections.items()]
    for key, value in waiting:
        if isinstance(value, dict):
            waiting += [(f"{key}.{name}", entry) for name, entry in value.items()]
        elif isinstance(value, str | bool | int | float):
            numbers[key] = value
    return numbers
