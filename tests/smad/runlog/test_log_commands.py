"""`smad log`: tables for people, JSON for programs."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from msgspec.structs import replace

from smad.cli.log import log
from smad.errors import RunLogError, SmadError
from smad.runlog.export import WRITERS
from smad.runlog.reader import read_run
from smad.runlog.schema import Event
from smad.runlog.writer import write_run

from .helpers import HEADER, rows, write_small_run


def invoke(*words: object) -> Result:
    return CliRunner().invoke(log, [str(word) for word in words])


def output(*words: object) -> str:
    result = invoke(*words)
    assert result.exception is None, result.output
    return result.output


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_small_run(tmp_path / "20261120-050709-first.mcap", 100)
    write_small_run(tmp_path / "20261120-060000-second.mcap", 300)
    return tmp_path


def test_list_has_a_line_for_each_run(folder: Path) -> None:
    lines = output("list", "--folder", folder).splitlines()
    assert [line.split()[0] for line in lines] == [
        "file",
        "20261120-050709-first.mcap",
        "20261120-060000-second.mcap",
    ]
    assert [run["rows"] for run in json.loads(output("list", "--folder", folder, "--json"))] == [
        100,
        300,
    ]


@pytest.mark.parametrize("jump_s", [-7200.0, 0.0, 3600.0])
def test_durations_are_the_boards_when_somebody_sets_the_clock_in_mid_run(
    tmp_path: Path, jump_s: float
) -> None:
    late_s = 1.79e9 + jump_s
    write_run(
        tmp_path / "run.mcap",
        HEADER,
        [
            Event(host_time_s=1.79e9 - 5.0, kind="link", text="connected"),
            *rows(100),
            Event(host_time_s=late_s, kind="link", text="the port was lost"),
            *(replace(row, host_time_s=late_s + row.t_s) for row in rows(200, start=100)),
            Event(host_time_s=late_s + 9.0, kind="note", text="afterwards"),
        ],
    )
    listed, shown = durations_s(tmp_path / "run.mcap")
    assert listed == shown == pytest.approx(2.99)


def test_durations_add_up_when_the_board_restarts_in_mid_run(tmp_path: Path) -> None:
    write_run(tmp_path / "run.mcap", HEADER, [*rows(1000), *rows(301)])
    listed, shown = durations_s(tmp_path / "run.mcap")
    assert listed == shown == pytest.approx(9.99 + 3.0)


def test_a_recovered_log_is_listed_with_what_is_left_of_it(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap", 2000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    output("recover", path)
    path.unlink()
    listed, shown = durations_s(tmp_path / "run.recovered.mcap")
    assert listed == shown
    assert 0.0 < shown < 19.99


def test_a_log_that_does_not_say_how_long_it_is_is_listed_without(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap", 100)
    path.write_bytes(path.read_bytes().replace(b"board_s", b"bored_s"))
    assert durations_s(path)[0] is None
    assert "100" in output("list", "--folder", tmp_path)


def durations_s(path: Path) -> tuple[float, float]:
    """What `list` and what `show` say of the only log of a folder."""
    (listed,) = json.loads(output("list", "--folder", path.parent, "--json"))
    return listed["duration_s"], json.loads(output("show", path, "--json"))["duration_s"]


def test_an_empty_folder_is_said_to_be_empty(tmp_path: Path) -> None:
    assert "no run logs" in output("list", "--folder", tmp_path)
    result = invoke("show", "--folder", tmp_path)
    assert isinstance(result.exception, RunLogError)


def test_show_takes_the_newest_run_and_names_channels_and_events(folder: Path) -> None:
    text = output("show", "--folder", folder)
    assert "second.mcap" in text
    assert "300 in 2.99 s at 100 Hz" in text
    assert "too hot" in text
    summary = json.loads(output("show", folder / "20261120-050709-first.mcap", "--json"))
    assert summary["rows"] == 100
    assert summary["seed"] == 7


@pytest.mark.parametrize("suffix", [suffix[1:] for suffix in WRITERS])
def test_export_writes_beside_the_log(folder: Path, suffix: str) -> None:
    path = folder / "20261120-050709-first.mcap"
    assert "100 rows to" in output("export", path, "--to", suffix)
    assert path.with_suffix(f".{suffix}").exists()
    again = invoke("export", path, "--to", suffix)
    assert isinstance(again.exception, SmadError)
    assert "--overwrite" in str(again.exception)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("--to csv -o a.parquet", "another format; got a.parquet; allowed: *.csv"),
        ("-o a.csv --fps 5", "frames are those of lerobot; got 5; leave --fps out"),
    ],
)
def test_an_export_ignores_no_option(folder: Path, words: str, told: str) -> None:
    refused = invoke("export", folder / "20261120-050709-first.mcap", *words.split())
    assert isinstance(refused.exception, SmadError)
    assert told in str(refused.exception)


def test_a_log_of_one_axis_is_not_split(folder: Path) -> None:
    refused = invoke("split", folder / "20261120-050709-first.mcap")
    assert isinstance(refused.exception, SmadError)
    assert "of one axis; use it as it is" in str(refused.exception)


def test_import_says_what_became_of_each_column(tmp_path: Path) -> None:
    source = tmp_path / "a.csv"
    source.write_text("time_s,x_mm,why\n0,1,a\n1,2,b\n")
    text = output("import", source)
    assert "2 rows to" in text
    assert "left out: why" in text
    assert "force_N" in text
    assert len(read_run(tmp_path / "a.mcap")) == 2


def test_import_takes_a_mapping(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Zeit,force_N\n0,1\n1,1\n")
    (tmp_path / "m.toml").write_text('[columns."Zeit"]\nchannel = "t_s"\ncolumn_unit = "ms"\n')
    done = json.loads(
        output("import", tmp_path / "a.csv", "--mapping", tmp_path / "m.toml", "--json")
    )
    assert done["channel_of"] == {"Zeit": "t_s", "force_N": "force_N"}


def test_recover_says_what_was_lost(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap", 2000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    text = output("recover", path)
    kept = read_run(tmp_path / "run.recovered.mcap")
    assert not kept.cut_short
    assert 0 < len(kept) < 2000
    assert f"{len(kept)} messages to" in text
    assert "cut off at byte" in text


def test_help_of_every_command_is_at_hand() -> None:
    for command in log.commands:
        assert "Usage" in output(command, "--help")


@pytest.mark.parametrize(
    ("suffix", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")]
)
def test_a_run_is_written_as_a_figure_of_a_columns_width(
    folder: Path, tmp_path: Path, suffix: str, begins: bytes
) -> None:
    target = tmp_path / f"figure.{suffix}"
    assert output("plot", "--folder", folder, "--figure", target).strip() == str(target)
    data = target.read_bytes()
    assert data.startswith(begins)
    output("plot", "--folder", folder, "--figure", target)
    assert target.read_bytes() == data
    if suffix == "svg":
        assert f'width="{85 / 25.4 * 72:.6f}pt"' in data.decode()
        assert "Displacement" in data.decode()
    if suffix == "png":
        assert int.from_bytes(data[16:20], "big") == pytest.approx(85 / 25.4 * 600, abs=1)


def test_a_figure_of_another_kind_is_refused(folder: Path, tmp_path: Path) -> None:
    result = invoke("plot", "--folder", folder, "--figure", tmp_path / "a.jpg")
    assert isinstance(result.exception, SmadError)
    assert ".pdf .png .svg" in str(result.exception)
