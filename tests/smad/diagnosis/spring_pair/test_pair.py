"""The spring pair as a plant of the diagnosis."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sim_device.plant import load_parameters
from sim_device.plant.draws import draw
from sim_device.plant.models import read_model
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.plant import ModelPoint, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.spring_pair.signals import CHANNELS, _usable, run_from_columns
from tests.smad.diagnosis.cases import strong

PLANT, PRINTED = SmaPlant(), SmaPlant(variant="printed")
EXTENDED_EFFECTS = [e.name for e in PLANT.effects]


@cache
def clean() -> GapRun:
    """A run without noise or quanta."""
    return recorded("mixed", PLANT, ModelPoint({}), 3, noise=False, duration_s=40.0)


def test_the_model_run_on_its_own_inputs_gives_its_own_output() -> None:
    run = clean()
    found = PLANT.simulate(ModelPoint({}), run)
    assert found.keys() == run.outputs.keys()
    for name, measured in run.outputs.items():
        span = float(np.ptp(measured))
        assert float(np.max(np.abs(found[name] - measured))) <= 2e-3 * span + 1e-9, name


@pytest.mark.parametrize("name", ["rtd_lag", "tube_friction", "driver_lag", "minor_loop"])
def test_an_effect_at_zero_strength_changes_no_bit_of_any_channel(name: str) -> None:
    effect = next(e for e in PLANT.effects if e.name == name)
    run = clean().part(0, 1500)
    without = PLANT.simulate(ModelPoint({}), run)
    with_zero = PLANT.simulate(ModelPoint({}, {name: strong(effect, 0.0)}), run)
    assert all(np.array_equal(without[k], with_zero[k]) for k in without)


def test_the_library_depends_on_the_variant() -> None:
    assert "water_warming" in {e.name for e in PRINTED.effects}
    assert "water_warming" not in set(EXTENDED_EFFECTS)
    assert len(PLANT.effects) >= 25


def test_refit_bounds_reach_a_quarter_and_five_kelvin() -> None:
    for p in PLANT.parameters:
        assert p.low < p.nominal <= p.high
        if p.nominal == 0.0:
            continue
        if p.unit == "K":
            assert p.nominal - p.low >= 5.0 - 1e-9 <= p.high - p.nominal
        else:
            assert p.low <= 0.75 * p.nominal + 1e-12
        assert p.prior_sd < 0.5 * (p.high - p.low)


def test_a_point_that_is_not_physical_gives_nan_and_no_error() -> None:
    hot = PLANT.parameter_set["martensite_start"]
    found = PLANT.simulate(ModelPoint({"martensite_finish": hot + 1.0}), clean())
    assert all(np.isnan(v).all() for v in found.values())


def test_the_start_of_a_run_is_rest_and_regimes_are_found_by_side() -> None:
    run = clean()
    whole, x = PLANT.regimes(run, ""), PLANT.regimes(run, "X")
    assert whole["rest"][run.t_s < 3.5].all()
    assert not (whole["rest"] & whole["heating"]).any()
    assert 0.02 < x["heating"].mean() < whole["heating"].mean()
    assert whole["reversal"].any()
    assert whole["pump on"].any()


def test_columns_of_a_log_become_a_run_whose_gaps_do_not_count_once_it_is_admitted() -> None:
    n = 50
    columns = {c.name: np.ones(n) for c in CHANNELS if c.name != "force_N"}
    columns |= {"t_s": np.arange(n) * 0.01, "duty_x": np.zeros(n), "duty_y": np.zeros(n)}
    columns |= {"i_cmd_x_A": np.zeros(n), "i_cmd_y_A": np.zeros(n)}
    columns["i_applied_x_A"] = np.full(n, np.nan)
    columns["v_x_V"][10:13] = np.nan
    columns["force_N"] = np.full(n, np.nan)
    run = run_from_columns("a", columns)
    assert set(run.inputs) == {"i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y"}
    assert "force_N" not in run.outputs
    assert np.isnan(run.outputs["v_x_V"]).sum() == 3
    bridged, _, refused = _usable(run)
    assert not refused
    assert bridged.good.sum() == n - 3
    assert np.isfinite(bridged.outputs["v_x_V"]).all()


def test_a_model_file_from_before_the_shares_is_even(tmp_path: Path) -> None:
    path = tmp_path / "old.toml"
    path.write_text('format = "smad-model-1"\n[effects.rtd_lag]\ntau_s = 0.4\n', encoding="utf-8")
    assert PLANT.load_model(path).effects == {"rtd_lag": {"tau_s": 0.4, "y_share": 1.0}}


def test_a_model_file_goes_with_the_parameter_set_that_it_was_made_with(tmp_path: Path) -> None:
    point = ModelPoint({"film_scale": 1.1})
    of_a, of_b, of_file = (tmp_path / f"{name}.toml" for name in ("a", "b", "file"))
    set_b = SmaPlant(load_parameters("B"))
    made_up = SmaPlant(load_parameters("A").replace(resistivity=8.3e-7))
    for plant, path in ((PLANT, of_a), (set_b, of_b), (made_up, of_file)):
        plant.save_model(point, path, "")
        assert plant.load_model(path).theta["film_scale"] == 1.1
        assert read_model(path).parameters.digest() == plant.set_of(point.theta).digest()
    for plant, path, base in ((set_b, of_a, "A"), (PLANT, of_b, "B"), (made_up, of_b, "B")):
        with pytest.raises(PlantMismatch, match=f"another parameter set.*--params {base}"):
            plant.load_model(path)


def test_a_model_file_says_how_uncertain_its_values_are(tmp_path: Path) -> None:
    point = ModelPoint(
        {"film_scale": 1.1, "side_flow": 0.1, "displacement_zero": 0.2},
        {"rtd_lag": {"tau_s": 0.5, "y_share": 1.0}},
    )
    names = ("film_scale", "side_flow", "displacement_zero", "rtd_lag.tau_s")
    covariance = np.diag([0.04, 0.01, 0.0025, 0.09])
    covariance[0, 3] = covariance[3, 0] = 0.03
    path = tmp_path / "better.toml"
    PLANT.save_model(point, path, "", Uncertainty(names, covariance))
    known = read_model(path).covariance
    assert known is not None
    assert known.names == (
        "parameters.film_scale", "effects.uneven_flow.share", "mounting.displacement_zero_mm",
        "effects.rtd_lag.tau_s",
    )  # fmt: skip
    assert np.array_equal(known.matrix, covariance)
    drawn = draw(read_model(path), np.random.default_rng(1))
    assert drawn.effects["rtd_lag"]["tau_s"] != 0.5
    assert drawn.effects["uneven_flow"]["share"] != 0.1
    assert PLANT.load_model(path).theta["film_scale"] == 1.1
