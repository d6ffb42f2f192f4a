"""Replay: the same plant in one call, sub-models alone on fed signals, many points in threads."""

import numpy as np
import pytest

from sim_device.plant import Drive, Inputs, Plant, Replay, load_parameters, simulate
from sim_device.plant.errors import InputError
from sim_device.plant.parameters import initial_detwinned
from sim_device.plant.replay import DRIVEN, OUTPUTS, drivers
from sim_device.plant.start import Start
from sim_device.plant.units import ZERO_C
from tests.sim_device.plant.cases import alternating

P = load_parameters("A")
QUIET = P.replace(**{name: 0.0 for name in P.names if name.startswith("noise_")})


@pytest.fixture(scope="module")
def inputs():
    return alternating(seconds=30.0)


@pytest.fixture(scope="module")
def whole(inputs):
    return simulate(P, inputs)


def still(start):
    """Five seconds in which nothing is driven, from a start."""
    return Inputs(np.linspace(0, 5, 51), np.zeros((51, 2)), np.zeros((51, 2)), start=start)


@pytest.mark.parametrize(
    "options", [{}, {"variant": "printed"}, {"cooling": "air"}, {"fixture": "blocked"}]
)
def test_a_replay_is_the_plant_to_the_last_bit_also_at_uneven_times(options):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.002, 0.03, 400))
    i_A, duty = rng.uniform(0, 4, (400, 2)), rng.uniform(0, 1, (400, 2))
    stage = np.linspace(0, 2e-3, 400)
    out = simulate(QUIET, Inputs(t, i_A, duty, stage_m=stage), **options)
    plant = Plant(QUIET, **options)
    for n in range(1, 400):
        drive = Drive(i_A=tuple(i_A[n]), pump_duty=tuple(duty[n]), stage_m=stage[n])
        plant.advance(drive, t[n] - t[n - 1])
        seen = plant.read()
        assert seen.displacement_m == out["displacement_m"][n]
        assert seen.force_N == out["force_N"][n]
        assert seen.rtd_degC[0] == out["rtd_x_degC"][n]
        assert seen.v_V[1] == out["v_y_V"][n]
        assert plant.truth.xi_S[0] == out["xi_S_x"][n]


def test_every_output_is_one_value_a_sample_and_can_be_asked_for_alone(inputs, whole):
    assert set(whole) == set(OUTPUTS)
    assert {values.shape for values in whole.values()} == {inputs.t_s.shape}
    some = simulate(P, inputs, outputs=("force_N", "T_x_K"))
    assert list(some) == ["force_N", "T_x_K"]
    np.testing.assert_array_equal(some["force_N"], whole["force_N"])


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"driver_lag": {"tau_s": 0.02}},
        {"driver_gain": {"gain": 0.05}, "driver_lag": {"tau_s": 0.004}},
        {"driver_saturation": {"deficit": 0.2, "y_share": 0.5}},
        {"current_offset": {}},
    ],
)
def test_the_drivers_alone_give_the_currents_of_the_whole_plant_to_the_last_bit(inputs, effects):
    replay = Replay(inputs)
    setup = replay.setup(P, effects)
    whole = replay.run_setup(setup, dt_s=3e-3)
    alone = drivers(inputs, setup, dt_s=3e-3)
    assert tuple(alone) == DRIVEN
    for name, current in alone.items():
        np.testing.assert_array_equal(current, whole[name])


def test_a_setup_gives_a_fresh_state_each_time(inputs):
    replay = Replay(inputs)
    setup = replay.setup(P)
    before = replay.run_setup(setup)
    warm = setup.state(310.0)
    warm[0].x.T_wire = 0.0
    assert setup.state(310.0)[0].x.T_wire == 310.0
    after = replay.run_setup(setup)
    for name, values in before.items():
        np.testing.assert_array_equal(values, after[name])


@pytest.mark.parametrize(
    "effect",
    [
        {},
        {"unified_kinetics": {}},
        {"cold_ends": {}},
        {"encoder_slip": {}},
        {"encoder_backlash": {}},
    ],
    ids=str,
)
@pytest.mark.parametrize("tension", [None, 1.3])
def test_a_pair_that_starts_elsewhere_rests_there_under_its_tension(effect, tension):
    away = -1.5e-3
    out = simulate(P, still(Start(displacement_m=away, tension_N=tension)), effects=effect)
    np.testing.assert_allclose(out["displacement_m"], away, rtol=1e-9)
    np.testing.assert_allclose(out["true_force_N"], tension or P["initial_force"], rtol=1e-9)
    reach = P["max_deflection"]
    assert out["xi_S_x"][0] - out["xi_S_y"][0] == pytest.approx(-2 * away / reach)
    middle = 0.5 * (out["xi_S_x"][0] + out["xi_S_y"][0])
    assert middle == pytest.approx(initial_detwinned(P, tension))


def test_a_pair_starts_no_further_away_than_its_springs_can_stand_when_all_is_martensite():
    out = simulate(P, still(Start(displacement_m=0.1)))
    assert 3.5e-3 < out["displacement_m"][0] < 5e-3
    assert out["xi_S_x"][0] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(out["displacement_m"], out["displacement_m"][0], rtol=1e-9)
    out = simulate(P, still(Start(tension_N=100.0)))
    assert out["xi_S_x"][0] == out["xi_S_y"][0] == pytest.approx(0.0, abs=1e-9)
    assert 1.4 < out["true_force_N"][0] < 1.5


def test_springs_start_as_warm_as_they_are_said_to_be_and_cool():
    out = simulate(P, still(Start(wires_K=(302.0, 300.5))))
    assert out["rtd_x_degC"][0] == pytest.approx(302.0 - ZERO_C, abs=0.02)
    assert out["rtd_y_degC"][0] == pytest.approx(300.5 - ZERO_C, abs=0.02)
    assert out["rtd_x_degC"][-1] < out["rtd_x_degC"][0]


def test_a_used_pair_starts_where_it_reads():
    """What its strokes have left is in temperatures, displacement and tension, and nowhere else."""
    dt_s, strokes = 0.1, 600
    i_A, duty = np.zeros((1000, 2)), np.zeros((1000, 2))
    for begin, spring in ((0, 1), (300, 0), (620, 1)):
        i_A[begin : begin + 90, spring] = 2.9
        duty[begin + 110 : begin + 270, spring] = 1.0
    times = dt_s * np.arange(1, 1001)
    whole = simulate(P, Inputs(times, i_A, duty))
    here = {name: column[strokes - 1] for name, column in whole.items()}
    reads = Start(
        displacement_m=here["displacement_m"],
        tension_N=here["force_N"],
        wires_K=(here["T_x_K"], here["T_y_K"]),
    )
    later = times[strokes:], i_A[strokes:], duty[strokes:]
    off = {}
    for start in (reads, Start()):
        replayed = simulate(P, Inputs(*later, start=start))["displacement_m"]
        off[start] = np.abs(replayed - whole["displacement_m"][strokes:]).max()
    assert off[reads] < 0.02e-3
    assert off[Start()] > 10.0 * off[reads]


def test_a_start_needs_the_pair_and_numbers_that_a_bench_can_be_at():
    with pytest.raises(InputError, match="antagonistic"):
        simulate(P, still(Start(displacement_m=1e-3)), fixture="blocked")
    for wrong in ({"displacement_m": np.nan}, {"tension_N": -1.0}, {"wires_K": (300.0, 27.0)}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            Start(**wrong)


def test_heat_takes_away_where_a_pair_has_started(inputs, whole):
    start = Start(displacement_m=2e-3)
    elsewhere = Inputs(inputs.t_s, inputs.i_A, inputs.pump_duty, start=start)
    off = simulate(P, elsewhere)["displacement_m"] - whole["displacement_m"]
    assert off[0] == pytest.approx(2e-3)
    assert abs(off[-1]) < 0.01 * off[0]


def test_feeding_back_the_plants_own_current_and_temperature_changes_nothing(inputs, whole):
    current = np.column_stack([whole["true_i_x_A"], whole["true_i_y_A"]])
    fed = simulate(P, inputs, feeds={"i_A": current})
    np.testing.assert_array_equal(fed["displacement_m"], whole["displacement_m"])
    T = np.column_stack([whole["T_x_K"], whole["T_y_K"]])
    fed = simulate(P, inputs, feeds={"temperature_K": T})
    np.testing.assert_allclose(fed["T_x_K"], whole["T_x_K"], atol=1e-12)
    np.testing.assert_allclose(fed["displacement_m"], whole["displacement_m"], atol=2e-5)


def test_fed_force_drives_the_kinetics_and_fed_displacement_gives_force_by_eq_9(inputs, whole):
    T = np.column_stack([whole["T_x_K"], whole["T_y_K"]])
    feeds = {"temperature_K": T, "force_N": whole["true_force_N"]}
    phase = simulate(P, inputs, feeds=feeds)
    np.testing.assert_allclose(phase["xi_S_x"], whole["xi_S_x"], atol=2e-3)
    np.testing.assert_allclose(phase["displacement_m"], whole["displacement_m"], atol=1e-4)
    feeds["displacement_m"] = whole["true_displacement_m"]
    mechanics = simulate(P, inputs, feeds=feeds)
    np.testing.assert_array_equal(mechanics["true_displacement_m"], whole["true_displacement_m"])
    np.testing.assert_allclose(mechanics["force_N"], whole["force_N"], atol=5e-3)


def test_fed_displacement_alone_holds_both_springs_at_their_lengths(inputs, whole):
    T = np.column_stack([whole["T_x_K"], whole["T_y_K"]])
    out = simulate(
        P,
        inputs,
        feeds={"temperature_K": T, "displacement_m": whole["true_displacement_m"]},
    )
    np.testing.assert_allclose(
        out["deflection_x_m"], P["initial_deflection"] - whole["true_displacement_m"], atol=1e-9
    )
    np.testing.assert_allclose(out["force_N"], whole["force_N"], atol=5e-3)


def test_a_fed_current_ignores_the_driver_but_a_command_does_not(inputs):
    gained = {"driver_gain": {"gain": 0.1}}
    commanded = simulate(P, inputs, effects=gained)
    fed = simulate(P, inputs, effects=gained, feeds={"i_A": inputs.i_A})
    np.testing.assert_allclose(commanded["i_x_A"][1:], 1.1 * inputs.i_A[1:, 0])
    np.testing.assert_allclose(fed["i_x_A"][1:], inputs.i_A[1:, 0])


def test_recorded_inlet_and_ambient_replace_those_of_the_set(inputs):
    n = inputs.t_s.size
    warm = Inputs(
        inputs.t_s,
        inputs.i_A,
        inputs.pump_duty,
        inlet_K=np.full(n, 303.0),
        ambient_K=np.linspace(300, 301, n),
    )
    out = simulate(P, warm)
    np.testing.assert_allclose(out["rtd_inlet_degC"], 29.85)
    assert out["rtd_ambient_degC"][-1] == pytest.approx(27.85)
    assert out["T_y_K"][-1] > simulate(P, inputs)["T_y_K"][-1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"t_s": [0.0, 0.01, 0.01]}, "increase at sample 2"),
        ({"t_s": []}, "empty"),
        ({"i_A": [[0, 0], [1, -1], [0, 0]]}, "i_A = -1.0 at sample 1"),
        ({"i_A": [[0, 0], [1, 1], [0, float("nan")]]}, "i_A = nan at sample 2"),
        ({"i_A": [[0, 0]]}, "shape"),
        ({"pump_duty": [[0, 0], [0, 0], [0, 1.5]]}, "pump_duty = 1.5 at sample 2"),
        ({"stage_m": [0.0, 5.0, 0.0]}, "stage_m"),
    ],
)
def test_wrong_inputs_are_refused_naming_sample_and_value(change, words):
    given = {"t_s": [0.0, 0.01, 0.02], "i_A": np.zeros((3, 2)), "pump_duty": np.zeros((3, 2))}
    with pytest.raises(InputError, match=words):
        Inputs(**{key: np.array(value, float) for key, value in {**given, **change}.items()})


def test_wrong_feeds_and_outputs_are_refused(inputs):
    with pytest.raises(InputError, match="feed 'pressure'"):
        simulate(P, inputs, feeds={"pressure": np.zeros(3)})
    with pytest.raises(InputError, match="force_N has shape"):
        simulate(P, inputs, feeds={"force_N": np.zeros(3)})
    with pytest.raises(InputError, match="output 'colour'"):
        simulate(P, inputs, outputs=("colour",))
    with pytest.raises(InputError, match="dt_s"):
        simulate(P, inputs, dt_s=0.0)
