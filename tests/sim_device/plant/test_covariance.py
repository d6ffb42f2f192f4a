"""What is uncertain in a model file, and plants drawn from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_device.plant.covariance import Covariance
from sim_device.plant.draws import draw, draw_between
from sim_device.plant.errors import ModelError
from sim_device.plant.laws import Law, Term
from sim_device.plant.models import read_model, save_model

NAMES = ("parameters.martensite_start", "effects.rtd_lag.tau_s", "mounting.side_resistance")
MATRIX = np.array([[0.25, 0.05, 0.0], [0.05, 0.04, 0.001], [0.0, 0.001, 0.0004]])


def saved(path: Path, matrix: np.ndarray = MATRIX) -> Path:
    save_model(
        path,
        effects={"rtd_lag": {"tau_s": 0.8}},
        covariance=Covariance(NAMES, matrix),
    )
    return path


@pytest.mark.parametrize("suffix", ["toml", "json"])
def test_a_covariance_is_read_as_it_was_written(tmp_path: Path, suffix: str) -> None:
    read = read_model(saved(tmp_path / f"better.{suffix}")).covariance
    assert read is not None
    assert read.names == NAMES
    assert np.array_equal(read.matrix, MATRIX)


def test_draws_have_the_mean_and_the_covariance_of_the_file(tmp_path: Path) -> None:
    model = read_model(saved(tmp_path / "better.toml"))
    rng = np.random.default_rng(2)
    drawn = [draw(model, rng) for _ in range(400)]
    values = np.array(
        [
            [
                m.parameters["martensite_start"],
                m.effects["rtd_lag"]["tau_s"],
                m.mounting["side_resistance"],
            ]
            for m in drawn
        ]
    )
    mean = [model.parameters["martensite_start"], 0.8, 0.0]
    deviation = np.sqrt(np.diag(MATRIX))
    assert np.all(np.abs(values.mean(axis=0) - mean) < 4.0 * deviation / 20.0)
    correlations = np.cov(values.T) / np.outer(deviation, deviation)
    assert np.allclose(correlations, MATRIX / np.outer(deviation, deviation), atol=0.25)


def test_a_draw_is_the_same_for_the_same_seed_and_keeps_to_the_ranges(tmp_path: Path) -> None:
    model = read_model(saved(tmp_path / "wide.toml", MATRIX * 100.0))
    drawn = [draw(model, np.random.default_rng(seed)) for seed in range(30)]
    again = [draw(model, np.random.default_rng(seed)) for seed in range(30)]
    lags = [m.effects["rtd_lag"]["tau_s"] for m in drawn]
    assert lags == [m.effects["rtd_lag"]["tau_s"] for m in again]
    assert min(lags) == 0.0
    starts = [m.parameters["martensite_start"] for m in drawn]
    assert all(m.parameters["martensite_finish"] < m.parameters["martensite_start"] for m in drawn)
    assert np.std(starts) > 0.5


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('names = ["parameters.nothing"]\nmatrix = [[1.0]]', "no value 'parameters.nothing'"),
        ('names = ["effects.rtd_lag.tau_s"]\nmatrix = [[1.0]]', "no value 'effects.rtd_lag.tau_s'"),
        ('names = ["parameters.resistivity"]\nmatrix = [[-1.0]]', "is negative"),
        ('names = ["parameters.resistivity"]\nmatrix = [[nan]]', "not finite"),
        ('names = ["parameters.resistivity"]\nmatrix = [["1"]]', "numbers only"),
        ('names = ["parameters.resistivity"]\nmatrix = []', "a row for each name"),
        ("names = []\nmatrix = []", "names must be given"),
        (
            'names = ["parameters.resistivity", "parameters.density"]\n'
            "matrix = [[1.0], [2.0, 1.0]]",
            "not positive semi-definite",
        ),
        (
            'names = ["parameters.resistivity", "parameters.density"]\n'
            "matrix = [[1.0, 0.5], [0.2, 1.0]]",
            "must be symmetric",
        ),
        ('names = ["parameters.resistivity"]\nmatrix = [[1.0]]\nextra = 1', "unknown key 'extra'"),
    ],
)
def test_a_covariance_that_is_none_is_refused_in_a_line(
    tmp_path: Path, table: str, said: str
) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(f'format = "smad-model-1"\n[covariance]\n{table}\n')
    with pytest.raises(ModelError, match=r"bad\.toml: covariance") as refused:
        read_model(path)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_model_without_a_covariance_cannot_be_drawn_from(tmp_path: Path) -> None:
    save_model(tmp_path / "plain.toml")
    with pytest.raises(ModelError, match="nothing to draw from"):
        draw(read_model(tmp_path / "plain.toml"), np.random.default_rng(0))


def test_ranges_by_hand_may_name_an_effect_that_the_model_is_without(tmp_path: Path) -> None:
    save_model(tmp_path / "plain.toml")
    model = read_model(tmp_path / "plain.toml")
    rng = np.random.default_rng(1)
    drawn = draw_between(
        model, {"effects.rtd_lag.tau_s": (0.2, 0.4), "parameters.film_scale": (0.8, 1.2)}, rng
    )
    assert 0.2 <= drawn.effects["rtd_lag"]["tau_s"] <= 0.4
    assert 0.8 <= drawn.parameters["film_scale"] <= 1.2
    with pytest.raises(ModelError, match=r"no value 'parameters\.nothing'"):
        draw_between(model, {"parameters.nothing": (0.0, 1.0)}, rng)


def test_coefficients_of_laws_are_drawn_with_the_rest(tmp_path: Path) -> None:
    warmer = Law("heat_into_wire", "x", (Term(name="constant", coefficient=0.3),))
    (name,) = warmer.names
    path = tmp_path / "better.toml"
    save_model(path, laws=(warmer,), covariance=Covariance((name,), np.array([[0.01]])))
    model = read_model(path)
    rng = np.random.default_rng(3)
    drawn = [draw(model, rng).laws[0].terms[0].coefficient for _ in range(300)]
    assert np.mean(drawn) == pytest.approx(0.3, abs=0.02)
    assert np.std(drawn) == pytest.approx(0.1, abs=0.02)
