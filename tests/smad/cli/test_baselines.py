"""`smad gap commission` and `checkup --baseline`, the bench replaced: what is kept and told."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

import smad.cli.gap_checkup as commands
from smad.checkup import programme
from smad.checkup.programme import Programme, ProgrammeRun
from smad.checkup.series import Player, Recorded, finished
from smad.checkup.store import SCHEMA, read_about
from smad.cli import execute
from smad.cli.gap_runs import without_cut_runs
from smad.diagnosis import spring_pair
from smad.diagnosis.runs import GapRun
from smad.runlog.header import RunHeader
from smad.runlog.schema import CUT, Event, Row
from smad.runlog.writer import write_run
from tests.smad.checkup.short import PLANT, SHORT, played

PROGRAMME = Programme("short", "one run", (replace(SHORT, quick=True),))
OTHER = Programme("short", "another", (replace(SHORT, name="other"),))


def write_log(path: Path, run: GapRun, board: str = "", cut: str = "") -> None:
    columns = {"t_s": run.t_s, **run.inputs, **run.outputs}
    rows = [
        Row(**dict(zip(columns, values, strict=True)))
        for values in zip(*(c.tolist() for c in columns.values()), strict=True)
    ]
    header = RunHeader(source="sim", rate_hz=100.0, board={"uid": board} if board else {})
    events = [Event(t_s=float(run.t_s[-1]), kind="note", text=f"{CUT}{cut}")] if cut else []
    write_run(path, header, [*rows, *events])


class ScriptedBench:
    """Plays what is asked; the run number `fails_at` does not come to its end."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.number = count(1)
        self.runs = 0
        self.clients = 0
        self.fails_at = 0

    @contextlib.contextmanager
    def player(self, line: object, *effects: object) -> Iterator[Player]:
        self.clients += 1

        def play(run: ProgrammeRun, original: Path | None) -> Recorded:
            self.runs += 1
            if self.runs == self.fails_at:
                raise KeyboardInterrupt
            path = self.folder / f"{next(self.number)}.mcap"
            write_log(path, played(90 + self.runs, what=run), "board-1")
            return Recorded(path)

        yield lambda series: play


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ScriptedBench:
    return scripted(monkeypatch, tmp_path)


def scripted(monkeypatch: pytest.MonkeyPatch, folder: Path) -> ScriptedBench:
    own = ScriptedBench(folder)
    monkeypatch.setattr(commands._Bench, "player", own.player)
    monkeypatch.setattr(spring_pair, "SmaPlant", lambda: PLANT)
    monkeypatch.setattr(programme, "chosen", lambda folder, quick=False: PROGRAMME)
    return own


def commission(folder: Path, *options: str) -> int:
    return execute(["gap", "commission", "--sim", "--baseline", str(folder), *options])


@pytest.fixture(scope="module")
def commissioned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A baseline, and how many runs were played for it; a test changes a copy of it."""
    folder = tmp_path_factory.mktemp("commissioned")
    with pytest.MonkeyPatch.context() as patch:
        own = scripted(patch, folder)
        assert commission(folder / "baseline") == 0
    return folder / "baseline", own.runs


@pytest.fixture
def baseline(bench: ScriptedBench, commissioned: tuple[Path, int], tmp_path: Path) -> Path:
    """The folder of a baseline that this bench has played."""
    made, bench.runs = commissioned
    return Path(shutil.copytree(made, tmp_path / "baseline"))


def test_a_commissioning_that_was_interrupted_goes_on_and_again_adds_what_was_asked(
    bench: ScriptedBench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "baseline"
    bench.fails_at = 2
    assert commission(folder) != 0
    assert commission(folder) == 0
    assert bench.runs == 3
    assert commission(folder) != 0
    assert "is a baseline already; add repeats to it with --again" in capsys.readouterr().err
    assert commission(folder, "--again", "--repeats", "1") == 0
    assert read_about(folder).repeats == 3
    assert bench.runs == 4


def test_repeats_that_were_played_and_not_yet_counted_are_not_played_once_more(
    bench: ScriptedBench, baseline: Path
) -> None:
    folder = baseline
    before = [(folder / n, (folder / n).read_bytes()) for n in ("baseline.json", "reference.npz")]
    assert commission(folder, "--again", "--repeats", "1") == 0
    for path, data in before:
        path.write_bytes(data)
    assert commission(folder, "--again", "--repeats", "1") == 0
    assert (bench.runs, read_about(folder).repeats) == (3, 3)


@pytest.mark.parametrize("broken", ["baseline.json", "reference.npz"])
def test_a_baseline_that_cannot_be_read_is_computed_anew_and_nothing_is_played(
    bench: ScriptedBench, baseline: Path, broken: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = baseline
    path = folder / broken
    text = path.read_bytes()
    path.write_bytes(
        text.replace(b'"schema": %d' % SCHEMA, b'"schema": 1') if broken[0] == "b" else b"torn"
    )
    checkup = ["gap", "checkup", "--sim", "--baseline", str(folder)]
    assert execute(checkup) != 0
    assert "commission again in the same folder: it is computed anew" in capsys.readouterr().err
    assert commission(folder) == 0
    assert "computed anew from the runs in" in capsys.readouterr().err
    assert bench.runs == 2
    assert execute(checkup) == 0


def test_good_runs_of_another_programme_are_not_mixed_with_it(
    bench: ScriptedBench,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "baseline"
    bench.fails_at = 2
    assert commission(folder) != 0
    monkeypatch.setattr(programme, "chosen", lambda folder, quick: OTHER)
    assert commission(folder) != 0
    assert "good-1 holds runs of another programme; got " in capsys.readouterr().err


def test_good_runs_and_those_of_another_bench_are_no_runs_of_now(
    baseline: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, elsewhere = baseline, tmp_path / "elsewhere"
    elsewhere.mkdir()
    write_log(elsewhere / "short.mcap", played(1), "board-2")
    checkup = ["gap", "checkup", "--baseline", str(folder), "--now"]
    assert execute([*checkup, str(folder / "good-2")]) != 0
    assert "is given twice" in capsys.readouterr().err
    assert execute([*checkup, str(elsewhere)]) != 0
    assert "runs of two benches are mixed" in capsys.readouterr().err


def test_one_client_plays_all_repeats_of_a_bench_and_knows_of_a_stop_between_them(
    bench: ScriptedBench, tmp_path: Path
) -> None:
    assert execute(["gap", "commission", "--baseline", str(tmp_path / "baseline")]) == 0
    assert (bench.runs, bench.clients) == (2, 1)


def test_an_investigation_says_why_it_is_over_and_what_would_be_played_next(
    bench: ScriptedBench, baseline: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(["gap", "investigate", "--sim", "--baseline", str(baseline)]) == 0
    said = capsys.readouterr().out
    finding = "every run of the baseline was played: nothing has changed beyond the repeat floor"
    assert f"{finding}; 1 run in 0.4 min\n" in said
    assert said.endswith(f"runs and report: {baseline / 'investigation-1'}\n")
    assert execute(["gap", "next", "--baseline", str(baseline)]) == 0
    assert capsys.readouterr().out.endswith(f"\n{finding}\n")
    assert bench.clients == 1


STOP = "stopped by disarm of a client"


def test_a_good_run_that_a_stop_cut_is_told_of_and_left_out_of_a_check_up(
    bench: ScriptedBench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, now = tmp_path / "good", tmp_path / "now"
    good.mkdir()
    now.mkdir()
    write_log(good / "whole.mcap", played(1))
    write_log(good / "cut.mcap", played(2), cut=STOP)
    write_log(now / "short.mcap", played(3))
    command = ["gap", "checkup", "--good", str(good), "--now", str(now)]
    assert execute(command) == 0
    said = capsys.readouterr().err
    assert f"cut.mcap was cut ({STOP}), and is left out of the good runs" in said
    assert "repeats 1 good run: " in said
    (good / "whole.mcap").unlink()
    assert execute(command) != 0
    assert "was cut; " in capsys.readouterr().err


def test_a_diagnosis_takes_no_good_run_that_was_cut(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, cut, table = tmp_path / "whole.mcap", tmp_path / "cut.mcap", tmp_path / "table.csv"
    write_log(whole, played(1))
    write_log(cut, played(2), cut=STOP)
    assert without_cut_runs([whole, cut, table]) == (whole, table)
    assert f"cut.mcap was cut ({STOP})" in capsys.readouterr().err
    assert execute(["gap", "diagnose", str(whole), "--good", str(cut)]) == 2
    assert "every good run was cut" in capsys.readouterr().err


def test_a_repeat_with_a_cut_run_is_no_part_of_a_baseline(baseline: Path) -> None:
    folder = baseline
    cut = folder / "good-2" / "short.mcap"
    cut.unlink()
    write_log(cut, played(92), "board-1", cut=STOP)
    assert finished([folder / "good-1", folder / "good-2"], PROGRAMME) == [folder / "good-1"]
