"""Run logs to a dataset of LeRobot v3.0: Parquet and `meta/`, an episode for each run.

`observation.state` has what was measured, `action` what was commanded, in the units of the channel
names. LeRobot wants frames at an even rate: a frame has the last sample taken by then. It wants
numbers, too (its policies scale by mean and deviation, and one NaN spoils a batch): where a channel
has none, as the reference of an idle bench, its last one stays, before the first the first, and 0
where a run has none at all. `complementary_info.*_known` is false there and where samples are lost.

Layout: huggingface/lerobot, `src/lerobot/datasets/utils.py` and `dataset_metadata.py`, v3.0.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smad.errors import RunLogError
from smad.extras import part
from smad.runlog.folders import whole_folder
from smad.runlog.holes import HOLE_STEPS
from smad.runlog.reader import Run, recorded
from smad.runlog.schema import CHANNELS

SUFFIX = ".lerobot"
VERSION = "v3.0"
STATE, ACTION = "observation.state", "action"
COMMANDED = (
    "i_cmd_x_A", "i_cmd_y_A", "duty_x", "duty_y", "drain_x", "drain_y", "reference_mm",
    "reference_degC",
)  # fmt: skip
MEASURED = (
    "displacement_mm", "angle_deg", "force_N", "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC",
    "rtd_ambient_degC", "i_meas_x_A", "i_meas_y_A", "v_x_V", "v_y_V", "supply_V", "stage_mm",
)  # fmt: skip
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_INDEX = {"frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_APPLIED = {
    "i_cmd_x_A": "i_applied_x_A", "i_cmd_y_A": "i_applied_y_A", "duty_x": "duty_x",
    "duty_y": "duty_y",
}  # fmt: skip
"""Commands, where they were not recorded, by what the next sample shows as applied."""
_MOST_FPS = 1000
_KNOWN = {STATE: "complementary_info.state_known", ACTION: "complementary_info.action_known"}
"""Which numbers of a feature were recorded; the others are filled in."""
Frames = dict[str, NDArray[Any]]


def export_lerobot(
    runs: Sequence[Run], target: Path, *, fps: int | None = None, overwrite: bool = False
) -> Path:
    """Write the runs as the episodes of the dataset `target`, a folder; returns it.

    fps: frames per second; left out, the rate of the first run, rounded. Raises RunLogError without
    rows, for a target that is there (with `overwrite`: that is no dataset), and for a disk that
    refuses; MissingPartError without pyarrow.
    """
    if not runs or not all(len(run) for run in runs):
        raise RunLogError("a run holds no rows", action="leave it out")
    rate = fps or _rate(runs[0])
    if not 1 <= rate <= _MOST_FPS:
        raise RunLogError(
            "frames per second out of range",
            value=rate,
            limit=f"1 to {_MOST_FPS}",
            action="name another rate with --fps",
        )
    with whole_folder(target, "meta/info.json", "dataset", overwrite=overwrite) as folder:
        _write(runs, folder, rate)
    return target


def frames_in(dataset: Path) -> int:
    """Frames of all episodes of a dataset that was written."""
    return int(json.loads((dataset / "meta" / "info.json").read_text())["total_frames"])


def _rate(run: Run) -> int:
    """Samples per second of a run, rounded, at least 1."""
    step_s = float(np.median(np.diff(run.columns["t_s"]))) if len(run) > 1 else 1.0
    return max(round(1.0 / step_s), 1) if step_s > 0.0 else 1


def _channels(runs: Sequence[Run], names: Sequence[str]) -> list[str]:
    return [n for n in names if any(np.isfinite(_numbers(run, n)).any() for run in runs)]


def frames(run: Run, channels: Mapping[str, Sequence[str]], fps: int) -> Frames:
    """The run at even times from its first sample on: arrays of float32, (n, channels) each, and
    beside each one of bool, which of its numbers were recorded."""
    t_s = np.asarray(run.columns["t_s"], dtype=np.float64)
    # Board time begins anew after a restart; what comes before ends the episode.
    back = np.flatnonzero(np.diff(t_s) <= 0)
    end = int(back[0]) + 1 if len(back) else len(t_s)
    since_s = t_s[:end] - t_s[0]
    at_s = np.arange(int(np.floor(since_s[-1] * fps + 1e-6)) + 1) / fps
    last = np.searchsorted(since_s, at_s + 1e-6 / fps, side="right") - 1
    # Not yet as late as a hole begins at.
    fresh = at_s - since_s[last] < HOLE_STEPS * np.median(np.diff(since_s, append=np.inf))
    episode: Frames = {"timestamp": at_s.astype(np.float32)}
    for key, names in channels.items():
        columns = [_numbers(run, name)[:end][last] for name in names]
        values = np.stack(columns, axis=1)
        episode[key] = np.apply_along_axis(without_gaps, 0, values).astype(np.float32)
        episode[_KNOWN[key]] = np.isfinite(values) & fresh[:, None]
    return episode


def without_gaps(column: NDArray[np.float64]) -> NDArray[np.float64]:
    """The column with its last number where it has none; at the start its first; else 0."""
    finite = np.flatnonzero(np.isfinite(column))
    if not len(finite):
        return np.zeros_like(column)
    last = np.searchsorted(finite, np.arange(len(column)), side="right") - 1
    return column[finite[np.maximum(last, 0)]]


def _numbers(run: Run, name: str) -> NDArray[np.float64]:
    column = run.columns.get(name, np.full(len(run), np.nan))
    if name in _APPLIED and (name == _APPLIED[name] or not recorded(column).any()):
        column = run.columns.get(_APPLIED[name], column)
        column = np.r_[column[1:], column[-1:]]
    return np.where(recorded(column), column.astype(np.float64), np.nan)


def _write(runs: Sequence[Run], folder: Path, fps: int) -> None:
    pa, parquet = part("pyarrow"), part("pyarrow.parquet")
    channels = {STATE: _channels(runs, MEASURED), ACTION: _channels(runs, COMMANDED)}
    channels = {key: names for key, names in channels.items() if names}
    tasks = list(dict.fromkeys(_task(run) for run in runs))
    tables, episodes, parts, begin = [], [], [], 0
    for number, run in enumerate(runs):
        episode = frames(run, channels, fps)
        count = len(episode["timestamp"])
        task = tasks.index(_task(run))
        episode |= {
            "frame_index": np.arange(count),
            "episode_index": np.full(count, number),
            "index": np.arange(begin, begin + count),
            "task_index": np.full(count, task),
        }
        tables.append(_table(episode, channels))
        parts.append(episode)
        episodes.append(
            {
                "episode_index": number,
                "tasks": [tasks[task]],
                "length": count,
                "data/chunk_index": 0,
                "data/file_index": 0,
                "dataset_from_index": begin,
                "dataset_to_index": begin + count,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **_flat(statistics(episode)),
            }
        )
        begin += count
    data = folder / DATA.format(chunk_index=0, file_index=0)
    data.parent.mkdir(parents=True)
    with parquet.ParquetWriter(data, tables[0].schema, compression="snappy") as writer:
        for table in tables:  # an episode is a row group, as theirs
            writer.write_table(table)
    (folder / EPISODES).parent.mkdir(parents=True)
    parquet.write_table(pa.Table.from_pylist(episodes), folder / EPISODES)
    parquet.write_table(_task_table(tasks), folder / "meta" / "tasks.parquet")
    together = {key: np.concatenate([episode[key] for episode in parts]) for key in parts[0]}
    _json(folder / "meta" / "stats.json", statistics(together))
    _json(folder / "meta" / "info.json", _info(channels, fps, len(runs), begin, len(tasks)))


def _task(run: Run) -> str:
    return run.header.name or "run"


def _table(episode: Frames, channels: Mapping[str, Sequence[str]]) -> Any:
    pa = part("pyarrow")
    arrays = {
        name: pa.FixedSizeListArray.from_arrays(pa.array(episode[name].ravel()), len(names))
        for key, names in channels.items()
        for name in (key, _KNOWN[key])
    }
    arrays |= {key: pa.array(episode[key]) for key in ("timestamp", *_INDEX)}
    return pa.table(arrays)


def _task_table(tasks: Sequence[str]) -> Any:
    # pandas shall read the names as index, as LeRobot's reader expects; it need not be here.
    pa = part("pyarrow")

    def about(name: str, kind: str, numpy: str) -> dict[str, Any]:
        return {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": numpy,
            "metadata": None,
        }

    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [about("task_index", "int64", "int64"), about("task", "unicode", "object")],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": np.arange(len(tasks)), "task": pa.array(tasks)})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def statistics(episode: Frames) -> dict[str, dict[str, list[float]]]:
    """Least, most, mean, deviation, count and quantiles of each feature."""
    summary = {}
    for key, values in episode.items():
        rows = values.reshape(len(values), -1).astype(np.float64)
        summary[key] = {
            "min": rows.min(axis=0).tolist(),
            "max": rows.max(axis=0).tolist(),
            "mean": rows.mean(axis=0).tolist(),
            "std": rows.std(axis=0).tolist(),
            "count": [float(len(rows))],
            **{name: np.quantile(rows, q, axis=0).tolist() for name, q in _QUANTILES.items()},
        }
    return summary


def _flat(stats: Mapping[str, Mapping[str, list[float]]]) -> dict[str, list[float]]:
    return {f"stats/{key}/{name}": v for key, all_ in stats.items() for name, v in all_.items()}


def _info(
    channels: Mapping[str, Sequence[str]], fps: int, episodes: int, total: int, tasks: int
) -> dict[str, Any]:
    features: dict[str, Any] = {
        key: {
            "dtype": "float32",
            "shape": [len(names)],
            "names": list(names),
            "units": [CHANNELS[name].unit for name in names],
        }
        for key, names in channels.items()
    }
    features |= {
        _KNOWN[key]: {"dtype": "bool", "shape": [len(names)], "names": list(names)}
        for key, names in channels.items()
    }
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    features |= {key: {"dtype": kind, "shape": [1], "names": None} for key, kind in _INDEX.items()}
    return {
        "codebase_version": VERSION,
        "robot_type": "smad",
        "total_episodes": episodes,
        "total_frames": total,
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }


def _json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=4) + "\n")
