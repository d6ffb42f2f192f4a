"""What is in a folder of runs, from head and end of each file. Without numpy."""

import math
from pathlib import Path

from mcap import records
from msgspec import Struct

from smad.errors import RunLogError, refused_by_system
from smad.runlog import open_logs
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.mcap_file import CHANNEL_IDS, FIRST_AXIS_ID, ROWS_DURATION, ROWS_METADATA_NAME
from smad.runlog.paths import SUFFIX
from smad.runlog.scan import Damage, NotMcapError, scan
from smad.runlog.schema import Row
from smad.runlog.statistics import read_ending


class Overview(Struct, frozen=True, kw_only=True):
    """One line of a list of runs. `rows` and `duration_s` are None when it has no end.

    `duration_s` is board time, and None in a log whose writer did not note it.
    """

    path: str
    size_bytes: int
    name: str = ""
    source: str = ""
    started_unix_s: float = 0.0
    rows: int | None = None
    duration_s: float | None = None
    problem: str = ""


def list_runs(folder: str | Path, newest: int | None = None) -> list[Overview]:
    """The run logs of a folder by name, which is by time, or its `newest` ones.

    Reads only head and end of each file.

    Raises RunLogError when the folder cannot be read.
    """
    folder = Path(folder)
    cause = f"cannot read folder {folder}"
    with refused_by_system(RunLogError, cause, action="name another with --folder"):
        paths = sorted(path for path in folder.iterdir() if path.suffix == SUFFIX)
    return [_overview(path) for path in paths[-newest if newest else 0 :]]


def _overview(path: Path) -> Overview:
    try:
        open_still = open_logs.being_written(path)
        size_bytes = path.stat().st_size
        header = _header(path, size_bytes)
        ending = read_ending(path, ROWS_METADATA_NAME)
    except OSError as error:
        return Overview(path=str(path), size_bytes=0, problem=error.strerror or "unreadable")
    except NotMcapError:
        return Overview(path=str(path), size_bytes=size_bytes, problem="no MCAP file")
    rows = duration_s = None
    problem = "being written" if open_still else "cut short"
    if ending is not None:
        counts = ending.statistics.channel_message_counts
        rows = counts.get(FIRST_AXIS_ID, 0) or counts.get(CHANNEL_IDS[Row], 0)
        problem = ""
        duration_s = _seconds(ending.metadata.get(ROWS_DURATION, ""))
    return Overview(
        path=str(path),
        size_bytes=size_bytes,
        name=header.name,
        source=header.source,
        started_unix_s=header.started_unix_s,
        rows=rows,
        duration_s=duration_s,
        problem=problem,
    )


def _seconds(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _header(path: Path, size_bytes: int) -> RunHeader:
    with path.open("rb") as file:
        for item in scan(file, size_bytes, Damage()):
            if isinstance(item, records.Metadata) and item.name == METADATA_NAME:
                return RunHeader.from_metadata(item.metadata)
            if isinstance(item, tuple):
                break
    return RunHeader()
