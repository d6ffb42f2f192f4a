"""Connections that wait, are displaced, or find no descriptor; ports that close to newcomers."""

import asyncio
import math
import os
import resource
import select
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import pytest
import zmq

from campaign.rig import free_ports
from smad.config import TcpConfig
from smad.daemon.command.remote import Routes, Source, TcpServer
from smad.daemon.sockets.address import listen_local
from smad.daemon.sockets.descriptors import (
    RESERVE,
    Descriptors,
    Shares,
    open_descriptors,
    shares_of,
)
from smad.daemon.sockets.gate import Gate
from smad.daemon.sockets.listener import Connection, Hooks, Listener, Terms
from smad.daemon.sockets.zmtp import GREETING, encoded, ready
from smad.errors import DaemonError

TURNS = 5000
HELLO = GREETING + ready(b"DEALER")


class Room:
    """A listener that answers what it is told."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "room"
        self.lines: list[socket.socket] = []
        self.listener: Listener

    def open(self, *, standing_s: float = math.inf, **options: Any) -> None:
        self.listener = Listener(
            asyncio.get_running_loop(),
            listen_local(f"ipc://{self.path}", 0o077),
            Terms(
                b"ROUTER", frozenset((b"DEALER",)), longest=1000, queue=10, standing_s=standing_s
            ),
            Hooks(self._answer),
            **options,
        )

    def _answer(self, connection: Connection) -> None:
        while connection.message is not None:
            connection.send(encoded([b"re:" + connection.message[0]]))
            connection.advance()

    def enter(self, said: bytes = HELLO) -> socket.socket:
        line = socket.socket(socket.AF_UNIX)
        line.connect(str(self.path))
        line.setblocking(False)
        line.sendall(said)
        self.lines.append(line)
        return line


@pytest.fixture
async def room(tmp_path: Path) -> AsyncIterator[Room]:
    room = Room(tmp_path)
    yield room
    for line in room.lines:
        line.close()
    room.listener.close()
    assert not room.path.exists()


@pytest.fixture
def limits() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


async def until(done: Callable[[], object]) -> None:
    for _ in range(TURNS):
        if done():
            return
        await asyncio.sleep(0.001)
    raise AssertionError("it never came")


async def heard(line: socket.socket) -> bytes:
    data = bytearray()

    def more() -> bool:
        try:
            data.extend(line.recv(4096))
        except BlockingIOError:
            return False
        return data.endswith(b"re:hello")

    await until(more)
    return bytes(data)


def is_open(line: socket.socket) -> bool:
    try:
        return line.recv(4096) != b""
    except BlockingIOError:
        return True
    except ConnectionResetError:
        return False


async def test_who_comes_when_all_places_are_taken_waits_for_one(room: Room) -> None:
    room.open(most=2)
    first = room.enter()
    await until(lambda: len(room.listener) == 1)
    room.enter()
    third = room.enter(HELLO + encoded([b"hello"]))
    await until(lambda: room.listener.kept_waiting == 1)
    assert len(room.listener) == 2
    first.close()
    assert (await heard(third)).endswith(b"re:hello")
    assert len(room.listener) == 2


async def test_the_longest_silent_makes_room_for_a_stop(room: Room) -> None:
    room.open(most=2, standing_s=0.0)
    silent, talker = room.enter(), room.enter()
    await until(lambda: len(room.listener) == 2)
    talker.sendall(encoded([b"hello"]))
    await heard(talker)
    late = room.enter(HELLO + encoded([b"hello"]))
    await heard(late)
    assert room.listener.displaced == 1
    await until(lambda: not is_open(silent))
    assert is_open(talker)


async def test_who_says_nothing_at_all_is_sent_away(
    room: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("smad.daemon.sockets.listener.HANDSHAKE_S", 0.0)
    room.open()
    line = room.enter(b"")
    await until(lambda: not is_open(line))
    assert len(room.listener) == 0


async def test_who_asks_for_a_name_in_use_is_heard_by_another_name(room: Room) -> None:
    room.open()
    named = GREETING + ready(b"DEALER", b"me") + encoded([b"hello"])
    first, second = room.enter(named), room.enter(named)
    await heard(first)
    await heard(second)
    names = [one.identity for one in room.listener]
    assert names.count(b"me") == 1
    assert len(set(names)) == 2
    first.close()
    second.close()
    await until(lambda: len(room.listener) == 0)
    await heard(room.enter(named))
    assert [one.identity for one in room.listener] == [b"me"]


async def test_a_peer_that_does_not_read_is_not_sent_more_than_the_queue(room: Room) -> None:
    room.open()
    room.enter()
    await until(lambda: any(one.greeted for one in room.listener))
    (connection,) = room.listener
    taken = 0
    while connection.send(b"x" * 10_000):
        taken += 1
        assert taken < 1000
    assert not connection.send(b"x")
    line = room.lines[0]
    read = 0

    def drained() -> bool:
        nonlocal read
        with suppress(BlockingIOError):
            read += len(line.recv(1_000_000))
        return read >= taken * 10_000

    await until(drained)
    assert connection.send(b"x")


async def test_without_a_descriptor_a_connection_waits_and_the_reserve_lets_it_in(
    room: Room, limits: None
) -> None:
    allowed = [False]
    line = socket.socket(socket.AF_UNIX)
    full = open_descriptors()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)

    class Reserve:
        def __enter__(self) -> None:
            if allowed[0]:
                resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

        def __exit__(self, *_: object) -> None:
            return None

    room.open(reserve=Reserve)
    line.connect(str(room.path))
    line.setblocking(False)
    line.sendall(HELLO + encoded([b"hello"]))
    room.lines.append(line)
    # Below every descriptor that a new connection could get.
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(full, 3), hard))
    await until(lambda: room.listener.kept_waiting)
    assert len(room.listener) == 0
    allowed[0] = True
    await heard(line)


async def test_without_a_descriptor_the_longest_silent_goes_before_the_reserve_is_touched(
    room: Room, limits: None
) -> None:
    used = []
    room.open(standing_s=0.0, reserve=lambda: nullcontext(used.append(open_descriptors())))
    room.enter()
    await until(lambda: len(room.listener) == 1)
    late = socket.socket(socket.AF_UNIX)
    room.lines.append(late)
    full = max(int(one) for one in os.listdir("/proc/self/fd")) + 1
    resource.setrlimit(
        resource.RLIMIT_NOFILE, (full, resource.getrlimit(resource.RLIMIT_NOFILE)[1])
    )
    holes = []
    with suppress(OSError):
        while True:
            holes.append(os.open("/dev/null", os.O_RDONLY))
    late.connect(str(room.path))
    late.setblocking(False)
    late.sendall(HELLO + encoded([b"hello"]))
    await heard(late)
    for hole in holes:
        os.close(hole)
    assert room.listener.displaced == 1
    assert used == [full - 1]


def test_with_every_descriptor_taken_they_are_still_counted(limits: None) -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, hard))
    assert open_descriptors() == 3


def test_a_link_that_has_the_sockets_name_is_removed_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / "room").symlink_to(tmp_path / "elsewhere")
    line = listen_local(f"ipc://{tmp_path}/room", 0o077)
    assert (tmp_path / "room").is_socket()
    assert not (tmp_path / "elsewhere").exists()
    assert (tmp_path / "room").stat().st_mode & 0o077 == 0
    line.close()


def test_every_channel_has_a_share_and_no_share_is_another_ones() -> None:
    assert shares_of(200, 40, tcp=True) == Shares(36, 36, 36, 36)
    assert shares_of(20_000, 40, tcp=True) == Shares(256, 256, 256, 1024)
    assert shares_of(1024, 40, tcp=False) == Shares(256, 256, 256, 0)
    for limit in range(100, 2000, 7):
        for tcp in (False, True):
            s = shares_of(limit, 40, tcp=tcp)
            assert s.stop + s.command + s.telemetry + s.tcp <= limit - 40 - RESERVE


def test_a_limit_that_is_too_low_is_refused_with_the_least_that_will_do() -> None:
    with pytest.raises(DaemonError) as refused:
        shares_of(30, 20, tcp=False)
    assert refused.value.limit == "at least 48"
    assert shares_of(48, 20, tcp=False).stop == 4


def test_the_reserve_is_out_of_reach_but_in_its_block(limits: None) -> None:
    descriptors = Descriptors()
    descriptors.set_reserve_aside()
    taken: list[int] = []

    def take(most: int) -> None:
        while len(taken) < most:
            taken.append(os.open("/dev/null", os.O_RDONLY))

    try:
        with pytest.raises(OSError, match="Too many open files"):
            take(descriptors.limit)
        with descriptors.reserve(), descriptors.reserve():
            take(len(taken) + RESERVE)
            with pytest.raises(OSError, match="Too many open files"):
                take(len(taken) + 1)
        with pytest.raises(OSError, match="Too many open files"):
            take(len(taken) + 1)
    finally:
        for one in taken:
            os.close(one)


def test_a_gate_that_is_shut_keeps_newcomers_out_and_those_who_are_in_stay() -> None:
    gate = Gate("127.0.0.1", 0)
    zeromq = socket.socket(fileno=gate.for_zeromq())
    address = zeromq.getsockname()
    with socket.create_connection(address) as guest:
        inside, _ = zeromq.accept()
        with socket.create_connection(address) as waiting:
            gate.shut(nullcontext)
            assert waiting.recv(1) == b""
        with socket.socket() as late:
            late.setblocking(False)
            assert late.connect_ex(address) != 0
            with pytest.raises(BlockingIOError):
                zeromq.accept()
            guest.sendall(b"still here")
            assert inside.recv(10) == b"still here"
        gate.open()
        with socket.create_connection(address, timeout=60.0) as newcomer:
            assert newcomer.getpeername() == address
        inside.close()
    zeromq.close()
    gate.close()


def test_while_a_gate_is_held_zeromq_finds_nobody_there() -> None:
    gate = Gate("127.0.0.1", 0)
    zeromq = socket.socket(fileno=gate.for_zeromq())
    with socket.create_connection(zeromq.getsockname()), select.epoll() as ready_ones:
        ready_ones.register(zeromq, select.EPOLLIN)
        assert ready_ones.poll(60.0)
        with gate.hidden_from_zeromq(), pytest.raises(BlockingIOError):
            zeromq.accept()
        assert ready_ones.poll(0.0)
        ready_ones.unregister(zeromq)
        zeromq.accept()[0].close()
    zeromq.close()
    gate.close()


def test_zeromqs_thread_has_taken_a_gate_on_once_it_waits_for_input_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("smad.daemon.sockets.gate._TAKEN_ON_WITHIN_S", 0.0)
    gate = Gate("127.0.0.1", 0)
    zeromq = socket.socket(fileno=gate.for_zeromq())
    with select.epoll() as thread:
        with pytest.raises(TimeoutError):
            gate.wait_until_taken_on()
        thread.register(zeromq, 0)
        with pytest.raises(TimeoutError):
            gate.wait_until_taken_on()
        thread.modify(zeromq, select.EPOLLIN)
        gate.wait_until_taken_on()
    zeromq.close()
    gate.close()


def test_events_are_read_until_nothing_is_monitored_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    closed = []
    close = Source.close

    def note(source: Source) -> None:
        closed.append(source.monitored)
        close(source)

    monkeypatch.setattr(Source, "close", note)
    command_port, stop_port = free_ports(2)
    with zmq.Context() as context:
        tcp = TcpConfig(command_port=command_port, stop_port=stop_port)
        secret = zmq.curve_keypair()[1]
        TcpServer(context, tcp, secret, _IGNORED, queue=10, reserve=nullcontext).close()
    assert closed == [True, True, False, False, False]


def test_commands_are_closed_to_newcomers_before_stops_are() -> None:
    ports = free_ports(2)
    tcp = TcpConfig(command_port=ports[0], stop_port=ports[1])
    secret = zmq.curve_keypair()[1]

    def lets_in(port: int) -> bool:
        with socket.socket() as line:
            line.settimeout(0.2)
            with suppress(TimeoutError):
                line.connect(("127.0.0.1", port))
                return True
        return False

    with zmq.Context() as context:
        door = TcpServer(context, tcp, secret, _IGNORED, queue=10, reserve=nullcontext)
        door.most = 8
        let_in = []
        for connections in (3, 4, 7, 8, 7, 5, 3, 2):
            door.look(connections)
            let_in.append((lets_in(ports[0]), lets_in(ports[1])))
        assert let_in == [
            (True, True),
            (False, True),
            (False, True),
            (False, False),
            (False, False),
            (False, True),
            (False, True),
            (True, True),
        ]
        assert door.counts.shut == 2
        door.close()


def test_a_port_that_is_taken_is_refused_and_leaves_nothing_open() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other, zmq.Context() as context:
        tcp = TcpConfig(command_port=other.getsockname()[1], stop_port=free_ports(1)[0])
        secret = zmq.curve_keypair()[1]
        with pytest.raises(DaemonError, match="cannot listen on tcp"):
            TcpServer(
                context,
                tcp,
                secret,
                _IGNORED,
                queue=10,
                reserve=nullcontext,
            )
        # A socket left open would keep the context from ending here.


def _ignore(socket: object, frames: object) -> None:
    return None


_IGNORED = Routes(_ignore, _ignore)
