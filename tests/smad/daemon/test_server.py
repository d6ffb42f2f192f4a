"""The command server and the telemetry stream over real sockets, in this process."""

import asyncio
import contextlib
import json
import os
import socket
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest
import zmq
import zmq.asyncio

from smad.api import LARGEST_TAKEN_IN
from smad.client.endpoints import Endpoints
from smad.config import DaemonConfig, TcpConfig, TelemetryConfig
from smad.daemon.command.auth import KeyAuthenticator, server_keys
from smad.daemon.command.server import CommandServer, Handlers
from smad.daemon.sockets.zmtp import GREETING, encoded, ready
from smad.daemon.telemetry.publisher import Publisher
from smad.errors import ConfigError, DaemonError
from smad.runlog.schema import Row

PATIENCE_MS = 20_000


class Echo:
    """A server whose commands answer with what was sent; `order` says what was served when."""

    def __init__(self, folder: Path) -> None:
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.endpoints = Endpoints(folder, "bench")
        self.order: list[bytes] = []
        self.port_looks = 0
        self.clients = zmq.asyncio.Context()
        self.server = CommandServer(
            self.context,
            Handlers(self._answer, self._answer, self._look),
            loop=asyncio.get_running_loop(),
            queue=1000,
        )

    def _answer(self, client: bytes, data: bytes, send: Any, behind: bool) -> None:
        self.order.append(data)
        send(b"re:" + data)

    def _look(self) -> None:
        self.port_looks += 1

    def client(self, kind: int = zmq.DEALER, stop: bool = False) -> Any:
        socket = self.clients.socket(kind)
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(self.endpoints.stop if stop else self.endpoints.command)
        return socket

    def close(self) -> None:
        self.server.close()
        self.clients.destroy(linger=0)
        self.context.destroy(linger=0)


@pytest.fixture
async def echo(tmp_path: Path) -> AsyncIterator[Echo]:
    echo = Echo(tmp_path)
    echo.server.serve_ipc(echo.endpoints, 0o077)
    yield echo
    echo.close()


@pytest.fixture
def viewers() -> Iterator[Any]:
    context = zmq.asyncio.Context()

    def connect(address: str, topic: bytes = b"smad") -> Any:
        viewer = context.socket(zmq.SUB)
        viewer.setsockopt(zmq.SUBSCRIBE, topic)
        viewer.connect(address)
        return viewer

    yield connect
    context.destroy(linger=0)


async def receive(socket: Any) -> list[bytes]:
    assert await socket.poll(PATIENCE_MS), "no reply came"
    frames: list[bytes] = await socket.recv_multipart()
    return frames


async def test_dealer_and_req_clients_are_both_answered(echo: Echo) -> None:
    dealer, req = echo.client(), echo.client(zmq.REQ)
    await dealer.send(b"a")
    await req.send(b"b")
    assert await receive(dealer) == [b"re:a"]
    assert await receive(req) == [b"re:b"]


async def test_the_sockets_are_the_users_own(echo: Echo) -> None:
    path = echo.endpoints.command.removeprefix("ipc://")
    assert os.stat(path).st_mode & 0o077 == 0


async def test_a_burst_is_fully_answered_and_the_port_is_looked_at_before_each_command(
    echo: Echo,
) -> None:
    client = echo.client()
    client.setsockopt(zmq.SNDHWM, 0)
    client.setsockopt(zmq.RCVHWM, 0)
    for number in range(3000):
        await client.send(b"%d" % number)
    replies = [await receive(client) for _ in range(3000)]
    assert replies[-1] == [b"re:2999"]
    assert echo.port_looks >= 3000


async def test_a_stop_is_served_before_the_commands_that_wait(echo: Echo) -> None:
    client, stopper = echo.client(), echo.client(stop=True)
    await client.send(b"first")
    await receive(client)
    await stopper.send(b"first stop")
    await receive(stopper)
    for _ in range(500):
        await client.send(b"command")
    await stopper.send(b"stop")
    await receive(stopper)
    assert echo.order.index(b"stop") < 500


async def test_a_message_is_taken_in_to_be_refused_and_a_far_longer_one_ends_its_connection(
    echo: Echo,
) -> None:
    clumsy, rude, polite = echo.client(), echo.client(), echo.client()
    await clumsy.send(b"x" * LARGEST_TAKEN_IN)
    assert len((await receive(clumsy))[0]) > LARGEST_TAKEN_IN
    await rude.send(b"y" * (LARGEST_TAKEN_IN + 1))
    await polite.send(b"hello")
    assert await receive(polite) == [b"re:hello"]
    assert b"a message of" in (await receive(rude))[0]
    assert not any(data[:1] == b"y" for data in echo.order)


async def test_a_message_of_several_parts_is_dropped_and_counted(echo: Echo) -> None:
    client = echo.client()
    await client.send_multipart([b"a", b"b", b"c"])
    await client.send(b"after")
    assert await receive(client) == [b"re:after"]
    assert echo.server.dropped_messages == 1


async def test_a_client_that_never_reads_does_not_hold_the_server_up(echo: Echo) -> None:
    deaf, polite = echo.client(), echo.client()
    deaf.setsockopt(zmq.RCVHWM, 1)
    for _ in range(2000):
        await deaf.send(b"y" * 1000)
    await polite.send(b"hello")
    assert await receive(polite) == [b"re:hello"]


async def test_tcp_without_a_list_of_keys_is_refused(echo: Echo, tmp_path: Path) -> None:
    with pytest.raises(DaemonError, match="list of client keys"):
        echo.server.serve_tcp(DaemonConfig(), echo.endpoints)


class Dialled:
    """The echo's ports over TCP, which let in `friend`."""

    def __init__(self, echo: Echo) -> None:
        self.friend = zmq.curve_keypair()
        ports = _free_ports()
        tcp = TcpConfig(
            enabled=True,
            command_port=ports[0],
            stop_port=ports[1],
            allowed_keys=(self.friend[0].decode(),),
        )
        self._echo = echo
        self.command_port = ports[0]
        self._command, _ = echo.server.serve_tcp(DaemonConfig(tcp=tcp), echo.endpoints)

    def dial(self, keys: tuple[bytes, bytes] | None, name: bytes | None = None) -> Any:
        socket = self._echo.clients.socket(zmq.DEALER)
        socket.setsockopt(zmq.LINGER, 0)
        if name is not None:
            socket.setsockopt(zmq.IDENTITY, name)
        if keys is not None:
            socket.setsockopt(zmq.CURVE_PUBLICKEY, keys[0])
            socket.setsockopt(zmq.CURVE_SECRETKEY, keys[1])
            socket.setsockopt(zmq.CURVE_SERVERKEY, self._echo.server.server_key.encode())
        socket.connect(self._command)
        return socket


async def test_over_tcp_a_listed_key_gets_in_and_a_strangers_does_not(echo: Echo) -> None:
    tcp = Dialled(echo)
    good, bad, plain = tcp.dial(tcp.friend), tcp.dial(zmq.curve_keypair()), tcp.dial(None)
    await bad.send(b"let me in")
    await plain.send(b"me too")
    await good.send(b"hello")
    assert await receive(good) == [b"re:hello"]
    authenticator = echo.server.authenticator
    assert authenticator is not None
    while authenticator.refused == 0:
        await asyncio.sleep(0.01)
    assert echo.order == [b"hello"]


async def test_over_tcp_who_comes_back_is_heard_though_its_old_connection_looks_open(
    echo: Echo,
) -> None:
    tcp = Dialled(echo)
    before = tcp.dial(tcp.friend, b"operator")
    await before.send(b"hello")
    assert await receive(before) == [b"re:hello"]
    again = tcp.dial(tcp.friend, b"operator")
    await again.send(b"stop")
    assert await receive(again) == [b"re:stop"]


def options_of_the_connection_at(port: int) -> list[int]:
    """SO_KEEPALIVE, idle s, probes and their interval s of what came in at a port here."""
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            copy = socket.socket(fileno=int(name))
            try:
                if copy.getsockname()[1:2] == (port,) and copy.getpeername():
                    return [copy.getsockopt(level, option) for level, option in KEEP_ALIVE]
            finally:
                copy.detach()
    return []


KEEP_ALIVE = (
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE),
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE),
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT),
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL),
)


async def test_over_tcp_a_client_whose_machine_is_gone_is_found_out(echo: Echo) -> None:
    tcp = Dialled(echo)
    client = tcp.dial(tcp.friend)
    await client.send(b"hello")
    assert await receive(client) == [b"re:hello"]
    kept_alive, idle_s, count, every_s = options_of_the_connection_at(tcp.command_port)
    assert kept_alive
    assert idle_s + count * every_s <= 120


def test_the_doorkeeper_refuses_what_is_no_curve_request() -> None:
    authenticator = KeyAuthenticator(())
    assert authenticator.answer([b"2.0", b"1"]) is None
    reply = authenticator.answer([b"1.0", b"1", b"smad", b"::1", b"", b"NULL"])
    assert reply is not None
    assert reply[2] == b"400"


def test_the_servers_keys_are_made_once_and_kept_from_others(tmp_path: Path) -> None:
    path = tmp_path / "bench.key"
    first = server_keys(path)
    assert server_keys(path) == first
    assert path.stat().st_mode & 0o077 == 0
    path.chmod(0o644)
    with pytest.raises(ConfigError, match="others can read"):
        server_keys(path)
    path.chmod(0o600)
    path.write_text("rubbish")
    with pytest.raises(ConfigError, match="key pair"):
        server_keys(path)


async def test_telemetry_is_two_frames_with_time_and_number_and_null_for_nan(
    viewers: Any, tmp_path: Path
) -> None:
    publisher = Publisher(asyncio.get_running_loop(), TelemetryConfig())
    publisher.bind_ipc(f"ipc://{tmp_path}/t", 0o077)
    viewer = viewers(f"ipc://{tmp_path}/t")
    while not await viewer.poll(10):
        publisher.publish(Row(t_s=1.5, force_N=float("nan"), i_meas_x_A=2.0), 1e9)
    frames = await viewer.recv_multipart()
    publisher.close()
    assert frames[0] == b"smad"
    assert len(frames) == 2
    sample = json.loads(frames[1])
    assert sample["timestamp"] == 1e9
    assert sample["sequence"] >= 1
    assert sample["force_N"] is None
    assert sample["i_meas_x_A"] == 2.0


async def test_a_viewer_gets_only_the_topics_it_asked_for(viewers: Any, tmp_path: Path) -> None:
    publisher = Publisher(asyncio.get_running_loop(), TelemetryConfig())
    publisher.bind_ipc(f"ipc://{tmp_path}/t", 0o077)
    other, viewer = (viewers(f"ipc://{tmp_path}/t", topic) for topic in (b"other", b"sm"))
    while not await viewer.poll(10):
        publisher.publish(Row(t_s=0.0), 0.0)
    viewer.setsockopt(zmq.UNSUBSCRIBE, b"sm")
    while await viewer.poll(100):
        await viewer.recv_multipart()
        publisher.publish(Row(t_s=0.0), 0.0)
    assert not await other.poll(0)
    publisher.close()


async def test_a_viewer_that_never_reads_costs_samples_not_time(
    viewers: Any, tmp_path: Path
) -> None:
    publisher = Publisher(asyncio.get_running_loop(), TelemetryConfig(high_water_mark=10))
    publisher.bind_ipc(f"ipc://{tmp_path}/t", 0o077)
    # What the two kernels' and ZeroMQ's buffers take is not lost, so the viewer is a plain socket.
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(f"{tmp_path}/t")
        line.sendall(GREETING + ready(b"SUB") + encoded([b"\1"]))
        while not any(viewer.topics for viewer in publisher.listeners[0]):
            await asyncio.sleep(0)
        for number in range(20_000):
            publisher.publish(Row(t_s=float(number)), float(number))
    assert publisher._streams[""].sequence == 20_000
    assert publisher.dropped > 10_000
    publisher.close()


async def test_an_address_in_use_is_noted_and_ipc_goes_on(tmp_path: Path) -> None:
    port = _free_ports()[0]
    with zmq.Context() as context, context.socket(zmq.PUB) as other:
        other.bind(f"tcp://127.0.0.1:{port}")
        publisher = Publisher(asyncio.get_running_loop(), TelemetryConfig())
        publisher.bind_ipc(f"ipc://{tmp_path}/t", 0o077)
        publisher.bind_extra(f"tcp://127.0.0.1:{port}", 0o077)
        assert "another bench may use it" in publisher.note
        assert len(publisher.listeners) == 1
        assert (tmp_path / "t").is_socket()
        publisher.close()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "tcp://127.0.0.1:x", "udp://a:1", ""])
async def test_an_address_that_is_none_is_noted(address: str) -> None:
    publisher = Publisher(asyncio.get_running_loop(), TelemetryConfig())
    publisher.bind_extra(address, 0o077)
    assert "neither tcp://host:port nor ipc://path" in publisher.note


def _free_ports() -> tuple[int, int]:
    with socket.socket() as first, socket.socket() as second:
        first.bind(("127.0.0.1", 0))
        second.bind(("127.0.0.1", 0))
        return first.getsockname()[1], second.getsockname()[1]
