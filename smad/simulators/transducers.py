"""What sensors and drives of any plant may do to a signal: gain, zero, lag, delay, saturation.

Each effect has one strength. At 0 the signal passes unchanged, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smad.diagnosis.numerics.lag import lagged
from smad.diagnosis.plant import Array, Effect, EffectParameter, EffectValues

_GAIN = (0.05, 0.5)
_ZERO_OF_RANGE = (0.02, 0.25)
_LONGEST = 10.0
_SATURATES = (0.2, 0.9)


@dataclass(frozen=True, kw_only=True)
class Transduced:
    """A signal that passes a sensor or a drive: its name, unit and range, and where it is felt.

    `lag_s` is what it may well lag by, `places` the names of the places of the diagnosis.
    """

    name: str
    unit: str
    low: float
    high: float
    lag_s: float
    drive: bool
    signals: tuple[str, ...]
    places: tuple[str, ...] = ()


def effects_of(t: Transduced, *, delay: bool = True, saturation: bool = False) -> list[Effect]:
    """The effects that a signal may have, named `{signal}_gain`, `_zero`, `_lag` and so on."""
    what = f"{'drive' if t.drive else 'reading'} {t.name}"
    gain, most_gain = _GAIN
    zero, most_zero = (share * (t.high - t.low) for share in _ZERO_OF_RANGE)
    longest = _LONGEST * t.lag_s
    rows = [
        ("gain", "gain error", _value("g", "1", gain, -most_gain, most_gain), "(1 + g)·y"),
        ("zero", "zero error", _value("b", t.unit, zero, -most_zero, most_zero), "y + b"),
        ("lag", "lag", _value("tau_s", "s", t.lag_s, 0.0, longest), "tau·s' = y − s"),
    ]
    if delay:
        rows.append(("delay", "delay", _value("T_s", "s", t.lag_s, 0.0, longest), "y(t − T)"))
    if saturation:
        cut = _value("cut", "1", _SATURATES[0], 0.0, _SATURATES[1])
        rows.append(("saturation", "saturation", cut, "|y| ≤ (1 − cut)·largest"))
    return [
        Effect(
            name=f"{t.name}_{end}",
            title=f"{title} of the {what}",
            parameters=(value,),
            signals=t.signals,
            equation=law,
            places=t.places,
        )
        for end, title, value, law in rows
    ]


def transduced(
    column: Array, effects: EffectValues, name: str, t_s: Array, largest: float = 0.0
) -> Array:
    """What a sensor or a drive makes of a signal (n,); the column itself without an effect.

    `largest` is the size that saturation is a share of.
    """
    gain, zero, tau_s, delay_s, cut = (
        effects.get(f"{name}_{end}", {}).get(value, 0.0)
        for end, value in (("gain", "g"), ("zero", "b"), ("lag", "tau_s"), ("delay", "T_s"),
                           ("saturation", "cut"))
    )  # fmt: skip
    if gain != 0.0:
        column = column * (1.0 + gain)
    if zero != 0.0:
        column = column + zero
    if cut > 0.0 and largest > 0.0:
        column = np.clip(column, -(1.0 - cut) * largest, (1.0 - cut) * largest)
    if delay_s > 0.0:
        column = np.interp(t_s - delay_s, t_s, column)
    if tau_s > 0.0 and len(t_s) > 1:
        keep = float(np.exp(-float(np.median(np.diff(t_s))) / tau_s))
        column = lagged(column, keep)
    return np.asarray(column)


def _value(name: str, unit: str, typical: float, low: float, high: float) -> EffectParameter:
    return EffectParameter(name=name, unit=unit, typical=typical, low=low, high=high)
