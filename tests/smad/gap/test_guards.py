"""Guards: a verdict is refused, or says so, where the runs given would make it false."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from smad.gap.records import Diagnosis, Outcome

from smad.diagnosis.data.guards import goes_further, same_recording
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, ask
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant, make_inputs, recorded, simulated


def runs_of(*seeds: int) -> list[GapRun]:
    return [recorded("random", seed, OTHER, duration_s=20.0) for seed in seeds]


def copied(run: GapRun) -> GapRun:
    """The same recording under another name, through a file that keeps six digits."""
    outputs = {k: np.round(v, 6) for k, v in run.outputs.items()}
    return replace(run.with_columns(outputs=outputs), name="a copy", t_s=run.t_s + 3.0)


def said(diagnosis: Diagnosis, kind: str) -> list[str]:
    return [f.text for f in diagnosis.findings if f.kind == kind]


def test_a_recording_is_known_by_its_samples_and_not_by_its_name() -> None:
    (one, other) = runs_of(1, 2)
    assert same_recording(one, copied(one))
    assert not same_recording(one, replace(other, name=one.name))
    assert not same_recording(one, one.part(0, len(one.t_s) // 2))


def test_a_run_to_fit_that_is_also_held_out_refuses_the_verdict() -> None:
    runs = runs_of(1, 2)
    diagnosis = ask(runs, hold_out=[copied(runs[0])])
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "cannot be judged on what it was fitted to" in diagnosis.verdict.text
    assert [r.name for r in diagnosis.runs if r.role == "refused"] == ["a copy"]


def test_a_run_in_question_that_is_also_known_good_refuses_the_verdict() -> None:
    runs = runs_of(1, 2)
    diagnosis = ask(runs, good=[runs[0], runs[1]])
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "cannot say what is good" in diagnosis.verdict.text


def test_the_same_run_twice_counts_once() -> None:
    runs = runs_of(1, 2)
    diagnosis = ask([*runs, copied(runs[0])])
    assert sorted(r.role for r in diagnosis.runs) == ["fit", "fit", "refused"]
    (text,) = said(diagnosis, "given twice")
    assert "holds the same samples as" in text


def test_a_single_run_and_a_single_known_good_run_are_told_in_one_line_each() -> None:
    (one, good) = runs_of(1, 3)
    (alone, unsure) = said(ask([one], good=[good]), "few runs")
    assert "a single run to fit" in alone
    assert "a single known-good run" in unsure


def test_runs_of_two_benches_are_said_to_disagree() -> None:
    others = [
        recorded("random", seed, {"c_J_K": 33.0, "ha_W_K": 0.53}, duration_s=40.0)
        for seed in (3, 4)
    ]
    here = [recorded("random", seed, OTHER, duration_s=40.0) for seed in (1, 2)]
    found = ask([*here, *others])
    assert found.verdict.outcome is Outcome.CONTRADICTING
    assert "two benches" in found.verdict.plain
    assert ask(here).verdict.outcome is not Outcome.CONTRADICTING


def gently(seed: int) -> GapRun:
    """A known-good run with a third of the usual power."""
    plant, inputs = HeaterPlant(), make_inputs("random", 40.0, seed)
    point = ModelPoint(NOMINAL, {})
    return simulated(plant, f"gentle {seed}", {k: v / 3 for k, v in inputs.items()}, point)


def test_runs_that_drive_the_bench_further_than_the_known_good_ones_are_told_so() -> None:
    roles = {"fit": runs_of(1, 2), "hold-out": [], "good": [gently(3), gently(4)]}
    (finding,) = goes_further(roles, HeaterPlant())
    assert "power_l_W" in finding.text
    assert "give known-good runs that go as far" in finding.text
    assert goes_further({**roles, "good": runs_of(1, 2)}, HeaterPlant()) == []
    assert goes_further({**roles, "good": []}, HeaterPlant()) == []


def test_an_effect_does_not_count_as_excitation() -> None:
    strong = [recorded("random", 1, OTHER, {"driver_gain": {"g": 0.2}}, duration_s=20.0)]
    good = [recorded("random", 1, OTHER, duration_s=20.0)]
    assert goes_further({"fit": strong, "hold-out": [], "good": good}, HeaterPlant()) == []


def test_a_cause_is_not_called_new_where_no_known_good_run_went() -> None:
    slow = [
        recorded("random", s, NOMINAL, {"sensor_lag": {"tau_s": 1.5}}, duration_s=40.0)
        for s in (1, 2)
    ]
    as_far = [recorded("random", s, NOMINAL, duration_s=40.0) for s in (1, 2)]
    beyond, within = ask(slow, good=[gently(3), gently(4)]), ask(slow, good=as_far)
    assert beyond.verdict.effects == within.verdict.effects == ["sensor_lag"]
    assert "Whether it is new cannot be told" in beyond.verdict.plain
    assert "Whether it is new cannot be told" not in within.verdict.plain
