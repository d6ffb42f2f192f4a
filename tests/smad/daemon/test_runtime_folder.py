"""The names in the runtime folder come back when somebody removes them while a daemon runs."""

import asyncio
import shutil
import socket
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from smad.client.endpoints import Connection, Endpoints, prepare_folder, write_connection
from smad.daemon.lockfile import LockFile
from smad.daemon.runtime_folder import RuntimeFolder
from smad.daemon.sockets.address import listen_local
from smad.daemon.sockets.listener import Hooks, Listener, Terms

TURNS = 5000


class Made:
    """A folder with what a daemon keeps in it, and one channel that is listened to."""

    def __init__(self, folder: Path) -> None:
        self.endpoints = Endpoints(folder, "bench")
        umask = prepare_folder(folder)
        self.lock = LockFile(self.endpoints.lock)
        self.lock.acquire()
        self.listener = Listener(
            asyncio.get_running_loop(),
            listen_local(self.endpoints.stop, umask),
            Terms(b"ROUTER", accepts=frozenset((b"DEALER",)), longest=100, queue=10),
            Hooks(),
        )
        connection = Connection(
            bench="bench", pid=1, version="", command="", stop=self.endpoints.stop, telemetry=""
        )
        write_connection(self.endpoints.connection_file, connection, umask)
        self.place = RuntimeFolder(self.endpoints, connection, self.lock, [self.listener])
        self.lines: list[socket.socket] = []

    def connect(self) -> socket.socket:
        """A client's socket; connected as soon as the kernel has its name."""
        line = socket.socket(socket.AF_UNIX)
        self.lines.append(line)
        line.connect(self.endpoints.stop.removeprefix("ipc://"))
        return line

    async def connected(self, count: int) -> None:
        """Wait until so many connections have been taken in."""
        for _ in range(TURNS):
            if len(self.listener) == count:
                return
            await asyncio.sleep(0.001)
        raise AssertionError(f"{len(self.listener)} connections, not {count}")


@pytest.fixture
async def made(tmp_path: Path) -> AsyncIterator[Made]:
    made = Made(tmp_path / "run")
    yield made
    for line in made.lines:
        line.close()
    made.listener.close()
    made.lock.release()


async def test_a_folder_in_order_is_left_alone(made: Made) -> None:
    before = [path.lstat().st_ino for path in sorted(made.endpoints.folder.iterdir())]
    assert made.place.look() == ""
    assert [path.lstat().st_ino for path in sorted(made.endpoints.folder.iterdir())] == before


async def test_a_deleted_folder_is_made_again_with_lock_sockets_and_connection_file(
    made: Made,
) -> None:
    folder = made.endpoints.folder
    before = made.connect()
    await made.connected(1)
    shutil.rmtree(folder)
    told = made.place.look()
    assert "bench.stop" in told
    assert "made again" in told
    assert made.place.look() == ""
    assert folder.stat().st_mode & 0o777 == 0o700
    assert made.endpoints.connection_file.exists()
    made.connect()
    await made.connected(2)
    assert before.fileno() >= 0
    with pytest.raises(BlockingIOError):
        LockFile(made.endpoints.lock).acquire()


async def test_who_knocked_at_the_old_socket_comes_in(made: Made) -> None:
    made.connect()
    shutil.rmtree(made.endpoints.folder)
    made.place.look()
    await made.connected(1)


async def test_a_link_in_a_sockets_place_is_removed_and_not_followed(
    made: Made, tmp_path: Path
) -> None:
    path = made.endpoints.folder / "bench.stop"
    path.unlink()
    path.symlink_to(tmp_path / "elsewhere")
    assert "bench.stop" in made.place.look()
    assert path.is_socket()
    assert not (tmp_path / "elsewhere").exists()


async def test_a_name_that_another_daemon_took_is_left_to_it_and_told_once(made: Made) -> None:
    shutil.rmtree(made.endpoints.folder)
    prepare_folder(made.endpoints.folder)
    other = LockFile(made.endpoints.lock)
    other.acquire()
    assert "another daemon has the name" in made.place.look()
    assert made.place.look() == ""
    assert not made.endpoints.connection_file.exists()
    made.endpoints.lock.unlink()
    assert "made again" in made.place.look()
    other.release()
