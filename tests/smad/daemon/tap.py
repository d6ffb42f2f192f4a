"""A man in the middle of each line: it loses what it is told to, and keeps what each board sends.

It knows nothing of the daemon. `Tap.armed_after` is the oracle: for how long a board has sent that
it is armed, or that current flows, after a time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field

from campaign.virtual import Line
from firmware_protocol import messages as wire
from firmware_protocol.codec import CODEC
from firmware_protocol.framing import DELIMITER, FrameDecoder
from firmware_protocol.mirror import HOT

STATE = bytes([wire.State.info.number])
Lose = Callable[[wire.Message], bool]


def nothing(_: wire.Message) -> bool:
    """Lose no message."""
    return False


@dataclass
class Tap:
    """What is lost in each direction, and when, by the rig's time, the board sent that it heats."""

    to_board: Lose = nothing
    to_host: Lose = nothing
    late_until_us: int = 0
    """Until then what the daemon says is kept on its way, in order."""
    heating_us: list[int] = field(default_factory=list)
    _late: bytes = b""

    def delayed(self, data: bytes, now_us: int) -> bytes:
        """Return what arrives now of this and of what was kept."""
        data, self._late = self._late + data, b""
        if now_us < self.late_until_us:
            data, self._late = b"", data
        return data

    def armed_after(self, told_us: int, until_us: int) -> int:
        """Return for how long after a time the board sent that it is armed, µs; 0 for never."""
        later = [at_us for at_us in self.heating_us if told_us < at_us <= until_us]
        return max(later) - told_us if later else 0


class TappedLine(Line):
    """A line with a tap on it."""

    tap: Tap

    def step(self) -> None:
        """Take a sample, note what the board says of itself, pass on what is not lost."""
        data = self.bench.step()
        passed = self._passed(data, self.tap.to_host, note=True)
        if self.end is not None and passed:
            with contextlib.suppress(OSError):
                self.end.send(passed)

    def receive(self) -> None:
        """Let the board hear what is not lost of what the daemon said."""
        data = b""
        if self.end is not None:
            with contextlib.suppress(OSError):
                data = self._passed(self.end.recv(65_536), self.tap.to_board)
        self.bench.receive(self.tap.delayed(data, self.phase_us + self.bench.now_us))

    def _passed(self, data: bytes, lose: Lose, *, note: bool = False) -> bytes:
        if lose is nothing and not note:
            return data
        kept = []
        for piece in data.split(DELIMITER):
            # The first byte says how far away the next zero is: what follows it is the type.
            if lose is nothing and piece[1:2] != STATE:
                kept.append(piece)
                continue
            message = _message(piece)
            if note and isinstance(message, wire.State) and _heats(message):
                self.tap.heating_us.append(self.phase_us + self.bench.now_us)
            kept.append(b"" if message is not None and lose(message) else piece)
        return DELIMITER.join(kept)


def tapped(line: Line) -> TappedLine:
    """Return the same board and line with a tap on it."""
    made = TappedLine(line.bench, line.phase_us)
    made.tap = Tap()
    return made


def _heats(state: wire.State) -> bool:
    return state.mode in HOT or any(state.i_applied_mA)


def _message(piece: bytes) -> wire.Message | None:
    frames = FrameDecoder().feed(piece + DELIMITER)
    return CODEC.unpack(frames[0].type, frames[0].payload) if frames else None
