"""How long a row and a cell are follows from how fast the records say that a bench is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from smad.arrays import Array
from smad.diagnosis.data.admission import admit, row_of_admitted_s
from smad.diagnosis.data.grid import (
    MOST_ROWS,
    PERIOD_S,
    Grid,
    row_length_s,
    usual_correlation_time_s,
)
from smad.diagnosis.runs import GapRun
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded


def finer(run: GapRun) -> GapRun:
    """The run sampled five times as often."""
    t_s = np.arange(5 * len(run.t_s) - 4) * 0.02

    def between(columns: Mapping[str, Array]) -> dict[str, Array]:
        return {k: np.interp(t_s, run.t_s, v) for k, v in columns.items()}

    return GapRun(run.name, t_s, between(run.inputs), between(run.outputs))


@pytest.mark.parametrize("family", ["random", "sines"])
def test_a_row_is_a_tenth_of_the_correlation_time_in_whole_samples(family: str) -> None:
    runs = [finer(recorded(family, seed, duration_s=60.0)) for seed in (1, 2)]
    usual = usual_correlation_time_s(runs, HeaterPlant())
    assert usual is not None
    row_s = row_length_s(runs, HeaterPlant())
    assert row_s == pytest.approx(usual / 10.0, abs=runs[0].dt_s)
    assert row_s / runs[0].dt_s == pytest.approx(round(row_s / runs[0].dt_s))


def test_a_row_has_no_cliff_in_the_time_scale_of_a_bench() -> None:
    run = finer(recorded("random", 1, duration_s=60.0))
    lengths = [row_length_s([slowed(run, f)], HeaterPlant()) / f for f in np.linspace(0.9, 1.1, 21)]
    assert max(lengths) < 1.15 * min(lengths)


def test_all_runs_together_have_rows_that_fit_into_memory() -> None:
    run = finer(recorded("random", 1, duration_s=60.0))
    many = [replace(run, name=str(k)) for k in range(200)]
    rows = sum(r.duration_s for r in many) / row_length_s(many, HeaterPlant())
    assert rows <= MOST_ROWS


def slowed(run: GapRun, factor: float) -> GapRun:
    return replace(run, t_s=run.t_s * factor)


@pytest.mark.parametrize("factor", [10.0, 100.0, 0.1])
def test_rows_go_with_the_time_scale(factor: float) -> None:
    runs = [slowed(finer(recorded("random", 1, duration_s=60.0)), factor)]
    usual = usual_correlation_time_s(runs, HeaterPlant())
    assert usual is not None
    assert row_length_s(runs, HeaterPlant()) == pytest.approx(usual / 10.0, abs=runs[0].dt_s)


def test_a_row_is_no_shorter_than_a_sample() -> None:
    run = recorded("random", 1, duration_s=60.0)
    few = replace(
        run.part(0, 0),
        t_s=run.t_s[::20],
        inputs={k: v[::20] for k, v in run.inputs.items()},
        outputs={k: v[::20] for k, v in run.outputs.items()},
    )
    found = row_length_s([few], HeaterPlant())
    assert found == pytest.approx(20 * run.dt_s, rel=1e-5)
    assert len(Grid.of(few, found).valid) == len(few.t_s)


def without(run: GapRun, begin_s: float, end_s: float) -> GapRun:
    """The run without its samples of a time."""
    kept = (run.t_s < begin_s) | (run.t_s > end_s)
    return replace(
        run,
        t_s=run.t_s[kept],
        inputs={k: v[kept] for k, v in run.inputs.items()},
        outputs={k: v[kept] for k, v in run.outputs.items()},
    )


@pytest.mark.parametrize("hole_s", [1.0, 3.0, 12.0])
def test_rows_are_those_of_a_run_up_to_its_hole(hole_s: float) -> None:
    plant, whole = HeaterPlant(), recorded("sines", 1, duration_s=60.0)
    torn, cut = without(whole, 37.95, 37.95 + hole_s), without(whole, 37.95, 99.0)
    row_s = row_of_admitted_s([torn], plant)
    assert row_s == row_length_s([cut], plant)
    (kept,) = admit([torn], plant, row_s).admitted
    assert kept.duration_s == pytest.approx(cut.duration_s)


def test_a_run_of_a_hole_near_its_start_makes_no_row_shorter() -> None:
    runs = [recorded("sines", seed, duration_s=60.0) for seed in (1, 2)]
    torn = [runs[0], without(runs[1], 1.0, 5.0)]
    assert row_of_admitted_s(torn, HeaterPlant()) == row_of_admitted_s(runs[:1], HeaterPlant())


@pytest.mark.parametrize("short_s", [8.0, 12.0, 20.0])
def test_a_run_much_shorter_than_those_beside_it_is_used(short_s: float) -> None:
    plant = HeaterPlant()
    runs = [recorded("sines", 1, duration_s=60.0), recorded("random", 2, duration_s=short_s)]
    row_s = row_of_admitted_s(runs, plant)
    assert len(admit(runs, plant, row_s).admitted) == 2
    too_short = [*runs, recorded("random", 3, duration_s=3.0)]
    assert row_of_admitted_s(too_short, plant) == row_s


def test_a_run_that_would_cost_too_many_rows_of_the_others_is_left_out_with_a_word() -> None:
    plant = HeaterPlant()
    long = [recorded("random", seed, duration_s=900.0) for seed in range(2)]
    runs = [*long, recorded("sines", 2, duration_s=8.0)]
    found = admit(runs, plant, row_of_admitted_s(runs, plant))
    assert len(found.admitted) == 2
    assert "so that all runs have at most 6000; give fewer beside it" in found.findings[-1].text


def test_a_run_too_short_for_the_plant_is_refused_by_that_limit_beside_longer_ones_too() -> None:
    plant = HeaterPlant()
    runs = [recorded("sines", 1, duration_s=60.0), recorded("random", 2, duration_s=3.0)]
    alone = admit(runs[1:], plant, row_of_admitted_s(runs[1:], plant)).findings[-1].text
    row_s = row_of_admitted_s(runs, plant)
    assert row_s > 1.5 * runs[1].dt_s
    assert admit(runs, plant, row_s).findings[-1].text == alone


def test_noise_and_channels_that_stand_still_say_nothing_of_a_time_scale() -> None:
    run = recorded("random", 1, duration_s=60.0)
    rng = np.random.default_rng(0)
    noise = {k: rng.standard_normal(len(run.t_s)) for k in run.outputs}
    flat = {k: np.zeros(len(run.t_s)) for k in run.outputs}
    plant = HeaterPlant()
    for outputs in (noise, flat, {k: v * np.nan for k, v in flat.items()}):
        assert usual_correlation_time_s([run.with_columns(outputs=outputs)], plant) is None
    assert row_length_s([], plant) == PERIOD_S
    one = run.with_columns(outputs={**noise, "temp_l_degC": run.outputs["temp_l_degC"]})
    assert usual_correlation_time_s([one], plant) > 1.0


@pytest.mark.parametrize("begin_s", [0.0, 3600.0, 1.7e9])
@pytest.mark.parametrize("rate_hz", [100.0, 250.0, 500.0])
def test_rows_of_whole_samples_hold_as_many_at_each_whenever_the_clock_began(
    rate_hz: float, begin_s: float
) -> None:
    run = GapRun("r", begin_s + np.arange(6000) / rate_hz, {}, {})
    grid = Grid.of(run, 50 * run.dt_s)
    assert (np.diff(grid.starts) == 50).all()


@pytest.mark.parametrize("begin_s", [0.0, 3600.0, -7.0])
def test_a_clock_that_began_near_0_needs_no_more_than_the_usual_share(begin_s: float) -> None:
    rng = np.random.default_rng(1)
    run = GapRun("r", begin_s + np.cumsum(0.01 + 0.001 * rng.random(999)), {}, {})
    assert run.dt_s == float(np.median(np.diff(run.t_s)))
    before_edge_s = 0.1 * (3.0 - np.array([0.9e-9, 1.1e-9]))
    assert run.period_numbers(before_edge_s, 0.1, 1e-9).tolist() == [3, 2]


def test_steps_of_unix_time_that_are_all_different_have_their_median() -> None:
    run = GapRun("r", 1.7e9 + np.array([0.0, 0.01, 0.03]), {}, {})
    assert run.dt_s == pytest.approx(0.015, abs=1e-6)
