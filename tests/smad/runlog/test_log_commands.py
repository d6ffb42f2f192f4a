"""`smad log`: tables for people, JSON for programs."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from smad.cli.log import log
from smad.errors import RunLogError, SmadError
from smad.runlog.reader import read_run

from .helpers import write_small_run


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
        "file", "20261120-050709-first.mcap", "20261120-060000-second.mcap",
    ]  # fmt: skip
    assert [run["rows"] for run in json.loads(output("list", "--folder", folder, "--json"))] == [
        100, 300,
    ]  # fmt: skip


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


@pytest.mark.parametrize("suffix", ["csv", "parquet", "mat"])
def test_export_writes_beside_the_log(folder: Path, suffix: str) -> None:
    path = folder / "20261120-050709-first.mcap"
    assert "100 rows to" in output("export", path, "--to", suffix)
    assert path.with_suffix(f".{suffix}").exists()
    again = invoke("export", path, "--to", suffix)
    assert isinstance(again.exception, SmadError)
    assert "--overwrite" in str(again.exception)


def test_import_says_what_became_of_each_column(tmp_path: Path) -> None:
    source = tmp_path / "a.csv"
    source.write_text("time_s,x_mm,why\n0,1,a\n1,2,b\n")
    text = output("import", source)
    assert "2 rows to" in text
    assert "left out: why" in text
    assert "force_N" in text
    assert len(read_run(tmp_path / "a.mcap")) == 2


def test_import_takes_a_mapping(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Zeit\n0\n1\n")
    (tmp_path / "m.toml").write_text('[columns."Zeit"]\nchannel = "t_s"\nunit = "ms"\n')
    done = json.loads(
        output("import", tmp_path / "a.csv", "--mapping", tmp_path / "m.toml", "--json")
    )
    assert done["channel_of"] == {"Zeit": "t_s"}


def test_recover_says_what_was_lost(tmp_path: Path) -> None:
    path = write_small_run(tmp_path / "run.mcap", 2000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    text = output("recover", path)
    kept = read_run(tmp_path / "run.recovered.mcap")
    assert not kept.cut_short
    assert 0 < len(kept) < 2000
    assert f"{len(kept)} messages to" in text
    assert "breaks off at byte" in text


def test_help_of_every_command_is_at_hand() -> None:
    for command in log.commands:
        assert "Usage" in output(command, "--help")
