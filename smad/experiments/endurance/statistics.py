"""What each cycle came to, from the columns of a recorded block."""

from collections.abc import Iterator, Mapping

import numpy as np
from msgspec import Struct

from smad.arrays import Array
from smad.experiments.endurance.profile import Profile

LEAST_A = 0.3
"""Below this current a voltage over a current is noise."""


class Cycle(Struct, frozen=True, kw_only=True):
    """One cycle; NaN where it was not measured. `number` counts from 1 over the whole run.

    `t_s` is the board time of its beginning in its block. `transformation_degC` is the temperature
    of spring X at the middle of the stroke while X heats; `resistance_ohm` is the mean of V/I of X
    while more than 0.3 A flow.
    """

    number: int
    t_s: float
    duration_s: float
    stroke_mm: float
    force_max_N: float
    resistance_ohm: float
    transformation_degC: float
    peak_degC: float
    energy_J: float


NAMES = Cycle.__struct_fields__


def bounds(reference: Array, profile: Profile) -> list[tuple[int, int]]:
    """Return first and last sample (excluded) of each whole cycle: from rise to rise.

    A cycle begins where the reference rises through the middle of the profile.
    """
    middle = 0.5 * (profile.low + profile.high)
    above = np.concatenate(([False], reference > middle))
    rises = np.flatnonzero(~above[:-1] & above[1:])
    return list(zip(rises[:-1].tolist(), rises[1:].tolist(), strict=True))


def cycles_of(columns: Mapping[str, Array], profile: Profile, first: int) -> Iterator[Cycle]:
    """Yield the statistics of each whole cycle of a block whose first one has number `first`."""
    edges = bounds(np.asarray(columns[profile.reference], float), profile)
    for number, (begin, end) in enumerate(edges, first):
        yield _cycle(number, {name: np.asarray(c, float)[begin:end] for name, c in columns.items()})


def _cycle(number: int, part: Mapping[str, Array]) -> Cycle:
    t_s, current_A, volts = part["t_s"], part["i_meas_x_A"], part["v_x_V"]
    power_W = np.abs(current_A * volts) + np.abs(part["i_meas_y_A"] * part["v_y_V"])
    heated = current_A > LEAST_A
    displacement_mm = part["displacement_mm"]
    return Cycle(
        number=number,
        t_s=float(t_s[0]),
        duration_s=float(t_s[-1] - t_s[0]),
        stroke_mm=stroke(displacement_mm),
        force_max_N=most(part["force_N"]),
        resistance_ohm=float(np.mean(volts[heated] / current_A[heated]))
        if heated.any()
        else np.nan,
        transformation_degC=_crossing(displacement_mm, part["rtd_x_degC"]),
        peak_degC=most(part["rtd_x_degC"]),
        energy_J=float(np.trapezoid(np.nan_to_num(power_W), t_s)) if len(t_s) > 1 else np.nan,
    )


def stroke(values: Array) -> float:
    """Return the 99th percentile less the 1st, so that a spike of one sample is none; else NaN."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return np.nan
    low, high = np.percentile(finite, (1.0, 99.0))
    return float(high - low)


def most(values: Array) -> float:
    """Return the 99th percentile; NaN without a value."""
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, 99.0)) if len(finite) else np.nan


def _crossing(displacement_mm: Array, temperature_degC: Array) -> float:
    """The temperature around the middle of the rise, over a tenth of the stroke."""
    usable = np.isfinite(displacement_mm) & np.isfinite(temperature_degC)
    if not usable.any():
        return np.nan
    moved, warm = displacement_mm[usable], temperature_degC[usable]
    low, high = np.percentile(moved, (1.0, 99.0))
    rising = np.gradient(moved) > 0.0 if len(moved) > 1 else np.zeros(len(moved), bool)
    near = rising & (np.abs(moved - 0.5 * (low + high)) < 0.05 * (high - low))
    return float(np.mean(warm[near])) if near.any() else np.nan
