"""What sensors and drives of any plant may do to a signal: gain, zero, lag, delay, saturation.

Each effect has one strength. At 0 the signal passes unchanged, to the last bit.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from smad.diagnosis.numerics.lag import lagged
from smad.diagnosis.places.bare import INPUT, READING
from smad.diagnosis.plant import Array, Channel, Effect, EffectParameter, EffectValues, Signal

_GAIN = (0.05, 0.5)
_ZERO_OF_RANGE = (0.02, 0.25)
_LONGEST = 10.0
_SATURATES = (0.2, 0.9)
KINDS = ("gain", "zero", "lag", "delay", "saturation")
"""What a sensor or a drive may do to a signal; only a drive saturates."""


def effects_of(
    channels: Sequence[Channel],
    drives: Iterable[Signal],
    lag_s: float,
    *,
    acts_at: Callable[[str], str] = INPUT.__add__,
    kinds: Collection[str],
) -> list[Effect]:
    """The effects of each reading, then of each drive, named `{signal}_gain`, `_zero`, `_lag` …

    Of all the `kinds` are taken that are named; saturation is one of a drive. `lag_s` is what
    either may well lag by; a drive `acts_at` a place of the diagnosis.
    """
    everything = tuple(c.name for c in channels)
    effects: list[Effect] = []
    for c in channels:
        felt = _Felt(f"reading {c.name}", (c.name,), f"{READING}{c.name}")
        effects += _effects(c, felt, lag_s, set(kinds) - {"saturation"})
    for s in drives:
        felt = _Felt(f"drive {s.name}", everything, acts_at(s.name))
        effects += _effects(s, felt, lag_s, kinds)
    return effects


class _Felt(NamedTuple):
    """What a signal is in words, the channels that it changes, and its place."""

    words: str
    signals: tuple[str, ...]
    place: str


def _effects(
    of: Channel | Signal, felt: _Felt, lag_s: float, kinds: Collection[str]
) -> Iterable[Effect]:
    gain, most_gain = _GAIN
    zero, most_zero = (share * (of.high - of.low) for share in _ZERO_OF_RANGE)
    longest = _LONGEST * lag_s
    cut = _value("cut", "1", _SATURATES[0], 0.0, _SATURATES[1])
    for end, title, value, law in (
        ("gain", "gain error", _value("g", "1", gain, -most_gain, most_gain), "(1 + g)·y"),
        ("zero", "zero error", _value("b", of.unit, zero, -most_zero, most_zero), "y + b"),
        ("lag", "lag", _value("tau_s", "s", lag_s, 0.0, longest), "tau·s' = y − s"),
        ("delay", "delay", _value("T_s", "s", lag_s, 0.0, longest), "y(t − T)"),
        ("saturation", "saturation", cut, "|y| ≤ (1 − cut)·largest"),
    ):
        if end not in kinds:
            continue
        yield Effect(
            name=f"{of.name}_{end}",
            title=f"{title} of the {felt.words}",
            parameters=(value,),
            signals=felt.signals,
            equation=law,
            places=(felt.place,),
        )


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
