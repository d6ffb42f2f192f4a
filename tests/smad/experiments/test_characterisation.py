"""Stretch, block test and resistance recover the parameters of a bench they do not know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_device.plant.parameters import load_parameters
from smad.experiments.campaign import CampaignResult, run_on
from smad.experiments.errors import ExperimentError
from smad.experiments.fig4_stretch import Curve, austenite, curve_of, martensite
from smad.experiments.fig5_block import Block, Branch, reverse_lines
from smad.experiments.recording import Recording
from smad.experiments.registry import make_experiment
from smad.experiments.resistance import resistivity

from .helpers import NOMINAL, driver, given

NAMES = ("resistance", "fig4-stretch", "fig5-block")
RECOVERED = {
    "resistivity",
    "modulus_martensite",
    "modulus_austenite",
    "stress_start",
    "stress_finish",
    "max_deflection",
    "austenite_start",
    "austenite_finish",
    "slope_austenite",
    "martensite_start",
    "slope_martensite",
}


@pytest.fixture(scope="module")
def campaign() -> CampaignResult:
    """The three on a bench of other parameters, analysed starting from the nominal set."""
    settings = {
        "fig4-stretch": {"rate_mm_per_s": 3.0, "settle_s": 5.0},
        "fig5-block": {"heating_K_per_s": 0.8, "bottom_degC": 38.0},
    }
    experiments = [make_experiment(name, settings.get(name)) for name in NAMES]
    return run_on(experiments, driver(given()), NOMINAL)


def test_every_parameter_is_recovered_within_its_tolerance(campaign: CampaignResult) -> None:
    assert {estimate.name for estimate in campaign.estimates} == RECOVERED
    missed = {
        estimate.name: (estimate.value, given()[estimate.name])
        for estimate in campaign.estimates
        if not estimate.holds(given()[estimate.name])
    }
    assert missed == {}


def test_the_nominal_values_would_not_have_passed(campaign: CampaignResult) -> None:
    passing = {
        estimate.name
        for estimate in campaign.estimates
        if replace(estimate, value=NOMINAL[estimate.name]).holds(given()[estimate.name])
    }
    assert passing == set()


def test_intervals_hold_the_value_and_are_narrower_than_the_tolerance(
    campaign: CampaignResult,
) -> None:
    for estimate in campaign.estimates:
        assert estimate.low <= estimate.value <= estimate.high
        tolerance = estimate.tolerance
        allowed = max(tolerance.share * estimate.value, tolerance.difference)
        assert 0.0 < estimate.high - estimate.low < 2.0 * allowed


def test_the_recovered_parameters_make_a_parameter_file_with_their_sources(
    campaign: CampaignResult, tmp_path: Path
) -> None:
    from sim_device.plant.parameters import parameters_text

    path = tmp_path / "recovered.toml"
    path.write_text(parameters_text(campaign.recovered), encoding="utf-8")
    read = load_parameters(path)
    for name in RECOVERED:
        assert read[name] == pytest.approx(campaign.recovered[name], rel=1e-9)
        assert read.entry(name).status == "derived"
        assert "95 % interval" in read.entry(name).source
    assert read.entry("coils").source == NOMINAL.entry("coils").source


def test_a_stretch_without_a_plateau_is_refused() -> None:
    delta = np.linspace(1e-3, 0.02, 200)
    with pytest.raises(ExperimentError, match="no detwinning plateau"):
        martensite(Curve(delta, 58.5 * delta, 26.85), NOMINAL)


def test_a_warm_stretch_without_a_linear_part_is_refused() -> None:
    delta = np.linspace(0.03, 0.05, 200)
    with pytest.raises(ExperimentError, match="no linear part"):
        austenite(Curve(delta, 116.0 * delta, 60.0), NOMINAL)


def test_a_block_test_that_never_transforms_is_refused() -> None:
    flat = Branch(np.linspace(300.0, 305.0, 100), np.full(100, 57e6))
    with pytest.raises(ExperimentError, match="too little transformation"):
        reverse_lines([Block(0.025, 57e6, flat, flat)] * 2, NOMINAL)


def test_a_resistance_without_steps_of_current_is_refused() -> None:
    n = 200
    columns = {
        f"{what}_{spring}_{unit}": np.full(n, value)
        for spring in "xy"
        for what, unit, value in (("i_meas", "A", 0.2), ("v", "V", 0.15), ("i_applied", "A", 0.2))
    }
    with pytest.raises(ExperimentError, match="did not change enough"):
        resistivity(Recording({"t_s": np.arange(n) * 0.01, **columns}, {}), NOMINAL)


def test_one_reading_that_is_lost_does_not_cost_a_stretch() -> None:
    displacement_mm = np.linspace(0.0, 95.0, 1000)
    displacement_mm[500] = np.nan
    columns = {name: np.ones(1000) for name in ("force_N", "rtd_x_degC")}
    columns |= {"t_s": np.arange(1.0, 1001.0), "displacement_mm": displacement_mm}
    curve = curve_of(Recording(columns, {"stretch": 0.0, "end": 1000.0}))
    assert np.isfinite(curve.deflection_m).all()
    assert curve.deflection_m[-1] == pytest.approx(0.095, abs=3e-4)
