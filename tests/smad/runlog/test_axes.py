"""A run log of several axes: a channel set for each, one time base, one file or several."""

from pathlib import Path

import numpy as np
import pytest
from pyarrow import csv, parquet

from smad.cli import execute
from smad.config import parse_config
from smad.errors import RunLogError
from smad.experiments.logs import recording_of
from smad.records.importer import import_table
from smad.report.runs import panels_of, run_parts
from smad.runlog.export import side_by_side
from smad.runlog.formats import export_axes
from smad.runlog.header import RunHeader
from smad.runlog.one_axis import extract
from smad.runlog.overview import list_runs
from smad.runlog.reader import read_axes, read_run
from smad.runlog.recover import recover
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run

NAMES = ("pitch-1", "yaw-1")
BEGUN_S = 1_700_000_000.0


def written(path: Path) -> Path:
    """Two boards whose clocks began 50 s apart, one twice as fast, its first sample later."""
    rows = [
        (Row(t_s=k * 0.01, displacement_mm=float(k)), "pitch-1", BEGUN_S + k * 0.01)
        for k in range(10)
    ]
    rows += [
        (Row(t_s=50.0 + k * 0.02, tick=k), "yaw-1", BEGUN_S + 0.035 + k * 0.02) for k in range(3)
    ]
    header = RunHeader(source="sim", axes=NAMES, started_unix_s=BEGUN_S)
    write_run(path, header, [Event(host_time_s=BEGUN_S, kind="note", text="begun"), *rows])
    return path


def test_each_axis_is_read_by_its_name_with_times_on_one_clock(tmp_path: Path) -> None:
    path = written(tmp_path / "run.mcap")
    runs = read_axes(path)
    assert list(runs) == list(NAMES)
    assert [len(run) for run in runs.values()] == [10, 3]
    assert runs["yaw-1"].columns["t_s"][0] == 50.0
    assert runs["yaw-1"].unix_s[0] - runs["pitch-1"].unix_s[0] == pytest.approx(0.035, abs=1e-6)
    assert [event.text for event in read_run(path, axis="yaw-1").events] == ["begun"]
    (listed,) = list_runs(tmp_path)
    assert (listed.rows, listed.problem) == (10, "")
    assert listed.duration_s == pytest.approx(0.09)


def test_an_axis_must_be_named_and_be_there(tmp_path: Path) -> None:
    path = written(tmp_path / "run.mcap")
    for axis in ("", "roll"):
        with pytest.raises(RunLogError, match=r"several axes; got .*; allowed: pitch-1, yaw-1"):
            read_run(path, axis=axis)
    write_run(tmp_path / "one.mcap", RunHeader(), [Row(t_s=0.0)])
    assert list(read_axes(tmp_path / "one.mcap")) == [""]
    with pytest.raises(RunLogError, match="a bench of one axis"):
        read_run(tmp_path / "one.mcap", axis="yaw-1")


def test_an_axis_that_is_alone_in_its_log_need_not_be_named(tmp_path: Path) -> None:
    header = RunHeader(axes=("roll",), started_unix_s=BEGUN_S)
    write_run(tmp_path / "roll.mcap", header, [(Row(t_s=0.0), "roll", BEGUN_S)])
    assert len(read_run(tmp_path / "roll.mcap")) == 1


def test_a_wide_table_holds_the_last_sample_of_each_axis_and_nothing_before_its_first(
    tmp_path: Path,
) -> None:
    wide = side_by_side(read_axes(written(tmp_path / "run.mcap"))).columns
    assert wide["pitch-1.displacement_mm"].tolist() == list(range(10))
    assert wide["yaw-1.tick"].tolist() == [-1, -1, -1, -1, 0, 0, 1, 1, 2, 2]
    assert np.isnan(wide["yaw-1.t_s"][:4]).all()
    np.testing.assert_allclose(wide["t_s"], np.arange(10) * 0.01, atol=1e-6)


def test_a_cut_log_is_recovered_with_its_axes(tmp_path: Path) -> None:
    whole = written(tmp_path / "run.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-600])
    recover(cut, tmp_path / "mended.mcap")
    assert [len(run) for run in read_axes(tmp_path / "mended.mcap").values()] == [10, 3]


def test_the_export_is_a_file_an_axis_or_one_with_prefixed_names(tmp_path: Path) -> None:
    path = written(tmp_path / "run.mcap")
    assert execute(["log", "export", str(path)]) == 0
    assert csv.read_csv(tmp_path / "run.yaw-1.csv").column_names == ["t_s", "tick"]
    assert execute(["log", "export", str(path), "--wide", "--to", "parquet"]) == 0
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == [
        "t_s", "pitch-1.t_s", "pitch-1.displacement_mm", "yaw-1.t_s", "yaw-1.tick",
    ]  # fmt: skip
    assert table.schema.field("pitch-1.displacement_mm").metadata[b"unit"] == b"mm"
    assert table.column("yaw-1.tick").null_count == 4
    assert execute(["log", "export", str(path), "--wide", "--to", "mat"]) == 1


def test_an_axis_becomes_a_log_of_its_own_with_its_own_configuration(tmp_path: Path) -> None:
    config = "".join(
        f'[[axes]]\nname = "{name}"\ntravel_mm = {mm}\n'
        for name, mm in zip(NAMES, (3.0, 4.0), strict=True)
    )
    path = tmp_path / "run.mcap"
    header = RunHeader(
        axes=NAMES,
        configuration=config,
        gains={"pitch-1.kp_A_per_mm": 1.0, "yaw-1.kp_A_per_mm": 2.0},
    )
    rows = [
        (Row(t_s=k * 0.01, tick=k), axis, BEGUN_S + k * 0.01) for k in range(600) for axis in NAMES
    ]
    write_run(path, header, [Event(kind="note", text="begun"), *rows])
    assert execute(["log", "split", str(path)]) == 0
    run = read_run(tmp_path / "run.yaw-1.mcap")
    assert run.columns["tick"].tolist() == list(range(600))
    assert [event.text for event in run.events] == ["begun"]
    assert (run.header.axes, run.header.gains) == ((), {"kp_A_per_mm": 2.0})
    own = parse_config(run.header.configuration)
    assert (own.axes, own.limits.displacement_max_mm) == ((), 4.0)
    assert not run.cut_short
    assert not run.notes


def test_the_export_of_an_axis_is_imported_as_a_log_of_that_axis(tmp_path: Path) -> None:
    runs = read_axes(written(tmp_path / "run.mcap"))
    export_axes(runs, tmp_path / "run.csv")
    import_table(tmp_path / "run.pitch-1.csv", tmp_path / "back.mcap")
    for axis in ("", "pitch-1"):
        back = read_run(tmp_path / "back.mcap", axis=axis)
        for name, column in runs["pitch-1"].columns.items():
            np.testing.assert_array_equal(back.columns[name], column)


def test_a_log_that_is_not_whole_is_not_split_into_logs_that_seem_whole(tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(written(tmp_path / "run.mcap").read_bytes()[:-600])
    with pytest.raises(RunLogError, match=r"is not whole: .* log recover"):
        extract(cut, "pitch-1")
    assert not (tmp_path / "cut.pitch-1.mcap").exists()


def test_an_axis_of_a_recovered_log_says_where_its_holes_are(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rows = [
        (Row(t_s=t), "yaw-1", BEGUN_S + t) for t in (*np.arange(0.0, 1.0, 0.01), 3.0, 3.01, 3.02)
    ]
    write_run(path, RunHeader(axes=("yaw-1",)), rows)
    path.write_bytes(path.read_bytes()[:-600])
    recover(path, tmp_path / "mended.mcap")
    (note,) = read_run(extract(tmp_path / "mended.mcap", "yaw-1")).notes
    assert note.startswith("no samples from 0.990 to 3.000 s")


def test_the_marks_of_an_experiment_on_one_of_several_axes_are_found_by_when_they_came(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.mcap"
    rows = [
        (Row(t_s=begin + k * 0.01, host_time_s=BEGUN_S + k * 0.01), axis, BEGUN_S + k * 0.01)
        for k in range(500)
        for axis, begin in (("pitch-1", 5.0), ("yaw-1", 90.0))
    ]
    # The daemon of several boards has no board time for an event.
    marks = [
        Event(host_time_s=BEGUN_S + at_s, kind="note", text=f"mark {name}")
        for name, at_s in (("heat", 1.002), ("cool", 3.002))
    ]
    write_run(path, RunHeader(axes=NAMES), [*rows, *marks])
    run = read_run(extract(path, "yaw-1"))
    recording = recording_of(run)
    assert recording.marks == pytest.approx({"heat": 91.002, "cool": 93.002})
    assert len(recording.between("heat", "cool").t_s) == 200
    assert [mark.x for mark in panels_of(run_parts([run])).marks] == pytest.approx([1.002, 3.002])
