"""Which process the OOM killer prefers when memory runs out."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from smad.processes import oom
from smad.processes.oom import FIRST, LAST, prefer_as_oom_victim, protect, score

SCORE = Path("/proc/self/oom_score_adj")


def of(code: str) -> int:
    """The adjustment of a process of its own that has run this."""
    script = f"{code}\nprint(open('/proc/self/oom_score_adj').read())"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return int(done.stdout.split()[-1])


@pytest.mark.parametrize("command", ["log list", "gap effects", "run list", "view --help"])
def test_a_command_that_reads_files_is_ended_before_others(command: str) -> None:
    code = f"from smad.cli import execute\nexecute({command.split()!r})"
    assert of(code) == FIRST


def test_a_command_that_drives_the_bench_stays_as_it_was() -> None:
    before = int(SCORE.read_text())
    assert of("from smad.cli import execute\nexecute(['config', 'show'])") == before


def test_a_score_that_is_higher_already_stays(tmp_path: Path) -> None:
    path = tmp_path / "score"
    path.write_text("1000\n")
    prefer_as_oom_victim(path)
    assert score(path) == 1000


def test_the_daemon_asks_to_be_ended_last_and_reads_what_it_got(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "score"
    path.write_text("0\n")
    assert protect(path) == LAST
    path.write_text("0\n")
    monkeypatch.setattr(oom, "_write", lambda path, value: None)
    assert protect(path) == 0


def test_where_there_is_no_such_file_nothing_happens(tmp_path: Path) -> None:
    prefer_as_oom_victim(tmp_path / "none")
    assert protect(tmp_path / "none") is None
    assert not os.listdir(tmp_path)
