"""Calorimetry: the file form, and the method on synthetic data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_device.plant.units import ZERO_C
from smad.experiments.dsc import estimates_of, instrument_lag, quantities
from smad.experiments.dsc_file import COLUMNS, DscData, read_dsc, synthetic_dsc
from smad.experiments.errors import DataFileError
from smad.experiments.registry import make_experiment

from .helpers import NOMINAL, NoDriver, given

ABOVE_K = 333.0


def dsc_text(data: DscData) -> str:
    """The data as a file that `read_dsc` reads."""
    lines = [
        f"# mass_mg = {data.mass_kg * 1e6:g}",
        f"# rate_K_per_min = {data.rate_K_per_s * 60.0:g}",
        ",".join((*COLUMNS, *(["baseline_mW"] if data.baseline_W is not None else []))),
    ]
    columns = [data.t_s, data.temperature_K - ZERO_C, data.heat_flow_W * 1e3]
    if data.baseline_W is not None:
        columns.append(data.baseline_W * 1e3)
    lines += [",".join(f"{value:.5f}" for value in row) for row in np.array(columns).T]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("seed", [0, 1])
def test_the_parameters_of_a_synthetic_sample_are_recovered(seed: int) -> None:
    found = estimates_of(synthetic_dsc(given(), seed=seed), ABOVE_K, seed)
    assert len(found) == 8
    assert [estimate.name for estimate in found if not estimate.holds(given()[estimate.name])] == []


def test_the_lag_of_the_instrument_is_found_and_taken_out() -> None:
    for lag_s in (1.0, 4.0):
        data = synthetic_dsc(NOMINAL, seed=5, lag_s=lag_s)
        assert instrument_lag(data) == pytest.approx(lag_s, abs=1.0)
        found = quantities(data, ABOVE_K)
        for name in ("austenite_start", "martensite_start"):
            assert found[name] == pytest.approx(NOMINAL[name], abs=0.3)


def test_without_an_empty_pan_there_is_no_heat_capacity() -> None:
    import dataclasses

    data = dataclasses.replace(synthetic_dsc(NOMINAL, seed=0), baseline_W=None)
    names = {estimate.name for estimate in estimates_of(data, ABOVE_K, 0)}
    assert "austenite_start" in names
    assert not any("capacity" in name for name in names)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    data = synthetic_dsc(NOMINAL, seed=2)
    path = tmp_path / "sample.csv"
    path.write_text(dsc_text(data), encoding="utf-8")
    read = read_dsc(path)
    assert read.mass_kg == pytest.approx(18e-6)
    assert read.rate_K_per_s == pytest.approx(5.0 / 60.0)
    assert np.allclose(read.heat_flow_W, data.heat_flow_W, atol=1e-8)


def test_the_experiment_reads_the_file_and_moves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "sample.csv"
    path.write_text(dsc_text(synthetic_dsc(given(), seed=2)), encoding="utf-8")
    findings = make_experiment("dsc", {"file": str(path)}).run(NoDriver(), NOMINAL)
    by_name = {estimate.name: estimate for estimate in findings.estimates}
    assert by_name["austenite_finish"].holds(given()["austenite_finish"])
    assert not by_name["austenite_finish"].holds(NOMINAL["austenite_finish"])


GOOD = dsc_text(synthetic_dsc(NOMINAL, seed=2))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (GOOD.replace("# mass_mg = 18\n", ""), "mass_mg"),
        (GOOD.replace("# mass_mg = 18", "# mass_mg = -18"), "positive"),
        (GOOD.replace("heat_flow_mW", "heat"), "heat_flow_mW"),
        ("\n".join(GOOD.splitlines()[:50]), "too short"),
        (GOOD.replace("\n1.00000,", "\nabc,", 1), "table line 3"),
        (GOOD.replace("\n1.00000,", "\nnan,", 1), "table line 3"),
        ("", "mass_mg"),
    ],
)
def test_a_file_of_another_form_is_refused_with_what_is_wrong(
    tmp_path: Path, text: str, says: str
) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataFileError, match=says) as refused:
        read_dsc(path)
    assert len(str(refused.value).splitlines()) == 1


def test_a_missing_file_is_refused_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=r"nowhere\.csv"):
        read_dsc(tmp_path / "nowhere.csv")


def test_a_file_without_a_peak_is_refused() -> None:
    flat = synthetic_dsc(NOMINAL.replace(latent_heating=0.0, latent_cooling=0.0), seed=1)
    with pytest.raises(DataFileError, match="no peak"):
        quantities(flat, ABOVE_K)
