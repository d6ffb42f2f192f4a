"""How long a row and a cell are follows from how fast the records say that a bench is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smad.gap import Settings, diagnose
from smad.gap.records import Outcome

from smad.diagnosis.data.grid import Grid
from smad.diagnosis.data.scales import correlation_time_s, suited
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, SHOWN
from tests.smad.gap.heater_plant import HeaterPlant, recorded


@pytest.mark.parametrize("family", ["random", "sines", "still"])
def test_a_bench_of_seconds_keeps_the_rows_that_it_has_always_had(family: str) -> None:
    runs = [recorded(family, seed, duration_s=60.0) for seed in (1, 2)]
    assert suited(Settings(), runs, HeaterPlant()) == Settings()


def slowed(run: GapRun, factor: float) -> GapRun:
    return replace(run, t_s=run.t_s * factor)


@pytest.mark.parametrize(("factor", "period_s"), [(10.0, 1.0), (100.0, 10.0), (0.1, 0.01)])
def test_rows_cells_and_the_least_length_go_with_the_time_scale(
    factor: float, period_s: float
) -> None:
    runs = [slowed(recorded("random", 1, duration_s=60.0), factor)]
    found, usual = suited(Settings(), runs, HeaterPlant()), Settings()
    assert found.period_s == pytest.approx(period_s)
    assert found.block_s / found.period_s == pytest.approx(usual.block_s / usual.period_s)
    assert found.min_duration_s / found.period_s == pytest.approx(80.0)
    others = {"period_s": 0.1, "block_s": 5.0, "min_duration_s": 8.0}
    assert replace(found, **others) == usual


def test_a_row_is_no_shorter_than_a_sample() -> None:
    run = recorded("random", 1, duration_s=60.0)
    few = replace(
        run.part(0, 0),
        t_s=run.t_s[::20],
        inputs={k: v[::20] for k, v in run.inputs.items()},
        outputs={k: v[::20] for k, v in run.outputs.items()},
    )
    found = suited(Settings(), [few], HeaterPlant())
    assert found.period_s == pytest.approx(20 * run.dt_s, rel=1e-5)
    assert found.block_s == pytest.approx(50 * found.period_s)
    assert len(Grid.of(few, found.period_s).t_s) == len(few.t_s)


def test_noise_and_channels_that_stand_still_say_nothing_of_a_time_scale() -> None:
    run = recorded("random", 1, duration_s=60.0)
    rng = np.random.default_rng(0)
    noise = {k: rng.standard_normal(len(run.t_s)) for k in run.outputs}
    flat = {k: np.zeros(len(run.t_s)) for k in run.outputs}
    plant = HeaterPlant()
    for outputs in (noise, flat, {k: v * np.nan for k, v in flat.items()}):
        assert correlation_time_s([run.with_columns(outputs=outputs)], plant) is None
    assert suited(Settings(), [], plant) == Settings()
    one = run.with_columns(outputs={**noise, "temp_l_degC": run.outputs["temp_l_degC"]})
    assert correlation_time_s([one], plant) > 1.0


def test_the_report_says_what_rows_and_cells_were() -> None:
    run = recorded("random", 1, OTHER, {"driver_gain": SHOWN["driver_gain"]}, duration_s=50.0)
    found = diagnose([run], plant=HeaterPlant())
    assert found.verdict.outcome is Outcome.EFFECT
    assert any("averaged over 0.1 s" in text for text in found.limits)
    assert found.settings["block_s"] == 5.0
