"""The plant behaves as the bench does: the published facts, in kind."""

import numpy as np
import pytest
from numpy.typing import NDArray

from evaluation.plant.effects import magnitudes
from evaluation.plant.kernel import constant_inputs, simulate
from evaluation.plant.layout import COLUMNS, PLAY, PLAYS
from evaluation.plant.parameters import NAMES, Bench, another_bench
from evaluation.plant.phase import martensite

Array = NDArray[np.float64]
DT = 0.01
WARM = 48.85  # °C, the 322 K of the published heating run


@pytest.fixture(scope="module")
def slow_heating() -> dict[str, Array]:
    """X at 1 A in static water, then its pump."""
    heating = constant_inputs(170.0, DT, i_x=1.0)
    cooling = constant_inputs(30.0, DT, duty_x=1.0)
    return simulate(Bench(), np.vstack([heating, cooling]), DT, magnitudes())


def _first(values: Array, reached: NDArray[np.bool_]) -> float:
    assert reached.any()
    return float(np.argmax(reached)) * DT


def test_one_ampere_reaches_322_kelvin_in_about_two_minutes(
    slow_heating: dict[str, Array],
) -> None:
    t = slow_heating["T_x_degC"]
    assert 110.0 < _first(t, t > WARM) < 170.0


def test_four_ampere_reach_322_kelvin_in_some_seconds() -> None:
    out = simulate(Bench(), constant_inputs(10.0, DT, i_x=4.0), DT, magnitudes())
    assert 3.5 < _first(out["T_x_degC"], out["T_x_degC"] > WARM) < 6.0


def test_the_pair_moves_ten_millimetres_at_the_published_force(
    slow_heating: dict[str, Array],
) -> None:
    hot = 16999
    assert slow_heating["true_mm"][hot] == pytest.approx(10.0, abs=0.5)
    assert slow_heating["true_force_N"][hot] == pytest.approx(1.743, abs=0.05)
    assert slow_heating["true_mm"][100] == pytest.approx(0.0, abs=0.05)
    assert slow_heating["true_force_N"][100] == pytest.approx(1.24, abs=0.02)


def test_the_antagonist_meets_its_martensite_curve_at_a_quarter_of_the_fraction(
    slow_heating: dict[str, Array],
) -> None:
    turning = slow_heating["turned_y"] > slow_heating["turned_y"][0] + 1e-4
    assert slow_heating["xi_x"][np.argmax(turning)] == pytest.approx(0.27, abs=0.05)


def test_the_pump_cools_in_seconds_what_air_does_not_in_minutes(
    slow_heating: dict[str, Array],
) -> None:
    cooling = slow_heating["T_x_degC"][17000:]
    pumped = _first(cooling, cooling < 31.85)
    assert 4.0 < pumped < 9.0
    still = np.vstack([constant_inputs(5.0, DT, i_x=4.0), constant_inputs(60.0, DT)])
    alone = simulate(Bench(), still, DT, magnitudes())["T_x_degC"]
    assert alone[-1] > 35.0


def test_after_cooling_the_pair_keeps_a_little_travel_and_force(
    slow_heating: dict[str, Array],
) -> None:
    assert slow_heating["true_mm"][-1] == pytest.approx(1.2, abs=1.0)
    assert slow_heating["true_force_N"][-1] == pytest.approx(1.228, abs=0.06)


def test_the_reverse_stroke_mirrors_the_first_one() -> None:
    stroke = [
        constant_inputs(5.2, DT, i_x=4.0),
        constant_inputs(15.0, DT, duty_x=1.0),
        constant_inputs(5.2, DT, i_y=4.0),
    ]
    out = simulate(Bench(), np.vstack(stroke), DT, magnitudes())
    assert out["true_mm"].max() > 9.0
    assert out["true_mm"][-1] < -9.0


def _along(temperatures: list[float]) -> tuple[float, Array]:
    """Fraction and plays after a path of temperatures, stress-free, from all martensite."""
    p = Bench().vector()
    plays = np.zeros(PLAY + PLAYS)
    plays[PLAY:] = 1.0
    fraction = 1.0
    for temperature in temperatures:
        after = np.zeros(PLAYS)
        fraction, _ = martensite(plays, temperature, 7.0, 0.0, p, after)
        plays[PLAY:] = after
    return fraction, plays[PLAY:].copy()


def test_minor_loops_close_and_are_forgotten() -> None:
    """Return-point memory and wiping out, the two marks of a Preisach operator."""
    before, plays = _along([41.0])
    inside, _ = _along([41.0, 32.0])
    again, after = _along([41.0, 32.0, 38.0, 33.5, 41.0])
    assert 0.1 < before < 0.9
    assert inside > before + 0.1
    assert again == before
    assert (after == plays).all()


def test_heat_goes_only_where_it_is_put() -> None:
    out = simulate(Bench(), constant_inputs(60.0, DT, i_x=1.5), DT, magnitudes())
    assert np.abs(out["T_y_degC"] - 26.85).max() < 1e-9


def test_energy_in_is_energy_kept_and_lost() -> None:
    bench = Bench()
    out = simulate(bench, constant_inputs(20.0, DT, i_x=2.0), DT, magnitudes())
    joule = float(np.sum(out["v_x_V"] * out["i_meas_x_A"]) * DT)
    stored = bench.wire_J_K * (out["T_x_degC"][-1] - 26.85)
    stored += bench.water_J_K * (out["water_x_degC"][-1] - 26.85)
    stored += bench.latent_J * (1.0 - out["xi_x"][-1])
    warmth = np.maximum(out["water_x_degC"] - 26.85, 0.0)
    lost = float(np.sum(bench.loss_W_K * warmth * (np.maximum(warmth, 0.2) / 15) ** 0.12) * DT)
    assert stored + lost == pytest.approx(joule, rel=0.01)


def test_halving_the_tick_changes_nothing_that_could_be_measured() -> None:
    fast = constant_inputs(5.0, 0.005, i_x=4.0)
    slow = constant_inputs(5.0, DT, i_x=4.0)
    a = simulate(
        Bench(), np.vstack([fast, constant_inputs(5.0, 0.005, duty_x=1.0)]), 0.005, magnitudes()
    )
    b = simulate(Bench(), np.vstack([slow, constant_inputs(5.0, DT, duty_x=1.0)]), DT, magnitudes())
    assert np.abs(a["T_x_degC"][1::2] - b["T_x_degC"]).max() < 0.25
    assert np.abs(a["true_mm"][1::2] - b["true_mm"]).max() < 0.2


def test_every_bench_is_off_in_every_constant_that_may_differ() -> None:
    nominal = Bench()
    bench = another_bench(np.random.default_rng(1))
    same = {n for n in NAMES if getattr(bench, n) == getattr(nominal, n)}
    assert same == {"stress_MPa_N", "loss_power", "conduction_W_K", "driver_lag_s", "supply_V",
                    "supply_ohm", "turn_power"}  # fmt: skip
    ratio = bench.latent_J / nominal.latent_J
    assert 0.03 <= abs(ratio - 1.0) <= 0.10
    assert another_bench(np.random.default_rng(1)) == bench


def test_a_run_gives_every_column() -> None:
    out = simulate(Bench(), constant_inputs(0.5, DT), DT, magnitudes())
    assert set(out) == set(COLUMNS)
    assert all(np.isfinite(values).all() for values in out.values())
