"""Runs are replayed from where they start."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from smad.checkup.programme import shipped
from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.starts import started, usual_starts
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verify import verified
from tests.smad.checkup.short import PLANT, played, starting_at

RUN = shipped().runs[0]
TRUE = ModelPoint({})
STEADY = dict.fromkeys(("tube_loss", "flow_max", "film_scale"), 1.0)


def starting(*away_mm: float) -> list[GapRun]:
    """A run of an unchanged bench for each distance from where it was mounted."""
    runs = [starting_at(played(s, moved=STEADY, what=RUN), a) for s, a in enumerate(away_mm, 1)]
    return [replace(run, name=f"run {k}") for k, run in enumerate(runs)]


def starts_of(runs: Sequence[GapRun]) -> list[float | None]:
    return [run.starts.get("displacement_mm") for run in runs]


def test_all_runs_start_as_mounted_or_none_does() -> None:
    assert starts_of(started(PLANT, starting(0.3, -0.4))) == [None, None]
    assert starts_of(started(PLANT, starting(0.3, 0.8))) == [
        pytest.approx(0.3, abs=0.02),
        pytest.approx(0.8, abs=0.02),
    ]


def test_a_run_without_the_reading_starts_at_the_mean_of_the_others() -> None:
    one, other, blind = starting(0.6, 1.0, 0.8)
    blind = replace(blind, outputs={"force_N": blind.outputs["force_N"]})
    assert starts_of(started(PLANT, [one, other, blind]))[2] == pytest.approx(0.8, abs=0.02)


def test_a_start_that_the_caller_gave_is_kept() -> None:
    (run,) = starting(1.0)
    given = {"displacement_mm": 0.6}
    assert started(PLANT, [replace(run, starts=given)])[0].starts == given


def test_samples_that_are_marked_bad_say_nothing_of_a_start() -> None:
    (run,) = starting(0.0)
    bad = run.t_s < run.t_s[0] + 0.9
    shown = np.where(bad, 2.0, run.outputs["displacement_mm"])
    marked = replace(run.with_columns(outputs={"displacement_mm": shown}), valid=~bad)
    assert usual_starts(PLANT, [[marked]]) == [{}]


def test_admission_notes_where_a_run_starts_and_nothing_of_one_that_starts_as_mounted() -> None:
    elsewhere, mounted = (admit(starting(a), PLANT, PERIOD_S) for a in (-1.0, 0.1))
    assert starts_of(elsewhere.admitted) == [pytest.approx(-1.0, abs=0.02)]
    assert [f.kind for f in elsewhere.findings] == ["start"]
    assert "displacement_mm = -1.0" in elsewhere.findings[0].text
    assert starts_of(mounted.admitted) == [None]
    assert not mounted.findings


def test_the_zero_of_the_encoder_does_not_move_what_is_read_at_the_start() -> None:
    (run,) = started(PLANT, starting(1.0))
    for zero_mm in (0.0, 0.3, -0.3):
        shown = PLANT.simulate(ModelPoint({"displacement_zero": zero_mm}), run)
        assert shown["displacement_mm"][0] == pytest.approx(1.0, abs=0.03)
        assert shown["displacement_mm"][-1] - zero_mm == pytest.approx(
            PLANT.simulate(TRUE, run)["displacement_mm"][-1], abs=0.1
        )


def test_an_unchanged_bench_that_starts_elsewhere_leaves_its_floor() -> None:
    runs = starting(-1.0, -1.4, 0.2)
    for row in verified(PLANT, runs, TRUE)[:-1]:
        assert row.raw < 1.3 * row.floor, row.signal
    as_mounted = [replace(run, starts={"displacement_mm": 0.0}) for run in runs]
    (displacement,) = [
        row for row in verified(PLANT, as_mounted, TRUE) if "displacement" in row.signal
    ]
    assert displacement.raw > 5.0 * displacement.floor
