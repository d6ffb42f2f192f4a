"""What a check-up's JSON says, as far as an endurance run has to know it."""

from __future__ import annotations

import msgspec
from msgspec import Struct

from smad.experiments.endurance.run import Judgement


class _Rival(Struct, frozen=True):
    kind: str
    probability: float


class _Cause(Struct, frozen=True):
    rivals: list[_Rival] = []


class _Verdict(Struct, frozen=True):
    outcome: str
    headline: str
    causes: list[_Cause] = []


def judgement_of(data: bytes) -> Judgement:
    """Return headline and probability that an effect or a law has come.

    Of causes it is that of the surest; of a cause without a table of rivals, 1. Raises
    msgspec.MsgspecError.
    """
    verdict = msgspec.json.decode(data, type=_Verdict)
    sure = [
        sum(r.probability for r in cause.rivals if r.kind in ("effect", "law"))
        if cause.rivals
        else 1.0
        for cause in verdict.causes
    ]
    return Judgement(verdict.headline, min(1.0, max(sure, default=0.0)))
