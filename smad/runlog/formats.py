"""All axes of a run log as files of another program, in any format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import RunLogError

if TYPE_CHECKING:
    from smad.runlog.reader import Run

FORMATS = ("csv", "parquet", "mat", "rosbag2", "lerobot")
"""What `--to` takes: the suffixes of `export.WRITERS`, and two kinds of folder."""


def export_axes(
    runs: Mapping[str, Run],
    target: Path,
    *,
    kind: str = "",
    wide: bool = False,
    fps: int | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write each axis to a file of its own, or with `wide` all to one; returns the files.

    The suffix of `target` names the format; `kind` "rosbag2" or "lerobot" says it for a folder of
    another name. Raises RunLogError.
    """
    from smad.runlog import lerobot, rosbag
    from smad.runlog.export import export_run, side_by_side

    if wide and target.suffix not in (".csv", ".parquet"):
        raise RunLogError(
            "several axes in one table make a CSV or Parquet file",
            value=target.name,
            action="name a .csv or .parquet file, or leave --wide out",
        )
    if wide and len(runs) > 1:
        runs = {"": side_by_side(runs)}
    named = target.suffix.removeprefix(".")
    if kind and named in FORMATS and kind != named:
        raise RunLogError(
            "the name of the file is that of another format",
            value=target.name,
            limit=f"*.{kind}",
            action="give one of format and name (--to, --output)",
        )
    if fps is not None and "lerobot" not in (kind, named):
        raise RunLogError("frames are those of lerobot", value=fps, action="leave --fps out")
    files: list[Path] = []
    for axis, run in runs.items():
        path = target.with_name(f"{target.stem}.{axis}{target.suffix}") if axis else target
        if kind == "rosbag2" or target.suffix == rosbag.SUFFIX:
            files.append(rosbag.export_bag(run, path, overwrite=overwrite))
        elif kind == "lerobot" or target.suffix == lerobot.SUFFIX:
            files.append(lerobot.export_lerobot([run], path, fps=fps, overwrite=overwrite))
        else:
            files += export_run(run, path, overwrite=overwrite)
    return files


def count_in(files: Sequence[Path], runs: Mapping[str, Run]) -> tuple[int, str]:
    """How much was written of the longest run: so many frames of a dataset, else rows."""
    from smad.runlog import lerobot

    if all((file / "meta").is_dir() for file in files):
        return max(map(lerobot.frames_in, files)), "frames"
    return max(map(len, runs.values())), "rows"
