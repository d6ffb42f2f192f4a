"""Laws at places: the kernel makes what numpy makes, they stay bounded, and reach every plant."""

import json

import numpy as np
import pytest

from sim_device.bench import SimulatedBench
from sim_device.plant import Drive, Plant, Replay, load_parameters, simulate
from sim_device.plant.errors import InputError, ModelError
from sim_device.plant.laws import MOST_TERMS, Factor, Law, Term, check_laws
from sim_device.plant.models import read_model, save_model
from sim_device.plant.places import PLACES, keys_of, place
from sim_device.plant.replay import OUTPUTS, trajectory
from tests.sim_device.plant.cases import alternating
from tests.sim_device.plant.law_terms import as_forcing, design_matrix, law_space, support_of

P = load_parameters("A")
RUN = alternating(seconds=32.0)
STEP_S = 0.02  # longer than a sample: one substep each
STATES = trajectory(Replay(RUN), Replay(RUN).setup(P), dt_s=STEP_S)
SUPPORT_OF = {entry.name: support_of(entry.name, "both", [STATES]) for entry in PLACES}


def line(state, low, high, coefficient, **other):
    factor = Factor(state=state, low=low, high=high, centre=0.0, scale=1.0, **other)
    return Term(name=state, factors=(factor,), coefficient=coefficient)


def mixed_law(name, side):
    """Every term of the rule at once, small, of changing sign."""
    terms = law_space(name, side, SUPPORT_OF[name])
    size = 0.1 * place(name).scale / len(terms)
    return Law(name, side, terms).with_coefficients(size * np.cos(np.arange(len(terms))))


@pytest.mark.parametrize("name", [e.name for e in PLACES if not e.name.startswith("force_cell")])
def test_a_law_in_the_kernel_is_the_forcing_that_numpy_makes_of_its_trajectory(name):
    law = mixed_law(name, place(name).sides[-1])
    by_law = simulate(P, RUN, laws=[law], dt_s=STEP_S)
    replay = Replay(RUN)
    states = trajectory(replay, replay.setup(P, laws=[law]), dt_s=STEP_S)
    design = design_matrix(name, law.side, states, law.terms, RUN.t_s)
    values = design @ np.array([term.coefficient for term in law.terms])
    assert np.ptp(values) > 0.0
    forced = simulate(P, RUN, dt_s=STEP_S, forcing={(name, law.side): as_forcing(name, values)})
    plain = simulate(P, RUN, dt_s=STEP_S)
    for output in ("T_x_K", "T_y_K", "v_y_V", "i_y_A", "rtd_y_degC", "displacement_m", "force_N"):
        size = max(np.abs(forced[output] - plain[output]).max(), 1e-6)
        assert np.abs(by_law[output] - forced[output]).max() < 1e-6 * size, output


def test_a_force_law_of_temperatures_is_its_forcing_too():
    wire = line("wire", 295.0, 330.0, 1e-3)
    law = Law("force_cell_on_x", "both", (wire,))
    by_law = simulate(P, RUN, laws=[law], dt_s=STEP_S)
    states = trajectory(Replay(RUN), Replay(RUN).setup(P, laws=[law]), dt_s=STEP_S)
    values = design_matrix(law.place, law.side, states, law.terms, RUN.t_s)[:, 0] * 1e-3
    key = (law.place, law.side)
    forced = simulate(P, RUN, dt_s=STEP_S, forcing={key: as_forcing(law.place, values)})
    assert by_law["force_N"] == pytest.approx(forced["force_N"], abs=1e-9)


def test_a_law_with_coefficients_of_zero_changes_no_bit():
    laws = [Law(e.name, "both", law_space(e.name, "both", SUPPORT_OF[e.name])[:9]) for e in PLACES]
    plain, other = simulate(P, RUN), simulate(P, RUN, laws=laws)
    assert all(np.array_equal(plain[name], other[name]) for name in OUTPUTS)


@pytest.mark.parametrize(
    ("effect", "term"),
    [
        ("viscous_drag", line("velocity", -1.0, 1.0, 40.0)),
        (
            "tube_friction",
            Term(
                name="velocity_sign",
                coefficient=0.08,
                factors=(
                    Factor(
                        state="velocity", kind="sign", low=-1.0, high=1.0, centre=0.0, scale=2e-5
                    ),
                ),
            ),
        ),
    ],
)
def test_a_law_may_drag_and_rub_as_an_effect_does(effect, term):
    values = {"coulomb_N": 0.08} if effect == "tube_friction" else {"coefficient_N_s_m": 40.0}
    wanted = simulate(P, RUN, effects={effect: values})
    # An effect's force sensor sits in the middle, so half of the law is on either side of it.
    half = Term(name=term.name, factors=term.factors, coefficient=0.5 * term.coefficient)
    laws = [Law(f"force_cell_on_{side}", "both", (half,)) for side in "xy"]
    got, plain = simulate(P, RUN, laws=laws), simulate(P, RUN)
    for output in ("displacement_m", "force_N", "spring_force_x_N"):
        gone = np.sqrt(np.mean((wanted[output] - plain[output]) ** 2))
        left = np.sqrt(np.mean((wanted[output] - got[output]) ** 2))
        assert left < 0.35 * gone, (output, left, gone)


def test_outside_its_support_a_law_stays_at_its_last_value():
    law = Law("reading_rtd", "x", (line("wire", 302.0, 305.0, 0.1),))
    plain, got = simulate(P, RUN), simulate(P, RUN, laws=[law])
    added = got["rtd_x_degC"] - plain["rtd_x_degC"]
    assert plain["T_x_K"].max() > 310.0
    assert added[plain["T_x_K"] > 305.0] == pytest.approx(30.5, abs=1e-9)
    assert added[plain["T_x_K"] < 302.0] == pytest.approx(30.2, abs=1e-9)


def test_a_sensor_law_sees_the_channel_before_it_acts_and_its_lag():
    law = Law("reading_force", "both", (line("reading", 0.0, 5.0, 0.2, lag_s=1.0),))
    plain, got = simulate(P, RUN), simulate(P, RUN, laws=[law])
    design = design_matrix(
        "reading_force", "both", {"reading_force.both": plain["force_N"]}, law.terms, RUN.t_s
    )
    assert got["force_N"] - plain["force_N"] == pytest.approx(0.2 * design[:, 0], abs=1e-9)


def test_a_law_of_y_sees_its_own_contraction():
    states = {"displacement": np.array([1e-3, 2e-3])}
    term = (line("displacement", -1.0, 1.0, 1.0),)
    times = np.array([0.0, 1.0])
    x = design_matrix("heat_into_wire", "x", states, term, times)
    assert np.array_equal(design_matrix("heat_into_wire", "y", states, term, times), -x)


def test_the_rule_has_unique_names_and_lines_from_minus_one_to_one():
    for entry in PLACES:
        terms = law_space(entry.name, "both", SUPPORT_OF[entry.name])
        assert len({term.name for term in terms}) == len(terms) <= 256
        for _, side in keys_of(entry.name, "both"):
            design = design_matrix(entry.name, side, STATES, terms, RUN.t_s)
            assert np.isfinite(design).all()
            assert np.abs(design).max() <= 2.0
        check_laws([Law(entry.name, entry.sides[0], terms)])


def test_a_law_steps_alike_in_the_plant_and_in_a_replay():
    law = mixed_law("heat_into_wire", "both")
    got = simulate(P, RUN, laws=[law])
    plant = Plant(P, laws=[law])
    for k in range(1, 800):
        plant.advance(
            Drive(i_A=RUN.i_A[k], pump_duty=RUN.pump_duty[k]), RUN.t_s[k] - RUN.t_s[k - 1]
        )
        assert plant.truth.T_K[0] == got["T_x_K"][k]


def test_heat_that_a_law_adds_is_in_the_energy_books():
    heat = Law("heat_into_wire", "both", (Term(name="constant", coefficient=0.4),))
    water = Law("heat_into_water", "x", (line("wire", 295.0, 340.0, 2e-3),))
    plant = Plant(P, laws=[heat, water])
    for k in range(2000):
        plant.advance(Drive(i_A=(2.0 * (k < 900), 0.0), pump_duty=(0.5 * (k > 1200), 0.0)), 0.01)
    book = plant.energy
    assert book.forced > 2 * 0.4 * 20.0
    assert abs(book.closing) < 1e-6 * book.heat_in


@pytest.mark.parametrize("name", ["model.toml", "model.json"])
def test_a_model_file_gives_back_its_laws(tmp_path, name):
    laws = (mixed_law("heat_into_wire", "x"), mixed_law("reading_rtd", "both"))
    save_model(tmp_path / name, laws=laws, effects={"rtd_lag": {}})
    model = read_model(tmp_path / name)
    assert model.laws == laws
    assert model.effects.keys() == {"rtd_lag"}


def test_coefficients_have_stable_names():
    law = Law("film", "x", (Term(name="constant"), line("wire", 0.0, 1.0, 1.0)))
    assert law.names == ("laws.film.x.constant", "laws.film.x.wire")


LAW = {
    "place": "film",
    "side": "x",
    "support": {"wire": [300.0, 310.0]},
    "terms": [
        {
            "name": "wire",
            "coefficient": 0.1,
            "factors": [{"state": "wire", "centre": 305.0, "scale": 5.0}],
        }
    ],
}


def changed(**term):
    return {"terms": [{**LAW["terms"][0], **term}]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"place": "warp"}, "place 'warp' is unknown"),
        ({"side": "left"}, "place film has no side 'left'"),
        ({"colour": 1}, r"laws\[0\]: unknown key 'colour'"),
        ({"support": {}}, r"laws\[0\].terms\[0\].factors\[0\]: state 'wire' has no support"),
        ({"support": {"wire": [300.0]}}, r"support.wire is \[300.0\]; write \[low, high\]"),
        ({"support": {"wire": [310.0, 300.0]}}, "low <= high"),
        ({"support": {"wire": ["a", 1]}}, "'a', not a number"),
        (changed(coefficient=float("nan")), "coefficient of wire is nan"),
        (changed(name="No"), "term name 'No'"),
        (changed(factors=[{"state": "reading", "centre": 0, "scale": 1}]), "no support"),
        (changed(factors=[{"state": "wire", "centre": 0, "scale": 0}]), "scale > 0"),
        (changed(factors=[{"state": "wire", "centre": 0, "scale": 1, "kind": "cube"}]), "'cube'"),
        (changed(factors=[LAW["terms"][0]["factors"][0]] * 3), "3 factors; at most 2"),
    ],
)
def test_a_wrong_law_in_a_model_file_is_refused_in_one_clear_line(tmp_path, change, words):
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"format": "smad-model-1", "laws": [{**LAW, **change}]}))
    with pytest.raises(ModelError, match=words) as error:
        read_model(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("model.json: ")


def test_more_terms_than_the_kernel_takes_are_refused():
    terms = tuple(Term(name=f"t{n}") for n in range(MOST_TERMS // 2 + 1))
    with pytest.raises(InputError, match=f"have {MOST_TERMS + 2} terms"):
        check_laws([Law("film", "both", terms)])


def test_two_laws_at_one_place_and_side_are_refused():
    law = Law("film", "x", (Term(name="constant"),))
    with pytest.raises(InputError, match="there are two"):
        check_laws([law, law])


def test_a_simulated_bench_runs_the_laws_of_its_model():
    heat = Law("heat_into_wire", "x", (Term(name="constant", coefficient=1.0),))
    warmed, plain = (SimulatedBench(laws=laws) for laws in ([heat], []))
    for bench in (warmed, plain):
        for _ in range(300):
            bench.step()
    rise = warmed.plant.truth.T_K[0] - plain.plant.truth.T_K[0]
    times = np.arange(301) * 0.01
    still = type(RUN)(times, np.zeros((301, 2)), np.zeros((301, 2)))
    forced = simulate(P, still, forcing={("heat_into_wire", "x"): np.ones(301)})
    assert rise == pytest.approx(forced["T_x_K"][-1] - forced["T_y_K"][-1], rel=0.02)
