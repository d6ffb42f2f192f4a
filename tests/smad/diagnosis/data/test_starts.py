"""Runs are replayed from where they read at their start."""

from dataclasses import replace

import numpy as np
import pytest

from smad.checkup.programme import shipped
from smad.diagnosis.data.starts import started, usual_starts
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verify import verified
from tests.smad.checkup.short import PLANT, played

RUN = shipped().runs[0]
TRUE = ModelPoint({})
STROKES_S = 60.0
ZERO = "displacement_zero"


def used(seed: int, first: str = "y", point: ModelPoint = TRUE) -> GapRun:
    """A run after a stroke of each spring that it does not have; that of `first` came first."""
    run = RUN.as_run(27.0, 27.0)
    before = np.arange(run.t_s[0] - STROKES_S, run.t_s[0], 0.1)
    inputs = {name: np.r_[np.zeros(len(before)), column] for name, column in run.inputs.items()}
    for k, side in enumerate((first, "xy".replace(first, ""))):
        since_s = before - before[0] - 30.0 * k
        heated, pumped = (slice(*np.searchsorted(since_s, ab)) for ab in ((0, 9), (11, 27)))
        inputs[f"i_applied_{side}_A"][heated] = 2.9
        inputs[f"duty_{side}"][pumped] = 1.0
    levels = {n: np.r_[np.full(len(before), c[0]), c] for n, c in run.outputs.items()}
    whole = GapRun(RUN.name, np.r_[before, run.t_s], inputs, levels)
    found, noise = PLANT.simulate(point, whole), np.random.default_rng(seed)
    shown = {
        c.name: found[c.name][len(before) :] + c.noise * noise.normal(size=len(run.t_s))
        for c in PLANT.channels
    }
    return GapRun(f"{RUN.name} {seed}", run.t_s, run.inputs, shown)


def test_an_unchanged_bench_that_was_used_before_leaves_its_floor() -> None:
    runs = [used(1), used(2, first="x"), played(3, what=RUN)]
    assert all(row.raw < 1.3 * row.floor for row in verified(PLANT, runs, TRUE))
    as_mounted = [replace(run, starts={"displacement_mm": 0.0}) for run in runs]
    *_, whole = verified(PLANT, as_mounted, TRUE)
    assert whole.raw > 5.0


def test_a_reading_that_is_off_at_the_start_is_a_drift_of_its_run() -> None:
    """The zero of the encoder moves the reading, and with it where the replay starts."""
    off = ModelPoint({ZERO: 0.1})
    runs = [used(seed, point=off) for seed in (1, 2)]
    assert all(row.final < 1.3 * row.floor for row in verified(PLANT, runs, off))


def test_a_run_starts_with_what_it_reads_temperatures_above_those_of_the_water() -> None:
    (run,) = started(PLANT, [used(1)])
    read = run.at_start(PLANT.traits.starts)
    water = run.at_start(["rtd_inlet_degC"])["rtd_inlet_degC"]
    assert run.starts["displacement_mm"] == read["displacement_mm"]
    assert run.starts["force_N"] == read["force_N"]
    assert run.starts["rtd_x_degC"] == pytest.approx(read["rtd_x_degC"] - water)
    assert run.starts["rtd_x_degC"] > 0.1
    shown = PLANT.simulate(TRUE, run)
    for name, tolerance in (("displacement_mm", 0.01), ("force_N", 2e-3), ("rtd_x_degC", 0.05)):
        assert shown[name][0] == pytest.approx(read[name], abs=tolerance)


def test_a_run_without_a_reading_starts_at_the_mean_of_the_others() -> None:
    one, other, blind = used(1), used(2, first="x"), used(3)
    blind = replace(blind, outputs={"force_N": blind.outputs["force_N"]})
    *others, alone = (run.starts for run in started(PLANT, [one, other, blind]))
    assert alone["displacement_mm"] == pytest.approx(
        np.mean([starts["displacement_mm"] for starts in others])
    )


def test_a_start_that_the_caller_gave_is_kept() -> None:
    given = {"displacement_mm": 0.6}
    assert started(PLANT, [replace(used(1), starts=given)])[0].starts == given


def test_samples_that_are_marked_bad_say_nothing_of_a_start() -> None:
    run = used(1)
    bad = run.t_s < run.t_s[0] + 0.9
    shown = np.where(bad, 2.0, run.outputs["displacement_mm"])
    marked = replace(run.with_columns(outputs={"displacement_mm": shown}), valid=~bad)
    (starts,) = usual_starts(PLANT, [[marked]])
    assert starts["displacement_mm"] == pytest.approx(
        run.at_start(["displacement_mm"])["displacement_mm"], abs=0.02
    )
