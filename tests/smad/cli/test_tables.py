"""Tables fit the terminal; off a terminal they stay plain; nothing of an earlier run is lost."""

import sys
from pathlib import Path

import pytest

from smad.cli import execute
from smad.experiments.campaign import time_left
from smad.report.page import Table
from smad.view.terminal import tables
from smad.view.terminal.status_lines import folded, labelled
from tests.smad.runlog.helpers import write_small_run

WIDE = Table(
    ("name", "what", "value"),
    [("run-1", "a long sentence about one thing " * 10, "1.25"), ("run-2", "x" * 200, "3")],
    numeric=frozenset({2}),
)


@pytest.mark.parametrize("width", [60, 80, 132])
def test_no_line_of_a_table_is_wider_than_the_terminal_and_nothing_is_cut(width: int) -> None:
    shown = tables.fitted(WIDE.header, WIDE.rows, WIDE.numeric, width)
    assert max(map(len, shown.splitlines())) <= width
    assert shown.count("x") == 200
    assert shown.count("sentence") == 10
    assert "1.25" in shown


@pytest.mark.parametrize("width", range(20, 32))
def test_a_value_stays_with_its_unit_at_the_end_of_a_line(width: int) -> None:
    text = "rtd_lag, tau_s = 0.600 ± 0.004 s, probability 1.00; torque 12 N m, 3 min later"
    for lines in (
        tables.fitted(("rival",), [(text,)], (), width).splitlines()[2:],
        folded(text, width + len(labelled("", ""))).splitlines(),
    ):
        assert " ".join(map(str.strip, lines)) == text
        for value in ("0.600 ± 0.004 s", "12 N m", "3 min"):
            assert any(value in line for line in lines)


def test_columns_that_do_not_fit_are_left_out_and_named() -> None:
    header = ("file", "name", "source", "started", "rows", "size", "")
    row = ("20261125-212958-step-of-5-mm.mcap", "step", "sim", "2026-11-25 21:29:58", "1970",
           "0.16 MB", "cut short")  # fmt: skip
    shown = tables.fitted(header, [row], {4, 5}, 60)
    assert max(map(len, shown.splitlines())) <= 60
    assert "20261125-212958-step-of-5-mm" in shown
    assert "short" in shown
    assert "not shown at this width: started, rows, size" in shown
    assert "less -S" in shown
    assert "not shown" not in tables.fitted(header, [row], {4, 5}, 120)


def test_off_a_terminal_a_table_is_plain_columns(capsys: pytest.CaptureFixture[str]) -> None:
    tables.print_table(WIDE)
    out = capsys.readouterr().out
    assert "x" * 200 in out
    assert out.isascii()


def test_plain_columns_line_up_and_numbers_stand_at_the_right() -> None:
    shown = tables.in_full(("name", "value"), [("a", "1.0"), ("long name", "12.5")], {1})
    assert shown.splitlines() == [
        "name       value",
        "a            1.0",
        "long name   12.5",
    ]


def test_on_a_terminal_the_table_takes_its_width(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    tables.print_table(WIDE)
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_a_torn_log_is_shown_as_far_as_it_goes_with_the_command_that_recovers_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_small_run(tmp_path / "a.mcap", 2000)
    log.write_bytes(log.read_bytes()[: log.stat().st_size * 3 // 5])
    assert execute(["log", "show", str(log)]) == 0
    assert f"smad log recover {log}" in capsys.readouterr().out


def test_an_empty_log_is_told_as_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.mcap").write_bytes(b"")
    assert execute(["log", "show", str(tmp_path / "a.mcap")]) == 1
    assert "nothing was recorded into it" in capsys.readouterr().err


def test_a_page_of_an_earlier_run_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "experiments.html").write_text("earlier")
    assert execute(["run", "dsc", "--sim", "--jobs", "1"]) == 0
    assert (tmp_path / "experiments.html").read_text() == "earlier"
    assert "page  experiments-2.html" in capsys.readouterr().out


def test_progress_says_how_many_runs_are_done_and_how_long_the_rest_may_take() -> None:
    assert time_left(0, 40, 0.0) == ""
    assert time_left(10, 40, 20.0) == "; about 60 s left"
    assert time_left(10, 40, 200.0) == "; about 10 min left"
    assert time_left(40, 40, 200.0) == ""


@pytest.mark.parametrize("width", [60, 70, 80, 100])
def test_the_list_of_run_logs_keeps_every_word_whole(width: int) -> None:
    header = ("file", "name", "source", "started", "rows", "duration", "size", "")
    rows = [
        ("20261126-043534-first-run.mcap", "first run", "sim", "2026-11-26 04:35:34", "125",
         "1.2 s", "0.04 MB", ""),
    ]  # fmt: skip
    shown = tables.fitted(header, rows, {4, 5, 6}, width)
    left_out = shown.partition("not shown")[2]
    for name, cell in zip(header, rows[0], strict=True):
        assert name in shown
        assert name in left_out or all(word in shown for word in cell.split())


def test_a_line_of_the_status_goes_on_below_its_text() -> None:
    line = labelled("link", "ttyACM0, 115200 baud, 100 Hz, 3213 samples, 0 missed, 0 skipped")
    first, second = folded(line, 60).splitlines()
    assert first.startswith("link        ttyACM0")
    assert second.index(second.strip()) == 12
    assert max(len(first), len(second)) <= 60
    assert folded(line, 200) == line
