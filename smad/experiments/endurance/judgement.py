"""What a check-up's JSON says, as far as an endurance run has to know it."""

from __future__ import annotations

import msgspec
from msgspec import Struct

from smad.experiments.endurance.run import Judgement


class _Place(Struct, frozen=True):
    probabilities: list[float] = []


class _Verdict(Struct, frozen=True):
    outcome: str
    headline: str
    places: list[_Place] = []


def judgement_of(data: bytes) -> Judgement:
    """Return headline and probability that some place has changed.

    Of a list of places that the data do not tell apart it is the sum of their probabilities; of a
    verdict that names a place without any, 1. Raises msgspec.MsgspecError.
    """
    verdict = msgspec.json.decode(data, type=_Verdict)
    if not verdict.places:
        return Judgement(verdict.headline, 0.0)
    sums = [sum(place.probabilities) for place in verdict.places if place.probabilities]
    return Judgement(verdict.headline, min(1.0, max(sums, default=1.0)))
