"""The bench, as a client sees it, in the messages of a run log.

The telemetry is emptied thirty times a second instead of being awaited sample by sample: the
process wakes less often than samples come.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Protocol

import msgspec
import zmq

from smad.api import TELEMETRY_TOPIC, Entry, Status
from smad.bridge.foxglove import LINK, LOG, ROWS, Channel, Value, log
from smad.client import AsyncClient
from smad.client.wire import subscribe
from smad.config import Config
from smad.config.load import parse_config
from smad.errors import SmadError
from smad.runlog.schema import LinkSample, Row

DRAIN_EVERY_S = 1 / 30
STATUS_EVERY_S = 1.0
PARAMS_EVERY = 10
"""The board's parameters are read once in so many statuses."""
RETRY_S = 0.5
TIMEOUT_S = 2.0
_QUEUE = 2000
_TOPIC = TELEMETRY_TOPIC.encode()
_NS = 1e9
_SECTIONS = ("control", "limits")
"""Of the configuration, what a viewer is shown: not where files and keys lie."""
_encode = msgspec.json.Encoder().encode


class _Stamped(Row, kw_only=True):
    timestamp: float


_sample = msgspec.json.Decoder(_Stamped).decode
_row = msgspec.json.Decoder(Row).decode


class Sink(Protocol):
    """Who gets the messages."""

    def wants(self, channel: Channel) -> bool:
        """Whether anybody reads that channel."""

    def publish(self, channel: Channel, time_ns: int, body: bytes) -> None:
        """Pass on a message of the channel."""

    def news(self, why_away: str) -> None:
        """Say that status and parameters are new, or why there are none."""


class Source:
    """One bench. `parameters` by name; `events` are the last ones of the daemon's journal."""

    def __init__(self, bench: str) -> None:
        self.bench = bench
        self.parameters: dict[str, Value] = {}
        self.events: tuple[Entry, ...] = ()

    async def run(self, sink: Sink) -> None:
        """Follow the bench for ever: connect, and connect again whenever the daemon is gone."""
        while True:
            try:
                async with AsyncClient(self.bench, timeout_s=TIMEOUT_S) as client:
                    await self._follow(client, sink)
            except SmadError as error:
                sink.news(str(error))
            await asyncio.sleep(RETRY_S)

    async def _follow(self, client: AsyncClient, sink: Sink) -> None:
        self.parameters |= _of_config(parse_config(await client.config()))
        async with asyncio.TaskGroup() as tasks:
            draining = tasks.create_task(_drain(client.connection.telemetry, sink))
            try:
                for count in _forever():
                    status = await client.status()
                    if count % PARAMS_EVERY == 0:
                        with contextlib.suppress(SmadError):
                            board = {f"board.{p.name}": p.value for p in await client.params()}
                            self.parameters |= board
                    self._seen(status, sink)
                    await asyncio.sleep(STATUS_EVERY_S)
            except SmadError as error:
                sink.news(str(error))
            finally:
                draining.cancel()

    def _seen(self, status: Status, sink: Sink) -> None:
        gains = msgspec.structs.asdict(status.gains)
        self.parameters |= {f"gains.{k}": v for k, v in gains.items() if v is not None}
        known, self.events = set(self.events), status.events
        for entry in status.events:
            if entry not in known:
                sink.publish(LOG, *log(entry.time_s, entry.kind, entry.text))
        now_s = status.sample.host_time_s if status.sample is not None else None
        if now_s is not None and sink.wants(LINK):
            sample = LinkSample(host_time_s=now_s, counters=link_counters(status))
            sink.publish(LINK, round(now_s * _NS), _encode(sample))
        sink.news("")


def link_counters(status: Status) -> dict[str, float]:
    """Return the counters of the link under the names that the run log has for them."""
    link, counts, timing = status.link, status.counts, status.timing
    return {
        **{f"host_{name}": float(value) for name, value in link.frames.items()},
        **{f"board_{name}": float(value) for name, value in link.board_stats.items()},
        "missed_samples": float(counts.missed),
        "skipped_samples": float(counts.skipped),
        "setpoints_dropped": float(counts.setpoints_dropped),
        "commands_refused": float(counts.refused),
        "setpoint_age_p99_us": timing.setpoint_age.p99_us,
        "own_share_p99_us": timing.own_share.p99_us,
    }


async def _drain(address: str, sink: Sink) -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = subscribe(context, address, _TOPIC, _QUEUE)
    try:
        while True:
            with contextlib.suppress(zmq.Again):
                for _ in range(_QUEUE):
                    _, data = socket.recv_multipart(zmq.NOBLOCK)
                    if sink.wants(ROWS):
                        # As in the run log: what was not measured is absent.
                        time_ns = round(_sample(data).timestamp * _NS)
                        sink.publish(ROWS, time_ns, _encode(_row(data)))
            await asyncio.sleep(DRAIN_EVERY_S)
    finally:
        socket.close(linger=0)
        context.destroy(linger=0)


def _of_config(config: Config) -> dict[str, Value]:
    """Numbers, words and switches of the sections that are shown, by their keys."""
    sections = msgspec.to_builtins({name: getattr(config, name) for name in _SECTIONS})
    found: dict[str, Value] = {}
    waiting = [(name, value) for name, value in sections.items()]
    for key, value in waiting:
        if isinstance(value, dict):
            waiting += [(f"{key}.{name}", own) for name, own in value.items()]
        elif isinstance(value, str | bool | int | float):
            found[key] = value
    return found


def _forever() -> range:
    return range(2**62)
