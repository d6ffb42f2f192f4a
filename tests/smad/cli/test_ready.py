"""Every program that heats the bench looks first for what it will need afterwards."""

from __future__ import annotations

import ast
import importlib.util
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import smad.cli
from smad import api
from smad.cli import execute
from smad.cli.output import ready_client
from smad.client.endpoints import FOLDER_VARIABLE
from smad.config import Config, config_to_toml
from smad.errors import SmadError
from smad.experiments.ready import require_ready
from smad.files import display_path
from tests.smad.cli.test_commands import STATUS
from tests.smad.fakedaemon import MOTION, FakeDaemon, fake_daemon

DRIVERS = {
    "LiveDriver",
    "RestFirstDriver",
    "InPlaceDriver",
    "live",
    "repeat_on",
}
"""What carries a plan out on a daemon."""
HEATING = {
    "tune": ["tune", "--yes"],
    "run": ["run", "resistance"],
    "gap next": ["gap", "next", "--run", "sines"],
    "gap commission": ["gap", "commission", "--quick", "--baseline", "baseline"],
}


@pytest.fixture
def daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDaemon]:
    sockets = tmp_path / "s"
    sockets.mkdir()
    monkeypatch.setenv(FOLDER_VARIABLE, str(sockets))
    monkeypatch.chdir(tmp_path)
    with fake_daemon(sockets) as one:
        one.answers["motion"] = msgspec.structs.replace(MOTION, armed=False, mode="SAFE")
        one.answers["config"] = api.ConfigText(toml=config_to_toml(Config()))
        logs_in(one, tmp_path / "runs")
        yield one


def logs_in(daemon: FakeDaemon, folder: Path) -> None:
    recorder = api.RecorderStatus(recording=False, folder=str(folder))
    daemon.answers["status"] = msgspec.structs.replace(STATUS, recorder=recorder)


def asked(daemon: FakeDaemon) -> set[str]:
    return {request["method"] for request in daemon.asked}


@pytest.mark.parametrize("words", HEATING.values(), ids=HEATING)
def test_nothing_is_armed_where_the_logs_of_the_daemon_cannot_be_read(
    words: list[str], daemon: FakeDaemon, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    logs_in(daemon, tmp_path / "file" / "runs")
    assert execute(words) == 1
    assert "the run logs of the daemon cannot be read from here" in capsys.readouterr().err
    assert not asked(daemon) & {"arm", "move", "heat", "current", "record.start"}


@pytest.mark.parametrize("words", HEATING.values(), ids=HEATING)
def test_nothing_is_armed_where_a_package_is_missing_that_is_needed_afterwards(
    words: list[str],
    daemon: FakeDaemon,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda n, *a: None if n == "numpy" else find(n, *a)
    )
    assert execute(words) == 1
    assert "numpy is not installed" in capsys.readouterr().err
    assert "arm" not in asked(daemon)


@pytest.mark.parametrize(
    "words",
    [
        ["tune", "--save", "none/a.toml"],
        ["run", "resistance", "--report", "none/a.html"],
        ["run", "resistance", "--save-parameters", "none/a.toml"],
    ],
)
def test_nothing_is_armed_where_the_output_cannot_be_written(
    words: list[str], daemon: FakeDaemon, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(words) == 1
    assert "there is no folder none" in capsys.readouterr().err
    assert not daemon.asked


def test_a_disk_without_room_is_told_with_what_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, daemon: FakeDaemon
) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=1_000_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda place: usage)
    with pytest.raises(SmadError, match=r"too little room .* got 1 MB free; allowed: 72 MB"):
        ready_client("bench", extra="gap").__enter__()
    assert "arm" not in asked(daemon)


def test_a_bench_that_is_ready_is_not_refused(tmp_path: Path) -> None:
    require_ready(extra="gap", outputs=[tmp_path / "page.html", None])


def test_every_module_of_the_command_line_that_drives_a_daemon_asks_first() -> None:
    (folder,) = smad.cli.__path__
    modules = [m for m in sorted(Path(folder).glob("*.py")) if m.name != "output.py"]
    driving = [m for m in modules if called(m) & DRIVERS]
    assert {m.name for m in driving} >= {
        "tune.py",
        "run.py",
        "repeat.py",
        "gap_next.py",
        "gap_checkup.py",
        "run_endurance.py",
    }
    assert [m.name for m in driving if "ready_client" not in called(m)] == []


def called(module: Path) -> set[str]:
    calls = (n for n in ast.walk(ast.parse(module.read_text())) if isinstance(n, ast.Call))
    return {call.func.id for call in calls if isinstance(call.func, ast.Name)}


def test_a_path_is_shown_from_here_on_where_it_is_below(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert display_path(tmp_path / "runs" / "a.mcap") == f"runs{os.sep}a.mcap"
    assert display_path("/elsewhere/a.mcap") == "/elsewhere/a.mcap"
