"""Where a plant's model and runs disagree, or what is new since good runs: places with laws."""

import time
from collections.abc import Mapping, Sequence

from firmware_protocol.nearest import instead
from smad.diagnosis.answer import Answer, answer_of
from smad.diagnosis.data.admission import RunSet, admit_groups, row_of_admitted_s
from smad.diagnosis.data.guards import FIT, GOOD, HOLD_OUT, goes_further, too_few
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.moved_inputs import moved_inputs
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.paired.difference import compared, notes_of
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import Effect, PlantModel
from smad.diagnosis.questions import AdmittedRuns, changed_pairs, changed_runs, differs
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import (
    CAUSES,
    CHANGED,
    COLUMN_DOUBTED,
    DIFFERS,
    PAIRED,
    PARAMETERS,
    QUIET,
    REFUSED,
    Finding,
    RunRecord,
    Verdict,
)
from smad.progress import Say, silent

_NO_CAUSE = {QUIET: "nothing new", PARAMETERS: "no cause"}
"""Outcomes of runs that repeat good ones after which the other runs are judged, in words."""


@repeatable
def diagnose(
    runs: Sequence[GapRun],
    *,
    plant: PlantModel,
    good: Sequence[GapRun] = (),
    hold_out: Sequence[GapRun] = (),
    candidates: Sequence[str] | None = None,
    progress: Say = silent,
) -> Answer:
    """Say what the model lacks compared with the runs: fit rivals by replay and compare their gaps.

    With `good` runs it says what has changed since them. Runs that repeat their inputs are judged
    first, each by models fitted to the others; where these show no cause, or there are none, the
    other runs are judged. `hold_out` are runs to judge on; without them, too, each run is judged by
    models fitted to the others.
    `candidates` are the effects that may be named. Equal runs give equal answers. Raises
    PlantMismatch for a candidate that the plant does not have and for a run that is no GapRun, and
    GapError if the model cannot replay the runs; unusable runs are refused in the verdict.
    """
    began = time.perf_counter()
    effects = library(plant, candidates)
    _require_runs((*runs, *hold_out, *good))
    progress("admission")
    period_s = row_of_admitted_s([*runs, *hold_out, *good], plant)
    groups = admit_groups({FIT: runs, HOLD_OUT: hold_out, GOOD: good}, plant, period_s, progress)
    roles = {role: a.admitted for role, a in groups.items()}
    findings = sorted((f for a in groups.values() for f in a.findings), key=lambda f: f.run)
    findings += too_few(roles)
    question = CHANGED if good else DIFFERS
    if lacking := _lacking(groups):
        headline = f"no run {lacking} can be used"
        answer = Answer(verdict=Verdict(question=question, outcome=REFUSED, headline=headline))
    else:
        admitted = AdmittedRuns(
            plant=with_places(plant),
            fit=roles[FIT],
            held_out=roles[HOLD_OUT],
            good=roles[GOOD],
            effects=tuple(effects),
            period_s=period_s,
            say=progress,
        )
        if good:
            answer, in_question = _of_changed(admitted)
            findings += goes_further(in_question, admitted.good, plant) if in_question else []
        else:
            search = differs(admitted)
            answer = answer_of(search, question=DIFFERS)
            if text := moved_inputs(admitted, search):
                fitted = [run.name for run in roles[FIT]]
                findings += [Finding(name, COLUMN_DOUBTED, text, False) for name in fitted]
    headline = answer.verdict.headline
    doubted = {f.run for f in findings if f.kind == COLUMN_DOUBTED}
    if answer.verdict.causes and doubted.issuperset(run.name for run in roles[FIT]):
        headline = f"a column may be misread; as it was read, {headline}"
    return answer.stamped(
        plant,
        time.perf_counter() - began,
        headline=headline,
        findings=findings,
        runs=_records(groups),
    )


def _of_changed(admitted: AdmittedRuns) -> tuple[Answer, Sequence[GapRun]]:
    """What is new since the good runs, and the runs that were judged without a good partner.

    Runs that repeat good ones show the smallest changes. If they show no cause, the others are
    judged: an effect may act in these alone.
    """
    runs = (*admitted.fit, *admitted.held_out)
    repeating = changed_pairs(admitted)
    if repeating is None:
        return answer_of(changed_runs(admitted), question=CHANGED), runs
    search, pairs = repeating
    answer = answer_of(search, question=CHANGED, gaps_of=PAIRED)
    notes = [*answer.verdict.notes, compared(pairs), *notes_of(pairs)]
    paired = {pair.name for pair in pairs.pairs}
    names = [run.name for run in runs if run.name not in paired]
    if not names:
        return answer.with_verdict(notes=notes), ()
    listed = ", ".join(names)
    if answer.verdict.outcome not in _NO_CAUSE:
        note = f"not judged, since no good run has their inputs: {listed}; diagnose them separately"
        return answer.with_verdict(notes=[*notes, note]), ()
    apart = admitted.of(names)
    apart_runs = (*apart.fit, *apart.held_out)
    of_others = answer_of(changed_runs(apart), question=CHANGED)
    same, more = answer.verdict.outcome, of_others.verdict.outcome
    if more == QUIET or (same == PARAMETERS and more != CAUSES):
        note = f"runs with new inputs show {_NO_CAUSE[same]} either: {listed}"
        return answer.with_verdict(notes=[*notes, note]), apart_runs
    note = f"runs that repeat good ones show {_NO_CAUSE[same]}; runs with new inputs do: {listed}"
    notes = [note, *of_others.verdict.notes, *notes]
    return of_others.with_verdict(notes=notes), apart_runs


def _require_runs(runs: Sequence[object]) -> None:
    for run in runs:
        if not isinstance(run, GapRun):
            raise PlantMismatch(
                "a run is no GapRun",
                value=type(run).__name__,
                action="read a file with read_gap_run, or make one of its columns",
            )


def library(plant: PlantModel, candidates: Sequence[str] | None) -> list[Effect]:
    """The effects that may be named. Raises PlantMismatch for one that the plant does not have."""
    names = {e.name for e in plant.effects}
    foreign = sorted(set(candidates or ()) - names)
    if foreign:
        raise PlantMismatch(
            "a candidate is not an effect of this plant",
            value=foreign[0],
            action=instead(foreign[0], sorted(names), "name effects of the plant's library"),
        )
    return [e for e in plant.effects if candidates is None or e.name in candidates]


def _lacking(groups: Mapping[str, RunSet]) -> str:
    """The purpose of the first group of runs of which none can be used; empty without such a group.

    Without it another question would be answered than was asked. There must be runs to fit.
    """
    for role, words in ((FIT, "to fit"), (HOLD_OUT, "held out"), (GOOD, "known to be good")):
        if (groups[role].given or role == FIT) and not groups[role].admitted:
            return words
    return ""


def _records(groups: Mapping[str, RunSet]) -> list[RunRecord]:
    """A record of every run that was given, with its role or `refused`."""
    return [
        RunRecord.of(r, "refused" if r.name in group.refused else role)
        for role, group in groups.items()
        for r in group.given
    ]
