"""How likely each hypothesis is: a law at a place, or an effect of the library that acts there.

A hypothesis counts by what it takes of each channel, over the most that any hypothesis takes there:
one that explains the channel with the largest change and is wrong about the others must not win.
These shares are the regressors of a conditional logit (McFadden 1974), whose weights were fitted to
development benches. So what is told is a probability, and is checked as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.numerics.folds import Array

WRONG = 2.0
"""A wrong name costs as much as so many right ones are worth."""
NAMED = WRONG / (1.0 + WRONG)
"""From this probability on an effect is the name."""
_LEAST_SHARE = 0.01


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """What may be missing: a law at `place`, or the `effect` that acts there (empty for a law).

    `gains` (channels,) are what it takes of each channel's sum of squares.
    """

    place: str
    effect: str = ""
    gains: Array


def shares(gains: Array, noise: float, most: Array) -> Array:
    """Share that `gains` (hypotheses, channels) have of the `most` (channels,); (hypotheses,).

    The mean over channels, each by the log of how far what there is to take is above `noise`.
    """
    best = np.maximum(most, 1e-9)
    weight = np.log1p(best / max(noise, 1.0))
    return np.asarray(np.clip(gains / best, -1.0, 1.0) @ (weight / weight.sum()))


def odds(hypotheses: Sequence[Hypothesis], c: Constants, noise: float) -> Array:
    """The probability of each hypothesis where one of them is right; (hypotheses,)."""
    gains = np.array([h.gains for h in hypotheses])
    log = np.log(np.maximum(shares(gains, noise, gains.max(axis=0)), 0.0) + _LEAST_SHARE)
    named = np.array([bool(h.effect) for h in hypotheses])
    score = np.where(named, c.effect_odds + c.effect_weight * log, c.law_weight * log)
    e = np.exp(score - score.max())
    return np.asarray(e / e.sum())


def of_places(hypotheses: Sequence[Hypothesis], probability: Array) -> dict[str, float]:
    """The probability of each place, the likeliest first."""
    total: dict[str, float] = {}
    for h, p in zip(hypotheses, probability, strict=True):
        total[h.place] = total.get(h.place, 0.0) + float(p)
    return dict(sorted(total.items(), key=lambda item: (-item[1], item[0])))


def told(places: dict[str, float], level: float) -> list[str]:
    """The fewest places that together hold the `level`; `places` come likeliest first."""
    before = np.cumsum([0.0, *places.values()])[:-1]
    return [p for p, so_far in zip(places, before, strict=True) if so_far < level]
