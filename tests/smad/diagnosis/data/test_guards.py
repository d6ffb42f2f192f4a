"""Guards: a verdict is refused, or says so, where the runs given would make it false."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from smad.diagnosis.data.guards import FURTHER, goes_further, same_recording
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import REFUSED, Verdict
from tests.smad.diagnosis.cases import OTHER, ask
from tests.smad.diagnosis.heater_plant import NOMINAL, HeaterPlant, make_inputs, recorded, simulated


def runs_of(*seeds: int) -> list[GapRun]:
    return [recorded("random", seed, OTHER, duration_s=20.0) for seed in seeds]


def copied(run: GapRun) -> GapRun:
    """The same recording under another name, through a file that keeps six digits."""
    outputs = {k: np.round(v, 6) for k, v in run.outputs.items()}
    return replace(run.with_columns(outputs=outputs), name="a copy", t_s=run.t_s + 3.0)


def said(found: Verdict, kind: str) -> list[str]:
    return [f.text for f in found.findings if f.kind == kind]


def test_a_recording_is_known_by_its_samples_and_not_by_its_name() -> None:
    (one, other) = runs_of(1, 2)
    assert same_recording(one, copied(one))
    assert not same_recording(one, replace(other, name=one.name))
    assert not same_recording(one, one.part(0, len(one.t_s) // 2))


def test_a_run_to_fit_that_is_also_held_out_refuses_the_verdict() -> None:
    runs = runs_of(1, 2)
    found = ask(runs, hold_out=[copied(runs[0])])
    assert found.outcome == REFUSED
    assert "cannot be judged on what it was fitted to" in " ".join(f.text for f in found.findings)
    assert [r.name for r in found.runs if r.role == "refused"] == ["a copy"]


def test_a_run_in_question_that_is_also_known_good_refuses_the_verdict() -> None:
    runs = runs_of(1, 2)
    found = ask(runs, good=[runs[0], runs[1]])
    assert found.outcome == REFUSED
    assert "cannot say what is good" in " ".join(f.text for f in found.findings)


def test_the_same_run_twice_counts_once() -> None:
    runs = runs_of(1, 2)
    found = ask([*runs, copied(runs[0])])
    assert sorted(r.role for r in found.runs) == ["fit", "fit", "refused"]
    (text,) = said(found, "given twice")
    assert "holds the same samples as" in text


def test_a_single_run_and_a_single_known_good_run_are_told_in_one_line_each() -> None:
    (one, good) = runs_of(1, 3)
    (alone, unsure) = said(ask([one], good=[good]), "few runs")
    assert "a single run to fit" in alone
    assert "a single known-good run" in unsure


def gently(seed: int) -> GapRun:
    """A known-good run with a third of the usual power."""
    plant, inputs = HeaterPlant(), make_inputs("random", 40.0, seed)
    point = ModelPoint(NOMINAL, {})
    return simulated(plant, f"gentle {seed}", {k: v / 3 for k, v in inputs.items()}, point)


def test_runs_that_drive_the_bench_further_than_the_known_good_ones_are_told_so() -> None:
    runs = runs_of(1, 2)
    (finding,) = goes_further(runs, [gently(3), gently(4)], HeaterPlant())
    assert "power_l_W" in finding.text
    assert "give known-good runs that go as far" in finding.text
    assert goes_further(runs, runs_of(1, 2), HeaterPlant()) == []
    assert goes_further(runs, [], HeaterPlant()) == []


def test_an_effect_does_not_count_as_excitation() -> None:
    strong = [recorded("random", 1, OTHER, {"driver_gain": {"g": 0.2}}, duration_s=20.0)]
    good = [recorded("random", 1, OTHER, duration_s=20.0)]
    assert goes_further(strong, good, HeaterPlant()) == []


def test_a_verdict_says_that_runs_go_further_than_the_known_good_ones() -> None:
    found = ask(runs_of(1, 2), good=[gently(3), gently(4)])
    (text,) = said(found, FURTHER)
    assert "errors of the model out there count as changes" in text
    assert said(ask(runs_of(1, 2), good=runs_of(3, 4)), FURTHER) == []
