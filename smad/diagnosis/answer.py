"""From a search to a verdict: the table of rivals, causes in words, gaps, models."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from smad.diagnosis.constants import shipped
from smad.diagnosis.places.bare import unwrapped
from smad.diagnosis.places.place import BOTH
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, SavesModel, Uncertainty
from smad.diagnosis.rivals.describe import (
    effect_values,
    law_terms,
    part_words,
    rival_words,
    where_words,
)
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Fit
from smad.diagnosis.rivals.parts import EffectPart, LawPart
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import EFFECT, LAW, NOTHING, credible_set
from smad.diagnosis.rivals.search import Search, Step
from smad.diagnosis.rivals.uncertainty import Precision
from smad.diagnosis.rivals.unseen import unseen_strengths
from smad.diagnosis.verdict import (
    CAUSES,
    MEASURED,
    PARAMETERS,
    QUIET,
    UNEXPLAINED,
    Cause,
    EffectValue,
    ParameterMoved,
    RivalGap,
    RunGap,
    SignalGap,
    Verdict,
    headline_of,
)
from smad.version import VERSION

_ROWS = 8
"""Rivals of a table at most."""
_LEAST_NAMED = 0.005


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """A verdict with what it rests on; `search` is None where runs were refused.

    `stages` are the rivals whose gaps are reported: as configured, with fitted parameters, and with
    the first 1, 2 … causes; `model` is that of the last. `alternatives` are the rivals of the first
    step between which the runs do not decide.
    """

    verdict: Verdict
    search: Search | None = None
    stages: tuple[Rival, ...] = ()
    model: ModelPoint | None = None
    alternatives: tuple[Rival, ...] = ()

    def __repr__(self) -> str:
        """The headline; the rest is in the verdict."""
        return f"<Answer: {self.verdict.headline}>"

    def with_verdict(self, **fields: Any) -> Answer:
        """The answer with some fields of the verdict replaced."""
        return replace(self, verdict=msgspec.structs.replace(self.verdict, **fields))

    def stamped(self, plant: PlantModel, seconds: float, **fields: Any) -> Answer:
        """The same with the versions of plant and program and the time taken, too."""
        versions = {"plant": plant.name, "plant_version": plant.version, "smad_version": VERSION}
        return self.with_verdict(**fields, **versions, seconds=round(seconds, 2))


def answer_of(search: Search, *, question: str, gaps_of: str = MEASURED) -> Answer:
    """The answer of a search to `question` (DIFFERS …); `gaps_of` is MEASURED or PAIRED."""
    asked, fitted = search.question, search.final.fit
    tied = asked.tied is not None and not search.moved
    precision = Precision.at_fit(asked.evidence, fitted or search.parameters.fitted, tied=tied)
    entered = search.entered_parts()
    steps = [search.steps[k] for k, _ in entered]
    with_causes = [*(rival for _, rival in entered[:-1]), search.final] if entered else []
    causes = [
        _cause(asked, precision, k, step, search.final, gap=asked.gap(rival))
        for k, (step, rival) in enumerate(zip(steps, with_causes, strict=True))
    ]
    stages = (search.configured, search.parameters, *with_causes)
    *gaps, whole = signal_gaps(asked, stages)
    outcome = _outcome(search, causes)
    headline = headline_of(question, outcome, causes, whole)
    uncertainty = None if fitted is None else uncertainty_of(precision, fitted)
    # A bench that is as it was has the model of its good runs.
    as_it_was = outcome == QUIET and asked.tied is not None
    with_model = [search.configured] if as_it_was else stages[1:]
    verdict = Verdict(
        question=question,
        outcome=outcome,
        headline=headline,
        causes=causes,
        rivals=_table(asked, precision, search.steps[-1].rivals) if search.steps else [],
        parameters=_moved(asked, fitted, uncertainty),
        gaps_of=gaps_of,
        budget=gaps,
        whole=whole,
        by_run=_by_run(asked, search.configured, search.parameters, search.final),
        judged_on=asked.judged_on,
        unseen=unseen_strengths(search),
        notes=_of_withdrawn(search),
        models=_models(asked, precision, with_model, headline),
    )
    return Answer(
        verdict=verdict,
        search=search,
        stages=stages,
        model=asked.point_of(search.final),
        alternatives=_alternatives(steps[0]) if steps else (),
    )


def _alternatives(step: Step) -> tuple[Rival, ...]:
    """The rivals of a step between which the runs do not decide; one where they do."""
    rivals = {r.name: r for r in step.rivals if r.has_part}
    total = _total(r.probability for r in rivals.values())
    given_a_part = {n: r.probability / total for n, r in rivals.items()}
    return tuple(rivals[n] for n in credible_set(given_a_part, shipped().credible_level))


def _total(probabilities: Iterable[float]) -> float:
    """The sum, and never 0, so that it can be divided by."""
    return max(sum(probabilities), 1e-300)


def _outcome(search: Search, causes: Sequence[Cause]) -> str:
    """Causes, parameters, or quiet; unexplained where a gap remains that no rival explains.

    The rival *nothing*, which is fitted with day-to-day variation, may close the gap, too.
    """
    if causes:
        return CAUSES
    last = search.steps[-1].rivals if search.steps else ()
    rivals = [search.final, *(r for r in last if r.kind == NOTHING)]
    if not any(map(search.question.is_quiet, rivals)):
        return UNEXPLAINED
    return PARAMETERS if search.moved else QUIET


def _of_withdrawn(search: Search) -> list[str]:
    """What was withdrawn, since it leaves a larger gap than parameters alone."""
    parts = ", ".join(part_words(search.question.model.plant, part) for part in search.withdrawn)
    return [f"not reported, since parameters alone leave less: {parts}"] if parts else []


def signal_gaps(question: Question, stages: Sequence[Rival]) -> list[SignalGap]:
    """RMS residual of each stage on the judged runs: by signal in its unit, over all in floors."""
    counts, floors = question.judged.counts.sum(axis=0), question.judged.floors
    rms = [question.channel_gaps(r) * floors for r in stages]
    signals = [
        (c.name, c.words, c.unit, float(floors[i]), [float(x[i]) for x in rms])
        for i, c in enumerate(question.model.plant.channels)
        if counts[i] > 0
    ]
    whole = ("all signals", "", "floors", 1.0, [question.gap(r) for r in stages])
    return [
        SignalGap(
            signal=signal,
            words=words,
            unit=unit,
            floor=floor,
            raw=raw,
            parameters=parameters,
            causes=causes,
        )
        for signal, words, unit, floor, (raw, parameters, *causes) in (*signals, whole)
    ]


def gaps_on(answer: Answer, evidence: Evidence) -> list[SignalGap]:
    """The gaps of further runs, to which only drifts are fitted, for each stage of an answer.

    Empty where the model cannot replay them.
    """
    search = answer.search
    if search is None:
        return []
    # The form error of the parts was measured on the runs judged before.
    question = replace(search.question, held_out=evidence, form_sd=())
    rivals = [question.of_point(question.point_of(stage)) for stage in answer.stages]
    replayed = [r for r in rivals if r is not None]
    return signal_gaps(question, replayed) if len(replayed) == len(rivals) else []


def _by_run(question: Question, *stages: Rival) -> list[RunGap]:
    counts = np.maximum(question.judged.counts.sum(axis=1), 1.0)
    rms = [np.sqrt(r.squares.sum(axis=1) / counts).tolist() for r in stages]
    return [
        RunGap(run=played.whole.name, raw=raw, parameters=parameters, final=final)
        for played, raw, parameters, final in zip(question.judged.played, *rms, strict=True)
    ]


def _table(
    question: Question, precision: Precision, rivals: Sequence[Rival], named: Sequence[str] = ()
) -> list[RivalGap]:
    """The likeliest rivals, all without a part, and those `named`.

    Rivals whose probability prints as 0 are ordered by their gap. Only values of those `named` get
    standard deviations, which take many exact replays.
    """
    plant = question.model.plant

    def order(r: Rival) -> tuple[float, float]:
        printed_as_zero = round(r.probability, 2) == 0.0
        return 0.0 if printed_as_zero else -r.probability, question.gap(r)

    listed = [r for k, r in enumerate(rivals) if k < _ROWS or not r.has_part or r.name in named]
    counts = question.judged.counts.sum(axis=0)
    titles = {e.name: e.title for e in question.effects}
    return [
        RivalGap(
            kind=r.kind,
            name=r.name.removeprefix("law:"),
            words=rival_words(plant, r),
            title=titles.get(r.name, "") if r.has_part else "",
            values=_values(r, precision if r.name in named else None),
            places=list(r.places),
            gap=question.gap(r),
            probability=r.probability,
            by_signal={
                c.name: float(np.sqrt(r.squares[:, i].sum() / counts[i]))
                for i, c in enumerate(plant.channels)
                if counts[i] > 0
            },
        )
        for r in sorted(listed, key=order)
    ]


def _values(rival: Rival, precision: Precision | None) -> list[EffectValue]:
    """The values of the effect that a rival adds; `precision` gives their standard deviations."""
    if rival.kind != EFFECT:
        return []
    fitted, part = rival.fitted, rival.parts[-1]
    assert isinstance(part, EffectPart)
    block = fitted.model.slices[-1]
    sd = None if precision is None else _standard_deviations(precision.covariance(fitted))[block]
    return effect_values(part, fitted.x[block], sd)


def _standard_deviations(matrix: Array) -> Array:
    """Square roots of the diagonal of a covariance matrix (k, k), (k,)."""
    return np.sqrt(np.maximum(np.diag(matrix), 0.0))


def _cause(
    question: Question, precision: Precision, index: int, step: Step, final: Rival, *, gap: float
) -> Cause:
    """The cause of step `index` as it is in the final model; `gap` is the gap with it."""
    plant, fitted, level = question.model.plant, final.fitted, shipped().credible_level
    part, block = fitted.model.parts[index], fitted.model.slices[index]
    x, sd = fitted.x[block], _standard_deviations(precision.covariance(fitted))[block]
    effect = part if isinstance(part, EffectPart) else None
    law = part if isinstance(part, LawPart) else None
    of_parts = [r for r in step.rivals if r.has_part]
    total = _total(r.probability for r in of_parts)
    laws = [r.places[0] for r in of_parts if r.kind == LAW]
    places = place_probabilities([(r.places, r.probability) for r in of_parts], laws)
    named = {r.name: r.probability for r in of_parts if r.kind == EFFECT}
    in_library = _total(named.values())
    names = {n: p / in_library for n, p in sorted(named.items(), key=lambda item: -item[1])}
    stayed = step.entered is not None and part.name == step.entered.name
    place = _place_of(part.places, laws if stayed else ())
    credible = credible_set(names, level)
    beside = next((r.parts[:-1] for r in of_parts), ())
    played = question.evidence.played if law else []
    trajectories = [plant.trajectory(fitted.point, p.run, fast=True) for p in played]
    return Cause(
        kind=EFFECT if effect else LAW,
        name=effect.name if effect else "",
        place=place,
        words=where_words(plant, place, law.candidate.side if law else BOTH),
        probability=places.get(place, 0.0),
        places=places,
        place_words={n: where_words(plant, n, BOTH) for n in places},
        names={n: p for n, p in names.items() if p >= _LEAST_NAMED or n in credible},
        outside=1.0 - in_library / total,
        credible_names=credible,
        credible_places=credible_set(places, level),
        values=effect_values(effect, x, sd) if effect else [],
        terms=law_terms(plant, law, x, sd, trajectories) if law else [],
        unit=next((p.unit for p in plant.places if p.name == place), ""),
        gap=gap,
        rivals=_table(question, precision, step.rivals, [part.name, *credible]),
        beside=[part_words(plant, p) for p in beside],
    )


def place_probabilities(
    parts: Sequence[tuple[Sequence[str], float]], laws: Sequence[str]
) -> dict[str, float]:
    """Probability of each place, the likeliest first, from `parts`: places and probability of each.

    They sum to 1, given that something is missing. An effect counts for the one of its places whose
    law is likeliest; `laws` are the places of laws, the likeliest first.
    """
    total = _total(p for _, p in parts)
    places: dict[str, float] = {}
    for of_part, p in parts:
        place = _place_of(of_part, laws)
        places[place] = places.get(place, 0.0) + p / total
    return dict(sorted(places.items(), key=lambda item: -item[1]))


def _place_of(listed: Sequence[str], laws: Sequence[str]) -> str:
    """The place among those `listed` whose law is likeliest, else the first."""
    return next((p for p in laws if p in listed), listed[0] if listed else "")


def uncertainty_of(precision: Precision, fitted: Fit) -> Uncertainty:
    """Covariance of parameters and coefficients in the plant's units."""
    parameters = fitted.model.plant.parameters
    names, scale = [q.name for q in parameters], [q.prior_sd for q in parameters]
    for part in fitted.model.parts:
        if isinstance(part, EffectPart):
            names += [f"{part.name}.{q.name}" for q in part.effect.parameters]
            scale += [q.scale for q in part.effect.parameters]
        else:
            of_terms, scales = part.responses.coefficients(part.columns)
            names += of_terms
            scale += scales.tolist()
    unit = np.array(scale)
    return Uncertainty(tuple(names), unit[:, None] * precision.covariance(fitted) * unit)


def _moved(
    question: Question, fitted: Fit | None, uncertainty: Uncertainty | None
) -> list[ParameterMoved]:
    """The parameters, ordered by how many standard deviations they have moved."""
    if fitted is None or uncertainty is None:
        return []
    start, theta = question.model.start.theta, fitted.point.theta
    moved = [
        ParameterMoved(
            name=q.name,
            words=q.words,
            unit=q.unit,
            before=start.get(q.name, q.nominal),
            after=theta[q.name],
            sd=float(sd),
            at_bound=bool(theta[q.name] <= q.low or theta[q.name] >= q.high),
        )
        # The covariance goes on with the coordinates of the parts.
        for q, sd in zip(
            question.model.plant.parameters,
            _standard_deviations(uncertainty.covariance),
            strict=False,
        )
    ]
    return sorted(moved, key=lambda q: -abs(q.after - q.before) / max(q.sd, 1e-30))


def _models(
    question: Question, precision: Precision, rivals: Sequence[Rival], note: str
) -> list[str]:
    """Model files as text, one for each rival; none without `SavesModel`."""
    plant = question.model.plant
    # The places of a simulator write its model themselves.
    writer = plant if isinstance(plant, SavesModel) else unwrapped(plant)
    if not isinstance(writer, SavesModel):
        return []
    out = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        for rival in rivals:
            uncertainty = uncertainty_of(precision, rival.fit) if rival.fit else None
            writer.save_model(question.point_of(rival), path, note, uncertainty)
            out.append(path.read_text("utf-8"))
    return out
