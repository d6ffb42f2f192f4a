"""The daemon process and what it opens: too few descriptors, planted links, keys struck off."""

import signal
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
import zmq

from campaign.rig import free_ports
from smad.client import Client, NoAnswer
from smad.client.wire import Keys
from smad.config import TcpConfig, config_to_toml, load_config
from smad.processes.daemon import DaemonProcess
from tests.hil.conftest import PATIENCE_S, Hil


def until(done: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.02)


def allow(path: Path, keys: tuple[str, ...], ports: tuple[int, int]) -> None:
    """Write that these keys may command over TCP into a configuration."""
    config = load_config(path)
    tcp = TcpConfig(enabled=True, command_port=ports[0], stop_port=ports[1], allowed_keys=keys)
    daemon = msgspec.structs.replace(config.daemon, tcp=tcp)
    path.write_text(config_to_toml(msgspec.structs.replace(config, daemon=daemon)))


def test_with_too_few_descriptors_it_refuses_to_start_in_one_line(hil: Hil) -> None:
    config = hil.write_config(hil.device().port)
    daemon = DaemonProcess(["--config", str(config)], hil.folder, descriptors=30)
    assert daemon.process.wait(PATIENCE_S) == 1
    text = daemon.log.read_text()
    assert len(text.splitlines()) == 1
    assert text.startswith("smad: the limit on open files is too low")
    assert "got 30; allowed: at least " in text
    least = int(text.split("at least ")[1].split(";")[0])
    enough = DaemonProcess(["--config", str(config)], hil.folder, descriptors=least)
    enough.wait_until_ready()
    assert not hil.client().motion().armed
    enough.end()


def test_links_planted_in_its_folder_are_not_followed(hil: Hil, tmp_path: Path) -> None:
    hil.folder.chmod(0o770)
    names = ("json.new", "json", "command", "stop", "telemetry")
    for name in names:
        (hil.folder / f"bench.{name}").symlink_to(tmp_path / name)
    hil.ready_daemon(hil.device().port)
    assert not hil.client().motion().armed
    assert list(tmp_path.iterdir()) == []
    assert (hil.folder / "bench.json").stat().st_mode & 0o777 == 0o640
    assert (hil.folder / "bench.lock").stat().st_mode & 0o777 == 0o640
    assert (hil.folder / "bench.stop").stat().st_mode & 0o777 == 0o770


@pytest.mark.parametrize("name", ["lock", "key"])
def test_a_planted_link_that_would_have_to_be_followed_is_refused(
    hil: Hil, tmp_path: Path, name: str
) -> None:
    (hil.folder / f"bench.{name}").symlink_to(tmp_path / "target")
    daemon = hil.daemon(hil.device().port)
    if name == "key":
        daemon.end(signal.SIGKILL)
        key = zmq.curve_keypair()[0].decode()
        allow(hil.folder / "bench.toml", (key,), _two(free_ports(2)))
        daemon = DaemonProcess(["--config", str(hil.folder / "bench.toml")], hil.folder)
    assert daemon.process.wait(PATIENCE_S) == 1
    assert "Traceback" not in daemon.log.read_text()
    assert f"bench.{name}" in daemon.last_line
    assert not (tmp_path / "target").exists()


def test_a_hangup_reads_the_list_of_keys_anew_and_nothing_else(hil: Hil) -> None:
    port = hil.device().port
    config = hil.write_config(port)
    ports = _two(free_ports(2))
    pairs = [tuple(k.decode() for k in zmq.curve_keypair()) for _ in range(2)]
    allow(config, (pairs[0][0],), ports)
    daemon = DaemonProcess(["--config", str(config)], hil.folder)
    daemon.wait_until_ready()
    local = hil.client()

    def dial(number: int, timeout_s: float) -> Client:
        keys = Keys(pairs[number][0], pairs[number][1], local.connection.server_key)
        where = (local.connection.tcp_command, local.connection.tcp_stop)
        return Client.remote(*where, keys, timeout_s=timeout_s)

    def hang_up(words: str) -> None:
        daemon.process.send_signal(signal.SIGHUP)
        until(lambda: words in daemon.log.read_text())

    with dial(0, PATIENCE_S) as first:
        assert not first.motion().armed
        config.write_text(config.read_text() + "nonsense = 1\n")
        hang_up("the list of keys stays as it was: ")
        assert "nonsense" in daemon.log.read_text()
        assert not first.motion().armed
        config.write_text(config.read_text().replace("nonsense = 1\n", ""))
        allow(config, (pairs[1][0],), ports)
        hang_up("read the list of keys anew, 1 in all, 1 new, 1 gone")
        with dial(1, PATIENCE_S) as second:
            assert not second.motion().armed
            # The first is connected still, and not heard any more.
            first.timeout_s = 1.0
            with pytest.raises(NoAnswer):
                first.motion()
    assert daemon.end() == 0


def _two(ports: list[int]) -> tuple[int, int]:
    return ports[0], ports[1]
