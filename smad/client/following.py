"""A bench as a viewer follows it: samples of all axes, the status every so often, who is there.

A client like any other. The telemetry is emptied thirty times a second instead of being awaited
sample by sample: the process wakes less often than samples come.
"""

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import Protocol

import msgspec
import zmq

from smad.api import AXIS_TOPICS, TELEMETRY_TOPIC, AxisStatus, Status, topic_of
from smad.client import AsyncClient
from smad.client.wire import subscribe
from smad.config import Config
from smad.config.load import parse_config
from smad.errors import SmadError

DRAINS_PER_S = 30.0
PARAMS_EVERY = 10
"""The boards' parameters are read once in so many statuses."""
RETRY_S = 0.5
TIMEOUT_S = 2.0
_QUEUE = 4000
"""Samples that wait for us: over a second of six axes at 500 Hz."""

OnParams = Callable[[str, Mapping[str, float]], None]
"""Gets the name of an axis and the values of its board's parameters."""


class Follower(Protocol):
    """Receives what happens on a bench. An axis has its name, the only one the empty name."""

    def on_config(self, config: Config) -> None:
        """The daemon answers, with this configuration."""

    def on_sample(self, axis: str, data: bytes) -> None:
        """A sample, as JSON; one that raises msgspec.ValidationError is passed over."""

    def on_status(self, status: Status) -> None:
        """The status has come."""

    def on_unreachable(self, why: str) -> None:
        """The daemon does not answer, for a reason in one line."""


async def follow(
    bench: str, follower: Follower, status_every_s: float, on_params: OnParams | None = None
) -> None:
    """Follow a bench for ever: connect, and connect again whenever the daemon is gone.

    The boards' parameters are read only if there is somebody to get them, `on_params`.
    """
    while True:
        try:
            async with AsyncClient(bench, timeout_s=TIMEOUT_S) as client:
                await _connected(client, follower, status_every_s, on_params)
        except SmadError as error:
            follower.on_unreachable(str(error))
        await asyncio.sleep(RETRY_S)


async def _connected(
    client: AsyncClient, follower: Follower, status_every_s: float, on_params: OnParams | None
) -> None:
    config = parse_config(await client.config())
    axes = tuple(config.by_axis())
    follower.on_config(config)
    async with asyncio.TaskGroup() as tasks:
        draining = tasks.create_task(_drain(client.connection.telemetry, axes, follower))
        try:
            for number in count():
                status = _by_name(await client.status(), axes)
                if tuple(status.parts()) != axes:
                    # Another daemon answers at the same address: begin anew.
                    return
                if on_params is not None and number % PARAMS_EVERY == 0:
                    for axis in axes:
                        with contextlib.suppress(SmadError):
                            read = await client[axis].params()
                            on_params(axis, {param.name: param.value for param in read})
                follower.on_status(status)
                await asyncio.sleep(status_every_s)
        except SmadError as error:
            follower.on_unreachable(str(error))
        finally:
            draining.cancel()


def _by_name(status: Status, axes: Sequence[str]) -> Status:
    """Return the status with its axis by name, where a bench has one and that has a name."""
    if status.axes or len(axes) != 1 or "" in axes:
        return status
    fields = {name: getattr(status, name) for name in AxisStatus.__struct_fields__}
    return msgspec.structs.replace(status, axes={axes[0]: AxisStatus(**fields)})


async def _drain(address: str, axes: tuple[str, ...], follower: Follower) -> None:
    if not address:
        # A daemon with telemetry.enabled = false: there is the status alone.
        return
    by_topic = {topic_of(axis).encode(): axis for axis in axes}
    first_topic = TELEMETRY_TOPIC if "" in axes else AXIS_TOPICS
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = subscribe(context, address, first_topic.encode(), _QUEUE)
    try:
        while True:
            with contextlib.suppress(zmq.Again):
                for _ in range(_QUEUE):
                    topic, data = socket.recv_multipart(zmq.NOBLOCK)
                    if topic in by_topic:
                        with contextlib.suppress(msgspec.ValidationError):
                            follower.on_sample(by_topic[topic], data)
            await asyncio.sleep(1 / DRAINS_PER_S)
    finally:
        socket.close(linger=0)
        context.destroy(linger=0)
