"""What the host repeats, tighter: each of its limits is derived from one of the board's.

The host stops first and without a fault, so that the board's checks are met only when the host,
its sensors' readings or the link have failed.
"""

from __future__ import annotations

from dataclasses import dataclass

from firmware_protocol.supervisor.limits import Limits


@dataclass(frozen=True, slots=True)
class HostRow:
    """One row: the board's limit it follows, and its share of it."""

    board: str
    percent: int
    meaning: str


HOST_ROWS: dict[str, HostRow] = {
    "temperature_cC": HostRow("fold_start_cC", 99, "folds the current back to zero"),
    "current_mA": HostRow("current_limit_mA", 100, "never asks for more current"),
    "current_slew_mA_per_ms": HostRow("current_slew_mA_per_ms", 100, "raises a current no faster"),
    "on_time_s": HostRow("on_time_limit_s", 95, "ends a run"),
    "setpoint_ttl_ms": HostRow("setpoint_ttl_ms", 100, "gives its setpoints this life"),
    "setpoint_age_us": HostRow("setpoint_age_us", 80, "counts a sample as answered late"),
    "supply_mV": HostRow("brown_out_mV", 113, "warns of a low supply"),
}


@dataclass(frozen=True, slots=True)
class HostLimits:
    """Limits for the host, in the board's units."""

    temperature_cC: int
    current_mA: int
    current_slew_mA_per_ms: int
    on_time_s: int
    setpoint_ttl_ms: int
    setpoint_age_us: int
    supply_mV: int


def host_limits(board: Limits) -> HostLimits:
    """Return the host's limits for the board's limits in force."""
    return HostLimits(
        **{name: getattr(board, row.board) * row.percent // 100 for name, row in HOST_ROWS.items()}
    )
