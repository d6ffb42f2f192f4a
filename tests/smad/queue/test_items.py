"""What the command line lets into a queue, and what it says of the rest."""

import errno
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from smad.api import Reason
from smad.cli import execute
from smad.cli.queue_items import KINDS, items_of, obstacle_of
from smad.client.errors import (
    BoardRefused,
    NoAnswer,
    NoDaemon,
    NotInControl,
    NotReady,
    Refused,
    Stopped,
)
from smad.errors import ComputerError, SmadError
from smad.experiments.errors import StoppedError, TrippedError
from smad.queue import Queue, QueueError, machine
from smad.queue.ending import is_used_up, status_of
from smad.queue.machine import Obstacle

MOVES = '[[pieces]]\nkind = "step"\ndisplacement_mm = {mm}\nduration_s = 2.0\n'


def said(obstacle: Obstacle | None) -> str:
    assert obstacle is not None
    assert not obstacle.of_computer
    return obstacle.text


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SMAD_RUNTIME_DIR", str(tmp_path / "nobody"))
    monkeypatch.setenv("SMAD_QUEUE", str(tmp_path / "runs"))
    (tmp_path / "steps.toml").write_text(MOVES.format(mm=3.0))
    return tmp_path


def test_a_shortened_experiment_is_made_whole_and_repeats_are_items_of_their_own(
    folder: Path,
) -> None:
    items = items_of("run", ["fig11", "--set", "cycles=3"], folder, 2)
    assert [item.title for item in items] == [
        "run fig11-tracking --set cycles=3 (1 of 2)",
        "run fig11-tracking --set cycles=3 (2 of 2)",
    ]
    assert items[0].words == ("run", "fig11-tracking", "--set", "cycles=3")
    assert items[0].on_bench


def test_every_kind_is_taken_and_what_is_simulated_needs_no_bench(folder: Path) -> None:
    (folder / "good").mkdir()
    (folder / "good" / "baseline.json").write_text("{}")
    words = {
        "run": ["fig10", "--sim"],
        "tune": ["temperature", "--spring", "y"],
        "checkup": ["--baseline", "good"],
        "move": ["steps.toml"],
    }
    assert set(words) == set(KINDS)
    made = [items_of(kind, given, folder, 1)[0] for kind, given in words.items()]
    assert [item.on_bench for item in made] == [False, True, True, True]
    assert [obstacle_of(item) for item in made] == [None] * 4


def test_a_queued_tune_asks_nobody(folder: Path) -> None:
    (item,) = items_of("tune", ["--no-trial"], folder, 1)
    assert item.words == ("tune", "--yes", "--no-trial")
    assert item.title == "tune --no-trial"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["add", "walk"], "no such kind of item"),
        (["add", "run", "nonsense"], "no such experiment"),
        (["add", "run", "fig11", "--set", "cycles=-1"], "cycles is not valid"),
        (["add", "run", "fig11", "--report"], "requires an argument"),
        (["add", "run", "--list"], "is not queued"),
        (["add", "run", "repeat", "gone.mcap"], "is not there"),
        (["add", "run", "endurance", "--cycles", "0"], "'0' is not within 1 to 10000000"),
        (["add", "tune", "sideways"], "is not one of"),
        (["add", "tune", "--help"], "a command with --help does nothing"),
        (["add", "checkup", "--baseline", "gone"], "no baseline"),
        (["add", "checkup"], "give --baseline FOLDER of smad gap commission, or --good"),
        (["add", "checkup", "--good", "."], "--good needs --now"),
        (["add", "run", "endurance", "--cycles", "9", "--every", "3", "checkup"], "--baseline"),
        (["add", "move", "gone.toml"], "is not there"),
        (["add", "tune", "--repeat", "0"], "from 1 to 1000"),
        (["add", "tune", "--save", "steps.toml"], "is there already"),
        (["add", "run", "dsc", "--sim", "--report", "gone/x.html"], "there is no folder"),
        (["remove", "3"], "no such item"),
        (["move", "3", "1"], "no such item"),
        (["again", "3"], "no such item"),
        (["resume"], "give an end"),
        (["resume", "--hours", "1"], "the queue is empty"),
        (["resume", "--until", "yesterday"], "not an end time"),
        (["resume", "--hours", "1", "--confirm", "AAAA"], "given alone"),
        (["resume", "--confirm", "AAAA"], "no runner"),
    ],
)
def test_what_is_wrong_is_refused_in_one_line_and_nothing_is_queued(
    folder: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(["queue", *words]) != 0
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    with Queue(folder / "runs") as queue:
        assert queue.snapshot().items == ()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (MOVES.format(mm=3000.0), "file of moves"),
        (MOVES.format(mm=19.0), "limits.displacement_max_mm"),
        ("[[pieces]]\nkind = 'fly'\n", "file of moves"),
        ("pieces = []", "file of moves"),
        ("no toml", "file of moves"),
    ],
)
def test_a_file_of_moves_is_checked_against_the_limits(folder: Path, text: str, told: str) -> None:
    (folder / "steps.toml").write_text(text)
    with pytest.raises(SmadError, match=told):
        items_of("move", ["steps.toml"], folder, 1)


def test_an_item_whose_file_or_folder_has_gone_says_so_when_it_is_looked_at_again(
    folder: Path,
) -> None:
    (item,) = items_of("move", ["steps.toml"], folder, 1)
    (folder / "steps.toml").unlink()
    assert "is not there" in said(obstacle_of(item))
    (folder / "other").mkdir()
    (moved,) = items_of("tune", [], folder / "other", 1)
    (folder / "other").rmdir()
    assert "is gone" in said(obstacle_of(moved))


def test_a_full_disk_is_an_obstacle_of_the_computer_and_not_of_the_item(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (item,) = items_of("move", ["steps.toml"], folder, 1)
    monkeypatch.setattr(
        "smad.experiments.ready.shutil.disk_usage", lambda path: SimpleNamespace(free=1_000_000)
    )
    obstacle = obstacle_of(item)
    assert obstacle is not None
    assert obstacle.of_computer
    assert "too little room for run logs" in obstacle.text


def test_the_disk_that_counts_is_that_on_which_the_daemon_records(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = folder / "recorded"
    recorded.mkdir()
    monkeypatch.setattr("smad.client.folder.recording_folder", lambda bench: recorded)
    monkeypatch.setattr(
        "smad.experiments.ready.shutil.disk_usage",
        lambda path: SimpleNamespace(free=1_000_000 if path == recorded else 10**12),
    )
    with pytest.raises(ComputerError, match="recorded"):
        items_of("move", ["steps.toml"], folder, 1)


def test_the_queue_in_python_checks_as_the_command_line_does(folder: Path) -> None:
    with Queue(folder / "runs") as queue:
        (item,) = queue.add("move", "steps.toml")
        assert queue.snapshot().queued == (item,)
        with pytest.raises(QueueError, match="no such experiment"):
            queue.add("run", "nonsense")


def test_the_list_as_json_has_items_and_mode(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(["queue", "add", "--json", "move", "steps.toml"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["id"] == 1
    assert execute(["queue", "list", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["mode"], told["runner"], len(told["items"])) == ("paused", False, 1)


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (StoppedError("x"), machine.STOPPED),
        (Stopped("x"), machine.STOPPED),
        (NotReady("x", reason=Reason.STOPPED), machine.STOPPED),
        (TrippedError("x"), machine.TRIPPED),
        (NotReady("x", reason=Reason.FAULTED), machine.TRIPPED),
        (NoDaemon("x"), machine.LOST),
        (NoAnswer("x"), machine.LOST),
        (NotReady("x", reason=Reason.NOT_CONNECTED), machine.LOST),
        (NotInControl("x", reason=Reason.NOT_IN_CONTROL), machine.STOPPED),
        (BoardRefused("x", reason=Reason.NO_REPLY), machine.LOST),
        (BoardRefused("x", reason=Reason.BOARD_REFUSED), 1),
        (Refused("x", reason=Reason.RECORDER), machine.SHORT),
        (ComputerError("x"), machine.SHORT),
        (SmadError("x"), 1),
    ],
)
def test_a_stop_a_fault_and_a_lost_daemon_have_exit_statuses_of_their_own(
    error: SmadError, status: int
) -> None:
    assert status_of(error) == status


@pytest.mark.parametrize(
    ("error", "used_up"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), True),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), True),
        (MemoryError(), True),
        (FileNotFoundError(errno.ENOENT, "No such file or directory"), False),
    ],
)
def test_a_computer_that_is_used_up_differs_from_a_file_that_is_missing(
    error: MemoryError | OSError, used_up: bool
) -> None:
    assert is_used_up(error) is used_up
