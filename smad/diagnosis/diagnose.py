"""Where a plant's model and runs disagree, or what is new since good runs: places with laws."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from firmware_protocol.nearest import instead
from smad.diagnosis.answer import Answer, answer_of_changed, answer_of_differs
from smad.diagnosis.changed import changed
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.data.admission import RunSet, admit, in_common
from smad.diagnosis.data.guards import goes_further, too_few, without_repeats
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.scales import row_length_s
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.gap import Measured
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import Effect, PlantModel
from smad.diagnosis.runs import GapRun, distinctly_named
from smad.diagnosis.simulator import Asked, held_against
from smad.diagnosis.verdict import (
    CHANGED,
    DIFFERS,
    REFUSED,
    Finding,
    RunRecord,
    Verdict,
)
from smad.version import VERSION


@repeatable
def diagnose(
    runs: Sequence[GapRun],
    *,
    plant: PlantModel,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
    candidates: Sequence[str] | None = None,
    constants: Constants | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Answer:
    """Where the model and the runs disagree, which law is missing there, and what it is called.

    With runs that are known to be `good` the question is what has changed since. `hold_out` are
    runs to judge on; without them each run is judged by a model that had no part of it.
    `candidates` are the effects that may be named. Nothing is random. Raises PlantMismatch for a
    candidate that the plant does not have, and GapError where the model cannot replay the runs;
    runs that cannot be used are refused in the verdict.
    """
    began = time.perf_counter()
    effects = library(plant, candidates)
    progress("admission")
    given = {"fit": runs, "hold-out": hold_out, "good": good}
    period_s = row_length_s([*runs, *hold_out, *good], plant)
    order, admitted = _admitted(given, plant, period_s)
    roles = {role: a.admitted for role, a in zip(given, admitted, strict=True)}
    findings = [f for a in admitted for f in a.findings]
    findings += too_few(roles, asked_good=bool(good))
    lacking = _lacking(order, admitted)
    if lacking:
        question = CHANGED if good else DIFFERS
        headline = f"no run {lacking} can be used"
        answer = Answer(verdict=Verdict(question=question, outcome=REFUSED, headline=headline))
    else:
        findings += goes_further(roles, plant)
        every = (*roles["fit"], *roles["hold-out"])
        floors = estimate_floors([*every, *roles["good"]], plant, period_s)
        asked = Asked(
            plant=with_places(plant), runs=every, fit=len(roles["fit"]), good=roles["good"],
            effects=tuple(effects), period_s=period_s, constants=constants or shipped(),
            say=progress,
            floors=np.array([
                floors[c.name].total if c.name in floors else max(c.noise, c.quantum)
                for c in plant.channels
            ]),
        )  # fmt: skip
        answer = _answered(asked)
    verdict = msgspec.structs.replace(
        answer.verdict,
        findings=findings,
        runs=_records(order, admitted),
        plant=plant.name,
        plant_version=plant.version,
        smad_version=VERSION,
        seconds=round(time.perf_counter() - began, 2),
    )
    return replace(answer, verdict=verdict)


def _answered(asked: Asked) -> Answer:
    if asked.good:
        return answer_of_changed(asked, changed(asked))
    measured = Measured.of(asked.plant, asked.runs, asked.period_s)
    held = held_against(asked, measured, counts=asked.counts)
    return answer_of_differs(asked, held)


def library(plant: PlantModel, candidates: Sequence[str] | None) -> list[Effect]:
    """The effects that may be named. Raises PlantMismatch for one that the plant does not have."""
    known = {e.name for e in plant.effects}
    foreign = sorted(set(candidates or ()) - known)
    if foreign:
        raise PlantMismatch(
            "a candidate is no effect of this plant",
            value=foreign[0],
            action=instead(foreign[0], sorted(known), "name effects of the plant's library"),
        )
    return [e for e in plant.effects if candidates is None or e.name in candidates]


def _lacking(order: Sequence[Sequence[GapRun]], admitted: Sequence[RunSet]) -> str:
    """What the first group of runs is for that were given and of which none can be used.

    Without it another question would be answered than was asked. Runs to fit must be there.
    """
    for what, runs, admission in zip(("to fit", "held out", "known to be good"), order, admitted,
                                     strict=True):  # fmt: skip
        if (runs or what == "to fit") and not admission.admitted:
            return what
    return ""


def _admitted(
    given: Mapping[str, Sequence[GapRun]], plant: PlantModel, period_s: float
) -> tuple[list[list[GapRun]], list[RunSet]]:
    """Each group of runs, in an order that does not depend on the one given, and its admission.

    Runs are told apart by name, no recording is in two places, and groups have the same channels.
    """
    order = distinctly_named(
        [sorted(group, key=lambda r: (r.digest, r.name)) for group in given.values()]
    )
    once, repeats = without_repeats(dict(zip(given, order, strict=True)))
    admitted = [admit(group, plant, period_s) for group in once.values()]
    with_repeats = [
        RunSet(a.admitted, (*a.findings, *_of(group, repeats)))
        for group, a in zip(order, admitted, strict=True)
    ]
    return order, in_common(with_repeats)


def _of(runs: Sequence[GapRun], findings: Sequence[Finding]) -> list[Finding]:
    names = {r.name for r in runs}
    return [f for f in findings if f.run in names]


def _records(order: Sequence[Sequence[GapRun]], admitted: Sequence[RunSet]) -> list[RunRecord]:
    """Every run that was given, by its role; refused ones as such."""
    out = []
    for role, group, admission in zip(("fit", "hold-out", "good"), order, admitted, strict=True):
        out += [
            RunRecord(
                r.name, "refused" if r.name in admission.refused else role,
                round(r.duration_s, 3), r.digest,
            )
            for r in group
        ]  # fmt: skip
    return out
