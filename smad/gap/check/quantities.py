"""Fitted parameters of effects as quantities that mean the same in any functional form.

tests/withheld/quantities.py says what each quantity is. All are changes since the known-good runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from smad.gap.check.verdicts import Estimate
from smad.gap.records import ValueRecord


@dataclass(frozen=True)
class _Sum:
    """A weighted sum of an effect's parameters."""

    weights: Mapping[str, float]


_QUANTITIES: dict[str, _Sum] = {
    "driver_gain": _Sum({"gain": 1.0}),
    "driver_lag": _Sum({"tau_s": 1.0}),
    "contact_resistance": _Sum({"resistance_Ohm": 1.0}),
    "rtd_lag": _Sum({"tau_s": 1.0}),
    "rtd_offset": _Sum({"offset_K": 1.0}),
    # Mean delay of encoder and load cell; the delay of the temperatures is another question.
    "channel_delay": _Sum({"displacement_s": 0.5, "force_s": 0.5}),
    "encoder_backlash": _Sum({"width_m": 1e3}),
    "force_offset": _Sum({"offset_N": 1.0}),
    "force_gain": _Sum({"gain": 1.0}),
    # A first-order spin-up delays a ramp by its time constant.
    "pump_lag": _Sum({"dead_s": 1.0, "spinup_s": 1.0}),
    "flow_shortfall": _Sum({"share": 1.0}),
    # The quantity is the fall after three full cycles, the parameter the rise with each.
    "transformation_fatigue": _Sum({"shift_K": -3.0}),
}

COMPARABLE = tuple(_QUANTITIES)
"""Effects of the library that have a comparable quantity."""


def quantities(values: Sequence[ValueRecord]) -> dict[str, Estimate]:
    """Comparable quantities of the effects of a diagnosis, by effect.

    Intervals of a sum are added in quadrature, as if its parts were independent.
    """
    out = {}
    for effect in dict.fromkeys(v.effect for v in values):
        wanted = _QUANTITIES.get(effect)
        if wanted is None:
            continue
        own = [(wanted.weights[v.name], v) for v in values if _belongs(v, effect, wanted)]
        if own:
            out[effect] = _sum(own)
    return out


def _belongs(v: ValueRecord, effect: str, wanted: _Sum) -> bool:
    return v.effect == effect and v.name in wanted.weights


def _sum(parts: Sequence[tuple[float, ValueRecord]]) -> Estimate:
    value = sum(w * (v.value - v.before) for w, v in parts)
    # A negative weight turns an interval over.
    below = [w * (v.value - v.low) if w > 0 else w * (v.value - v.high) for w, v in parts]
    above = [w * (v.high - v.value) if w > 0 else w * (v.low - v.value) for w, v in parts]
    return Estimate(value, value - math.hypot(*below), value + math.hypot(*above))
