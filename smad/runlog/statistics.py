"""What stands at the end of a whole log, found without reading what is before it.

By hand, because the `mcap` package reads and decompresses whatever a damaged footer points at.
"""

import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from smad.runlog.scan import PARSE_ERRORS, RECORD_HEAD

_FOOTER = struct.Struct("<BQQQI")
_FOOTER_BODY_BYTES = _FOOTER.size - RECORD_HEAD.size
_LARGEST_RECORD_BYTES = 1_000_000
_MOST_RECORDS = 100_000

T = TypeVar("T")


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
