"""From a search to a verdict: the table of rivals, causes in words, gaps, models."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import msgspec
import numpy as np

from smad.diagnosis.constants import Constants
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.places.place import BOTH, PlacesPlant
from smad.diagnosis.plant import ModelPoint, SavesModel, Uncertainty
from smad.diagnosis.rivals.describe import Describer
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import Fit, covariance
from smad.diagnosis.rivals.parts import EffectPart, LawPart
from smad.diagnosis.rivals.rival import Question, Rival
from smad.diagnosis.rivals.score import EFFECT, LAW, NOTHING, credible_set
from smad.diagnosis.rivals.search import Searched, Step
from smad.diagnosis.rivals.unseen import unseen_strengths
from smad.diagnosis.verdict import (
    CAUSES,
    PARAMETERS,
    QUIET,
    UNEXPLAINED,
    Cause,
    EffectValue,
    ParameterMoved,
    RivalGap,
    RivalScore,
    RunGap,
    SignalGap,
    Verdict,
    headline_of,
)

_ROWS = 8
"""Rivals of a table at most."""
_LEAST_NAMED = 0.005


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """A verdict with what it rests on; `search` is None where runs were refused.

    `stages` are the rivals whose gaps are told: as configured, with other parameters, and with the
    first 1, 2 … causes; `model` is the last one's.
    """

    verdict: Verdict
    search: Searched | None = None
    stages: tuple[Rival, ...] = ()
    model: ModelPoint | None = None
    uncertainty: Uncertainty | None = None
    alternatives: tuple[Rival, ...] = ()

    def __repr__(self) -> str:
        """The headline; the rest is in the verdict."""
        return f"<Answer: {self.verdict.headline}>"

    def with_verdict(self, **fields: Any) -> Answer:
        """The same with some fields of the verdict replaced."""
        return replace(self, verdict=msgspec.structs.replace(self.verdict, **fields))


def answer_of(
    plant: PlacesPlant, search: Searched, *, question: str, constants: Constants, judged_on: str
) -> Answer:
    """The answer that a search gives."""
    final = search.final
    stages = _stages(search)
    causes = [
        _cause(plant, search, step, rival, constants)
        for step, rival in zip(_entered(search), stages[2:], strict=True)
    ]
    *gaps, whole = signal_gaps(plant, search.question, stages)
    outcome = _outcome(search, causes)
    point = search.question.model.start if final.fit is None else final.fit.point
    uncertainty = None if final.fit is None else uncertainty_of(plant, search.question, final.fit)
    verdict = Verdict(
        question=question,
        outcome=outcome,
        headline=headline_of(question, outcome, causes, whole),
        causes=causes,
        rivals=_table(plant, search.question, search.steps[-1].rivals) if search.steps else [],
        first_step=_scores(search.question, search.steps[0].rivals) if search.steps else [],
        independent_rows=search.question.independent_rows,
        parameters=_moved(plant, search.question.model.start, final.fit, uncertainty),
        budget=gaps,
        whole=whole,
        by_run=_by_run(search.question, search.configured, search.parameters, final),
        judged_on=judged_on,
        unseen=unseen_strengths(search),
        models=_models(
            plant, search.question, stages, headline_of(question, outcome, causes, whole)
        ),
    )
    return Answer(
        verdict=verdict,
        search=search,
        stages=stages,
        model=point,
        uncertainty=uncertainty,
        alternatives=_alternatives(search, constants.credible_level),
    )


def _alternatives(search: Searched, level: float) -> tuple[Rival, ...]:
    """The rivals between which the runs do not decide; one where they do, none without a cause."""
    entered = _entered(search)
    if not entered:
        return ()
    rivals = {r.name: r for r in entered[0].rivals if r.kind in (EFFECT, LAW)}
    total = max(sum(r.probability for r in rivals.values()), 1e-300)
    names = credible_set({n: r.probability / total for n, r in rivals.items()}, level)
    return tuple(rivals[n] for n in names)


def _outcome(search: Searched, causes: Sequence[Cause]) -> str:
    """Causes, parameters, or quiet; unexplained where much is left and no rival takes it.

    Day-to-day variation is nothing new: the rival *nothing* is fitted with it, and counts here.
    """
    if causes:
        return CAUSES
    last = search.steps[-1].rivals if search.steps else ()
    rivals = [search.final, *(r for r in last if r.kind == NOTHING)]
    if min(map(search.question.gap, rivals)) > search.question.quiet_gap:
        return UNEXPLAINED
    return PARAMETERS if search.moved else QUIET


def _entered(search: Searched) -> list[Step]:
    """The steps by which parts entered, in their order; none where all were withdrawn."""
    if search.final.fit is None or not search.final.fit.model.parts:
        return []
    return [s for s in search.steps if s.entered is not None and s.entered.kind in (EFFECT, LAW)]


def _stages(search: Searched) -> tuple[Rival, ...]:
    """As configured, with other parameters, then with each cause."""
    entered = _entered(search)
    prefixes = [s.entered for s in entered[:-1] if s.entered is not None]
    last = [search.final] if entered else []
    return (search.configured, search.parameters, *prefixes, *last)


def _gap(signal: str, words: str, unit: str, floor: float, left: Sequence[float]) -> SignalGap:
    raw, parameters, *causes = left
    return SignalGap(
        signal=signal,
        words=words,
        unit=unit,
        floor=floor,
        raw=raw,
        parameters=parameters,
        causes=causes,
    )


def signal_gaps(plant: PlacesPlant, question: Question, stages: Sequence[Rival]) -> list[SignalGap]:
    """What stages leave of the judged runs by signal, in its unit, and over all, in floors."""
    counts, floors = question.judged.counts.sum(axis=0), question.judged.floors
    left = [np.sqrt(r.squares.sum(axis=0) / np.maximum(counts, 1.0)) * floors for r in stages]
    signals = [
        _gap(c.name, c.words, c.unit, float(floors[i]), [float(x[i]) for x in left])
        for i, c in enumerate(plant.channels)
        if counts[i] > 0
    ]
    return [*signals, _gap("all signals", "", "floors", 1.0, [question.gap(r) for r in stages])]


def gaps_on(answer: Answer, evidence: Evidence) -> list[SignalGap]:
    """The gaps of further runs by signal and over all, for each stage of an answer.

    Nothing is fitted to them. Empty where the model cannot replay them.
    """
    search = answer.search
    if search is None:
        return []
    question = replace(search.question, held_out=evidence)
    plant: PlacesPlant = question.model.plant  # type: ignore[assignment]
    points = [question.model.start if s.fit is None else s.fit.point for s in answer.stages]
    rivals = [r for p in points if (r := question.of_point(p)) is not None]
    return signal_gaps(plant, question, rivals) if len(rivals) == len(points) else []


def _by_run(question: Question, *stages: Rival) -> list[RunGap]:
    counts = np.maximum(question.judged.counts.sum(axis=1), 1.0)
    raw, parameters, final = (np.sqrt(r.squares.sum(axis=1) / counts) for r in stages)
    return [
        RunGap(
            run=p.whole.name,
            raw=float(raw[k]),
            parameters=float(parameters[k]),
            final=float(final[k]),
        )
        for k, p in enumerate(question.judged.played)
    ]


def _table(plant: PlacesPlant, question: Question, rivals: Sequence[Rival]) -> list[RivalGap]:
    """The likeliest rivals, and those without a part whatever their probability.

    Those that are equally likely, as far as it is shown, by what they leave.
    """
    described = Describer(plant)
    shown = [r for k, r in enumerate(rivals) if k < _ROWS or r.kind not in (EFFECT, LAW)]
    counts = question.judged.counts.sum(axis=0)
    titles = {e.name: e.title for e in question.effects}
    return [
        RivalGap(
            kind=r.kind,
            name=r.name.removeprefix("law:"),
            words=described.rival(r),
            title=titles.get(r.name, ""),
            values=_values(described, question, r),
            places=list(r.places),
            gap=question.gap(r),
            probability=r.probability,
            by_signal={
                c.name: float(np.sqrt(r.squares[:, i].sum() / counts[i]))
                for i, c in enumerate(plant.channels)
                if counts[i] > 0
            },
        )
        for r in sorted(shown, key=lambda r: (-round(r.probability, 2), question.gap(r)))
    ]


def _values(described: Describer, question: Question, rival: Rival) -> list[EffectValue]:
    """The values of the effect that a rival adds."""
    if rival.kind != EFFECT or rival.fit is None:
        return []
    part, mine = rival.fit.model.parts[-1], rival.fit.model.slices[-1]
    if not isinstance(part, EffectPart):
        return []
    return described.values(part, rival.fit.x[mine], _deviations(question, rival.fit)[mine])


def _deviations(question: Question, fitted: Fit) -> Array:
    """Standard deviations of a fit's coordinates, (k,)."""
    return np.sqrt(np.maximum(np.diag(covariance(question.evidence, fitted, question.tau)), 0.0))


def _scores(question: Question, rivals: Sequence[Rival]) -> list[RivalScore]:
    """The scores of the rivals that were compared."""
    return [
        RivalScore(
            kind=r.kind,
            name=r.name.removeprefix("law:"),
            places=list(r.places),
            gap=question.gap(r),
            scores=[float(x) for x in r.scores],
            log_prior=r.log_prior,
            near=question.near(r),
        )
        for r, refuted in zip(rivals, question.refuted(rivals), strict=True)
        if not refuted
    ]


def _cause(
    plant: PlacesPlant, search: Searched, step: Step, stage: Rival, constants: Constants
) -> Cause:
    """A cause that entered, with the rivals of its step."""
    question = search.question
    assert stage.fit is not None
    index = _entered(search).index(step)
    parts = stage.fit.model.parts
    part, coordinates = parts[index], stage.fit.x[stage.fit.model.slices[index]]
    of_parts = [r for r in step.rivals if r.kind in (EFFECT, LAW)]
    total = max(sum(r.probability for r in of_parts), 1e-300)
    laws = [r.places[0] for r in of_parts if r.kind == LAW]
    places = place_probabilities([(r, r.probability) for r in of_parts])
    named = {r.name: r.probability for r in of_parts if r.kind == EFFECT}
    in_library = max(sum(named.values()), 1e-300)
    names = {n: p / in_library for n, p in sorted(named.items(), key=lambda item: -item[1])}
    described = Describer(plant)
    deviations = _deviations(question, stage.fit)[stage.fit.model.slices[index]]
    place = _place_of(step.entered, laws) if step.entered is not None else part.places[0]
    if step.entered is None or part.name != step.entered.name:
        place = part.places[0]
    side = part.candidate.side if isinstance(part, LawPart) else BOTH
    about = next((p for p in plant.places if p.name == place), None)
    trajectories = described.trajectories(question, stage.fit) if isinstance(part, LawPart) else []
    return Cause(
        kind=EFFECT if isinstance(part, EffectPart) else LAW,
        name=part.name if isinstance(part, EffectPart) else "",
        place=place,
        side=side,
        words=described.place(place, side),
        probability=places.get(place, 0.0),
        places=places,
        place_words={n: described.place(n, BOTH) for n in places},
        names={n: p for n, p in names.items() if p >= _LEAST_NAMED},
        outside=1.0 - in_library / total,
        credible_names=credible_set(names, constants.credible_level),
        credible_places=credible_set(places, constants.credible_level),
        values=described.values(part, coordinates, deviations)
        if isinstance(part, EffectPart)
        else [],
        terms=described.terms(part, coordinates, deviations, trajectories)
        if isinstance(part, LawPart)
        else [],
        largest=described.largest(part, coordinates, question, trajectories)
        if isinstance(part, LawPart)
        else 0.0,
        unit=about.unit if about is not None else "",
        gap=question.gap(stage),
        rivals=_table(plant, question, step.rivals),
    )


class Placed(Protocol):
    """A rival by what it is and where it acts."""

    @property
    def kind(self) -> str: ...
    @property
    def places(self) -> Sequence[str]: ...


def place_probabilities(parts: Sequence[tuple[Placed, float]]) -> dict[str, float]:
    """Probability of each place, the likeliest first, from those of effects and laws.

    They sum to 1: it is that of the place if anything is missing. An effect counts for the place
    whose law is likeliest among its own.
    """
    ordered = sorted(parts, key=lambda part: -part[1])
    laws = [r.places[0] for r, _ in ordered if r.kind == LAW]
    total = max(sum(p for _, p in parts), 1e-300)
    places: dict[str, float] = {}
    for rival, p in parts:
        place = _place_of(rival, laws)
        places[place] = places.get(place, 0.0) + p / total
    return dict(sorted(places.items(), key=lambda item: -item[1]))


def _place_of(rival: Placed, laws: Sequence[str]) -> str:
    """The place of a rival: of several, that whose law is likeliest, else the first listed."""
    listed = rival.places or ("",)
    return next((p for p in laws if p in listed), listed[0])


def uncertainty_of(plant: PlacesPlant, question: Question, fitted: Fit) -> Uncertainty:
    """Covariance of parameters and coefficients in the plant's units."""
    names: list[str] = [q.name for q in plant.parameters]
    scale: list[float] = [q.prior_sd for q in plant.parameters]
    for part in fitted.model.parts:
        if isinstance(part, EffectPart):
            names += [f"{part.name}.{q.name}" for q in part.effect.parameters]
            scale += [q.scale for q in part.effect.parameters]
        elif isinstance(part, LawPart):
            of_terms, scales = part.responses.coefficients(part.columns)
            names += of_terms
            scale += scales.tolist()
    unit = np.array(scale)
    return Uncertainty(
        tuple(names), unit[:, None] * covariance(question.evidence, fitted, question.tau) * unit
    )


def _moved(
    plant: PlacesPlant, start: ModelPoint, fitted: Fit | None, uncertainty: Uncertainty | None
) -> list[ParameterMoved]:
    """The parameters, those first that moved most beside their standard deviation."""
    if fitted is None or uncertainty is None:
        return []
    sd = np.sqrt(np.maximum(np.diag(uncertainty.covariance), 0.0))
    theta = fitted.point.theta
    moved = [
        ParameterMoved(
            name=q.name,
            words=q.words,
            unit=q.unit,
            before=start.theta.get(q.name, q.nominal),
            after=theta[q.name],
            sd=float(sd[k]),
            at_bound=bool(theta[q.name] <= q.low or theta[q.name] >= q.high),
        )
        for k, q in enumerate(plant.parameters)
    ]
    return sorted(moved, key=lambda q: -abs(q.after - q.before) / max(q.sd, 1e-30))


def _models(
    plant: PlacesPlant, question: Question, stages: Sequence[Rival], note: str
) -> list[str]:
    """Models with other parameters and with each cause, as text; none where none are written."""
    if not isinstance(plant, SavesModel):
        return []
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for k, rival in enumerate(stages[1:]):
            if rival.fit is None:
                continue
            path = Path(folder) / f"model-{k}.toml"
            plant.save_model(
                rival.fit.point, path, note, uncertainty_of(plant, question, rival.fit)
            )
            out.append(path.read_text("utf-8"))
    return out
