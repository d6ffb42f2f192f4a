"""Effects of hardware that exists twice: each side has its share of them."""

from functools import cache

import numpy as np
import pytest

from sim_device.plant import Drive, Plant, load_parameters, simulate
from sim_device.plant.effects.record import Y_SHARE
from sim_device.plant.effects.registry import EFFECTS, effect, effect_terms, resolve
from sim_device.plant.errors import EffectError
from sim_device.plant.replay import OUTPUTS
from tests.sim_device.plant.cases import alternating, at_level

P = load_parameters("A")
INPUTS = alternating(amps=2.9)
TUBES = ("tube_stiffness", "viscous_drag")
"""They resist the pair: what each side has of them tells in the force sensor alone."""
SHARED = [entry.name for entry in EFFECTS if Y_SHARE in entry.parameters]
SIDED = sorted({*SHARED} - {*TUBES})
OF_X = [name for name in OUTPUTS if "_x_" in name or name.endswith("_x")]
OF_Y = [name for name in OUTPUTS if "_y_" in name or name.endswith("_y")]


HELD = {"displacement_m": np.zeros(INPUTS.t_s.size)}
OF_SPRINGS = (
    "cold_ends", "convection_exponent", "minor_loop", "phase_resistivity", "r_phase",
    "residual_elongation", "stress_latent", "temperature_spread", "transformation_fatigue",
    "tube_wall",
)  # fmt: skip


@cache
def replayed(name=None, level=1.0, y_share=None, unified=False):
    """A replay with an effect at a level. Held, the springs do not know of each other."""
    effects = {} if name is None else {name: at_level(name, level)}
    if name is not None:
        del effects[name][Y_SHARE.name]
        if y_share is not None:
            effects[name][Y_SHARE.name] = y_share
    if unified:
        effects["unified_kinetics"] = {}
    return simulate(P, INPUTS, effects=effects, feeds=HELD, dt_s=0.01)


def same(one, other, names):
    return all(np.array_equal(one[name], other[name]) for name in names)


def test_springs_drivers_leads_rtds_and_water_lines_have_a_side_each():
    assert set(SHARED) == {
        "driver_gain", "driver_lag", "driver_saturation", "contact_resistance", "current_offset",
        "rtd_lag", "rtd_offset", "rtd_stem",
        "water_drainage", "air_pockets", "pump_lag", "flow_shortfall", "valve_leak",
        *OF_SPRINGS, *TUBES,
    }  # fmt: skip


@pytest.mark.parametrize("name", SHARED)
def test_an_even_share_is_no_share_bit_by_bit(name):
    values = effect(name).typical()
    x, y = effect_terms(resolve({name: values}))
    assert x == y
    given = {q.term: values[q.name] for q in effect(name).parameters if q.term is not None}
    assert {term: x[term] for term in given} == given
    assert resolve({name: {}})[name][Y_SHARE.name] == 1.0


@pytest.mark.parametrize("name", sorted({entry.name for entry in EFFECTS} - set(SHARED)))
def test_what_there_is_once_takes_no_share(name):
    with pytest.raises(EffectError, match=Y_SHARE.name):
        resolve({name: {Y_SHARE.name: 0.5}})
    uneven = {"driver_gain": {"gain": 0.05, Y_SHARE.name: 0.5}}
    x, y = effect_terms(resolve(uneven | {name: {}}))
    own = [q.term for q in effect(name).parameters if q.term is not None]
    assert [x[term] for term in own] == [y[term] for term in own]


@pytest.mark.parametrize("name", SIDED)
def test_each_side_is_that_of_a_bench_with_its_share_on_both(name):
    uneven = replayed(name, y_share=0.5)
    assert same(uneven, replayed(name, 1.5), OF_X)
    assert same(uneven, replayed(name, 0.5), OF_Y)
    assert not same(uneven, replayed(name, 0.5), OF_X)
    assert not same(uneven, replayed(name, 1.5), OF_Y)


@pytest.mark.parametrize("name", SIDED)
def test_a_share_of_nothing_leaves_a_side_untouched(name):
    assert same(replayed(name, y_share=0.0), replayed(), OF_Y)
    assert not same(replayed(name, y_share=0.0), replayed(), OF_X)
    assert same(replayed(name, y_share=2.0), replayed(), OF_X)
    assert not same(replayed(name, y_share=2.0), replayed(), OF_Y)


@pytest.mark.parametrize("name", OF_SPRINGS)
def test_with_the_unified_kinetics_too_a_spring_alone_has_the_effect(name):
    bare = replayed(unified=True)
    of_y_alone = replayed(name, y_share=2.0, unified=True)
    assert same(of_y_alone, bare, OF_X)
    assert not same(of_y_alone, bare, OF_Y)
    assert same(of_y_alone, replayed(name, 2.0, unified=True), OF_Y)


@pytest.mark.parametrize("name", OF_SPRINGS)
@pytest.mark.parametrize("fixture", ["stretch", "blocked"])
def test_a_spring_that_hangs_free_does_not_act_on_the_other(name, fixture):
    effects = {name: effect(name).typical() | {Y_SHARE.name: 2.0}}
    of_y_alone = simulate(P, INPUTS, fixture=fixture, effects=effects, dt_s=0.01)
    bare = simulate(P, INPUTS, fixture=fixture, dt_s=0.01)
    assert same(of_y_alone, bare, [*OF_X, "force_N", "displacement_m"])


@pytest.mark.parametrize("name", TUBES)
def test_of_what_tubes_resist_the_force_sensor_reads_what_acts_on_y(name):
    outputs = ("force_N", "displacement_m", "spring_force_x_N", "spring_force_y_N")

    def of(share):
        effects = {name: effect(name).typical() | {Y_SHARE.name: share}}
        return simulate(P, INPUTS, effects=effects, outputs=outputs, dt_s=0.01)

    of_x, even, of_y = of(0.0), of(1.0), of(2.0)
    np.testing.assert_allclose(of_x["force_N"], of_x["spring_force_y_N"], atol=1e-12)
    np.testing.assert_allclose(of_y["force_N"], of_y["spring_force_x_N"], atol=1e-12)
    assert same(of_x, even, outputs[1:])
    assert same(of_y, even, outputs[1:])
    assert np.abs(of_x["force_N"] - of_y["force_N"]).max() > 0.01


@pytest.mark.parametrize("name", ["cold_ends", "transformation_fatigue", "residual_elongation"])
def test_a_side_alone_switches_on_what_it_needs(name):
    for share, strains in ((0.0, [1.0, 0.0]), (2.0, [0.0, 1.0])):
        sides = effect_terms(resolve({name: effect(name).typical() | {Y_SHARE.name: share}}))
        assert [side["adds_strain"] for side in sides] == strains


def test_friction_and_late_channels_are_switched_on_for_both_sides():
    x, y = effect_terms(resolve({"tendon_slack": {}, "channel_delay": {}}))
    assert x["resists"] == y["resists"] == x["late"] == y["late"] == 1.0


def test_an_elongation_of_y_moves_the_pair_against_one_of_x():
    def moved(share):
        effects = {"residual_elongation": {"per_cycle_m": 1e-4, Y_SHARE.name: share}}
        return simulate(P, INPUTS, effects=effects, dt_s=0.01)["displacement_m"][-1] - at_rest

    at_rest = simulate(P, INPUTS, dt_s=0.01)["displacement_m"][-1]
    assert moved(2.0) * moved(0.0) < 0.0


@pytest.mark.parametrize("name", OF_SPRINGS)
def test_the_energy_books_close_with_a_spring_alone(name):
    plant = Plant(P, effects={name: effect(name).typical() | {Y_SHARE.name: 2.0}})
    for drive in (Drive(i_A=(3.5, 3.0)), Drive(pump_duty=(0.9, 0.3)), Drive(i_A=(0.0, 3.5))):
        for _ in range(600):
            plant.advance(drive, 0.01)
    assert abs(plant.energy.closing) < 1e-4 * plant.energy.heat_in


@pytest.mark.parametrize("name", SHARED)
def test_no_side_gets_more_than_the_range_of_a_strength(name):
    most = {q.name: q.high for q in effect(name).parameters if q.is_strength}
    x, y = effect_terms(resolve({name: most | {Y_SHARE.name: 0.25}}))
    for q in effect(name).parameters:
        if q.is_strength:
            assert x[q.term] == q.high
            assert y[q.term] == 0.25 * q.high
        elif q.term is not None:
            assert x[q.term] == y[q.term] == q.typical


def test_shares_are_refused_beyond_nothing_and_everything():
    with pytest.raises(Exception, match="outside 0 to 2"):
        resolve({"rtd_lag": {"tau_s": 0.5, "y_share": 2.1}})


def test_a_share_alone_is_of_the_typical_effect():
    values = resolve({"rtd_lag": {"y_share": 0.6}})["rtd_lag"]
    assert values == {"tau_s": effect("rtd_lag").typical()["tau_s"], "y_share": 0.6}
    x, y = effect_terms({"rtd_lag": values})
    assert y["rtd_lag"] / x["rtd_lag"] == pytest.approx(0.6 / 1.4)
