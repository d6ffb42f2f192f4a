"""Refuses a sample rate that the baud rate cannot carry, in the words of the configuration."""

from firmware_protocol.rates import MOST_SHARE, USUAL_BAUDS, USUAL_RATES_HZ, load
from smad.errors import ConfigError


def check_rate(rate_hz: int, baud: int) -> float:
    """Return the share of the line that the busier direction takes at a rate.

    Raises ConfigError, naming a pair that works, when the rate does not fit the baud rate.
    """
    share = load(rate_hz, baud).share
    if load(rate_hz, baud).fits:
        return share
    ways = [f"link.baud = {b} for {rate_hz} Hz" for b in USUAL_BAUDS if load(rate_hz, b).fits][:1]
    ways += [
        f"link.rate_hz = {r} at {baud} baud" for r in USUAL_RATES_HZ[::-1] if load(r, baud).fits
    ][:1]
    raise ConfigError(
        f"{rate_hz} samples a second do not fit {baud} baud",
        value=f"{share:.0%} of the line",
        limit=f"at most {MOST_SHARE:.0%}",
        action="set " + ", or ".join(ways),
    )
