"""Laws that were put into the tiny plant are found back in its simulator, and useless ones left."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from smad.diagnosis.gap import Measured, Residual, residual
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.numerics.forward import Forward
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import Responses, candidate_laws, responses
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.listed import Listed, listed
from smad.diagnosis.search.settle import Settler
from smad.diagnosis.search.where import Scored, Step
from tests.smad.diagnosis.cases import OTHER
from tests.smad.diagnosis.heater_plant import DT, NOMINAL, HeaterPlant, make_inputs

PLANT = with_places(HeaterPlant())
N = len(PLANT.parameters)
LEAST = np.array([0.06, 0.06, 0.03, 0.03, 0.2])
TRUE = {("reading_temp_l_degC", "fan"): 2.0, ("input_cmd_r_W", "cmd_r_W"): 0.8}
"""Place and term: coefficient at the place's scale."""


def runs_with(laws: tuple[object, ...]) -> list[GapRun]:
    out = []
    point = ModelPoint({**NOMINAL, **OTHER}, {}, laws)
    for seed in (1, 2):
        inputs = make_inputs("random", 40.0, seed)
        bare = GapRun(f"run {seed}", np.arange(len(inputs["fan"])) * DT, inputs, {})
        shown = PLANT.simulate(point, bare)
        rng = np.random.default_rng([seed, 7])
        outputs = {
            c.name: shown[c.name] + c.noise * rng.standard_normal(len(bare.t_s))
            for c in PLANT.channels
        }
        out.append(bare.with_columns(outputs=outputs))
    return out


@dataclass(frozen=True)
class Bench:
    """Runs of the plant with the laws of TRUE in it, and what the plain plant makes of them."""

    gap: Residual
    found: Responses
    rows: FoldRows

    def column(self, place: str, term: str) -> int:
        return next(
            own[k]
            for law, own in zip(self.found.laws, self.found.columns, strict=True)
            for k, t in enumerate(law.terms)
            if (law.place, t.name) == (place, term)
        )

    def step(self, place: str, term: str) -> Step:
        candidate = next(c for c in self.found.candidates() if c.place == place)
        chosen = (candidate.terms.index(term) - 1,)
        scored = Scored(candidate, Forward(np.zeros((2, self.rows.folds)), chosen), 0.1)
        return Step(chosen=scored, near=(scored,), share=0.1, gains=np.zeros(1))


@cache
def bench() -> Bench:
    start = nominal_point(PLANT)
    plain = Measured.of(PLANT, runs_with(()), 0.2)
    space = candidate_laws(PLANT, start, plain.played)
    whole = responses(PLANT, start, plain.played, space=space)
    empty = Bench(None, whole, None)  # type: ignore[arg-type]
    columns = np.array([empty.column(*key) for key in TRUE], dtype=np.intp)
    laws = whole.law_of(columns, np.array(list(TRUE.values())))
    measured = Measured.of(PLANT, runs_with(laws), 0.2)
    gap = residual(PLANT, start, measured, counts=(True, True), least=LEAST)
    found = responses(PLANT, start, measured.played, space=space)
    return Bench(gap, found, gap.fold_rows(found))


def test_laws_in_the_simulator_are_found_back_within_their_deviation_parameters_beside() -> None:
    b = bench()
    settler = Settler(b.gap, b.found, nominal_point(PLANT))
    alone = settler.first()
    assert alone is not None
    columns = np.array([b.column(*key) for key in TRUE], dtype=np.intp)
    end = settler.extended(alone, columns, np.zeros(len(columns)), alone=False)
    assert end is not None
    for _ in range(2):
        end = settler.refreshed(end)
    own = settler.uncertainty(end)
    sd = np.sqrt(np.diag(own.covariance))
    assert list(own.names[:N]) == [q.name for q in PLANT.parameters]
    assert own.names[N] == "laws.reading_temp_l_degC.both.fan"
    scale = np.array([b.found.scales[place] for place, _ in TRUE])
    wanted, found = scale * list(TRUE.values()), scale * end.x[N:]
    assert np.all(np.abs(found - wanted) < 4.0 * sd[N:])
    assert np.all(sd[N:] < 0.05 * wanted)
    theta = settler.model(end).theta
    for q, own_sd in zip(PLANT.parameters, sd, strict=False):
        assert abs(theta[q.name] - OTHER.get(q.name, q.nominal)) < 4.0 * own_sd, q.name
    assert end.left @ end.left < 0.4 * (alone.left @ alone.left)


def in_order(*keys: tuple[str, str]) -> Listed:
    b = bench()
    steps = [b.step(*key) for key in keys]
    found = listed(Settler(b.gap, b.found, nominal_point(PLANT)), b.rows, steps)
    assert found is not None
    return found


@pytest.mark.parametrize("first", [True, False])
def test_a_step_that_does_not_help_in_the_simulator_is_left_out(first: bool) -> None:
    useful, useless = ("reading_temp_l_degC", "fan"), ("reading_power_l_W", "fan")
    found = in_order(*((useful, useless) if first else (useless, useful)))
    assert [s.chosen.candidate.place for s in found.steps] == [useful[0]]
    assert len(found.settled) == len(found.predicted) == len(found.squares) == 2
    assert found.shares[0] > 0.15


def test_steps_that_help_are_kept_and_their_shares_add_up_to_what_all_take() -> None:
    found = in_order(*TRUE)
    assert [s.chosen.candidate.place for s in found.steps] == [place for place, _ in TRUE]
    assert sum(found.shares) == pytest.approx(1.0 - found.squares[-1] / found.squares[0])
    assert sum(found.shares) > 0.8


def test_held_out_predictions_are_of_models_that_had_no_part_of_the_run() -> None:
    """A run's own noise that a model was fitted to is in it, so the held-out gap is larger."""
    b = bench()
    settler = Settler(b.gap, b.found, nominal_point(PLANT))
    alone = settler.first()
    assert alone is not None
    held = settler.held_out(alone)
    assert held is not None
    kept = b.gap.fold >= 0
    assert settler.square(held, (0, 1)) > float(alone.left[kept] @ alone.left[kept])
