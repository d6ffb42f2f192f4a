"""Foxglove's WebSocket protocol, the server's end of one connection. Pure: text and bytes.

Source: docs/spec.md of github.com/foxglove/ws-protocol. A viewer asks for the subprotocol
`foxglove.websocket.v1`, or by its newer name `foxglove.sdk.v1`. We advertise channels, it
subscribes to some, and each message then goes out once for each of its subscriptions. Parameters
can be read and followed, not set.
"""

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import msgspec
from msgspec import Meta, Struct

from smad.runlog.schema import LINK_TOPIC, LinkSample, Row, json_schema, row_topic
from smad.version import VERSION

SUBPROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")
MOST_SUBSCRIPTIONS = 64
LOG_TOPIC = "/smad/log"
_DATA = struct.Struct("<BIQ")
_MESSAGE_DATA = 1
_NS = 1_000_000_000
INFO, WARNING, ERROR = range(3)
"""Levels of a status; those of a `foxglove.Log` have one more below them: DEBUG."""
_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_LOG_SCHEMA = msgspec.json.encode(
    {
        "title": "foxglove.Log",
        "type": "object",
        "properties": {
            "timestamp": _TIME,
            "level": {"type": "integer"},
            "message": {"type": "string"},
            "name": {"type": "string"},
            "file": {"type": "string"},
            "line": {"type": "integer"},
        },
    }
)
_LOG_LEVELS = {"warning": 3, "fault": 4}
_LOG_INFO = 2

Value = float | int | bool | str | tuple[float, ...]
Number = Annotated[int, Meta(ge=0, lt=2**32)]


class Channel(NamedTuple):
    """What a viewer can subscribe to. `schema` is JSON Schema, as the messages are JSON."""

    id: int
    topic: str
    schema_name: str
    schema: bytes


LINK = Channel(1, LINK_TOPIC, "smad.LinkSample", json_schema(LinkSample))
LOG = Channel(2, LOG_TOPIC, "foxglove.Log", _LOG_SCHEMA)
_FIRST_ROW_ID = 3


def rows_of(axes: Sequence[str]) -> dict[str, Channel]:
    """Return the channel of the samples of each axis; the only axis has the empty name."""
    schema = json_schema(Row)
    return {
        axis: Channel(number, row_topic(axis), "smad.Row", schema)
        for number, axis in enumerate(axes, start=_FIRST_ROW_ID)
    }


class _Op(Struct, tag_field="op", rename="camel", frozen=True):
    """What a viewer sends."""


class _Subscription(Struct, rename="camel", frozen=True):
    id: Number
    channel_id: Number


class _Subscribe(_Op, tag="subscribe", frozen=True):
    subscriptions: Annotated[list[_Subscription], Meta(max_length=MOST_SUBSCRIPTIONS)]


class _Unsubscribe(_Op, tag="unsubscribe", frozen=True):
    subscription_ids: list[Number]


class _GetParameters(_Op, tag="getParameters", frozen=True):
    parameter_names: list[str]
    id: str | None = None


class _SetParameters(_Op, tag="setParameters", frozen=True):
    parameters: list[dict[str, Any]]
    id: str | None = None


class _Follow(_Op, tag="subscribeParameterUpdates", frozen=True):
    parameter_names: list[str]


class _Unfollow(_Op, tag="unsubscribeParameterUpdates", frozen=True):
    parameter_names: list[str]


_decode = msgspec.json.Decoder(
    _Subscribe | _Unsubscribe | _GetParameters | _SetParameters | _Follow | _Unfollow
).decode
_encode = msgspec.json.Encoder().encode
History = Callable[[Channel], Iterable[tuple[int, bytes]]]


class Viewer:
    """One viewer: what it subscribed to, and what it is answered.

    `channels` and `parameters` say what they are now; `history` gives the messages of a channel
    that a new subscription begins with, and their times in ns.
    """

    def __init__(
        self,
        bench: str,
        session: str,
        channels: Callable[[], Sequence[Channel]],
        parameters: Callable[[], Mapping[str, Value]],
        history: History,
    ) -> None:
        self._bench = bench
        self._session = session
        self._offered = channels
        self._advertised: Sequence[Channel] = ()
        self._parameters = parameters
        self._history = history
        self._channels: dict[int, int] = {}
        self._followed: dict[str, Value | None] = {}

    def hello(self) -> list[str]:
        """Return what is sent first: who we are, and all channels."""
        server = {
            "op": "serverInfo",
            "name": f"smad, {self._bench}",
            "capabilities": ["parameters", "parametersSubscribe"],
            "supportedEncodings": ["json"],
            "metadata": {"smad": VERSION},
            "sessionId": self._session,
        }
        return [_text(server), *self._changed_channels()]

    def _changed_channels(self) -> list[str]:
        """Offer the channels that are new, and take back those that are gone."""
        before, self._advertised = self._advertised, self._offered()
        closed = [channel.id for channel in before if channel not in self._advertised]
        new = [
            {
                "id": channel.id,
                "topic": channel.topic,
                "encoding": "json",
                "schemaName": channel.schema_name,
                "schema": channel.schema.decode(),
                "schemaEncoding": "jsonschema",
            }
            for channel in self._advertised
            if channel not in before
        ]
        self._channels = {k: number for k, number in self._channels.items() if number not in closed}
        return [
            *([_text({"op": "unadvertise", "channelIds": closed})] if closed else []),
            *([_text({"op": "advertise", "channels": new})] if new else []),
        ]

    def receive(self, text: str) -> list[str | bytes]:
        """Take in a message of the viewer; return what it is answered."""
        try:
            request = _decode(text)
        except msgspec.MsgspecError as error:
            return [status(WARNING, f"not understood, or not offered here: {error}")]
        match request:
            case _Subscribe(subscriptions):
                return [message for entry in subscriptions for message in self._subscribe(entry)]
            case _Unsubscribe(subscription_ids):
                for number in subscription_ids:
                    self._channels.pop(number, None)
            case _GetParameters(names, number):
                return [self._values(names or list(self._parameters()), number)]
            case _SetParameters(parameters, number):
                names = [str(entry.get("name", "")) for entry in parameters]
                refused = "parameters are read-only here; change them with smad"
                return [status(WARNING, refused), self._values(names, number)]
            case _Follow(names):
                # A name that is invented is not kept: what a viewer makes up fills no memory.
                current = self._parameters()
                self._followed |= dict.fromkeys(n for n in names or current if n in current)
                return [*self._changed_parameters()]
            case _Unfollow(names):
                for name in names or list(self._followed):
                    self._followed.pop(name, None)
        return []

    def _subscribe(self, subscription: _Subscription) -> list[str | bytes]:
        channel = next(
            (offered for offered in self._offered() if offered.id == subscription.channel_id), None
        )
        if channel is None:
            return [status(ERROR, f"there is no channel {subscription.channel_id}")]
        if len(self._channels) >= MOST_SUBSCRIPTIONS and subscription.id not in self._channels:
            return [status(ERROR, f"{MOST_SUBSCRIPTIONS} subscriptions are open already")]
        self._channels[subscription.id] = channel.id
        return [_data(subscription.id, time_ns, body) for time_ns, body in self._history(channel)]

    def wants(self, channel: Channel) -> bool:
        """Whether it subscribed to the channel."""
        return channel.id in self._channels.values()

    def messages(self, channel: Channel, time_ns: int, body: bytes) -> list[bytes]:
        """Return a message of the channel, once for each subscription to it."""
        return [
            _data(number, time_ns, body)
            for number, channel_id in self._channels.items()
            if channel_id == channel.id
        ]

    def changed(self) -> list[str | bytes]:
        """Return new channels, and followed parameters that are not what the viewer was told."""
        return [*self._changed_channels(), *self._changed_parameters()]

    def _changed_parameters(self) -> list[str]:
        now = self._parameters()
        new = [name for name, last_sent in self._followed.items() if now.get(name) != last_sent]
        self._followed |= {name: now.get(name) for name in new}
        return [self._values(new, None)] if new else []

    def _values(self, names: Sequence[str], number: str | None) -> str:
        now = self._parameters()
        values = [_parameter(name, now[name]) for name in dict.fromkeys(names) if name in now]
        answer = {"op": "parameterValues", "parameters": values}
        return _text(answer | ({} if number is None else {"id": number}))


def status(level: int, text: str) -> str:
    """Return a message that the viewer shows to its user."""
    return _text({"op": "status", "level": level, "message": text})


def log(time_s: float, kind: str, text: str) -> tuple[int, bytes]:
    """Return an event as a `foxglove.Log`, and its time in ns."""
    time_ns = round(time_s * _NS)
    sec, nsec = divmod(time_ns, _NS)
    message = {
        "timestamp": {"sec": sec, "nsec": nsec},
        "level": _LOG_LEVELS.get(kind, _LOG_INFO),
        "message": text,
        "name": f"smad.{kind}" if kind else "smad",
        "file": "",
        "line": 0,
    }
    return time_ns, _encode(message)


def _parameter(name: str, value: Value) -> dict[str, Any]:
    kinds: dict[type, str] = {float: "float64", tuple: "float64_array"}
    kind = kinds.get(type(value))
    return {"name": name, "value": value, **({"type": kind} if kind else {})}


def _data(subscription: int, time_ns: int, body: bytes) -> bytes:
    return _DATA.pack(_MESSAGE_DATA, subscription, time_ns) + body


def _text(message: Mapping[str, Any]) -> str:
    return _encode(message).decode()
