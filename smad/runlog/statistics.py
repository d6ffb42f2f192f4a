"""The statistics at the end of a whole log, found without reading what is before them.

By hand, because the `mcap` package reads and decompresses whatever a damaged footer points at.
"""

from __future__ import annotations

import struct
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from smad.runlog.scan import PARSE_ERRORS, RECORD_HEAD

_FOOTER = struct.Struct("<BQQQI")
_FOOTER_BODY_BYTES = _FOOTER.size - RECORD_HEAD.size
_LARGEST_RECORD_BYTES = 1_000_000
_MOST_RECORDS = 100_000


def read_statistics(path: Path) -> records.Statistics | None:
    """Return the statistics; None for a log without an end, or with one that cannot be read.

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
        return _in_summary(file, summary_start, at_footer) if summary_start else None


def _in_summary(file: BinaryIO, at: int, end: int) -> records.Statistics | None:
    for _ in range(_MOST_RECORDS):
        if at > end - RECORD_HEAD.size:
            return None
        file.seek(at)
        opcode, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
        at += RECORD_HEAD.size + length
        if opcode != Opcode.STATISTICS:
            continue
        if length > _LARGEST_RECORD_BYTES:
            return None
        try:
            found: records.Statistics = records.Statistics.read(
                ReadDataStream(BytesIO(file.read(length)))
            )
        except PARSE_ERRORS:
            return None
        return found
    return None
