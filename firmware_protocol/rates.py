"""Whether a serial line can carry a STATE rate, and which pair of rate and baud would do."""

from __future__ import annotations

from dataclasses import dataclass

from firmware_protocol.codec import CODEC
from firmware_protocol.errors import RateError
from firmware_protocol.framing import OVERHEAD
from firmware_protocol.messages import MESSAGES, Message, Setpoint, State
from firmware_protocol.wire import Direction

BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""

MOST_SHARE = 0.70
"""The rest is for answers, fault reports, and a moment's catching up (a judgement)."""

USUAL_BAUDS = (115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000, 2_000_000, 3_000_000)
USUAL_RATES_HZ = (100, 250, 500)


@dataclass(frozen=True)
class Load:
    """What a line carries each second, per direction, and the share of the busier one."""

    rate_hz: int
    baud: int
    axes: int
    to_host_bytes_per_s: int
    to_board_bytes_per_s: int

    @property
    def share(self) -> float:
        """Part of the line's capacity in use; 0 for a port without a baud rate (USB)."""
        if self.baud == 0:
            return 0.0
        busier = max(self.to_host_bytes_per_s, self.to_board_bytes_per_s)
        return busier * BITS_PER_BYTE / self.baud

    @property
    def fits(self) -> bool:
        """Whether the share leaves enough room."""
        return self.share <= MOST_SHARE


def wire_size(message: type[Message]) -> int:
    """Return the bytes of a message on the wire, delimiter included."""
    return CODEC.layout(message).size + OVERHEAD + 2


def periodic(direction: Direction) -> int:
    """Return the bytes a second of all messages of that direction with a `per_s`."""
    return sum(wire_size(m) * m.info.per_s for m in MESSAGES if m.info.direction is direction)


def load(rate_hz: int, baud: int, axes: int = 1) -> Load:
    """Return what `axes` STATE streams at `rate_hz`, with their setpoints, put on the line."""
    return Load(
        rate_hz=rate_hz,
        baud=baud,
        axes=axes,
        to_host_bytes_per_s=rate_hz * axes * wire_size(State) + periodic(Direction.TO_HOST),
        to_board_bytes_per_s=rate_hz * axes * wire_size(Setpoint) + periodic(Direction.TO_BOARD),
    )


def check(rate_hz: int, baud: int, axes: int = 1) -> Load:
    """Return the load; raises RateError, naming a pair that works, if it does not fit."""
    needed = load(rate_hz, baud, axes)
    if needed.fits:
        return needed
    fast_enough = [b for b in USUAL_BAUDS if load(rate_hz, b, axes).fits]
    slow_enough = [r for r in USUAL_RATES_HZ if load(r, baud, axes).fits]
    ways = [f"{rate_hz} Hz at {fast_enough[0]} Bd"] if fast_enough else []
    ways += [f"{slow_enough[-1]} Hz at {baud} Bd"] if slow_enough else []
    who = "1 axis" if axes == 1 else f"{axes} axes"
    raise RateError(
        f"{rate_hz} Hz for {who} needs {needed.share:.0%} of {baud} Bd, the limit is "
        f"{MOST_SHARE:.0%}; use {' or '.join(ways) if ways else 'a USB port or fewer axes'}"
    )


def most_rate_hz(baud: int, axes: int = 1) -> int:
    """Return the highest usual rate that the line carries, 0 if none."""
    return max((rate for rate in USUAL_RATES_HZ if load(rate, baud, axes).fits), default=0)
