"""The port: one owner, writes that never wait, losses that are noticed, ports that come back."""

import asyncio
import contextlib
import errno
import os
import socket
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from smad.client.endpoints import (
    Connection,
    Endpoints,
    candidate_folders,
    default_folder,
    prepare_folder,
    read_connection,
    write_connection,
)
from smad.daemon.link.link import Link
from smad.daemon.link.port import PortFinder, SocketTransport, Transport, open_serial
from smad.daemon.lockfile import LockFile, port_lock
from smad.errors import DaemonError, PortError


class Line:
    """A link with its other end in the test's hands."""

    def __init__(self) -> None:
        self.received = bytearray()
        self.opened = 0
        self.losses: list[str] = []
        self.refuse = False
        self.far: socket.socket | None = None
        self.link = Link(
            self._open,
            loop=asyncio.get_running_loop(),
            retry_s=0.001,
            on_bytes=self.received.extend,
            on_open=self._opened,
            on_lost=self.losses.append,
        )

    def _open(self) -> Transport:
        if self.refuse:
            raise PortError("not there")
        near, self.far = socket.socketpair()
        near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        return SocketTransport(near)

    def _opened(self) -> None:
        self.opened += 1


@pytest.fixture
async def line() -> Line:
    line = Line()
    line.link.open()
    return line


async def until(condition: object) -> None:
    while not condition():  # type: ignore[operator]
        await asyncio.sleep(0.001)


async def test_bytes_arrive_and_leave(line: Line) -> None:
    assert line.far is not None
    line.far.send(b"abc")
    await until(lambda: line.received == b"abc")
    assert line.link.write(b"xyz")
    assert line.far.recv(10) == b"xyz"
    line.link.close()


async def test_a_full_port_drops_counts_and_marks_the_cut_with_a_delimiter(line: Line) -> None:
    assert line.far is not None
    frame = b"f" * 999 + b"\0"
    while line.link.write(frame):
        pass
    assert line.link.counts.short_writes == 1
    line.far.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while line.far.recv(65_536):
            pass
    assert line.link.write(b"next\0")
    arrived = line.far.recv(100)
    assert arrived.endswith(b"next\0")
    line.link.close()


async def test_a_closed_far_end_is_one_loss_and_the_port_is_opened_again(line: Line) -> None:
    assert line.far is not None
    line.far.close()
    await until(lambda: line.opened == 2)
    assert line.losses == ["unplugged"]
    assert line.link.counts.losses == 1
    line.link.close()


async def test_reopening_goes_on_until_the_port_is_there(line: Line) -> None:
    assert line.far is not None
    line.refuse = True
    line.far.close()
    await until(lambda: line.losses)
    await asyncio.sleep(0.02)
    assert line.opened == 1
    assert not line.link.write(b"into nothing")
    line.refuse = False
    await until(lambda: line.opened == 2)
    line.link.close()


async def test_a_closed_link_does_not_come_back(line: Line) -> None:
    line.link.close()
    line.link.read()
    await asyncio.sleep(0.01)
    assert line.opened == 1
    assert not line.losses


@pytest.fixture
def tty() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    yield master, os.ttyname(slave)
    os.close(slave)
    with contextlib.suppress(OSError):
        os.close(master)


def test_a_serial_port_is_opened_once_only(tty: tuple[int, str]) -> None:
    _, name = tty
    transport = open_serial(name, 115_200)
    with pytest.raises(PortError, match="in use by process"):
        open_serial(name, 115_200)
    transport.close()
    open_serial(name, 115_200).close()


def test_a_port_whose_lock_cannot_be_had_is_refused_as_a_port_is(
    tty: tuple[int, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, name = tty
    monkeypatch.setattr("smad.daemon.lockfile._SHARED_FOLDERS", (tmp_path,))
    port_lock(os.stat(name).st_rdev).path.mkdir()
    with pytest.raises(PortError, match="cannot use the lock file"):
        open_serial(name, 115_200)


def test_a_second_name_of_the_same_port_is_refused_too(
    tty: tuple[int, str], tmp_path: Path
) -> None:
    _, name = tty
    alias = tmp_path / "alias"
    alias.symlink_to(name)
    transport = open_serial(name, 115_200)
    with pytest.raises(PortError, match="in use"):
        open_serial(str(alias), 115_200)
    transport.close()


def test_reading_an_idle_port_is_no_loss(tty: tuple[int, str]) -> None:
    _, name = tty
    transport = open_serial(name, 115_200)
    with pytest.raises(BlockingIOError):
        os.read(transport.fileno(), 100)
    transport.close()


def test_what_a_pseudo_terminal_does_not_grant_is_noted(tty: tuple[int, str]) -> None:
    _, name = tty
    transport = open_serial(name, 115_200)
    assert any("low-latency" in note for note in transport.notes)
    transport.close()


@pytest.mark.parametrize(
    ("path", "words"),
    [("/dev/no-such-port", "no such port"), ("/dev/null", "not a serial port"), ("", "no such")],
)
def test_a_wrong_port_is_refused_with_its_name(path: str, words: str) -> None:
    with pytest.raises(PortError, match=words) as refused:
        open_serial(path, 115_200)
    assert refused.value.value == path


def test_without_permission_it_says_what_grants_it(
    tty: tuple[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("serial.Serial", denied)
    with pytest.raises(PortError, match="no permission to open") as refused:
        open_serial(tty[1], 115_200)
    # The udev rule gives the port to dialout, too: alone it opens nothing to anybody else.
    assert "dialout" in refused.value.action
    assert "udev" not in refused.value.action


def test_a_file_is_no_port(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(PortError, match="not a serial port"):
        open_serial(str(file), 115_200)


def test_a_port_that_comes_back_under_another_number_is_found_by_its_id(tmp_path: Path) -> None:
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    first, second = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1"
    first.write_text("")
    (by_id / "usb-board").symlink_to(first)
    finder = PortFinder(str(first), by_id)
    finder.remember(str(first))
    first.unlink()
    second.write_text("")
    (by_id / "usb-board").unlink()
    (by_id / "usb-board").symlink_to(second)
    assert os.path.realpath(finder.find()) == str(second)


def test_a_lock_is_held_once_and_names_its_holder(tmp_path: Path) -> None:
    first, second = LockFile(tmp_path / "lock"), LockFile(tmp_path / "lock")
    first.acquire()
    with pytest.raises(BlockingIOError):
        second.acquire()
    assert second.holder() == f"process {os.getpid()}"
    first.release()
    second.acquire()
    second.release()


def test_a_lock_in_a_folder_that_does_not_exist_is_an_error_with_the_path(tmp_path: Path) -> None:
    with pytest.raises(DaemonError, match="no-folder"):
        LockFile(tmp_path / "no-folder" / "lock").acquire()


def test_the_folder_is_the_users_own_and_named_by_the_environment(tmp_path: Path) -> None:
    assert default_folder({"XDG_RUNTIME_DIR": "/run/user/7"}) == Path("/run/user/7/smad")
    assert default_folder({"SMAD_RUNTIME_DIR": "/x", "XDG_RUNTIME_DIR": "/y"}) == Path("/x")
    assert candidate_folders({"SMAD_RUNTIME_DIR": "/x"}) == (Path("/x"),)
    assert Path("/run/smad") in candidate_folders({})
    folder = tmp_path / "new"
    assert prepare_folder(folder) == 0o077
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    folder.chmod(0o770)
    assert prepare_folder(folder) == 0o007


def test_a_folder_open_to_all_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o777)
    with pytest.raises(DaemonError, match="not safe"):
        prepare_folder(tmp_path)


def test_a_socket_path_that_is_too_long_is_refused_with_the_limit(tmp_path: Path) -> None:
    with pytest.raises(DaemonError, match="100 characters"):
        _ = Endpoints(tmp_path / ("d" * 90), "bench").command


def test_the_connection_file_of_a_daemon_that_died_counts_as_none(tmp_path: Path) -> None:
    path = tmp_path / "bench.json"
    assert read_connection(path) is None
    alive = Connection(
        bench="bench", pid=os.getpid(), version="1", command="c", stop="s", telemetry="t"
    )
    write_connection(path, alive, 0o077)
    assert read_connection(path) == alive
    write_connection(path, Connection(**{**_fields(alive), "pid": 2**22 + 1}), 0o077)
    assert read_connection(path) is None
    path.write_text("{")
    assert read_connection(path) is None


def _fields(connection: Connection) -> dict[str, object]:
    return {name: getattr(connection, name) for name in connection.__struct_fields__}
