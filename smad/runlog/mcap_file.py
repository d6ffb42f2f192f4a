"""An MCAP file written chunk by chunk, so that what was written is readable at any moment.

The `mcap` package's own writer decides by size when a chunk is full and has no flush; it also
spends some ten microseconds of interpreter time on each message. Here the caller packs messages
(`pack`), hands over a whole chunk, and the chunk is on its way to the disk when `write_chunk`
returns. Record layouts are those of the `mcap` package and of the specification (mcap.dev/spec).
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterable, Mapping, Sequence
from io import FileIO
from typing import NamedTuple

import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from msgspec import Struct

from smad.runlog.schema import TOPICS, Row, json_schema, row_topic
from smad.version import VERSION

MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_OVERHEAD = MESSAGE.size - 9
_INDEX_HEAD = struct.Struct("<BQHI")
_COMPRESSION_LEVEL = 1
_NS = 1e9

MESSAGES_A_CHUNK = 256
ROWS_METADATA_NAME = "smad.rows"
ROWS_DURATION = "board_s"
"""Board time that the rows cover, so that a list of logs need not read them."""

CHANNEL_IDS: Mapping[type[Struct], int] = {
    record: number for number, record in enumerate(TOPICS, start=1)
}

FIRST_AXIS_ID = len(CHANNEL_IDS) + 1
"""Channel of the samples of the first of several axes; the next ones follow."""

_NO_ENTRIES = array("Q")


class Packed(NamedTuple):
    """A message as it stands in a chunk."""

    channel_id: int
    time_ns: int
    data: bytes


def pack(channel_id: int, sequence: int, time_ns: int, body: bytes) -> Packed:
    """A message record; log time and publish time are both the time of the sample."""
    head = MESSAGE.pack(
        Opcode.MESSAGE, _MESSAGE_OVERHEAD + len(body), channel_id, sequence, time_ns, time_ns
    )
    return Packed(channel_id, time_ns, head + body)


class McapFile:
    """Writes the three topics of a run to an unbuffered file opened by the caller.

    The samples of several axes have a topic each (`add_axis`), with the schema of the rows.

    Every method raises OSError when the disk refuses; what was whole before the call is still
    whole in the file then, because a half-written record is cut off again.
    """

    def __init__(self, file: FileIO) -> None:
        self._file = file
        self._compressor = zstandard.ZstdCompressor(level=_COMPRESSION_LEVEL)
        self._chunk_indexes = bytearray()
        self._metadata_indexes = bytearray()
        self._metadata_count = 0
        self._chunk_count = 0
        self._counts = dict.fromkeys(CHANNEL_IDS.values(), 0)
        self._axes: list[str] = []
        self._filling: list[Packed] = []
        self._first_ns: int | None = None
        self._last_ns = 0
        self._last_row_ns: int | None = None
        self.rows_ns = 0
        """Board time that the rows so far cover. A restart of the board begins it anew, so only
        what goes forward counts."""
        self.size_bytes = 0
        header = records.Header(profile="", library=f"smad {VERSION}")
        self._write(MCAP0_MAGIC + _bytes_of(header) + _schemas() + _channels())

    def add_axis(self, name: str) -> int:
        """Add the channel for the samples of a named axis; return its number."""
        if name not in self._axes:
            self._write(_bytes_of(_channel(FIRST_AXIS_ID + len(self._axes), row_topic(name), Row)))
            self._counts[FIRST_AXIS_ID + len(self._axes)] = 0
            self._axes.append(name)
        return FIRST_AXIS_ID + self._axes.index(name)

    def write_metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """A metadata record, text to text."""
        self._write_filling()
        data = _bytes_of(records.Metadata(name=name, metadata=dict(texts)))
        offset = self.size_bytes
        self._write(data)
        self._metadata_count += 1
        index = records.MetadataIndex(offset=offset, length=len(data), name=name)
        self._metadata_indexes += _bytes_of(index)

    def add(self, message: Packed) -> None:
        """Add a message to the chunk that is filling, which is written once it is full.

        `write_metadata` and `finish` write it, too.
        """
        self._filling.append(message)
        if len(self._filling) >= MESSAGES_A_CHUNK:
            self._write_filling()

    def _write_filling(self) -> None:
        filling, self._filling = self._filling, []
        self.write_chunk(filling)

    def write_chunk(self, messages: Sequence[Packed]) -> None:
        """A compressed chunk with its message indexes, in one write. No messages, no chunk."""
        if not messages:
            return
        body = b"".join([message.data for message in messages])
        times, index = _message_index(messages)
        start_ns, end_ns = min(times), max(times)
        compressed = self._compressor.compress(body)
        data = _bytes_of(
            records.Chunk(
                compression="zstd",
                data=compressed,
                message_start_time=start_ns,
                message_end_time=end_ns,
                uncompressed_crc=zlib.crc32(body),
                uncompressed_size=len(body),
            )
        )
        chunk_length = len(data)
        offsets = {}
        for channel_id, entries in index.items():
            offsets[channel_id] = self.size_bytes + len(data)
            size = len(entries) * entries.itemsize
            data += _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel_id, size)
            data += entries.tobytes()
        start_offset = self.size_bytes
        self._write(data)
        self._chunk_count += 1
        for channel_id, entries in index.items():
            self._counts[channel_id] += len(entries) // 2
        rows = FIRST_AXIS_ID if self._axes else CHANNEL_IDS[Row]
        for time_ns in index.get(rows, _NO_ENTRIES)[::2]:
            if self._last_row_ns is not None:
                self.rows_ns += max(0, time_ns - self._last_row_ns)
            self._last_row_ns = time_ns
        self._first_ns = start_ns if self._first_ns is None else min(self._first_ns, start_ns)
        self._last_ns = max(self._last_ns, end_ns)
        self._chunk_indexes += _bytes_of(
            records.ChunkIndex(
                chunk_length=chunk_length,
                chunk_start_offset=start_offset,
                compression="zstd",
                compressed_size=len(compressed),
                message_start_time=start_ns,
                message_end_time=end_ns,
                message_index_length=len(data) - chunk_length,
                message_index_offsets=offsets,
                uncompressed_size=len(body),
            )
        )

    def finish(self) -> None:
        """The summary and the footer: from here on viewers can jump about in the file."""
        self.write_metadata(ROWS_METADATA_NAME, {ROWS_DURATION: f"{self.rows_ns / _NS:.6f}"})
        data_end = _bytes_of(records.DataEnd(data_section_crc=0))
        summary_start = self.size_bytes + len(data_end)
        groups = [
            (Opcode.SCHEMA, _schemas()),
            (Opcode.CHANNEL, _channels(self._axes)),
            (Opcode.STATISTICS, self._statistics()),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.METADATA_INDEX, bytes(self._metadata_indexes)),
        ]
        summary = b""
        offsets = []
        for opcode, data in groups:
            if data:
                start = summary_start + len(summary)
                offsets.append(records.SummaryOffset(opcode, start, len(data)))
                summary += data
        offset_start = summary_start + len(summary)
        summary += _bytes_of(*offsets)
        footer_head = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
        footer = records.Footer(
            summary_start=summary_start,
            summary_offset_start=offset_start,
            summary_crc=zlib.crc32(footer_head, zlib.crc32(summary)),
        )
        self._write(data_end + summary + _bytes_of(footer) + MCAP0_MAGIC)

    def _statistics(self) -> bytes:
        return _bytes_of(
            records.Statistics(
                attachment_count=0,
                channel_count=len(self._counts),
                channel_message_counts={k: n for k, n in self._counts.items() if n},
                chunk_count=self._chunk_count,
                message_count=sum(self._counts.values()),
                message_start_time=self._first_ns or 0,
                message_end_time=self._last_ns,
                metadata_count=self._metadata_count,
                schema_count=len(CHANNEL_IDS),
            )
        )

    def _write(self, data: bytes) -> None:
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) :]
        except OSError:
            # A cut record would hide everything that is written after it, should the disk recover.
            self._file.truncate(self.size_bytes)
            self._file.seek(self.size_bytes)
            raise
        self.size_bytes += len(data)


def _message_index(messages: Iterable[Packed]) -> tuple[list[int], dict[int, array[int]]]:
    times = []
    index: dict[int, array[int]] = {}
    offset = 0
    for channel_id, time_ns, data in messages:
        times.append(time_ns)
        entries = index.get(channel_id)
        if entries is None:
            entries = index[channel_id] = array("Q")
        entries.append(time_ns)
        entries.append(offset)
        offset += len(data)
    return times, index


def _bytes_of(*parts: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    for part in parts:
        part.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


def _schemas() -> bytes:
    schemas = (
        records.Schema(
            id=number,
            name=f"smad.{record.__name__}",
            encoding="jsonschema",
            data=json_schema(record),
        )
        for record, number in CHANNEL_IDS.items()
    )
    return _bytes_of(*schemas)


def _channels(axes: Sequence[str] = ()) -> bytes:
    fixed = (_channel(number, TOPICS[record], record) for record, number in CHANNEL_IDS.items())
    numbered = enumerate(axes, start=FIRST_AXIS_ID)
    return _bytes_of(*fixed, *(_channel(number, row_topic(name), Row) for number, name in numbered))


def _channel(number: int, topic: str, record: type[Struct]) -> records.Channel:
    return records.Channel(
        id=number,
        topic=topic,
        message_encoding="json",
        schema_id=CHANNEL_IDS[record],
        metadata={},
    )
