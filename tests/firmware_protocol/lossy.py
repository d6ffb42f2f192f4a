"""One direction of a bad serial line: bytes in at a time, other bytes out at another."""

from __future__ import annotations

import random
from dataclasses import dataclass, field


@dataclass
class Line:
    """Chances are per byte (flip, drop, insert) or per write (burst, twice, swap)."""

    rng: random.Random
    flip: float = 0.0
    drop: float = 0.0
    insert: float = 0.0
    burst: float = 0.0
    twice: float = 0.0
    swap: float = 0.0
    dead: bool = False
    stalled: bool = False
    most_bytes: int | None = None
    echo_to: Line | None = None
    held: list[bytes] = field(default_factory=list)
    late: list[bytes] | None = None

    def write(self, data: bytes) -> None:
        """Put bytes on the line, frame by frame."""
        if self.dead or not data:
            return
        if self.echo_to is not None:
            self.echo_to.held.append(data)
        for piece in data.split(b"\0")[:-1]:
            copies = 2 if self.rng.random() < self.twice else 1
            arriving = [self._spoil(piece + b"\0")] * copies
            if self.late is None and self.rng.random() < self.swap:
                self.late = arriving
                continue
            self.held += arriving + (self.late or [])
            self.late = None

    def read(self) -> list[bytes]:
        """Return what arrives now, in the pieces in which it arrives."""
        if self.stalled:
            return []
        data = b"".join(self.held)
        self.held.clear()
        if self.most_bytes is None:
            return [data] if data else []
        return [data[i : i + self.most_bytes] for i in range(0, len(data), self.most_bytes)]

    def _spoil(self, data: bytes) -> bytes:
        if not (self.flip or self.drop or self.insert or self.burst):
            return data
        out = bytearray()
        for byte in data:
            if self.rng.random() < self.drop:
                continue
            if self.rng.random() < self.insert:
                out.append(self.rng.randrange(256))
            flipped = self.rng.random() < self.flip
            out.append(byte ^ (1 << self.rng.randrange(8)) if flipped else byte)
        if self.rng.random() < self.burst:
            at = self.rng.randrange(len(out) + 1)
            out[at : at + 8] = self.rng.randbytes(8)
        return bytes(out)
