"""The plant sample by sample: readings, noise, environment, drain, and what it refuses."""

import math

import numpy as np
import pytest

from sim_device.plant import Drive, Plant, load_parameters
from sim_device.plant.errors import InputError, ModelError, SolverError

P = load_parameters("A")
QUIET = P.replace(**{name: 0.0 for name in P.names if name.startswith("noise_")})


def run(plant, drive, seconds, dt_s=0.01):
    for _ in range(round(seconds / dt_s)):
        plant.advance(drive, dt_s)
    return plant


def test_at_rest_the_readings_are_those_of_the_mounted_pair():
    seen = Plant(QUIET).read()
    assert seen.displacement_m == 0.0
    assert seen.force_N == P["initial_force"]
    assert seen.rtd_degC == pytest.approx((26.85,) * 4)
    assert seen.i_A == (0.0, 0.0)
    assert seen.v_V == (0.0, 0.0)
    assert seen.supply_V == P["supply_voltage"]


def test_heating_x_pulls_towards_x_and_shows_on_all_its_sensors():
    plant = run(Plant(QUIET), Drive(i_A=(3.0, 0.0)), 8.0)
    seen, truth = plant.read(), plant.truth
    assert seen.displacement_m > 5e-3
    assert seen.displacement_m == truth.displacement_m
    assert seen.rtd_degC[0] == pytest.approx(truth.T_K[0] - 273.15)
    assert seen.v_V[0] == pytest.approx(3.0 * truth.resistance_Ohm[0])
    assert truth.resistance_Ohm[0] == pytest.approx(0.758, rel=1e-3)
    assert seen.supply_V < P["supply_voltage"]
    assert sum(truth.deflection_m) == pytest.approx(2 * P["initial_deflection"])


def test_noise_comes_from_the_seed_and_has_the_width_of_the_file():
    readings = [Plant(P, seed=5).read() for _ in range(2)]
    assert readings[0] == readings[1]
    assert Plant(P, seed=6).read() != readings[0]
    plant = Plant(P, seed=7)
    forces = np.array([plant.read().force_N for _ in range(4000)])
    assert forces.std() == pytest.approx(P["noise_force"], rel=0.1)
    assert forces.mean() == pytest.approx(P["initial_force"], abs=2e-4)


def test_reading_does_not_disturb_the_plant():
    watched, unwatched = Plant(P, seed=1), Plant(P, seed=1)
    for _ in range(100):
        watched.read()
        watched.advance(Drive(i_A=(2.0, 0.0)), 0.01)
        unwatched.advance(Drive(i_A=(2.0, 0.0)), 0.01)
    assert watched.truth == unwatched.truth


def test_substeps_are_at_most_a_millisecond_unless_asked_otherwise():
    fine = run(Plant(QUIET), Drive(i_A=(3.0, 0.0)), 4.0, dt_s=0.1)
    coarse = run(Plant(QUIET, max_step_s=0.1), Drive(i_A=(3.0, 0.0)), 4.0, dt_s=0.1)
    same = run(Plant(QUIET, max_step_s=1e-3), Drive(i_A=(3.0, 0.0)), 4.0, dt_s=0.01)
    assert fine.truth.displacement_m == pytest.approx(same.truth.displacement_m, abs=1e-9)
    assert coarse.truth != fine.truth


def test_drained_water_lets_the_wire_heat_faster_and_the_pump_refills_it():
    drained = run(Plant(QUIET), Drive(drain=(True, False)), 5.0)
    assert drained.truth.fill[0] == pytest.approx(P["drain_film"], abs=0.01)
    assert drained.truth.fill[1] == 1.0
    wet = run(Plant(QUIET), Drive(), 5.0)
    for plant in (drained, wet):
        run(plant, Drive(i_A=(2.0, 0.0), drain=(plant is drained, False)), 2.0)
    assert drained.truth.T_K[0] - 300 > 2.0 * (wet.truth.T_K[0] - 300)
    run(drained, Drive(pump_duty=(1.0, 0.0)), 6.0)
    assert drained.truth.fill[0] == 1.0


def test_a_running_pump_wins_over_the_drain():
    plant = run(Plant(QUIET), Drive(pump_duty=(1.0, 0.0), drain=(True, False)), 3.0)
    assert plant.truth.fill[0] == 1.0


def test_flow_follows_the_duty():
    plant = run(Plant(QUIET), Drive(pump_duty=(0.5, 1.0)), 0.1)
    assert plant.truth.flow_m3_s == pytest.approx((0.5 * P["flow_max"], P["flow_max"]))


def test_more_flow_cools_faster_and_still_water_cools_more_than_air():
    left = {}
    for name, duty, cooling in (
        ("full", 1.0, "water"),
        ("half", 0.5, "water"),
        ("still", 0.0, "water"),
        ("air", 0.0, "air"),
    ):
        plant = Plant(QUIET, cooling=cooling, temperature_K=330.0)
        run(plant, Drive(pump_duty=(duty, 0.0)), 4.0)
        left[name] = plant.truth.T_K[0] - 300.0
    assert left["full"] < left["half"] < left["still"]
    assert left["air"] > left["full"]


def test_the_environment_can_change_during_a_run():
    plant = Plant(QUIET)
    plant.set_environment(inlet_K=295.0, ambient_K=302.0)
    run(plant, Drive(pump_duty=(1.0, 1.0)), 60.0)
    assert plant.truth.T_K[0] == pytest.approx(295.0, abs=0.5)
    assert plant.read().rtd_degC[2:] == pytest.approx((21.85, 28.85))
    with pytest.raises(InputError, match="finite"):
        plant.set_environment(inlet_K=math.nan)


def test_the_stage_moves_the_stretched_spring_and_not_the_pair():
    pulled = Plant(QUIET, fixture="stretch")
    assert pulled.read().force_N == 0.0
    run(pulled, Drive(stage_m=10e-3), 0.1)
    assert pulled.read().displacement_m == 10e-3
    assert pulled.read().force_N == pytest.approx(0.585, rel=5e-3)
    pair = run(Plant(QUIET), Drive(stage_m=10e-3), 0.1)
    assert pair.read().force_N == pytest.approx(P["initial_force"])


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        (Drive(i_A=(-1.0, 0.0)), "currents"),
        (Drive(i_A=(math.nan, 0.0)), "currents"),
        (Drive(i_A=(math.inf, 0.0)), "currents"),
        (Drive(pump_duty=(0.0, 1.2)), "duties"),
        (Drive(pump_duty=(0.0, math.nan)), "duties"),
        (Drive(stage_m=math.nan), "stage_m"),
    ],
)
def test_a_drive_that_is_not_physical_is_refused_and_changes_nothing(drive, words):
    plant = Plant(QUIET)
    before = plant.truth
    with pytest.raises(InputError, match=words):
        plant.advance(drive, 0.01)
    assert plant.truth == before
    plant.advance(Drive(), 0.01)


@pytest.mark.parametrize("dt_s", [0.0, -0.01, math.nan, math.inf])
def test_a_sample_needs_a_positive_duration(dt_s):
    with pytest.raises(InputError, match="dt_s"):
        Plant(QUIET).advance(Drive(), dt_s)


@pytest.mark.parametrize(
    "options", [{"variant": "real"}, {"fixture": "glued"}, {"cooling": "nitrogen"}]
)
def test_an_unknown_option_is_refused_with_the_known_ones(options):
    with pytest.raises(ModelError, match="use one of"):
        Plant(QUIET, **options)


def test_a_solver_that_gives_up_says_at_which_time_and_state():
    plant = run(Plant(QUIET), Drive(i_A=(1.0, 0.0)), 1.0)
    with pytest.raises(SolverError) as error:
        plant.advance(Drive(i_A=(1e200, 0.0)), 0.01)
    assert 1.0 < error.value.time_s < 1.02
    for word in ("t = 1", "T_x_K", "force_N", "displacement_m"):
        assert word in str(error.value)
