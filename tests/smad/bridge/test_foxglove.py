"""The protocol without a socket: what a viewer is told, and what each of its messages does."""

from __future__ import annotations

import json
import struct
from typing import Any

import pytest

from smad import api
from smad.bridge import foxglove
from smad.bridge.foxglove import LINK, LOG, Channel, Value, Viewer, log, rows_of
from smad.bridge.source import Source, counters
from smad.config import AxisConfig, Config
from smad.control.commands import Tune
from smad.runlog.schema import Row, json_schema
from tests.smad.view.test_forms_and_state import status

ROWS = rows_of(("",))[""]
CHANNELS = (ROWS, LINK, LOG)


def viewer(**parameters: Value) -> Viewer:
    def history(channel: Channel) -> list[tuple[int, bytes]]:
        return [log(2.5, "fault", "too hot")] if channel == LOG else []

    return Viewer("bench", "7", lambda: CHANNELS, lambda: parameters, history)


def ask(one: Viewer, **message: Any) -> list[Any]:
    return [
        json.loads(answer) if isinstance(answer, str) else answer
        for answer in one.receive(json.dumps(message))
    ]


def test_a_viewer_is_told_the_schemas_of_the_run_log() -> None:
    server, advertised = map(json.loads, viewer().hello())
    assert server["op"] == "serverInfo"
    assert server["capabilities"] == ["parameters", "parametersSubscribe"]
    channels = {one["topic"]: one for one in advertised["channels"]}
    assert set(channels) == {"/smad/row", "/smad/link", "/smad/log"}
    assert channels["/smad/row"]["schema"].encode() == json_schema(Row)
    assert channels["/smad/log"]["schemaName"] == "foxglove.Log"
    assert {one["schemaEncoding"] for one in advertised["channels"]} == {"jsonschema"}


def test_invented_names_of_parameters_are_not_kept() -> None:
    one = viewer(kp=3.0)
    for number in range(100):
        names = [f"{number} {n}" for n in range(100)]
        assert ask(one, op="subscribeParameterUpdates", parameterNames=names) == []
    assert not one._followed
    (told,) = ask(one, op="getParameters", parameterNames=["kp"] * 1000)
    assert [value["name"] for value in told["parameters"]] == ["kp"]


def test_each_subscription_gets_a_message_once_until_it_ends() -> None:
    one = viewer()
    pairs = [{"id": number, "channelId": ROWS.id} for number in (4, 5)]
    assert ask(one, op="subscribe", subscriptions=pairs) == []
    assert one.wants(ROWS)
    assert not one.wants(LOG)
    sent = one.messages(ROWS, 1_500_000_000, b"{}")
    assert [struct.unpack("<BIQ", data[:13]) for data in sent] == [
        (1, 4, 1_500_000_000),
        (1, 5, 1_500_000_000),
    ]
    assert {data[13:] for data in sent} == {b"{}"}
    assert ask(one, op="unsubscribe", subscriptionIds=[4, 5, 6]) == []
    assert one.messages(ROWS, 1, b"{}") == []


def test_who_subscribes_to_the_log_gets_what_happened_before() -> None:
    (data,) = ask(viewer(), op="subscribe", subscriptions=[{"id": 1, "channelId": LOG.id}])
    message = json.loads(data[13:])
    assert message["timestamp"] == {"sec": 2, "nsec": 500_000_000}
    assert (message["level"], message["name"], message["message"]) == (4, "smad.fault", "too hot")


def test_parameters_are_read_and_followed_but_not_set() -> None:
    values: dict[str, Value] = {"gains.kp": 7.0, "gains.cooling": "switch", "board.n": 3}
    one = Viewer("bench", "7", lambda: (), lambda: values, lambda channel: [])
    (all_of_them,) = ask(one, op="getParameters", parameterNames=[], id="q")
    assert all_of_them["id"] == "q"
    assert all_of_them["parameters"] == [
        {"name": "gains.kp", "value": 7.0, "type": "float64"},
        {"name": "gains.cooling", "value": "switch"},
        {"name": "board.n", "value": 3},
    ]
    refused, still = ask(one, op="setParameters", parameters=[{"name": "gains.kp", "value": 1}])
    assert "read-only" in refused["message"]
    assert still["parameters"][0]["value"] == 7.0
    (first,) = ask(one, op="subscribeParameterUpdates", parameterNames=["gains.kp"])
    assert first["parameters"][0]["value"] == 7.0
    assert one.changed() == []
    values |= {"gains.kp": 8.0, "board.n": 4}
    (later,) = map(json.loads, one.changed())
    assert later["parameters"] == [{"name": "gains.kp", "value": 8.0, "type": "float64"}]
    ask(one, op="unsubscribeParameterUpdates", parameterNames=["gains.kp"])
    values["gains.kp"] = 9.0
    assert one.changed() == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"op":"advertise","channels":[]}',
        "\x00",
        '{"op":"subscribe","subscriptions":[{"id":1}]}',
        '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}',
        '{"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]}',
    ],
)
def test_what_is_not_offered_or_not_understood_is_said(text: str) -> None:
    (answer,) = viewer().receive(text)
    assert json.loads(answer)["op"] == "status"


def test_a_viewer_has_no_more_subscriptions_than_are_allowed() -> None:
    one = viewer()
    for first in (0, foxglove.MOST_SUBSCRIPTIONS):
        many = [{"id": first + n, "channelId": ROWS.id} for n in range(foxglove.MOST_SUBSCRIPTIONS)]
        answers = ask(one, op="subscribe", subscriptions=many)
    assert {answer["op"] for answer in answers} == {"status"}
    assert len(one.messages(ROWS, 1, b"")) == foxglove.MOST_SUBSCRIPTIONS


class Seen:
    """A sink that remembers."""

    def __init__(self) -> None:
        self.published: list[tuple[str, int, dict[str, Any]]] = []
        self.told: list[str] = []

    def wants(self, channel: Channel) -> bool:
        return channel in CHANNELS

    def publish(self, channel: Channel, time_ns: int, body: bytes) -> None:
        self.published.append((channel.topic, time_ns, json.loads(body)))

    def announce(self, why_away: str) -> None:
        self.told.append(why_away)


def test_an_event_is_passed_on_once_and_the_gains_are_those_in_force() -> None:
    from msgspec.structs import replace

    source, sink = Source("bench"), Seen()
    events = (api.Entry(1.0, "connected"), api.Entry(2.0, "too hot", "fault"))
    now = replace(status(host_time_s=3.0), events=events[:1])
    source._sink = sink
    source.on_params("", {"cold_cC": 4500.0})
    source.on_status(now)
    source.on_status(replace(now, events=events))
    logged = [body["message"] for topic, _, body in sink.published if topic == "/smad/log"]
    assert logged == ["connected", "too hot"]
    assert [t for topic, t, _ in sink.published if topic == "/smad/link"] == [3_000_000_000] * 2
    assert source.parameters == {"gains.kp_A_per_mm": 7.0, "board.cold_cC": 4500.0}
    assert sink.told == ["", ""]
    assert counters(now)["missed_samples"] == 0.0


def test_each_axis_has_a_channel_counters_and_parameters_of_its_own() -> None:
    from msgspec.structs import replace

    source, sink = Source("bench"), Seen()
    source._sink = sink
    one = Viewer("bench", "7", lambda: source.channels, lambda: source.parameters, lambda c: [])
    one.hello()
    ask(one, op="subscribe", subscriptions=[{"id": 1, "channelId": ROWS.id}])
    axes = tuple(AxisConfig(name=name, travel_mm=4.0) for name in ("pitch-1", "yaw-1"))
    source.on_config(Config(axes=axes))
    gone, new = map(json.loads, one.changed())
    assert gone == {"op": "unadvertise", "channelIds": [ROWS.id]}
    assert [c["topic"] for c in new["channels"]] == [f"/smad/axis/{a.name}/row" for a in axes]
    assert one.changed() == []
    assert not one.wants(ROWS)
    part = status(host_time_s=3.0)
    both = replace(part, axes={"pitch-1": part, "yaw-1": replace(part, gains=Tune(kp_A_per_mm=9))})
    source.on_params("yaw-1", {"cold_cC": 4500.0})
    source.on_status(both)
    assert source.parameters["yaw-1.gains.kp_A_per_mm"] == 9
    assert source.parameters["pitch-1.gains.kp_A_per_mm"] == 7.0
    assert source.parameters["yaw-1.board.cold_cC"] == 4500.0
    assert source.parameters["pitch-1.limits.displacement_max_mm"] == 4.0
    ((_, _, body),) = [sent for sent in sink.published if sent[0] == "/smad/link"]
    assert {"pitch-1.missed_samples", "yaw-1.missed_samples"} <= set(body["counters"])
