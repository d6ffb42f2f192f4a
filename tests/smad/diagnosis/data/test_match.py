"""Which runs have the same inputs, on the tiny plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from smad.diagnosis.data.rows import grouped, same_programme
from smad.diagnosis.runs import GapRun
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

PLANT = HeaterPlant()
PERIOD_S = 0.5


def same(one: GapRun, other: GapRun) -> bool:
    return same_programme(PLANT, one, other, PERIOD_S)


def shrunk(run: GapRun, share: float) -> GapRun:
    """The run with inputs that move by a share of their span."""
    return run.with_columns(inputs={k: share * v for k, v in run.inputs.items()})


def test_recordings_of_another_day_have_the_same_inputs_whether_these_step_or_not() -> None:
    for family in ("random", "sines"):
        monday, tuesday = (recorded(family, 1, day=day) for day in (1, 2))
        late = replace(tuesday, name="tuesday", t_s=tuesday.t_s + 100.0)
        assert same(late, monday)
        assert not same(late, recorded(family, 2))


def test_a_run_that_ends_early_has_the_inputs_of_the_whole_one() -> None:
    whole = recorded("random", 1)
    assert same(replace(whole.part(0, 300), name="cut"), whole)


def test_inputs_are_compared_by_how_much_they_move() -> None:
    one, other = (shrunk(recorded("random", seed), 0.1) for seed in (1, 2))
    assert same(one, one)
    assert not same(one, other)


def test_inputs_that_stay_where_they_are_are_the_same_where_the_run_has_the_same_name() -> None:
    rest = recorded("random", 1).with_columns(
        inputs={k: np.zeros_like(v) for k, v in recorded("random", 1).inputs.items()}
    )
    assert same(rest, rest)
    assert not same(rest, replace(rest, name="another"))


def test_good_runs_are_grouped_by_their_inputs() -> None:
    runs = [recorded("random", seed, day=day) for day in (1, 2) for seed in (1, 2)]
    runs.append(recorded("sines", 1))
    groups = grouped(runs, same)
    assert [[r.name for r in g] for g in groups] == [
        ["random 1", "random 1"], ["random 2", "random 2"], ["sines 1"],
    ]  # fmt: skip
