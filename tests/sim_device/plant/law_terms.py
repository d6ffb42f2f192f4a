"""Laws evaluated on a recorded trajectory, to compare with what the kernel makes of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from sim_device.plant.laws import Array, Support, Term, basis, own_states, terms_over
from sim_device.plant.places import BOTH, keys_of, place


def law_space(
    place_name: str,
    side: str,
    support: Support,
    *,
    bends: bool = True,
    lags: bool = True,
    products: bool = True,
) -> tuple[Term, ...]:
    """Candidate terms of a place by rule, see `terms_over`, for the states that `support` names.

    Raises InputError for an unknown place, side or state.
    """
    entry = place(place_name)
    keys_of(place_name, side)
    return terms_over(entry.states, support, bends=bends, lags=lags, products=products)


def support_of(
    place_name: str, side: str, trajectories: Iterable[Mapping[str, Array]]
) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each state of a place over these trajectories."""
    support: dict[str, tuple[float, float]] = {}
    for states in trajectories:
        for _, own in keys_of(place_name, side):
            for name, values in own_states(place_name, own, states).items():
                low, high = support.get(name, (math.inf, -math.inf))
                support[name] = min(low, float(values.min())), max(high, float(values.max()))
    return support


def design_matrix(
    place_name: str,
    side: str,
    states: Mapping[str, Array],
    terms: Sequence[Term],
    t_s: Array,
) -> Array:
    """Basis functions of the terms (coefficients left out) on a trajectory, shape (n, k).

    side: "x" or "y", or "both" where the place has but that one. Row k has the functions of the
    states at sample k. At a reading they act on that very sample; at any other place from then on,
    so that the forcing of row k + 1 is made of row k (`as_forcing`). Raises InputError.
    """
    (key,) = keys_of(place_name, side) if side != BOTH else keys_of(place_name, side)[:1]
    return basis(own_states(place_name, key[1], states), terms, t_s)


def as_forcing(place_name: str, values: Array) -> Array:
    """Values of a law at the samples, (n, ...), as the forcing that a replay takes."""
    if place(place_name).reading:
        return values
    out = np.empty_like(values)
    out[0] = values[0]
    out[1:] = values[:-1]
    return out
