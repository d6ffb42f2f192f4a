"""A verdict with the scores of its first step, from which constants are fitted without a replay.

The product tells a table of rivals; what their probabilities are made of is kept here alone.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec

from smad.diagnosis.answer import Answer
from smad.diagnosis.verdict import Verdict


class RivalScore(msgspec.Struct, frozen=True, kw_only=True):
    """What the probability of a rival is made of.

    `scores` are those of `rivals/score.py`, one for each judged run, `log_prior` that of where its
    parameters are, `gap` what it leaves of the judged runs in floors; `near`: nothing that could be
    reported in any signal.
    """

    kind: str
    name: str
    places: list[str]
    gap: float
    scores: list[float]
    log_prior: float
    near: bool = False


class ScoredVerdict(Verdict, frozen=True, kw_only=True):
    """A verdict with all rivals of its first step.

    `independent_rows` is how many rows of a judged run and channel count as independent of each
    other, on average.
    """

    first_step: list[RivalScore] = msgspec.field(default_factory=list)
    independent_rows: float = 0.0


def scored(answer: Answer) -> ScoredVerdict:
    """The verdict of an answer with its scores; none where runs were refused."""
    verdict, search = msgspec.structs.asdict(answer.verdict), answer.search
    if search is None:
        return ScoredVerdict(**verdict)
    # The form error of parts that entered later was not in the floors of the first step.
    question = replace(search.question, form_sd=())
    rivals = search.steps[0].rivals if search.steps else ()
    first_step = [
        RivalScore(
            kind=r.kind,
            name=r.name.removeprefix("law:"),
            places=list(r.places),
            gap=question.gap(r),
            scores=[float(x) for x in r.scores],
            log_prior=r.log_prior,
            near=question.at_floor(r),
        )
        for r, refuted in zip(rivals, question.refuted(rivals), strict=True)
        if not refuted
    ]
    rows = question.independent_rows
    return ScoredVerdict(**verdict, first_step=first_step, independent_rows=rows)
