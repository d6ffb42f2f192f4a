"""Whether a sample rate fits a baud rate: STATE may fill at most 70 percent of the line."""

from __future__ import annotations

from firmware_protocol.codec import CODEC
from firmware_protocol.framing import OVERHEAD
from firmware_protocol.messages import State
from smad.errors import ConfigError

RATES_HZ = (100, 250, 500)
BAUDS = (115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000)
LARGEST_SHARE = 0.7
BITS_PER_BYTE = 10
"""Start bit, eight data bits, stop bit."""

_COBS_AND_DELIMITER = 2
STATE_BYTES = CODEC.layout(State).size + OVERHEAD + _COBS_AND_DELIMITER


def line_share(rate_hz: int, baud: int) -> float:
    """Return the share of the line that STATE takes."""
    return rate_hz * STATE_BYTES * BITS_PER_BYTE / baud


def check_rate(rate_hz: int, baud: int) -> None:
    """Raise ConfigError, naming a pair that works, when the rate does not fit the baud rate."""
    share = line_share(rate_hz, baud)
    if share <= LARGEST_SHARE:
        return
    baud_that_fits = next((b for b in BAUDS if line_share(rate_hz, b) <= LARGEST_SHARE), BAUDS[-1])
    rates_that_fit = [r for r in RATES_HZ if line_share(r, baud) <= LARGEST_SHARE]
    slower = f", or link.rate_hz = {rates_that_fit[-1]} at {baud} baud" if rates_that_fit else ""
    raise ConfigError(
        f"{rate_hz} samples a second do not fit {baud} baud",
        value=f"{share:.0%} of the line",
        limit=f"at most {LARGEST_SHARE:.0%}",
        action=f"set link.baud = {baud_that_fits} for {rate_hz} Hz{slower}",
    )
