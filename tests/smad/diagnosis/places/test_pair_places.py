"""Places of the spring pair as the diagnosis sees them."""

import numpy as np
import pytest

from sim_device.plant.laws import Law, Term
from smad.diagnosis.places.place import Forceable
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from tests.sim_device.plant.law_terms import as_forcing, design_matrix, law_space, support_of

PLANT = SmaPlant()
POINT = nominal_point(PLANT)


@pytest.fixture(scope="module")
def run():
    return recorded(PLANT.catalogue()[0].name, PLANT, POINT, 1, noise=False, duration_s=20.0)


def open_loop(run, point=POINT):
    return PLANT.simulate(point, run)


def test_every_reading_of_the_pair_is_a_place_in_the_channels_unit(run):
    assert isinstance(PLANT, Forceable)
    plain = open_loop(run)
    read = set()
    for place in (place for place in PLANT.places if place.reading):
        for side in place.sides:
            series = np.full(len(run.t_s), place.scale)
            forced = PLANT.forced(POINT, run, {(place.name, side): series})
            (channel,) = (c for c in plain if not np.array_equal(forced[c], plain[c]))
            unit = 1e3 if channel == "displacement_mm" else 1.0
            assert forced[channel] - plain[channel] == pytest.approx(unit * place.scale)
            read.add(channel)
    assert read == {channel.name for channel in PLANT.channels}


def test_an_effect_of_the_pair_tells_places_that_the_pair_has():
    known = {place.name for place in PLANT.places}
    assert all(set(effect.places) <= known for effect in PLANT.effects)


def test_without_forcing_the_pair_predicts_as_ever(run):
    plain, forced = open_loop(run), PLANT.forced(POINT, run, {})
    assert plain.keys() == forced.keys()
    assert all(np.array_equal(plain[c], forced[c]) for c in plain)


def test_a_law_in_the_point_is_close_to_the_forcing_of_its_states(run):
    states = PLANT.trajectory(POINT, run)
    name = "heat_into_wire"
    terms = law_space(name, "x", support_of(name, "x", [states]))[:3]
    law = Law(name, "x", terms).with_coefficients([0.2, 0.1, 0.1])
    point = ModelPoint(POINT.theta, {}, (law,))
    own = PLANT.trajectory(point, run)
    values = design_matrix(name, "x", own, terms, run.t_s) @ [0.2, 0.1, 0.1]
    by_law = open_loop(run, point)["rtd_x_degC"]
    forced = PLANT.forced(POINT, run, {(name, "x"): as_forcing(name, values)})["rtd_x_degC"]
    gone = np.abs(forced - open_loop(run)["rtd_x_degC"]).max()
    assert gone > 0.3
    assert np.abs(by_law - forced).max() < 0.02 * gone


def test_a_law_at_the_reading_of_a_current_is_added_to_it(run):
    law = Law("reading_current", "x", (Term(name="constant", coefficient=0.01),))
    point = ModelPoint(POINT.theta, {}, (law,))
    before, after = (PLANT.simulate(p, run)["i_meas_x_A"] for p in (POINT, point))
    assert after - before == pytest.approx(0.01)


def test_a_saved_point_comes_back_with_its_laws(tmp_path):
    law = Law("film", "both", (Term(name="constant", coefficient=-0.1),))
    PLANT.save_model(ModelPoint(POINT.theta, {}, (law,)), tmp_path / "better.toml", "note")
    assert PLANT.load_model(tmp_path / "better.toml").laws == (law,)
