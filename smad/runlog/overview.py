"""What is in a folder of runs, from head and end of each file. Without numpy.

The end is read by hand, because the `mcap` package reads and decompresses whatever a damaged footer
points at.
"""

import math
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct

from smad.errors import RunLogError, refused_by_system
from smad.runlog import open_logs
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.mcap_file import CHANNEL_IDS, FIRST_AXIS_ID, ROWS_DURATION, ROWS_METADATA_NAME
from smad.runlog.paths import SUFFIX, by_time
from smad.runlog.scan import PARSE_ERRORS, RECORD_HEAD, Damage, NotMcapError, scan
from smad.runlog.schema import Row

_FOOTER = struct.Struct("<BQQQI")
_FOOTER_BODY_BYTES = _FOOTER.size - RECORD_HEAD.size
_LARGEST_RECORD_BYTES = 1_000_000
_MOST_RECORDS = 100_000

T = TypeVar("T")


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
    """The run logs of a folder by the time in their names, or its `newest` ones.

    Reads only head and end of each file.

    Raises RunLogError when the folder cannot be read.
    """
    folder = Path(folder)
    cause = f"cannot read folder {folder}"
    with refused_by_system(RunLogError, cause, action="name another with --folder"):
        paths = sorted((p for p in folder.iterdir() if p.suffix == SUFFIX), key=by_time)
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


class Ending(NamedTuple):
    """The statistics of a log, and the last metadata of the name asked for."""

    statistics: records.Statistics
    metadata: dict[str, str]


def read_ending(path: Path, metadata_name: str) -> Ending | None:
    """Return the end; None for a log without one, or with one that cannot be read.

    Raises OSError when the disk fails.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        at_footer = size - _FOOTER.size - len(MCAP0_MAGIC)
        if at_footer < len(MCAP0_MAGIC):
            return None
        file.seek(at_footer)
        opcode, length, summary_start, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
        if (opcode, length) != (Opcode.FOOTER, _FOOTER_BODY_BYTES) or file.read() != MCAP0_MAGIC:
            return None
        return _in_summary(file, summary_start, at_footer, metadata_name) if summary_start else None


def _in_summary(file: BinaryIO, offset: int, end: int, name: str) -> Ending | None:
    statistics: records.Statistics | None = None
    metadata: dict[str, str] = {}
    for _ in range(_MOST_RECORDS):
        if offset > end - RECORD_HEAD.size:
            break
        opcode, length = _head_at(file, offset)
        if opcode == Opcode.STATISTICS:
            statistics = _parsed(file, length, records.Statistics.read)
        elif opcode == Opcode.METADATA_INDEX:
            index = _parsed(file, length, records.MetadataIndex.read)
            if index is not None and index.name == name and index.offset < offset:
                metadata = _metadata_at(file, index.offset)
        offset += RECORD_HEAD.size + length
    return None if statistics is None else Ending(statistics, metadata)


def _metadata_at(file: BinaryIO, offset: int) -> dict[str, str]:
    opcode, length = _head_at(file, offset)
    metadata = _parsed(file, length, records.Metadata.read) if opcode == Opcode.METADATA else None
    return {} if metadata is None else metadata.metadata


def _head_at(file: BinaryIO, offset: int) -> tuple[int, int]:
    file.seek(offset)
    head: tuple[int, int] = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
    return head


def _parsed(file: BinaryIO, length: int, parse: Callable[[ReadDataStream], T]) -> T | None:
    if length > _LARGEST_RECORD_BYTES:
        return None
    try:
        return parse(ReadDataStream(BytesIO(file.read(length))))
    except PARSE_ERRORS:
        return None
