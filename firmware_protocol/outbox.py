"""Bytes waiting to be written, and the delimiter that goes first after opening or a pause."""

from __future__ import annotations

from firmware_protocol.framing import DELIMITER

PAUSE_US = 100_000
"""After so long a silence the other end may have collected noise: one delimiter ends it."""

LIMIT = 8192
"""A reader that stays away must not fill the memory: frames beyond this are dropped."""


class Outbox:
    """Frames in order, urgent ones first."""

    def __init__(self) -> None:
        self._frames = bytearray()
        self._urgent = bytearray()
        self._last_us: int | None = None

    def add(self, frame: bytes) -> bool:
        """Append a frame; return False if there was no room."""
        if len(self._frames) + len(frame) > LIMIT:
            return False
        self._frames += frame
        return True

    def add_urgent(self, frame: bytes) -> None:
        """Put a frame before all others, with a delimiter that ends whatever was begun."""
        if len(self._urgent) < LIMIT:
            self._urgent += DELIMITER + frame

    def take(self, now_us: int) -> bytes:
        """Return everything, to be written now."""
        if not self._frames and not self._urgent:
            return b""
        paused = self._last_us is None or now_us - self._last_us > PAUSE_US
        data = (DELIMITER if paused else b"") + bytes(self._urgent) + bytes(self._frames)
        self._frames.clear()
        self._urgent.clear()
        self._last_us = now_us
        return data

    def reopen(self) -> None:
        """Forget what was waiting; begin as on a port just opened."""
        self._frames.clear()
        self._urgent.clear()
        self._last_us = None
