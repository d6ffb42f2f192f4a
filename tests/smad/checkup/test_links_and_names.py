"""Folders by way of links, and files of one name in several folders."""

from pathlib import Path

import pytest

from smad.checkup.files import _files_below, read_folder
from smad.diagnosis.errors import PairingError
from smad.runlog.paths import distinct_name


def test_a_link_to_a_folder_is_followed_and_one_to_a_folder_above_ends(tmp_path: Path) -> None:
    elsewhere = tmp_path / "disk"
    elsewhere.mkdir()
    (elsewhere / "run-1.csv").write_text("t_s\n")
    folder = tmp_path / "good"
    folder.mkdir()
    (folder / "day-1").symlink_to(elsewhere)
    (elsewhere / "round").symlink_to(folder)
    (folder / "self").symlink_to(folder)
    assert folder / "day-1" / "run-1.csv" in set(_files_below(folder))


def test_a_folder_without_a_run_says_so_also_by_way_of_a_link(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    with pytest.raises(PairingError, match="link holds no run file"):
        read_folder(tmp_path / "link")


def test_runs_of_one_name_are_told_apart_by_their_folders() -> None:
    paths = [Path("a/mon/run-1.csv"), Path("a/tue/run-1.csv"), Path("a/tue/run-2.csv")]
    assert [distinct_name(p, paths) for p in paths] == ["mon/run-1", "tue/run-1", ""]
    deep = [Path("x/day/run.csv"), Path("y/day/run.csv")]
    assert [distinct_name(p, deep) for p in deep] == ["x/day/run", "y/day/run"]
