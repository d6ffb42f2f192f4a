"""`smad bridge foxglove` beside a real daemon, read by a client that follows the protocol."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from bench.browser import running_daemon, served
from smad.bridge.foxglove import LINK, LOG, MOST_SUBSCRIPTIONS, SUBPROTOCOLS, rows_of
from smad.bridge.server import MOST_VIEWERS, serving
from smad.cli import execute
from smad.client import Client
from smad.client.arming import arm_when_allowed
from smad.client.endpoints import FOLDER_VARIABLE
from smad.runlog.schema import CHANNELS

PATIENCE_S = 120.0
ROWS = rows_of(("",))[""]


@contextlib.contextmanager
def bridge_of(folder: Path) -> Iterator[str]:
    """`smad bridge foxglove` of the daemon in `folder`; what it says to connect to."""
    with served(folder, ["bridge", "foxglove"]) as bridge:
        yield bridge.said[0].split()[2]
        assert bridge.end() == 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    made = tmp_path_factory.mktemp("bridge")
    with running_daemon(made, paced=True):
        yield made


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with bridge_of(folder) as said:
        yield said


def join(address: str, subprotocol: str = SUBPROTOCOLS[0]) -> ClientConnection:
    return connect(address, subprotocols=[Subprotocol(subprotocol)])


def ask(viewer: ClientConnection, **message: Any) -> None:
    viewer.send(json.dumps(message))


def message_of(viewer: ClientConnection, op: str) -> dict[str, Any]:
    """The next text message of that kind."""
    while True:
        got = viewer.recv(timeout=PATIENCE_S)
        if isinstance(got, str) and (message := json.loads(got))["op"] == op:
            found: dict[str, Any] = message
            return found


def data_of(viewer: ClientConnection, subscription: int) -> tuple[int, dict[str, Any]]:
    """Time in ns and body of the next message of a subscription."""
    while True:
        got = viewer.recv(timeout=PATIENCE_S)
        if isinstance(got, bytes):
            op, number, time_ns = struct.unpack("<BIQ", got[:13])
            assert op == 1
            if number == subscription:
                return time_ns, json.loads(got[13:])


def logged(viewer: ClientConnection, subscription: int, words: str) -> dict[str, Any]:
    """The next event that says so, among the next fifty."""
    events = (data_of(viewer, subscription)[1] for _ in range(50))
    return next(event for event in events if words in event["message"])


@pytest.mark.parametrize("subprotocol", SUBPROTOCOLS)
def test_a_viewer_gets_the_samples_of_the_bench(address: str, subprotocol: str) -> None:
    with join(address, subprotocol) as viewer:
        assert viewer.subprotocol == subprotocol
        assert message_of(viewer, "serverInfo")["name"] == "smad, bench"
        channels = message_of(viewer, "advertise")["channels"]
        schema = json.loads(next(c["schema"] for c in channels if c["id"] == ROWS.id))
        ask(viewer, op="subscribe", subscriptions=[{"id": 9, "channelId": ROWS.id}])
        samples = [data_of(viewer, 9) for _ in range(20)]
    times_ns = [time_ns for time_ns, _ in samples]
    assert times_ns == sorted(times_ns)
    ticks = [row["tick"] for _, row in samples]
    assert ticks == list(range(ticks[0], ticks[0] + 20))
    for _, row in samples:
        assert set(row) <= set(CHANNELS)
        assert set(row) <= set(schema["properties"])
        assert None not in row.values()


def test_events_counters_and_gains_reach_it_and_it_changes_none(address: str, folder: Path) -> None:
    with (
        join(address) as viewer,
        Client(folder=folder, timeout_s=PATIENCE_S, lease_s=None) as client,
    ):
        pairs = [{"id": 1, "channelId": LOG.id}, {"id": 2, "channelId": LINK.id}]
        ask(viewer, op="subscribe", subscriptions=pairs)
        assert "missed_samples" in data_of(viewer, 2)[1]["counters"]
        arm_when_allowed(client, PATIENCE_S)
        assert logged(viewer, 1, "→ ARMED")["name"] == "smad.state"
        ask(viewer, op="getParameters", parameterNames=["gains.kp_A_per_mm"], id="k")
        gains = message_of(viewer, "parameterValues")
        assert gains["parameters"][0]["value"] == client.status().gains.kp_A_per_mm
        wanted = [{"name": "gains.kp_A_per_mm", "value": 1.0}]
        ask(viewer, op="setParameters", parameters=wanted)
        assert "read-only" in message_of(viewer, "status")["message"]
        client.disarm()
        assert logged(viewer, 1, "ARMED →")["level"] == 2


def test_the_configuration_that_it_shows_names_no_files_and_no_keys(address: str) -> None:
    with join(address) as viewer:
        names: set[str] = set()
        while not any(name.startswith("board.") for name in names):
            ask(viewer, op="getParameters", parameterNames=[])
            names = {one["name"] for one in message_of(viewer, "parameterValues")["parameters"]}
    assert {name.partition(".")[0] for name in names} == {"board", "control", "gains", "limits"}


def test_a_viewer_of_another_protocol_and_one_too_many_are_refused(address: str) -> None:
    with pytest.raises(InvalidStatus):
        connect(address, subprotocols=[Subprotocol("something.else")])
    with contextlib.ExitStack() as stack:
        for _ in range(MOST_VIEWERS):
            message_of(stack.enter_context(join(address)), "serverInfo")
        with pytest.raises(InvalidStatus, match="503"):
            join(address)


def unread(address: str) -> socket.socket:
    """A viewer that subscribes to the samples, again and again, and then reads nothing more."""
    host, _, port = address.removeprefix("ws://").partition(":")
    end = socket.socket()
    # Little waits on its side, so that the bridge notices.
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    end.connect((host, int(port)))
    end.settimeout(PATIENCE_S)
    key = base64.b64encode(bytes(16)).decode()
    end.sendall(
        f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: {SUBPROTOCOLS[0]}\r\n\r\n".encode()
    )
    assert end.recv(12) == b"HTTP/1.1 101"
    pairs = [{"id": number, "channelId": ROWS.id} for number in range(MOST_SUBSCRIPTIONS)]
    text = json.dumps({"op": "subscribe", "subscriptions": pairs}).encode()
    # Masked by zeros: as it is.
    end.sendall(b"\x81" + struct.pack(">BH", 0x80 | 126, len(text)) + bytes(4) + text)
    return end


def test_viewers_that_never_read_lose_their_seats_to_others(folder: Path) -> None:
    with bridge_of(folder) as address, contextlib.ExitStack() as stack:
        for _ in range(MOST_VIEWERS):
            stack.enter_context(unread(address))
        # On a busy machine the first of them may have lost its place before the last came.
        deadline = time.monotonic() + PATIENCE_S
        while True:
            assert time.monotonic() < deadline
            try:
                viewer = join(address)
            except InvalidStatus:
                time.sleep(0.1)
            else:
                break
        with viewer:
            ask(viewer, op="subscribe", subscriptions=[{"id": 4, "channelId": ROWS.id}])
            assert data_of(viewer, 4)


def test_a_viewer_is_told_that_the_daemon_is_away(tmp_path: Path) -> None:
    with bridge_of(tmp_path) as address, join(address) as viewer:
        assert "no daemon is running" in message_of(viewer, "status")["message"]


async def test_who_serves_viewers_is_told_once_that_the_daemon_is_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    said: list[str] = []
    async with serving("wrong", 0, said.append) as bridge:
        while not said:
            await asyncio.sleep(0)
        bridge.announce(said[0])
    assert len(said) == 1
    assert "no daemon is running for the bench 'wrong'" in said[0]


def test_a_port_that_is_taken_is_named(address: str, capsys: pytest.CaptureFixture[str]) -> None:
    port = address.rpartition(":")[2]
    assert execute(["bridge", "foxglove", "--port", port]) != 0
    assert f"got {port}" in capsys.readouterr().err
