"""The configuration's limits that the board has as well: the host's may only be tighter."""

from collections.abc import Iterator
from operator import attrgetter
from typing import NamedTuple

from firmware_protocol.supervisor.host import HOST_ROWS, host_limits
from firmware_protocol.supervisor.limits import Limits
from smad.config.model import Config

KEYS: dict[str, tuple[str, float]] = {
    "temperature_cC": ("limits.temperature_max_degC", 100.0),
    "current_mA": ("control.current_limit_A", 1000.0),
    "current_slew_mA_per_ms": ("limits.current_rate_max_A_per_s", 1.0),
    "on_time_s": ("limits.on_time_max_s", 1.0),
    "setpoint_ttl_ms": ("link.setpoint_ttl_ms", 1.0),
}
"""Row of the host's table → key of the configuration, and how many of the row's unit its unit is.

The ranges of these keys come from the same rows, at the board's compiled limits.
"""


class Looser(NamedTuple):
    """A key that is looser than a board allows: `value` and `limit` in the key's unit."""

    key: str
    value: float
    limit: float
    board: str


def looser_than(config: Config, board: Limits) -> Iterator[Looser]:
    """Yield the keys that are looser than the host's share of the board's limits in force."""
    allowed = host_limits(board)
    for row, (key, scale) in KEYS.items():
        value: float = attrgetter(key)(config)
        limit = getattr(allowed, row) / scale
        if value > limit:
            yield Looser(key, value, limit, HOST_ROWS[row].board)
