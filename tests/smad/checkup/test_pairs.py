"""Pairs: with what has changed in the simulator, nothing is left of a check-up."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smad.checkup.judge import commissioned, judge_runs
from smad.checkup.programme import shipped
from smad.checkup.store import Baseline, load, save
from smad.diagnosis.data.starts import usual_starts
from smad.diagnosis.paired.difference import notes_of, pair_runs
from smad.diagnosis.paired.good import least_sd
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.rivals.evidence import Evidence, without_drifts
from smad.diagnosis.rivals.fit import replayed
from smad.diagnosis.rivals.rival import free_model
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import PARAMETERS, QUIET

from .short import PLANT, played, starting_at

RUN = shipped().runs[0]
MOVED = {"stress_start": 1.05, "stress_finish": 1.03, "flow_max": 0.97, "resistivity": 1.02}
"""Parameters with what they are multiplied by; displacement changes by millimetres."""
STEADY = dict.fromkeys(("tube_loss", "flow_max", "film_scale"), 1.0)
"""No day is like another in these, but here."""


def test_other_parameters_in_other_water_leave_nothing_once_they_are_in_the_simulator() -> None:
    reference = commissioned(PLANT, [[played(s, moved=STEADY, what=RUN) for s in (1, 2, 3)]])
    now = played(10, water_degC=24.0, moved=STEADY | MOVED, what=RUN)
    pairs = pair_runs(with_places(PLANT), reference, [(now, RUN.name)])
    (trial,) = pairs.evidence().trials
    model = free_model(pairs.plant, reference.point)
    theta = dict(reference.point.theta)
    for name, factor in MOVED.items():
        theta[name] = theta.get(name, PLANT.parameter_set[name]) * factor
    left = []
    for point in (reference.point, ModelPoint(theta, {})):
        predicted = replayed(pairs.evidence(), point, model, exact=True)
        assert predicted is not None
        rows = np.where(trial.rows.valid, trial.target - predicted[0], 0.0)
        left.append(np.sqrt((rows**2).mean(axis=0)) / least_sd(PLANT))
    before, after = left
    assert before.max() > 100.0
    assert after.max() < 3.0


def test_a_run_that_starts_elsewhere_leaves_nothing_once_starting_there_is_a_day() -> None:
    good = [played(s, moved=STEADY, what=RUN) for s in (1, 2, 3)]
    reference = commissioned(PLANT, [good])
    plant = with_places(PLANT)
    now = played(10, moved=STEADY, what=RUN)
    moved = starting_at(now, 1.5)

    def left(run: GapRun, *, known: bool = True) -> float:
        """Floors that are left in displacement."""
        paired = pair_runs(plant, reference, [(run, RUN.name)])
        (pair,) = paired.pairs
        assert bool(pair.away) == ("elsewhere" in " ".join(notes_of(paired)))
        trial = pair.trial
        if pair.away and not known:
            rows = replace(trial.rows, day=trial.rows.day[:-1], day_sd=trial.rows.day_sd[:-1])
            trial = replace(trial, rows=rows)
        evidence = Evidence(trials=(trial,), least_square=0.0)
        predicted = replayed(
            evidence, reference.point, free_model(plant, reference.point), exact=True
        )
        assert predicted is not None
        rows_left = without_drifts(evidence, evidence.residual(predicted))
        channel = [c.name for c in plant.channels].index("displacement_mm")
        return float(np.sqrt(evidence.variances(rows_left)[channel]))

    assert left(now) < 1.5
    assert left(moved) < 1.5
    assert left(moved, known=False) > 2.0 * left(moved)


def test_a_start_counts_as_another_where_neither_noise_nor_days_explain_it() -> None:
    reference = commissioned(PLANT, [[played(s, what=RUN) for s in (1, 2)]])
    plant = with_places(PLANT)
    now = played(10, what=RUN)

    def away(shift_mm: float) -> Mapping[str, float]:
        shifted = {"displacement_mm": now.outputs["displacement_mm"] + shift_mm}
        run = now.with_columns(outputs=shifted)
        (pair,) = pair_runs(plant, reference, [(run, RUN.name)]).pairs
        return pair.away

    assert away(0.0) == {}
    assert away(0.01) == {}
    assert away(1.0)["displacement_mm"] == pytest.approx(1.0, abs=0.1)
    assert away(-1.0)["displacement_mm"] == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize(
    "away_mm", [1.2, *(pytest.param(mm, marks=pytest.mark.campaign) for mm in (-1.2, 0.2))]
)
def test_good_runs_that_start_elsewhere_than_mounted_do_not_move_the_zero(
    away_mm: float, tmp_path: Path
) -> None:
    good = [starting_at(played(s, what=RUN), away_mm) for s in (1, 2)]
    reference = commissioned(PLANT, [good])
    (run,) = reference.runs
    channel = [c.name for c in PLANT.channels].index("displacement_mm")
    off = np.where(run.valid, run.mean - run.base, 0.0)[:, channel]
    starts = dict(run.played.run.starts)
    assert starts.keys() == {"displacement_mm", "rtd_x_degC", "rtd_y_degC"}
    assert starts["displacement_mm"] == pytest.approx(away_mm, abs=0.05)
    assert abs(reference.point.theta.get("displacement_zero", 0.0)) < 0.1
    assert np.sqrt((off**2).mean()) < 0.05
    save(Baseline("bench", "programme", reference), PLANT, tmp_path)
    (kept,) = load(tmp_path, PLANT).reference.runs
    assert kept.played.run.starts == starts


def test_a_reading_further_off_than_springs_can_stand_is_of_the_reading() -> None:
    runs = [played(s, what=RUN) for s in (1, 2)]
    far = [
        r.with_columns(outputs={"displacement_mm": r.outputs["displacement_mm"] + 20.0})
        for r in runs
    ]
    (starts,) = usual_starts(PLANT, [far])
    assert "displacement_mm" not in starts
    reference = commissioned(PLANT, [runs])
    (pair,) = pair_runs(with_places(PLANT), reference, [(far[0], RUN.name)]).pairs
    assert pair.away == {}


def test_a_run_that_starts_elsewhere_than_good_runs_that_start_elsewhere_adds_to_it() -> None:
    good = [starting_at(played(s, what=RUN), 1.0) for s in (1, 2)]
    reference = commissioned(PLANT, [good])
    now = starting_at(played(10, what=RUN), 1.8)
    (pair,) = pair_runs(with_places(PLANT), reference, [(now, RUN.name)]).pairs
    assert pair.away["displacement_mm"] == pytest.approx(0.8, abs=0.1)
    (usual, mounted) = (
        PLANT.simulate(reference.point, run)["displacement_mm"][0]
        for run in (pair.trial.played.run, replace(pair.trial.played.run, starts={}))
    )
    assert usual - mounted == pytest.approx(1.0, abs=0.1)


def test_a_start_is_no_change_and_a_reading_that_stays_off_is_one() -> None:
    reference = commissioned(PLANT, [[played(s, what=RUN) for s in (1, 2)]])
    now = played(14, what=RUN)
    shown = {"displacement_mm": now.outputs["displacement_mm"] + 0.8}
    started, misread = (
        judge_runs(PLANT, reference, [(run, RUN.name)]).verdict
        for run in (starting_at(now, 0.8), now.with_columns(outputs=shown))
    )
    assert started.outcome == QUIET
    assert misread.causes[0].place == "reading_displacement"
    for verdict in (started, misread):
        assert any("began elsewhere than its good run" in note for note in verdict.notes)


def test_a_pair_that_has_lost_preload_is_not_called_quiet() -> None:
    reference = commissioned(PLANT, [[played(s, moved=STEADY, what=RUN) for s in (1, 2)]])
    slack = played(10, moved=STEADY | {"initial_force": 0.92}, what=RUN)
    assert judge_runs(PLANT, reference, [(slack, RUN.name)]).verdict.outcome == PARAMETERS
