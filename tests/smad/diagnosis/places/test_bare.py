"""Places of a plant that offers none: its readings and its inputs."""

from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest

from sim_device.plant.laws import Factor, Law, Term
from smad.diagnosis.data.played import Played, predictions
from smad.diagnosis.places.bare import BarePlaces, unwrapped, with_places
from smad.diagnosis.places.place import Forceable
from smad.diagnosis.places.responses import candidate_laws, responses
from smad.diagnosis.plant import ModelPoint, PlantModel, nominal_point
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.simulators.bind import bind
from tests.smad.diagnosis.heater_plant import NOMINAL, HeaterPlant, make_inputs, simulated
from tests.smad.simulators.systems import declared_pendulum, pendulum_run

HEATER = HeaterPlant()
PLANT = with_places(HEATER)
POINT = nominal_point(HEATER)


def run_of(family: str = "random", duration_s: float = 40.0) -> GapRun:
    return simulated(HEATER, family, make_inputs(family, duration_s, 1), POINT)


def with_law(place: str, *terms: Term) -> ModelPoint:
    return replace(POINT, laws=(Law(place, "both", terms),))


def line(state: str, slope: float, low: float, high: float, zero: float = 0.0) -> Term:
    """slope · (state − zero)."""
    factor = Factor(state=state, low=low, high=high, centre=zero, scale=1.0)
    return Term(name=state, factors=(factor,), coefficient=slope)


def test_a_plant_without_places_has_one_for_each_reading_and_each_input() -> None:
    assert isinstance(PLANT, Forceable)
    assert [p.name for p in PLANT.places] == [
        *(f"reading_{c.name}" for c in HEATER.channels),
        *(f"input_{s.name}" for s in HEATER.inputs),
    ]
    units = {c.name: c.unit for c in HEATER.channels} | {s.name: s.unit for s in HEATER.inputs}
    for place in PLANT.places:
        assert place.unit == units[place.name.partition("_")[2]]
        assert place.scale > 0.0
        assert place.reading == place.name.startswith("reading_")
        assert {"fan", "rod_um", "rod_um_rate", "time"} <= set(place.states)


def test_a_plant_with_places_of_its_own_keeps_them() -> None:
    pair = SmaPlant()
    assert with_places(pair) is pair
    assert isinstance(PLANT, BarePlaces)


def test_a_forced_reading_is_added_to_and_nothing_else() -> None:
    run = run_of()
    plain = PLANT.forced(POINT, run, {})
    series = np.linspace(0.0, 1.0, len(run.t_s))
    forced = PLANT.forced(POINT, run, {("reading_rod_um", "both"): series})
    assert np.array_equal(forced["rod_um"], plain["rod_um"] + series)
    assert all(np.array_equal(forced[c], plain[c]) for c in plain if c != "rod_um")


def test_a_law_of_a_reading_acts_on_that_channel_alone() -> None:
    run = run_of()
    plain = PLANT.simulate(POINT, run)
    point = with_law("reading_temp_l_degC", line("fan", 0.5, 0.0, 1.0))
    shown = PLANT.simulate(point, run)
    assert shown.keys() == plain.keys()
    assert shown["temp_l_degC"] - plain["temp_l_degC"] == pytest.approx(0.5 * run.inputs["fan"])
    assert all(np.array_equal(shown[k], plain[k]) for k in plain if k != "temp_l_degC")


def test_a_law_of_an_input_is_what_the_plant_makes_of_that_input() -> None:
    run = run_of()
    point = with_law("input_cmd_l_W", line("cmd_l_W", 0.05, 0.0, 60.0))
    more = run.with_columns(inputs={**run.inputs, "cmd_l_W": 1.05 * run.inputs["cmd_l_W"]})
    shown, wanted = PLANT.simulate(point, run), HEATER.simulate(POINT, more)
    for key in wanted:
        np.testing.assert_allclose(shown[key], wanted[key], rtol=0, atol=1e-9)


def test_a_law_of_an_input_that_goes_with_the_output_is_made_to_agree_with_it() -> None:
    """Power that falls with the plate's temperature is a larger loss of this plate."""
    still = run_of("one side")
    point = with_law("input_cmd_l_W", line("temp_l_degC", -0.1, 22.0, 150.0, zero=22.0))
    shown = PLANT.simulate(point, still)
    lossy = ModelPoint({**NOMINAL, "ha_W_K": NOMINAL["ha_W_K"] + 0.1})
    wanted, plain = (HEATER.simulate(p, still) for p in (lossy, POINT))
    key = "temp_l_degC"
    assert np.abs(wanted[key] - plain[key]).max() > 1.0
    np.testing.assert_allclose(shown[key], wanted[key], rtol=0, atol=1e-3)


def test_a_law_over_what_it_moves_itself_is_made_to_agree_with_it_where_repetition_runs_away() -> (
    None
):
    """A torque against the rate of a pendulum, near its resonance, is damping."""
    ((run,),) = (bound := bind(declared_pendulum(), [pendulum_run(0, seconds=8.0)])).groups
    slope = 0.3
    point = ModelPoint({"damping": 0.03})
    law = Law("input_torque_N_m", "both", (line("angle_rad_rate", -slope, -20.0, 20.0),))
    shown, wanted, plain = (
        bound.plant.simulate(p, run)["angle_rad"]
        for p in (replace(point, laws=(law,)), ModelPoint({"damping": 0.03 + slope}), point)
    )
    assert np.std(shown - wanted) < 0.1 * np.std(plain - wanted)


def test_a_strong_law_that_is_right_agrees_with_what_was_measured() -> None:
    """Ten times the pendulum's damping as a torque: from zero, no repetition comes to it."""
    ((run,),) = (bound := bind(declared_pendulum(), [pendulum_run(0, seconds=8.0)])).groups
    point, damped = ModelPoint({"damping": 0.03}), ModelPoint({"damping": 3.03})
    law = Law("input_torque_N_m", "both", (line("angle_rad_rate", -3.0, -20.0, 20.0),))
    plain, wanted = (bound.plant.simulate(p, run)["angle_rad"] for p in (point, damped))
    measured = run.with_columns(outputs={"angle_rad": wanted})
    shown = bound.plant.simulate(replace(point, laws=(law,)), measured)["angle_rad"]
    assert np.std(shown - wanted) < 0.01 * np.std(plain - wanted)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("state", "nothing"), [("temp_l_degC", np.nan), ("temp_l_degC_rate", np.inf)]
)
def test_a_law_of_an_input_leaves_a_replay_without_numbers_as_it_is(
    capfd: pytest.CaptureFixture[str], state: str, nothing: float
) -> None:
    class Stops(HeaterPlant):
        def simulate(self, point, run, *, fast=False):  # type: ignore[no-untyped-def]
            shown = super().simulate(point, run, fast=fast)
            driven = bool(np.any(run.inputs["cmd_l_W"] != still.inputs["cmd_l_W"]))
            return shown if driven else {n: np.full(len(y), nothing) for n, y in shown.items()}

    still = run_of("one side")
    point = with_law("input_cmd_l_W", line(state, -0.1, 22.0, 150.0, zero=22.0))
    shown = with_places(Stops()).simulate(point, still)
    assert np.array_equal(shown["temp_l_degC"], np.full(len(still.t_s), nothing), equal_nan=True)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("place", "term"),
    [("reading_rod_um", "fan"), ("reading_temp_l_degC", "rod_um"), ("input_cmd_l_W", "cmd_l_W"),
     ("input_fan", "fan"), ("input_cmd_l_W", "temp_l_degC")],
)  # fmt: skip
def test_a_response_is_what_a_small_law_changes_in_the_simulator(place: str, term: str) -> None:
    played = [Played.of(run_of(), PLANT.inputs, period_s=0.2)]
    space = candidate_laws(PLANT, POINT, played)
    found = responses(PLANT, POINT, played, space=space)
    (column,) = (
        own[k]
        for law, own in zip(found.laws, found.columns, strict=True)
        for k, t in enumerate(law.terms)
        if (law.place, t.name) == (place, term)
    )
    small = 0.01
    laws = found.law_of(np.array([column]), np.array([small]))
    base, moved = (predictions(PLANT, replace(POINT, laws=own), played)[0] for own in ((), laws))
    change, response = (moved - base) / small, found.runs[0][column]
    assert np.abs(change).max() > 0.0
    assert np.abs(change - response).max() < 0.05 * np.abs(change).max()


@pytest.mark.parametrize("of", ["heater", "pendulum in windows"])
def test_what_a_plant_offers_beside_is_seen_as_python_from_3_12_on_looks_for_it(of: str) -> None:
    plant: PlantModel = HEATER
    offers = ("catalogue", "perform")
    if of != "heater":
        plant = bind(declared_pendulum(), [pendulum_run(0, seconds=8.0)]).plant
        offers = ("seams", "begun_otherwise")
    bare = with_places(plant)
    assert isinstance(bare, BarePlaces)
    for name in offers:
        assert inspect.getattr_static(unwrapped(bare), name, None) is not None
