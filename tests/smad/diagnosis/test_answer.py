"""From a search to the outcome of an answer."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.answer import _outcome, _table, answer_of
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import nominal_point
from smad.diagnosis.report.words import lines
from smad.diagnosis.rivals.evidence import recorded_evidence
from smad.diagnosis.rivals.parts import EffectPart
from smad.diagnosis.rivals.rival import Rival, question_of
from smad.diagnosis.rivals.score import EFFECT, NOTHING
from smad.diagnosis.rivals.search import Search
from smad.diagnosis.verdict import DIFFERS, QUIET, UNEXPLAINED
from smad.progress import silent
from tests.smad.diagnosis.cases import GAIN, OTHER, bank, strong
from tests.smad.diagnosis.heater_plant import HeaterPlant

PERIOD_S = 0.5


@pytest.mark.parametrize(("left_by_days", "outcome"), [(0.9, QUIET), (1.7, UNEXPLAINED)])
def test_day_to_day_variation_is_no_unexplained_change(left_by_days: float, outcome: str) -> None:
    as_configured = SimpleNamespace(kind=NOTHING, floors=1.8)
    other_days = SimpleNamespace(kind=NOTHING, floors=left_by_days)
    search = SimpleNamespace(
        question=SimpleNamespace(is_quiet=lambda rival: rival.floors <= 1.35),
        final=as_configured,
        moved=False,
        steps=[SimpleNamespace(rivals=[other_days])],
    )
    assert _outcome(cast(Any, search), []) == outcome


def test_what_is_withdrawn_is_noted() -> None:
    plant = with_places(HeaterPlant())
    start, runs = nominal_point(plant), bank(OTHER, GAIN)[:2]
    evidence = recorded_evidence(
        plant, runs, estimate_floors(runs, plant, PERIOD_S), PERIOD_S, start
    )
    question = question_of(plant, start, evidence, effects=plant.effects, say=silent)
    search = Search.start(question, exchange=False, laws=False)
    search.step()
    assert [part.name for part in search.parts] == ["driver_gain"]
    # On runs held out it leaves more.
    search.final = replace(search.final, squares=9.0 * search.parameters.squares)
    search.compare_with_parameters()
    verdict = answer_of(search, question=DIFFERS).verdict
    assert (verdict.outcome, verdict.causes) == (UNEXPLAINED, [])
    assert verdict.notes == ["not reported, since parameters alone leave less: driver_gain"]
    assert "driver_gain" in {r.name for r in verdict.rivals}


def test_a_law_that_an_effect_replaces_stays_a_law_and_tables_say_what_they_are_beside() -> None:
    plant = with_places(HeaterPlant())
    coupling = next(e for e in plant.effects if e.name == "coupling")
    runs = bank(OTHER, GAIN | {"coupling": strong(coupling)})
    start, floors = nominal_point(plant), estimate_floors(runs, plant, PERIOD_S)
    evidence = recorded_evidence(plant, runs, floors, PERIOD_S, start)
    question = question_of(plant, start, evidence, effects=plant.effects, say=silent)
    search = Search.start(question, exchange=False, laws=True)
    library = search.changes
    # The effect becomes known once a law stands in its place.
    for names in ((), ("coupling",)):
        search.changes = tuple(c for c in library if c.effect.name in names)
        search.step()
    search.changes = library
    search.final = search._exchange_parts(search.final)
    search.nest()
    verdict = answer_of(search, question=DIFFERS).verdict
    gain, other = verdict.causes
    assert (gain.name, other.name) == ("driver_gain", "coupling")
    replaced = next(r for r in gain.rivals if r.kind == "law")
    assert replaced.words == "a law at the reading of power_l_W"
    assert list(gain.names) == ["driver_gain"]
    assert gain.outside == pytest.approx(replaced.probability)
    assert (gain.beside, other.beside) == (["coupling"], [replaced.words])
    text = "\n".join(lines(verdict))
    assert "law:" not in text
    assert f"rival, beside {replaced.words}\n" in text


def test_rivals_are_in_one_order_where_a_table_shows_them_equally_likely() -> None:
    plant = HeaterPlant()

    def rival(number: int, floors: float, probability: float) -> Rival:
        part = EffectPart(plant.effects[number])
        model = SimpleNamespace(parts=(part,), slices=(slice(0, part.size),))
        return Rival(
            kind=EFFECT,
            name=part.name,
            fit=cast(Any, SimpleNamespace(model=model, x=np.ones(part.size))),
            squares=np.full((1, len(plant.channels)), floors**2),
            scores=np.zeros(1),
            probability=probability,
        )

    question = SimpleNamespace(
        model=SimpleNamespace(plant=plant),
        judged=SimpleNamespace(counts=np.ones((1, len(plant.channels)))),
        effects=plant.effects,
        gap=lambda r: float(np.sqrt(r.squares.mean())),
    )
    precision = SimpleNamespace(covariance=lambda fit: np.eye(len(fit.x)))
    ranked = [rival(0, 2.0, 0.501), rival(1, 1.0, 0.4985), rival(2, 9.0, 4e-4), rival(3, 8.0, 1e-4)]
    table = _table(cast(Any, question), cast(Any, precision), ranked)
    # Of those that are shown as 0 what they leave says more.
    assert [r.name for r in table] == [ranked[k].name for k in (0, 1, 3, 2)]
