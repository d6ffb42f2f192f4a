"""What a hangup changes: the list of keys, and nothing else. Keys that are none are refused."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import zmq

from smad.client.endpoints import write_anew
from smad.config import (
    Config,
    DaemonConfig,
    LinkConfig,
    TcpConfig,
    load_config,
    parse_config,
)
from smad.config.curve_key import is_curve_key
from smad.daemon.command.auth import KeyAuthenticator, server_keys
from smad.daemon.command.reload import reread_keys
from smad.errors import ConfigError

FIRST, SECOND = (zmq.curve_keypair()[0].decode() for _ in range(2))


def config(*keys: str, enabled: bool = True, rate_hz: int = 100) -> Config:
    tcp = TcpConfig(enabled=enabled, allowed_keys=keys)
    return Config(link=LinkConfig(rate_hz=rate_hz), daemon=DaemonConfig(tcp=tcp))  # type: ignore[arg-type]


def broken() -> Config:
    raise ConfigError("no such key", value="x")


def test_the_list_is_taken_over_and_the_rest_waits_for_a_restart() -> None:
    authenticator = KeyAuthenticator((FIRST,))
    told = reread_keys(config(FIRST), authenticator, lambda: config(SECOND, rate_hz=250))
    assert told == (
        "SIGHUP: read the list of keys anew, 1 in all, 1 new, 1 gone; "
        "what else has changed waits for a restart"
    )
    assert authenticator.knows(SECOND)
    assert not authenticator.knows(FIRST)
    assert authenticator.refused == 1


@pytest.mark.parametrize(
    ("reread", "words"),
    [
        (None, "without a configuration file"),
        (broken, "stays as it was: no such key; got x"),
        (lambda: config(SECOND, enabled=False), "stays as it was: TCP is off in the file"),
    ],
)
def test_what_cannot_be_used_leaves_the_list_as_it_was(
    reread: Callable[[], Config] | None, words: str
) -> None:
    authenticator = KeyAuthenticator((FIRST,))
    assert words in reread_keys(config(FIRST), authenticator, reread)
    assert authenticator.knows(FIRST)


def test_a_pipe_as_configuration_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(path := tmp_path / "smad.toml")
    said = reread_keys(config(FIRST), None, partial(load_config, path, again=True))
    assert "stays as it was" in said
    assert "it is not a file" in said


def test_without_tcp_there_is_no_list_to_change() -> None:
    assert "TCP are off" in reread_keys(Config(), None, lambda: config(FIRST))


def test_a_key_is_forty_digits_of_z85_and_32_bytes() -> None:
    assert all(is_curve_key(zmq.curve_keypair()[n].decode()) for n in (0, 1) for _ in range(100))
    largest = "%nSc0" * 8
    assert is_curve_key(largest)
    for wrong in ("", FIRST[:-1], FIRST + "0", "~" + FIRST[1:], "ä" + FIRST[1:], "%nSc1" * 8):
        assert not is_curve_key(wrong)


@pytest.mark.parametrize("wrong", ["abc", "#" * 40, "ü" * 40])
def test_an_impossible_entry_is_refused_with_place_value_and_what_is_expected(wrong: str) -> None:
    text = f'[daemon.tcp]\nenabled = true\nallowed_keys = ["{FIRST}", "{wrong}"]\n'
    with pytest.raises(ConfigError) as refused:
        parse_config(text)
    said = str(refused.value)
    assert "`allowed_keys`, entry 2 of 2" in said
    assert repr(wrong) in said
    assert "40 characters of Z85" in said


def _link(path: Path) -> None:
    path.symlink_to(path.parent / "nowhere")


def _garbage(path: Path) -> None:
    path.write_bytes(b"\xff" * 2000)
    path.chmod(0o600)


def _pair(secret: str) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.write_text(f"public {FIRST} secret {secret}")
        path.chmod(0o600)

    return make


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_link, "No such file"),
        (Path.mkdir, "Is a directory"),
        (lambda path: os.mkfifo(path, 0o600), "it is not a file"),
        (_pair("#" * 40), "key pair"),
        (_pair(SECOND), "belonging together"),
        (_pair("short"), "key pair"),
        (_garbage, "key pair"),
    ],
)
def test_a_key_file_that_is_none_is_refused(
    tmp_path: Path, make: Callable[[Path], None], words: str
) -> None:
    path = tmp_path / "key"
    make(path)
    with pytest.raises(ConfigError, match=words):
        server_keys(path, follow=True)
    with pytest.raises(ConfigError):
        server_keys(path)


def test_a_key_file_in_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        server_keys(tmp_path / "missing" / "key")


def test_a_link_to_a_key_file_is_followed_only_where_somebody_named_it(tmp_path: Path) -> None:
    made = server_keys(tmp_path / "key")
    (tmp_path / "link").symlink_to(tmp_path / "key")
    assert server_keys(tmp_path / "link", follow=True) == made
    with pytest.raises(ConfigError):
        server_keys(tmp_path / "link")


@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o600), (0o007, 0o640)])
def test_a_file_is_written_in_place_of_a_planted_link(
    tmp_path: Path, umask: int, mode: int
) -> None:
    path = tmp_path / "bench.crash.txt"
    path.symlink_to(tmp_path / "target")
    write_anew(path, b"text", umask)
    assert not (tmp_path / "target").exists()
    assert path.read_bytes() == b"text"
    assert path.stat().st_mode & 0o777 == mode
