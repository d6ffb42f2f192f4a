"""What an MCAP file holds, read from front to back, whatever has happened to its end.

The summary at the end of a file is not used: a log that was cut has none. A damaged chunk is
skipped and noted, and so is what follows a damaged length, up to the next chunk; a file that ends
in mid-record is read up to there.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length, before the body of every record."""

_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_INDEX_ENTRY_BYTES = 16
_LARGEST_CHUNK_BYTES = 256 * 2**20
_COMPRESSION = struct.pack("<I", 4) + b"zstd"
"""Stands in the head of every chunk that we write."""
_BEFORE_COMPRESSION = RECORD_HEAD.size + _CHUNK_HEAD.size - 4
_FIRST_UNKNOWN, _FIRST_PRIVATE = Opcode.DATA_END + 1, 0x80
_DATA_END_BYTES = 4
"""A CRC: a record that claims another length is damaged."""
_BLOCK_BYTES = 2**20

Parser = Callable[[ReadDataStream], Any]
_PARSERS: dict[int, Parser] = {
    Opcode.SCHEMA: records.Schema.read,
    Opcode.CHANNEL: records.Channel.read,
    Opcode.METADATA: records.Metadata.read,
}
PARSE_ERRORS = (McapError, struct.error, UnicodeDecodeError, ValueError)
"""What the parsers of the `mcap` package raise for a record that does not follow the format."""


class NotMcapError(Exception):
    """The file does not begin as an MCAP file does; `why` says so, and `action` what to do."""

    def __init__(self, beginning: bytes) -> None:
        self.why, self.action = "it does not begin as an MCAP file", ""
        if beginning.startswith(MCAP0_MAGIC.partition(b"\r\n")[0]):
            self.why = "its line ends were changed, as by a copy in text mode"
            self.action = "copy it again in binary mode"


class Message(NamedTuple):
    """One message: which channel, when, and its bytes."""

    channel_id: int
    time_ns: int
    body: bytes


@dataclass
class Damage:
    """What was wrong with a file, filled while it is scanned."""

    being_written: bool = False
    """Set by whoever opens the file; then it is no damage that it has no end."""
    ended_in_order: bool = False
    notes: list[str] = field(default_factory=list)
    lost_messages: int = 0
    """Messages in damaged chunks, as far as the file's own index tells."""
    unread_bytes: int = 0
    """Bytes that belong to no whole record."""


Item = Message | records.Channel | records.Metadata


def scan(file: BinaryIO, size: int, damage: Damage) -> Iterator[Item]:
    """The channels, metadata and messages of a file of `size` bytes, in file order.

    Raises NotMcapError when the first bytes are not MCAP's, OSError when the disk fails.
    """
    if (beginning := file.read(len(MCAP0_MAGIC))) != MCAP0_MAGIC:
        raise NotMcapError(beginning)
    offset = search_from = len(MCAP0_MAGIC)
    index_tells_loss = False
    while offset < size:
        head = file.read(RECORD_HEAD.size)
        if not _is_head(head, size - offset):
            chunk = _next_chunk(file, search_from, size)
            if chunk is None:
                break
            damage.unread_bytes += max(0, chunk - offset)
            damage.notes.append(f"the file is damaged before byte {chunk}; it goes on from there")
            file.seek(chunk)
            offset = chunk
            continue
        opcode, length = RECORD_HEAD.unpack(head)
        body = file.read(length)
        if opcode == Opcode.DATA_END:
            damage.ended_in_order = True
            file.seek(max(0, size - len(MCAP0_MAGIC)))
            if file.read() != MCAP0_MAGIC:
                damage.notes.append("the index at the end of the file is broken")
            return
        if opcode == Opcode.CHUNK:
            index_tells_loss = False
            search_from = offset + 1
            try:
                yield from records_in(chunk_data(body))
                search_from = offset + RECORD_HEAD.size + length
            except DamagedError as error:
                damage.notes.append(
                    f"the chunk at byte {offset} is damaged ({error}) and was skipped"
                )
                index_tells_loss = True
        elif opcode == Opcode.MESSAGE_INDEX:
            if index_tells_loss:
                damage.lost_messages += max(len(body) - 6, 0) // _INDEX_ENTRY_BYTES
        else:
            try:
                yield from records_in(head + body)
            except DamagedError as error:
                damage.notes.append(f"the record at byte {offset} is damaged ({error})")
        offset += RECORD_HEAD.size + length
    damage.unread_bytes += size - offset
    if damage.being_written:
        damage.notes.append("still being written; what is shown here is what it holds so far")
    else:
        damage.notes.append(f"the recording was cut off at byte {offset}")


def _is_head(head: bytes, bytes_left: int) -> bool:
    """Whether a record may begin so that has so many bytes up to the end of the file."""
    if len(head) < RECORD_HEAD.size:
        return False
    opcode, length = RECORD_HEAD.unpack(head)
    if opcode == Opcode.DATA_END and length != _DATA_END_BYTES:
        return False
    known = 0 < opcode < _FIRST_UNKNOWN or opcode >= _FIRST_PRIVATE
    return bool(known and length <= bytes_left - RECORD_HEAD.size)


def _next_chunk(file: BinaryIO, begin: int, size: int) -> int | None:
    """Return where the first chunk of ours from `begin` on begins; None where there is none."""
    position = begin + _BEFORE_COMPRESSION
    while position < size:
        file.seek(position)
        block = file.read(_BLOCK_BYTES)
        match = block.find(_COMPRESSION)
        while match >= 0:
            start = position + match - _BEFORE_COMPRESSION
            file.seek(start)
            head = file.read(RECORD_HEAD.size)
            if head[:1] == bytes([Opcode.CHUNK]) and _is_head(head, size - start):
                return start
            match = block.find(_COMPRESSION, match + 1)
        position += max(1, len(block) - len(_COMPRESSION) + 1)
    return None


class DamagedError(Exception):
    """A record or chunk that cannot be used; the text says why."""


def chunk_data(body: bytes) -> bytes:
    """The plain content of a chunk record. Raises DamagedError."""
    try:
        _, _, plain_size, crc, name_length = _CHUNK_HEAD.unpack_from(body)
        offset = _CHUNK_HEAD.size + name_length
        compression = body[_CHUNK_HEAD.size : offset].decode("ascii")
        (data_length,) = struct.unpack_from("<Q", body, offset)
    except (struct.error, UnicodeDecodeError):
        raise DamagedError("its head cannot be read") from None
    if plain_size > _LARGEST_CHUNK_BYTES:
        raise DamagedError(f"it claims {plain_size} bytes, over {_LARGEST_CHUNK_BYTES}")
    data = _decompress(compression, body[offset + 8 : offset + 8 + data_length], plain_size)
    if crc and zlib.crc32(data) != crc:
        raise DamagedError("its checksum does not match")
    return data


def _decompress(compression: str, data: bytes, plain_size: int) -> bytes:
    if compression == "":
        return data
    if compression == "zstd":
        try:
            claimed = zstandard.frame_content_size(data)
            if claimed > _LARGEST_CHUNK_BYTES:
                raise DamagedError(f"it claims {claimed} bytes, over {_LARGEST_CHUNK_BYTES}")
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=plain_size)
        except zstandard.ZstdError:
            raise DamagedError("zstd cannot decompress it") from None
    if compression == "lz4":
        import lz4.frame

        decompressor = lz4.frame.LZ4FrameDecompressor()
        try:
            plain: bytes = decompressor.decompress(data, max_length=max(plain_size, 1))
        except (RuntimeError, EOFError):
            raise DamagedError("lz4 cannot decompress it") from None
        if not decompressor.eof:
            raise DamagedError(f"it holds more than the {plain_size} bytes it claims, or less")
        return plain
    raise DamagedError(f"its compression {compression!r} is not known")


def records_in(data: bytes) -> Iterator[Item]:
    """The messages, channels and metadata among records. Raises DamagedError."""
    offset = 0
    end = len(data)
    while offset < end:
        try:
            opcode, length = RECORD_HEAD.unpack_from(data, offset)
            offset += RECORD_HEAD.size
            if opcode == Opcode.MESSAGE:
                channel_id, _, time_ns, _ = _MESSAGE_HEAD.unpack_from(data, offset)
                yield Message(
                    channel_id, time_ns, data[offset + _MESSAGE_HEAD.size : offset + length]
                )
            elif opcode in _PARSERS:
                item = _PARSERS[opcode](ReadDataStream(BytesIO(data[offset : offset + length])))
                if not isinstance(item, records.Schema):
                    yield item
        except PARSE_ERRORS:
            raise DamagedError("it does not follow the format") from None
        offset += length
