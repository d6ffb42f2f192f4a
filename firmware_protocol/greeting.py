"""The host's HELLO: with which nonce, and when again."""

from __future__ import annotations

from firmware_protocol.messages import PROTOCOL_MAJOR, PROTOCOL_MINOR, Hello

INTERVALS_US = (100_000, 200_000, 400_000, 1_000_000)
"""Time from one HELLO to the next; the last one repeats."""


class Greeting:
    """HELLO until somebody answers. Nonce 0 is left to the board's own announcements."""

    def __init__(self, nonce: int, schema_crc: int) -> None:
        self.nonce = nonce
        self.due_us: int | None = None
        self.count = 0
        self._schema_crc = schema_crc

    def renew(self) -> None:
        """Take another nonce: the next HELLO asks for a new session."""
        self.nonce = self.nonce % 0xFFFFFFFF + 1
        self.count = 0

    def hello(self, now_us: int) -> Hello:
        """Return the HELLO to send now."""
        self.due_us = now_us + INTERVALS_US[min(self.count, len(INTERVALS_US) - 1)]
        self.count += 1
        return Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR, self._schema_crc, self.nonce)

    def stop(self) -> None:
        """Send no more."""
        self.due_us = None
