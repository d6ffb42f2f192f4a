"""Programmes played run by run: what was finished is kept, and played once."""

from pathlib import Path

import pytest

from smad.checkup.errors import BaselineError
from smad.checkup.programme import Programme, ProgrammeRun, shipped
from smad.checkup.series import Recorded, finished, folder_for, play_series, read_state
from smad.control.commands import FollowInputs
from smad.control.plan import Do

PROGRAMME = shipped().quick()
FIRST, SECOND = (run.name for run in PROGRAMME.runs)


class Player:
    """Writes a log for each run; `fails` and `ends` name runs that do not get to their end."""

    def __init__(self, folder: Path, *, fails: str = "", ends: str = "") -> None:
        self._folder = folder
        self._fails = fails
        self._ends = ends
        self.asked: list[tuple[str, Path | None]] = []

    def __call__(self, run: ProgrammeRun, original: Path | None) -> Recorded:
        self.asked.append((run.name, original))
        if run.name == self._fails:
            raise ConnectionError("the daemon went away")
        log = self._folder / f"some-{run.name}.mcap"
        log.write_text(run.name)
        return Recorded(log, "it slipped" if run.name == self._ends else "")


def series(parent: Path, kind: str, programme: Programme = PROGRAMME) -> Path:
    return folder_for(parent, kind, programme)


def said(text: str) -> None:
    """What a user would read."""


def test_an_interrupted_series_goes_on_after_the_last_run_that_was_finished(
    tmp_path: Path,
) -> None:
    folder = series(tmp_path, "good")
    lines: list[str] = []
    with pytest.raises(ConnectionError):
        play_series(folder, PROGRAMME, Player(tmp_path, fails=SECOND), None, lines.append)
    assert lines[-1] == "good-1: 1 of 2 runs are kept; the same command goes on after them"
    assert finished([folder], PROGRAMME) == []
    assert series(tmp_path, "good") == folder
    again = Player(tmp_path)
    assert play_series(folder, PROGRAMME, again, None, said) == ""
    assert [name for name, _ in again.asked] == [SECOND]
    assert finished([folder], PROGRAMME) == [folder]
    assert series(tmp_path, "good").name == "good-2"


def test_a_series_that_was_ended_early_is_kept_and_no_repeat(tmp_path: Path) -> None:
    folder = series(tmp_path, "now")
    player = Player(tmp_path, ends=FIRST)
    assert play_series(folder, PROGRAMME, player, tmp_path / "good-1", said) == "it slipped"
    assert player.asked == [(FIRST, tmp_path / "good-1" / f"{FIRST}.mcap")]
    state = read_state(folder)
    assert state is not None
    assert state.ended == "it slipped"
    assert (folder / f"{FIRST}.mcap").exists()
    assert finished([folder], PROGRAMME) == []
    assert series(tmp_path, "now").name == "now-2"


def test_a_series_of_another_programme_is_not_gone_on_with(tmp_path: Path) -> None:
    folder = series(tmp_path, "now")
    with pytest.raises(ConnectionError):
        play_series(folder, PROGRAMME, Player(tmp_path, fails=SECOND), None, said)
    assert series(tmp_path, "now", shipped()).name == "now-2"


def test_a_disk_that_is_full_leaves_no_half_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = series(tmp_path, "good")

    def full(source: Path, target: Path) -> None:
        target.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(BaselineError, match=r"cannot keep the run.*No space left.*make room"):
        play_series(folder, PROGRAMME, Player(tmp_path), None, said)
    assert [p.name for p in folder.iterdir()] == ["series.json"]


def test_a_run_of_a_programme_is_one_timeline_of_its_rows() -> None:
    run = PROGRAMME.runs[0]
    commands = [a.command for a in run.plan().actions if isinstance(a, Do)]
    assert all(isinstance(c, FollowInputs) for c in commands)
    times = [t for c in commands if isinstance(c, FollowInputs) for t in c.t_s]
    assert times == run.t_s.tolist()
    assert commands[-1].end_s == run.duration_s  # type: ignore[union-attr]
