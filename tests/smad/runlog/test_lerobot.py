"""Run logs as a dataset of LeRobot v3.0, held against the layout that its reader takes.

Its own package needs PyTorch, so what its loader does is done here: paths from `info.json`, tasks
through pandas, one row group an episode, indices of the episodes.
"""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from smad.cli import execute
from smad.errors import RunLogError
from smad.runlog.lerobot import ACTION, STATE, export_lerobot
from smad.runlog.reader import Run, read_run
from smad.runlog.schema import Row
from smad.runlog.writer import write_run

from .helpers import HEADER, write_small_run

ROWS = 90


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return read_run(write_small_run(tmp_path_factory.mktemp("run") / "run.mcap", ROWS))


@pytest.fixture(scope="module")
def dataset(run: Run) -> Path:
    return export_lerobot([run, run], run.path.with_suffix(".lerobot"))


def info(dataset: Path) -> dict:  # type: ignore[type-arg]
    return json.loads((dataset / "meta" / "info.json").read_text())  # type: ignore[no-any-return]


def test_the_description_has_what_their_reader_asks_for(dataset: Path) -> None:
    told = info(dataset)
    assert told["codebase_version"] == "v3.0"
    assert told["total_episodes"] == 2
    assert told["splits"] == {"train": "0:2"}
    assert set(told["features"]) == {
        STATE, ACTION, "timestamp", "frame_index", "episode_index", "index", "task_index",
        "complementary_info.state_known", "complementary_info.action_known",
    }  # fmt: skip
    for feature in (STATE, ACTION):
        assert told["features"][feature]["shape"] == [len(told["features"][feature]["names"])]


def test_each_episode_lies_where_the_description_says(dataset: Path) -> None:
    told = info(dataset)
    episodes = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["episode_index"] for row in episodes] == [0, 1]
    for row in episodes:
        path = told["data_path"].format(
            chunk_index=row["data/chunk_index"], file_index=row["data/file_index"]
        )
        file = parquet.ParquetFile(dataset / path)
        part = file.read_row_group(row["episode_index"])
        assert len(part) == row["length"]
        index = part["index"].to_pylist()
        assert (index[0], index[-1] + 1) == (row["dataset_from_index"], row["dataset_to_index"])
        assert set(part["episode_index"].to_pylist()) == {row["episode_index"]}
    assert told["total_frames"] == episodes[-1]["dataset_to_index"]


def test_tasks_are_read_by_name_through_pandas(dataset: Path) -> None:
    import pandas as pd

    tasks = pd.read_parquet(dataset / "meta" / "tasks.parquet")
    assert tasks.index.name == "task"
    assert tasks["task_index"].tolist() == [0]


def test_frames_are_the_samples_at_even_times(run: Run, dataset: Path) -> None:
    told = info(dataset)
    table = parquet.ParquetFile(dataset / "data/chunk-000/file-000.parquet").read_row_group(0)
    times = np.array(table["timestamp"].to_pylist())
    assert np.allclose(np.diff(times), 1.0 / told["fps"], atol=1e-5)
    state = np.array(table[STATE].to_pylist())
    at = told["features"][STATE]["names"].index("rtd_x_degC")
    since_s = run.columns["t_s"] - run.columns["t_s"][0]
    for k in (0, 17, len(times) - 1):
        sample = np.searchsorted(since_s, k / told["fps"] + 1e-9, side="right") - 1
        assert state[k, at] == pytest.approx(run.columns["rtd_x_degC"][sample], rel=1e-6)


def test_where_a_bench_idles_the_last_number_stays_and_is_marked(run: Run, tmp_path: Path) -> None:
    reference = run.columns["reference_mm"].copy()
    reference[:20] = np.nan
    reference[20:40] = 3.0
    reference[40:] = np.nan
    columns = {**run.columns, "reference_mm": reference}
    made = export_lerobot([dataclasses.replace(run, columns=columns)], tmp_path / "a", fps=100)
    table = parquet.read_table(made / "data/chunk-000/file-000.parquet")
    at = info(made)["features"][ACTION]["names"].index("reference_mm")
    action = np.array(table[ACTION].to_pylist())
    known = np.array(table["complementary_info.action_known"].to_pylist())
    assert np.isfinite(action).all()
    assert set(action[:, at]) == {3.0}
    assert not known[:, at].all()
    assert known[:, at].any()


def test_a_channel_that_only_another_run_has_is_nought_and_marked(run: Run, tmp_path: Path) -> None:
    without = {name: column for name, column in run.columns.items() if name != "force_N"}
    runs = [run, dataclasses.replace(run, columns=without)]
    made = export_lerobot(runs, tmp_path / "b")
    file = parquet.ParquetFile(made / "data/chunk-000/file-000.parquet")
    at = info(made)["features"][STATE]["names"].index("force_N")
    second = file.read_row_group(1)
    assert set(np.array(second[STATE].to_pylist())[:, at]) == {0.0}
    assert not np.array(second["complementary_info.state_known"].to_pylist())[:, at].any()


def test_statistics_are_those_of_the_frames(dataset: Path) -> None:
    stats = json.loads((dataset / "meta" / "stats.json").read_text())
    rows = np.array(
        parquet.read_table(dataset / "data/chunk-000/file-000.parquet")[STATE].to_pylist()
    )
    assert stats[STATE]["max"] == pytest.approx(np.max(rows, axis=0).tolist())
    assert stats[STATE]["count"] == [len(rows)]


def test_what_cannot_be_written_is_said(run: Run, dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(RunLogError, match="is there already"):
        export_lerobot([run], dataset)
    with pytest.raises(RunLogError, match="is not a dataset"):
        export_lerobot([run], tmp_path, overwrite=True)
    with pytest.raises(RunLogError, match="frames per second"):
        export_lerobot([run], tmp_path / "a", fps=100_000)


def test_the_command_writes_a_dataset_beside_the_log(
    run: Run, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "made.lerobot"
    assert execute(["log", "export", str(run.path), "-o", str(target), "--fps", "50"]) == 0
    assert f"{info(target)['total_frames']} frames to {target}" in capfd.readouterr().out
    assert info(target)["fps"] == 50


def test_an_action_is_what_was_commanded_because_of_the_state_beside_it(tmp_path: Path) -> None:
    # The board shows duty and current one sample after they were commanded.
    steps = np.arange(40.0)
    rows = [
        Row(t_s=0.01 * k, duty_x=k / 100, i_applied_x_A=k / 10, i_cmd_y_A=k / 10) for k in steps
    ]
    write_run(tmp_path / "run.mcap", HEADER, rows)
    made = export_lerobot([read_run(tmp_path / "run.mcap")], tmp_path / "a")
    names = info(made)["features"][ACTION]["names"]
    table = parquet.read_table(made / "data/chunk-000/file-000.parquet")
    action = dict(zip(names, np.array(table[ACTION].to_pylist()).T, strict=True))
    later = np.minimum(steps + 1, 39)
    assert set(action) == {"i_cmd_x_A", "i_cmd_y_A", "duty_x"}
    np.testing.assert_allclose(action["duty_x"], later / 100, rtol=1e-6)
    np.testing.assert_allclose(action["i_cmd_x_A"], later / 10, rtol=1e-6)
    np.testing.assert_allclose(action["i_cmd_y_A"], steps / 10, rtol=1e-6)


def test_what_stands_for_samples_that_are_lost_is_not_called_known(tmp_path: Path) -> None:
    times = [k / 100 for k in (*range(50), *range(150, 200))]
    write_run(tmp_path / "run.mcap", HEADER, [Row(t_s=t, force_N=1.0) for t in times])
    made = export_lerobot([read_run(tmp_path / "run.mcap")], tmp_path / "a", fps=100)
    table = parquet.read_table(made / "data/chunk-000/file-000.parquet")
    known = np.array(table["complementary_info.state_known"].to_pylist())[:, 0]
    assert len(known) == 200
    assert known[:50].all()
    assert known[150:].all()
    assert not known[52:150].any()
