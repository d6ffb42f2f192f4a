"""How far each number of the supervisor can go, and the C types that follow.

Every field has a range here. The translation to C works out the range of every expression from
them (see typed), takes the narrowest type that holds it, and proves that what is stored fits its
field; where that cannot be proved the stored value is held at the end of the range, and the field
must be named in SATURATED, with the reason why no bench ever gets there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from firmware_protocol.enums import Fault
from firmware_protocol.supervisor.errors import TranslationError
from firmware_protocol.supervisor.limits import LIMIT_ROWS
from firmware_protocol.supervisor.observers import (
    FCC_PER_CC,
    SUM_MOST,
    TIMER_MOST_US,
    POWER_MOST_mW,
)


class Range(NamedTuple):
    """All whole numbers from `low` to `high`."""

    low: int
    high: int

    def holds(self, other: Range) -> bool:
        """Whether every number of `other` is in this range."""
        return self.low <= other.low and other.high <= self.high

    def joined(self, other: Range) -> Range:
        """Return the range of both and all between."""
        return Range(min(self.low, other.low), max(self.high, other.high))


FLAG = Range(0, 1)
TIME = Range(-(1 << 61), 1 << 61)
I16 = Range(-(1 << 15), (1 << 15) - 1)
U16 = Range(0, (1 << 16) - 1)
U8 = Range(0, 255)
I32 = Range(-(1 << 31), (1 << 31) - 1)
TOKEN = Range(-(1 << 62), 1 << 62)
STATE = Range(0, 6)
FAULT = Range(0, max(Fault))
CHANNEL = Range(0, 6)
LIMITER = Range(0, 5)
CURRENT = Range(0, LIMIT_ROWS["current_limit_mA"].compiled)
TIMER = Range(0, TIMER_MOST_US)
UA = Range(-32_768_000, 65_535_000)
BAND = Range(0, 1000 * CURRENT.high)
UV = Range(-65_535_000, 65_535_000)
FCC = Range(-32_768 * FCC_PER_CC, 32_767 * FCC_PER_CC)
OHMS = Range(0, 2_000_000)
SUM = Range(0, SUM_MOST)
COUNT = Range(0, 60_000)

MEASUREMENTS: dict[str, Range] = {
    "i_mA": I16, "applied_mA": CURRENT, "v_mV": Range(-65_535, 65_535), "rtd_cC": I16, "duty": U8,
    "pump_rpm": Range(-1, 65_535), "vbus_mV": Range(-65_535, 65_535), "leak": FLAG,
    "parameters_ok": FLAG, "encoder_invalid": FLAG, "force_invalid": FLAG,
}  # fmt: skip

COMMAND: dict[str, Range] = {
    "passed": FLAG, "link": Range(0, 15), "token": TOKEN, "fault": U8, "i_mA": U16, "duty": U8,
    "age_us": I32, "ttl_us": Range(0, 65_535_000), "stage_um": I32,
}  # fmt: skip

MEMORY: dict[str, Range] = {
    "lines": U8, "now_us": TIME, "dt_us": Range(0, 10_000_000), "started": FLAG,
    "paced_us": Range(-1, 10_000_000), "filter_share": U16, "band_share": U16, "lag_share": U16,
    "heavy_share": I32, "light_share": Range(0, 2_000_000_000), "drift_fcC": Range(0, 20_000_000),
    "rpm_share": U16, "heat_limit_nJ": SUM, "i2t_near_mA2us": SUM, "i2t_budget_mA2us": SUM,
    "i2t_trip_mA2us": SUM,
    "state": STATE, "entered_us": TIME, "armed_at_us": TIME,
    "gate": FLAG, "ceiling_mA": CURRENT, "ceiling_limiter": LIMITER, "applied_mA": CURRENT,
    "duty": U8, "limiter": LIMITER, "warnings": U16,
    "slew_from_mA": CURRENT, "slew_step_mA": Range(0, 4_000_000), "cooling": FLAG, "capped": FLAG,
    "setpoint_mA": U16, "setpoint_duty": U8, "setpoint_us": TIME,
    "setpoint_ttl_us": Range(0, 100_000), "stale_setpoints": TIMER, "stale_at_us": TIME,
    "token": TOKEN, "token_us": TIME, "token_valid": FLAG,
    "faults": Range(0, (1 << max(Fault)) - 1), "latched": FLAG, "first_fault": FAULT,
    "first_channel": CHANNEL, "first_value": I32, "first_limit": I32, "first_us": TIME,
    "value": I32, "limit": I32, "channel": CHANNEL,
    "coldest_cC": I16, "warmest_cC": I16, "sensor_ok": FLAG, "t_cC": I16,
    "power_mW": Range(0, POWER_MOST_mW), "i_uA": UA, "v_uV": UV,
    "band_low_uA": BAND, "band_high_uA": BAND,
    "anchor_cC": I16, "anchor_other_cC": I16,
    "anchor_net_nJ": Range(-SUM_MOST, SUM_MOST), "anchor_other_nJ": SUM,
    "stuck_cC": I16, "stuck_us": TIMER, "stuck_low_fcC": FCC, "off_us": TIMER, "off_fcC": FCC,
    "low_fcC": FCC, "low_seen_fcC": FCC, "high_fcC": FCC, "i2t_mA2us": SUM,
    "cool_us": TIMER, "cool_from_cC": I16, "reference_mohm": OHMS, "reference_cC": I16,
    "last_cC": I16, "jumps": COUNT, "jump_us": TIMER, "jump_cC": U16,
    "bad_samples": COUNT, "bad_us": TIMER, "need_samples": U8, "need_us": TIMER,
}  # fmt: skip

LIMITS: dict[str, Range] = {
    name: Range(min(row.compiled, row.tightest), max(row.compiled, row.tightest))
    for name, row in LIMIT_ROWS.items()
}

RECORDS: dict[str, dict[str, Range]] = {
    "Measurements": MEASUREMENTS,
    "Command": COMMAND,
    "Memory": MEMORY,
    "Limits": LIMITS,
}

ARGUMENTS: dict[str, Range] = {
    "k": CHANNEL, "now_us": TIME, "trigger": Range(0, 9), "fault": Range(1, max(Fault)),
    "channel": CHANNEL, "code": Range(0, 63), "value": I32, "limit": I32, "link": Range(0, 15),
    "loss_mW_per_K": Range(0, 1020), "steady_cC": I16, "full": Range(0, 6000), "duty": U8,
    "above_cC": Range(-65_735, 65_735), "i_mA": I16, "v_mV": Range(-65_535, 65_535),
}  # fmt: skip
"""Of the arguments that are numbers, by name."""

RESULTS: dict[str, Range] = {
    "saturated": I32,
    "resistance_mohm": OHMS,
    "of_duty": Range(0, 10_000),
    "loss_mW": Range(-10_000_000, 10_000_000),
    "power_mW": Range(0, POWER_MOST_mW),
}
RESULT = Range(0, 63)
"""Of every other function that returns a number: codes and verdicts."""

_LONG = "a timer: the limits it is compared with are far below a thousand seconds"
_SHARE = "a step over step plus lag: less than 1, which is 65536"
SATURATED: dict[str, str] = {
    "state": "the table of transitions has -1 for none, which is looked at before",
    "ceiling_mA": "folded back from the current limit, so never above it",
    "applied_mA": "never above the ceiling",
    "stale_setpoints": "a counter; only zero or not matters",
    "off_us": _LONG,
    "cool_us": _LONG,
    "jump_us": _LONG,
    "bad_us": _LONG,
    "jumps": "forgotten one in two seconds; a line so bad trips long before",
    "bad_samples": "compared with three at most",
    "off_fcC": "between the rail and the last reading that was believed",
    "low_fcC": "no spring is colder than absolute zero, and the loss goes to zero before",
    "high_fcC": "as low_fcC",
    "filter_share": _SHARE,
    "band_share": _SHARE,
    "lag_share": _SHARE,
    "loss_mW_per_K": "at full duty it is the sum of two limits, 1020",
    "resistance_mohm": "taken at half an ampere and more: below 132 ohm",
    "value": "what a report names; the wire holds 32 bits, and Python is held at their ends too",
}
"""Fields and arguments held at the end of their range, and why none gets there."""

_STORED = ("uint8_t", "int8_t", "uint16_t", "int16_t", "uint32_t", "int32_t", "int64_t")
_WIDEST_FIRST = ("int64_t", "int32_t", "uint32_t", "int16_t", "uint16_t", "int8_t", "uint8_t")


def span_of(kind: str) -> Range:
    """Return what a C type holds."""
    bits = int("".join(ch for ch in kind if ch.isdigit()))
    if kind.startswith("u"):
        return Range(0, (1 << bits) - 1)
    return Range(-(1 << (bits - 1)), (1 << (bits - 1)) - 1)


def stored_as(span: Range) -> str:
    """Return the narrowest type that holds a range. Raises TranslationError beyond 64 bits."""
    return _first(span, _STORED)


def stored_limits() -> list[tuple[str, object]]:
    """Return the limits that a parameter can change; the others are constants of the C."""
    return [(name, row) for name, row in LIMIT_ROWS.items() if row.number]


def in_order(
    members: Sequence[tuple[str, object]], spans: Mapping[str, Range]
) -> list[tuple[str, object, str]]:
    """Return name, value and C type of a record's members in the order of its struct.

    The widest come first, so that no chip leaves holes between them. Raises KeyError for a member
    without a range.
    """
    typed = [(name, value, stored_as(spans[name])) for name, value in members]
    return sorted(typed, key=lambda member: _WIDEST_FIRST.index(member[2]))


def counted_as(*spans: Range) -> str:
    """Return the narrowest signed type to calculate in that holds all of the ranges."""
    everything = spans[0]
    for other in spans[1:]:
        everything = everything.joined(other)
    return _first(everything, ("int16_t", "int32_t", "int64_t"))


def _first(span: Range, kinds: tuple[str, ...]) -> str:
    for kind in kinds:
        if span_of(kind).holds(span):
            return kind
    raise TranslationError(
        f"no type holds {span.low} to {span.high}; narrow the ranges, see ranges.py"
    )
