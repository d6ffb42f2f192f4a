"""Fitted parameters of effects as quantities that mean the same in any functional form.

tests/withheld/quantities.py says what each quantity is. All are changes since the known-good runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from smad.gap.check.verdicts import Estimate
from smad.gap.records import ValueRecord

_QUANTITIES: dict[str, Mapping[str, float]] = {
    "driver_gain": {"gain": 1.0},
    "driver_lag": {"tau_s": 1.0},
    "contact_resistance": {"resistance_Ohm": 1.0},
    "rtd_lag": {"tau_s": 1.0},
    "rtd_offset": {"offset_K": 1.0},
    # Mean delay of encoder and load cell; the delay of the temperatures is another question.
    "channel_delay": {"displacement_s": 0.5, "force_s": 0.5},
    "encoder_backlash": {"width_m": 1e3},
    "force_offset": {"offset_N": 1.0},
    "force_gain": {"gain": 1.0},
    # A first-order spin-up delays a ramp by its time constant.
    "pump_lag": {"dead_s": 1.0, "spinup_s": 1.0},
    "flow_shortfall": {"share": 1.0},
    # The quantity is the fall after three full cycles, the parameter the rise with each.
    "transformation_fatigue": {"shift_K": -3.0},
}

COMPARABLE = tuple(_QUANTITIES)
"""Effects of the library that have a comparable quantity, a weighted sum of its parameters."""


def quantities(values: Sequence[ValueRecord]) -> dict[str, Estimate]:
    """Comparable quantities of the effects of a diagnosis, by effect.

    Intervals of a sum are added in quadrature, as if its parts were independent.
    """
    out = {}
    for effect in dict.fromkeys(v.effect for v in values):
        weights = _QUANTITIES.get(effect, {})
        own = [(weights[v.name], v) for v in values if v.effect == effect and v.name in weights]
        if own:
            out[effect] = _sum(own)
    return out


def _sum(parts: Sequence[tuple[float, ValueRecord]]) -> Estimate:
    value = sum(w * (v.value - v.before) for w, v in parts)
    # A negative weight turns an interval over.
    below = [w * (v.value - v.low) if w > 0 else w * (v.value - v.high) for w, v in parts]
    above = [w * (v.high - v.value) if w > 0 else w * (v.low - v.value) for w, v in parts]
    return Estimate(value, value - math.hypot(*below), value + math.hypot(*above))
