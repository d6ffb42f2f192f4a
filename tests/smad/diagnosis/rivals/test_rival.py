"""What a rival leaves of the rows that it is judged by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.rivals.evidence import recorded_evidence, without_drifts
from smad.diagnosis.rivals.fit import reference_at
from smad.diagnosis.rivals.rival import cannot_replay, question_of
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded

PLANT = SmaPlant()
BENCH = ModelPoint({}, {"rtd_lag": {"tau_s": 0.6}})
PERIOD_S = 0.2


def in_a_room_off_by(K: float, seed: int) -> GapRun:
    """A run of the bench, in a room that is warmer than at its start all along."""
    run = recorded("levels", PLANT, BENCH, seed, duration_s=40.0)
    warmer = {("ambient_air", "both"): np.full(len(run.t_s), K)}
    moved, usual = PLANT.forced(BENCH, run, warmer), PLANT.forced(BENCH, run, {})
    return replace(run, outputs={n: y + moved[n] - usual[n] for n, y in run.outputs.items()})


# One run alone hardly says whether the room was as warm before it began.
@pytest.mark.parametrize(("rooms", "most"), [((0.5,), 1.5), ((0.5, -0.4), 1.1)])
def test_what_wanders_is_judged_alike_in_stretches_and_in_whole_runs(
    rooms: tuple[float, ...], most: float
) -> None:
    runs = [in_a_room_off_by(K, seed) for seed, K in enumerate(rooms, start=5)]
    start = replace(nominal_point(PLANT), effects=BENCH.effects)
    floors = estimate_floors(runs, PLANT, PERIOD_S)
    evidence = recorded_evidence(PLANT, runs, floors, PERIOD_S, start)
    asked = question_of(PLANT, start, evidence, effects=(), say=lambda text: None)
    base = reference_at(evidence, asked.model, np.zeros(asked.model.parameters))
    assert base is not None
    fitted = asked.converged("parameters", "parameters", base)
    assert fitted is not None
    assert asked.at_floor(fitted)
    ambient = [c.name for c in PLANT.channels].index("rtd_ambient_degC")
    whole = evidence.squares(without_drifts(evidence, fitted.fitted.residual))
    assert (fitted.squares[:, ambient] < most * whole[:, ambient]).all()


def test_the_error_of_a_model_that_cannot_replay_names_runs_held_out_too() -> None:
    fit, held_out = (
        SimpleNamespace(played=[SimpleNamespace(whole=SimpleNamespace(name=name))])
        for name in ("monday", "tuesday")
    )
    asked = SimpleNamespace(evidence=fit, held_out=held_out)
    assert cannot_replay(cast(Any, asked)).value == "monday, tuesday"
