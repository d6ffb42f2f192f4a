"""Forcing at places of the model: nothing where it is zero, and what each place does."""

import numpy as np
import pytest

from sim_device.plant import Replay, kernel, load_parameters, simulate
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.errors import InputError
from sim_device.plant.kernel import forcing as slots
from sim_device.plant.places import PLACES, SLOTS, STATE_NAMES, keys_of, place
from sim_device.plant.replay import OUTPUTS, TRAJECTORY, trajectory
from tests.sim_device.plant.cases import alternating
from tests.sim_device.plant.law_terms import as_forcing

P = load_parameters("A")
RUN = alternating(seconds=32.0)
N = RUN.t_s.size
CHANNELS = (
    "i_x_A", "i_y_A", "v_x_V", "v_y_V", "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC",
    "rtd_ambient_degC", "displacement_m", "force_N",
)  # fmt: skip
READINGS = [entry for entry in PLACES if entry.reading]


@pytest.fixture(scope="module")
def plain():
    return simulate(P, RUN)


def pushed(name, side, size=None, **options):
    series = np.full(N, place(name).scale if size is None else size)
    return simulate(P, RUN, forcing={(name, side): series}, **options)


def test_the_slots_of_the_kernel_are_those_of_the_table():
    assert len(SLOTS) == kernel.FORCED_SLOTS
    assert min(SLOTS[entry.name, entry.sides[0]] for entry in READINGS) == slots.FIRST_READING
    named = {
        "heat_into_wire": slots.HEAT_WIRE, "heat_into_water": slots.HEAT_WATER,
        "film": slots.FILM, "flow_before_pump": slots.FLOW_BEFORE,
        "flow_behind_pump": slots.FLOW_BEHIND, "transformation_shift": slots.SHIFT,
        "recoverable_strain": slots.STRAIN, "driven_current": slots.CURRENT,
        "resistance": slots.RESISTANCE, "force_cell_on_x": slots.CELL_ON_X,
        "force_cell_on_y": slots.CELL_ON_Y, "inlet_water": slots.INLET, "ambient_air": slots.AIR,
    }  # fmt: skip
    for name, slot in named.items():
        assert SLOTS[name, place(name).sides[0]] == slot
    assert STATE_NAMES[slots.VELOCITY] == "velocity"
    assert {entry.name for entry in PLACES} == named.keys() | {entry.name for entry in READINGS}


def test_a_forcing_of_zero_leaves_every_output_as_it_is_to_the_last_bit(plain):
    forcing = {key: np.zeros(N) for key in SLOTS}
    # One that is zero throughout is left out: this one runs through the kernel.
    late = {key: np.r_[np.zeros(N - 1), 1e-3] for key in SLOTS}
    zero, ends = (simulate(P, RUN, forcing=given) for given in (forcing, late))
    for name in OUTPUTS:
        assert np.array_equal(plain[name], zero[name]), name
        assert np.array_equal(plain[name][:-1], ends[name][:-1]), name


@pytest.mark.parametrize("entry", PLACES, ids=lambda entry: entry.name)
def test_a_place_touches_the_channels_that_it_claims_on_its_side(plain, entry):
    for side in entry.sides:
        result = pushed(entry.name, side)
        moved = {c for c in CHANNELS if not np.array_equal(result[c], plain[c])}
        assert set(entry.channels_of(side)) <= moved
        if entry.reading:
            assert moved == set(entry.channels_of(side))
            (channel,) = moved
            assert result[channel] - plain[channel] == pytest.approx(entry.scale, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "output", "sign"),
    [
        ("heat_into_wire", "T_x_K", 1),
        ("heat_into_water", "T_water_x_K", 1),
        ("flow_before_pump", "flow_x_m3_s", 1),
        ("flow_behind_pump", "flow_x_m3_s", 1),
        ("driven_current", "true_i_x_A", 1),
        ("resistance", "resistance_x_Ohm", 1),
        ("recoverable_strain", "true_force_N", -1),
        ("recoverable_strain", "true_displacement_m", -1),
        ("transformation_shift", "true_displacement_m", -1),
        ("film", "T_water_x_K", 1),
    ],
)
def test_more_at_a_place_of_x_moves_what_it_should_in_the_right_direction(
    plain, name, output, sign
):
    moved = sign * (pushed(name, "x")[output] - plain[output])
    assert moved.max() > 0.0
    assert np.abs(np.minimum(moved, 0.0)).max() < 0.5 * moved.max()


@pytest.mark.parametrize(("name", "side"), [("force_cell_on_x", "x"), ("force_cell_on_y", "y")])
def test_a_force_between_the_springs_is_what_x_pulls_more_and_its_cell_reads_its_side(name, side):
    result = pushed(name, "both", 0.05)
    apart = result["spring_force_x_N"] - result["spring_force_y_N"]
    assert apart[1:] == pytest.approx(0.05, abs=1e-9)
    assert result["force_N"][1:] == pytest.approx(result[f"spring_force_{side}_N"][1:], abs=1e-9)


def test_a_series_for_both_sides_is_that_series_on_each():
    wave = 0.3 * np.sin(RUN.t_s)
    each = dict.fromkeys(keys_of("heat_into_wire", "both"), wave)
    one = simulate(P, RUN, forcing={("heat_into_wire", "both"): wave})
    two = simulate(P, RUN, forcing=each)
    assert all(np.array_equal(one[name], two[name]) for name in OUTPUTS)


@pytest.mark.parametrize("name", ["driver_lag", "phase_resistivity"])
def test_a_forced_current_does_not_add_up_in_the_memory_of_an_effect(name):
    result = pushed("driven_current", "x", 0.1, effects={name: {}})
    without = simulate(P, RUN, effects={name: {}})
    assert result["true_i_x_A"][1:] - without["true_i_x_A"][1:] == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize(
    ("forcing", "words"),
    [
        ({("warp", "x"): np.zeros(N)}, "place 'warp' is unknown"),
        ({("film", "z"): np.zeros(N)}, "place film has no side 'z'"),
        ({("reading_force", "x"): np.zeros(N)}, "has no side 'x'"),
        ({("film", "x"): np.zeros(3)}, r"forcing of film.x has shape \(3,\)"),
        ({("film", "x"): np.full(N, np.nan)}, "forcing of film.x = nan"),
    ],
)
def test_a_forcing_that_cannot_be_is_refused_with_the_reason(forcing, words):
    with pytest.raises(InputError, match=words):
        simulate(P, RUN, forcing=forcing)


def test_a_plant_without_a_place_says_what_the_place_needs():
    forcing = {("heat_into_water", "x"): np.ones(N)}
    with pytest.raises(InputError, match="heat_into_water needs variant extended"):
        simulate(P, RUN, variant="printed", forcing=forcing)


def test_every_effect_names_places_of_the_table():
    for entry in EFFECTS:
        assert entry.places, entry.name
        assert len(set(entry.places)) == len(entry.places)
        for name in entry.places:
            place(name)


# What an effect adds at its place, of the states of the plant that has it.
SPANNED = [
    ("driver_gain", {"gain": 0.04}, lambda s, v: 0.04 / 1.04 * s[f"current.{v}"]),
    ("thermal_crosstalk", {}, lambda s, v: 0.02 * (s[f"wire.{_other(v)}"] - s[f"wire.{v}"])),
    ("flow_shortfall", {"share": 0.3}, lambda s, v: -0.3 * s[f"duty.{v}"]),
    ("residual_elongation", {}, lambda s, v: 1e-4 * s[f"transformed.{v}"]),
    ("transformation_fatigue", {"shift_K": -0.3}, lambda s, v: -0.3 * s[f"transformed.{v}"]),
    ("phase_resistivity", {}, None),
    ("ambient_drift", {}, lambda s, v: 0.02 * s["time"] + 2e-4 * s["time"] ** 2),
    ("rtd_offset", {}, None),
    ("force_gain", {}, lambda s, v: 0.04 * s["reading_force.both"]),
]


def _other(side):
    return {"x": "y", "y": "x"}[side]


@pytest.mark.parametrize(("name", "values", "law"), SPANNED, ids=lambda v: str(v)[:24])
def test_an_effect_is_what_its_first_place_makes_of_the_right_series(plain, name, values, law):
    entry = next(e for e in EFFECTS if e.name == name)
    values = values or entry.typical()
    first = place(entry.places[0])
    replay = Replay(RUN, outputs=(*CHANNELS, "resistance_x_Ohm", "resistance_y_Ohm"))
    setup = replay.setup(P, {name: values})
    wanted, states = replay.run_setup(setup), trajectory(replay, setup)
    forcing = {}
    for side in first.sides:
        if name == "rtd_offset":
            series = wanted[f"rtd_{side}_degC"] - plain[f"rtd_{side}_degC"]
        elif law is None:
            series = wanted[f"resistance_{side}_Ohm"] / plain[f"resistance_{side}_Ohm"] - 1.0
        elif name in ("driver_gain", "flow_shortfall"):
            series = law(states, side)  # of inputs, which are in force at once
        elif name == "force_gain":
            series = 0.04 * plain["force_N"]
        else:
            series = as_forcing(first.name, law(states, side))
        forcing[first.name, side] = series
    forced = simulate(P, RUN, forcing=forcing, outputs=CHANNELS)
    for channel in CHANNELS:
        gone = np.abs(wanted[channel] - plain[channel]).max()
        left = np.abs(wanted[channel] - forced[channel]).max()
        # The forcing stands still over a sample: an edge of a current is 10 ms late.
        assert left <= 0.03 * gone + 1e-9, (channel, left, gone)


def test_a_trajectory_has_every_state_of_every_place_and_says_what_the_outputs_say(plain):
    states = trajectory(Replay(RUN), Replay(RUN).setup(P))
    assert states.keys() == TRAJECTORY.keys()
    assert np.array_equal(states["wire.x"], plain["T_x_K"])
    assert np.array_equal(states["fraction.y"], plain["xi_S_y"] + plain["xi_T_y"])
    assert np.array_equal(states["reading_force.both"], plain["force_N"])
    assert np.array_equal(states["duty.x"][1:], RUN.pump_duty[1:, 0])
    rate = np.diff(plain["rtd_x_degC"]) / np.diff(RUN.t_s)
    assert states["reading_rtd_rate.x"][1:] == pytest.approx(rate, abs=1e-6)


def test_what_is_added_at_a_reading_goes_through_the_sensor():
    """A lag follows it, a gain scales it, a slip loses its share of it."""
    wave, drift = np.sin(0.5 * RUN.t_s), 1e-4 * np.maximum(RUN.t_s - 10.0, 0.0)
    added = {
        ("reading_rtd", "x"): wave,
        ("reading_force", "both"): 0.01 * wave,
        ("reading_displacement", "both"): drift,
    }
    sensors = {
        "rtd_lag": {"tau_s": 0.6},
        "force_gain": {"gain": 0.5},
        "encoder_slip": {"share": 0.2},
    }
    given, without = (simulate(P, RUN, effects=sensors, forcing=x) for x in (added, {}))
    lagged, course = wave[0], [wave[0]]
    gone = 1.0 - np.exp(-(RUN.t_s[1] - RUN.t_s[0]) / 0.6)
    for middle in 0.5 * (wave[1:] + wave[:-1]):
        lagged += gone * (middle - lagged)
        course.append(lagged)
    assert given["rtd_x_degC"] - without["rtd_x_degC"] == pytest.approx(course, abs=1e-4)
    assert given["force_N"] - without["force_N"] == pytest.approx(0.015 * wave, abs=1e-12)
    apart, kept = np.diff(given["displacement_m"] - without["displacement_m"]), np.diff(drift)
    rises = (np.diff(given["true_displacement_m"]) > 0.0) & (kept > 0.0)
    assert apart[rises] == pytest.approx(0.8 * kept[rises], abs=1e-9)
    for name in ("T_x_K", "true_displacement_m", "spring_force_x_N"):
        assert np.array_equal(given[name], without[name]), name


def test_a_law_sees_the_model_with_what_is_added_at_the_readings(plain):
    """So that a law depends on what was measured where a model is a little off."""
    added = {("reading_displacement", "both"): 1e-3 * np.sin(RUN.t_s)}
    replay = Replay(RUN, forcing=added)
    states = trajectory(replay, replay.setup(P))
    off = states["displacement"] - plain["true_displacement_m"]
    assert off == pytest.approx(1e-3 * np.sin(RUN.t_s), abs=1e-12)
    rate = np.diff(off) / np.diff(RUN.t_s)
    still = trajectory(Replay(RUN), replay.setup(P))["velocity"]
    assert (states["velocity"] - still)[1:] == pytest.approx(rate, abs=1e-9)
