"""One direction of the serial line, and what can happen to bytes on it.

A line takes bytes and the board's time and gives back what arrives. Healthy, it gives back what
it was given. Everything random comes from its generator.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

FLIPS_MOST = 5
BURST_BYTES = 24
PROBE = b"ATE1 E0 V1\rAT+GCAP\r\x7f\xf0\r\r~\x7e\x00x\xf0~"
"""What a modem manager sends to a port it finds (from the shape of such probes: AT, then junk)."""


@dataclass(slots=True)
class Line:
    """State of one direction. Rates are events per byte."""

    rng: random.Random
    flip: float = 0.0
    burst: float = 0.0
    drop: float = 0.0
    insert: float = 0.0
    duplicate: float = 0.0
    """Chance of each frame to arrive twice."""
    swap: float = 0.0
    """Chance of each frame to change places with the one behind it."""
    garbled: bool = False
    lost: bool = False
    stalled: bool = False
    split: int = 0
    """Deliver at most so many bytes a call; 0 for all."""
    delay_us: int = 0
    withheld: bytearray = field(default_factory=bytearray)
    late: list[tuple[int, bytes]] = field(default_factory=list)
    spoilt: bool = False
    """Set by `spoil`; while False bytes pass untouched."""

    def spoil(self, **changes: object) -> None:
        """Set fields by name."""
        for name, value in changes.items():
            setattr(self, name, value)
        self.spoilt = True

    def carry(self, data: bytes, now_us: int) -> bytes:
        """Return what arrives now, of `data` and of what was held back."""
        if not self.spoilt:
            return data
        if self.lost:
            return b""
        self.withheld += data
        if self.stalled:
            return b""
        data = bytes(self.withheld)
        self.withheld.clear()
        if self.split and len(data) > self.split:
            self.withheld += data[self.split :]
            data = data[: self.split]
        if self.duplicate or self.swap:
            data = self._shuffle_frames(data)
        if self.garbled:
            data = bytes(byte ^ self.rng.randrange(1, 256) for byte in data)
        if self.flip or self.burst or self.drop or self.insert:
            data = self._damage(data)
        return self._delayed(data, now_us)

    def _delayed(self, data: bytes, now_us: int) -> bytes:
        if not self.delay_us and not self.late:
            return data
        if data:
            self.late.append((now_us + self.delay_us, data))
        ready = b"".join(piece for due, piece in self.late if due <= now_us)
        self.late = [entry for entry in self.late if entry[0] > now_us]
        return ready

    def _shuffle_frames(self, data: bytes) -> bytes:
        frames = [piece + b"\x00" for piece in data.split(b"\x00")]
        tail = frames.pop()[:-1]
        out: list[bytes] = []
        for frame in frames:
            out.append(frame)
            if self.rng.random() < self.duplicate:
                out.append(frame)
        for n in range(len(out) - 1):
            if self.rng.random() < self.swap:
                out[n], out[n + 1] = out[n + 1], out[n]
        return b"".join(out) + tail

    def _damage(self, data: bytes) -> bytes:
        out = bytearray()
        burst_left = 0
        for byte in data:
            value = byte
            if self.rng.random() < self.burst:
                burst_left = self.rng.randrange(1, BURST_BYTES)
            if burst_left:
                burst_left -= 1
                value = self.rng.randrange(256)
            if self.rng.random() < self.drop:
                continue
            if self.rng.random() < self.flip:
                for _ in range(self.rng.randrange(1, FLIPS_MOST + 1)):
                    value ^= 1 << self.rng.randrange(8)
            out.append(value)
            if self.rng.random() < self.insert:
                out.append(self.rng.randrange(256))
        return bytes(out)
