"""Bytes read as a small program, and what a harness may find wrong.

A checksum stops a mutated frame at the door, and a token of 32 bits is not guessed. So the
harnesses of the sessions do not take their input as a stream: it says which frames to make, and
the harness adds what must be right for the frame to get any further.
"""

from __future__ import annotations

import struct


class Defect(AssertionError):
    """The code under test did what it says that it never does."""


def require(holds: object, message: str, *values: object) -> None:
    """Raise Defect with the message, its `{}` filled with the values, unless `holds`."""
    if not holds:
        raise Defect(message.format(*values))


class Program:
    """Takes values off the front of the input; an input that has ended gives zeros."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._position = 0

    def __bool__(self) -> bool:
        return self._position < len(self._data)

    def u8(self) -> int:
        """Return the next byte."""
        return int.from_bytes(self.take(1))

    def u16(self) -> int:
        """Return the next two bytes, little-endian."""
        number: int = struct.unpack("<H", self.take(2))[0]
        return number

    def take(self, count: int) -> bytes:
        """Return the next `count` bytes, filled up with zeros."""
        piece = self._data[self._position : self._position + count]
        self._position += count
        return piece.ljust(count, b"\0")

    def rest(self) -> bytes:
        """Return what is left."""
        piece = self._data[self._position :]
        self._position = len(self._data)
        return piece
