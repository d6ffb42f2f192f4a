"""The registry of candidate effects: complete, switchable, absent at zero, and acting."""

import math
import re
from typing import get_args

import numpy as np
import pytest

from sim_device.plant import Drive, Inputs, Plant, load_parameters, simulate
from sim_device.plant.effects.record import Signal, Subsystem
from sim_device.plant.effects.registry import (
    EFFECTS,
    effect,
    effect_terms,
    from_text,
    from_texts,
    resolve,
)
from sim_device.plant.errors import EffectError
from sim_device.plant.kernel.compiled import PACKAGE as KERNEL
from sim_device.plant.replay import OUTPUTS
from tests.sim_device.plant.cases import alternating, at_level, still

P = load_parameters("A")
NAMES = [entry.name for entry in EFFECTS]
SIGNALS = get_args(Signal)
# Channels by signal, with what a bench would resolve of each.
RESOLVED = {
    "current": ({"i_x_A", "i_y_A"}, 1e-3),
    "voltage": ({"v_x_V", "v_y_V"}, 1e-3),
    "temperature": ({"rtd_x_degC", "rtd_y_degC"}, 0.01),
    "inlet": ({"rtd_inlet_degC"}, 0.01),
    "ambient": ({"rtd_ambient_degC"}, 0.01),
    "displacement": ({"displacement_m"}, 2e-6),
    "force": ({"force_N"}, 1e-3),
}

READINGS = [reading for channels, _ in RESOLVED.values() for reading in channels]


def variant_of(name):
    return dict(effect(name).needs).get("variant", ("extended",))[0]


@pytest.fixture(scope="module")
def bare():
    inputs = alternating(amps=2.9)
    return inputs, {v: simulate(P, inputs, variant=v) for v in ("extended", "printed")}


def test_the_registry_has_enough_entries_and_each_name_once():
    assert len(NAMES) == len(set(NAMES)) >= 25
    assert {entry.subsystem for entry in EFFECTS} == set(get_args(Subsystem))


def test_every_term_of_the_kernel_belongs_to_one_parameter():
    of_parameters = [parameter.term for entry in EFFECTS for parameter in entry.parameters]
    terms = [term for term in of_parameters if term is not None]
    fields = set(effect_terms({})[0])
    made = {
        "resists", "adds_strain", "late", "driver_knee", "reads_x", "pair_stiffness", "pair_drag",
    }  # fmt: skip
    assert len(terms) == len(set(terms)), "two parameters have one term"
    missing, unused = set(terms) - fields, fields - made - set(terms)
    assert not missing, f"make {missing} fields of Effects in sim_device/plant/kernel/model.py"
    assert not unused, f"no parameter of the registry has the term {unused}"


def test_every_term_is_computed_with():
    files = [*KERNEL.glob("*.py"), KERNEL.parent / "constants.py"]
    text = "\n".join(file.read_text() for file in files if file.name != "model.py")
    used = set(re.findall(r"\b[exy]\.(\w+)", text))
    # Two become constants before the kernel sees them.
    made = {"inverse_warming_share", "driver_deficit"}
    unread = set(effect_terms({})[0]) - used
    assert unread == made, f"sim_device/plant/kernel computes nothing with {unread - made}"


@pytest.mark.parametrize("name", NAMES)
def test_an_entry_is_complete(name):
    entry = effect(name)
    for text in (entry.title, entry.equation, entry.separated_by, entry.reference):
        assert len(text) > 4
    assert entry.signals
    assert set(entry.signals) <= set(SIGNALS)
    assert set(entry.confused_with) <= set(NAMES) - {name}
    assert any(parameter.is_strength for parameter in entry.parameters)
    for parameter in entry.parameters:
        assert parameter.low <= parameter.typical <= parameter.high
        assert parameter.unit
        assert parameter.prior.scale > 0.0
        if parameter.zero is not None:
            assert parameter.low <= parameter.zero <= parameter.high


@pytest.mark.parametrize("name", NAMES)
def test_zero_strength_is_bit_identical_to_the_plant_without_the_effect(name, bare):
    inputs, plain = bare
    variant = variant_of(name)
    out = simulate(P, inputs, variant=variant, effects={name: at_level(name, 0.0)})
    for output in OUTPUTS:
        np.testing.assert_array_equal(out[output], plain[variant][output])


def change(out, plain, signal):
    """Largest root mean square change of the signal's channels, in what a bench resolves."""
    channels, quantum = RESOLVED[signal]
    return max(np.sqrt(np.mean((out[c] - plain[c]) ** 2)) / quantum for c in channels)


@pytest.mark.parametrize("name", NAMES)
def test_at_typical_strength_an_effect_shows_in_the_signals_it_claims_and_no_other(name, bare):
    inputs, plain = bare
    variant = variant_of(name)
    out = simulate(P, inputs, variant=variant, effects={name: {}})
    shown = {signal: change(out, plain[variant], signal) for signal in SIGNALS}
    claimed = effect(name).signals
    assert max(shown[signal] for signal in claimed) > 1.0
    assert {signal for signal in SIGNALS if shown[signal] > 2.0} <= set(claimed)


@pytest.mark.parametrize("name", NAMES)
def test_a_pair_that_nobody_drives_stays_as_it_was_mounted_with_each_effect(name):
    out = simulate(P, still(np.arange(2000) * 0.01), variant=variant_of(name), effects={name: {}})
    for wire in ("T_x_K", "T_y_K"):
        assert np.abs(out[wire] - P["ambient_temperature"]).max() < 0.05
    assert np.abs(out["true_displacement_m"]).max() < 5e-6
    if name != "ambient_drift":
        assert [r for r in READINGS if np.ptp(out[r]) > 1e-6] == [], "start its state at rest"


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_is_the_same_sample_by_sample_and_in_a_replay(name, bare):
    inputs, _ = bare
    variant = variant_of(name)
    short = Inputs(inputs.t_s[:500], inputs.i_A[:500], inputs.pump_duty[:500])
    out = simulate(P, short, variant=variant, effects={name: {}})
    quiet = {entry: 0.0 for entry in P.names if entry.startswith("noise_")}
    plant = Plant(P.replace(**quiet), variant=variant, effects={name: {}})
    for n in range(1, 500):
        row = short.rows[n]
        plant.advance(
            Drive(i_A=(row[0], row[1]), pump_duty=(row[2], row[3])), short.t_s[n] - short.t_s[n - 1]
        )
    seen = plant.read()
    assert seen.displacement_m == out["displacement_m"][-1]
    assert seen.force_N == out["force_N"][-1]
    assert seen.i_A == (out["i_x_A"][-1], out["i_y_A"][-1])
    assert seen.rtd_degC[:2] == (out["rtd_x_degC"][-1], out["rtd_y_degC"][-1])


def test_all_effects_together_run_and_keep_the_fractions_in_bounds(bare):
    inputs, _ = bare
    together = {name: {} for name in NAMES if variant_of(name) == "extended"}
    out = simulate(P, inputs, effects=together)
    for side in "xy":
        total = out[f"xi_S_{side}"] + out[f"xi_T_{side}"]
        assert out[f"xi_S_{side}"].min() >= 0.0
        assert out[f"xi_T_{side}"].min() >= 0.0
        assert total.max() <= 1.0
    assert out["force_N"].min() > 0.0


def test_a_stronger_effect_changes_more(bare):
    inputs, plain = bare
    for name in ("driver_gain", "rtd_lag", "tube_friction", "flow_shortfall", "minor_loop"):
        changes = []
        for level in (0.5, 1.0, 2.0):
            out = simulate(P, inputs, effects={name: at_level(name, level)})
            changes.append(sum(change(out, plain["extended"], signal) for signal in SIGNALS))
        assert changes[0] < changes[1] < changes[2]


def test_water_warming_turns_the_printed_variant_into_a_warming_one(bare):
    inputs, plain = bare
    out = simulate(P, inputs, variant="printed", effects={"water_warming": {"inverse_share": 1.0}})
    extended = plain["extended"]["T_x_K"].max() - 300.0
    assert out["T_x_K"].max() - 300.0 == pytest.approx(extended, rel=0.1)
    assert plain["printed"]["T_x_K"].max() - 300.0 < 0.5 * extended


def test_constant_friction_holds_the_pair_until_the_pull_exceeds_it():
    t = np.arange(3000) * 0.01
    i_A = np.column_stack([np.where(t > 0, 1.6, 0.0), 0 * t])
    inputs = Inputs(t, i_A, 0 * i_A)
    free = simulate(P, inputs)
    rubbing = {"coulomb_N": 0.1, "proportional": 0.0, "stribeck": 0.0}
    held = simulate(P, inputs, effects={"tube_friction": rubbing})
    pull = held["spring_force_x_N"] - held["spring_force_y_N"]
    moving = np.diff(held["true_displacement_m"], prepend=0.0) > 1e-9
    np.testing.assert_allclose(pull[moving], 0.1, atol=1e-6)
    assert np.abs(pull[~moving]).max() <= 0.1 + 1e-9
    assert held["true_displacement_m"][-1] < free["true_displacement_m"][-1] - 1e-4


def test_friction_that_holds_more_at_rest_slips_in_jumps_down_to_that_of_sliding():
    t = np.arange(3000) * 0.01
    i_A = np.column_stack([np.where(t > 0, 1.6, 0.0), 0 * t])
    rubbing = {"coulomb_N": 0.1, "proportional": 0.0, "stribeck": 0.3, "velocity_m_s": 0.1}
    inputs, effects = Inputs(t, i_A, 0 * i_A), {"tube_friction": rubbing}
    out = simulate(P, inputs, effects=effects)
    pull = out["spring_force_x_N"] - out["spring_force_y_N"]
    slips = np.flatnonzero(np.diff(out["true_displacement_m"]) > 1e-9)
    assert len(slips) > 5
    np.testing.assert_allclose(pull[slips], 0.13, atol=2e-3)
    np.testing.assert_allclose(pull[slips + 1], 0.1, atol=2e-3)
    coarse = simulate(P, inputs, effects=effects, dt_s=0.01)
    apart_m = np.abs(coarse["true_displacement_m"] - out["true_displacement_m"])
    assert np.sqrt(np.mean(apart_m**2)) < 1e-5


def test_proportional_friction_grows_with_the_tension():
    t = np.arange(3000) * 0.01
    i_A = np.column_stack([np.where(t > 0, 2.6, 0.0), 0 * t])
    rubbing = {"coulomb_N": 0.0, "proportional": 0.08, "stribeck": 0.0}
    out = simulate(P, Inputs(t, i_A, 0 * i_A), effects={"tube_friction": rubbing})
    pull = out["spring_force_x_N"] - out["spring_force_y_N"]
    moving = np.diff(out["true_displacement_m"], prepend=0.0) > 1e-8
    np.testing.assert_allclose(pull[moving], 0.08 * out["true_force_N"][moving], rtol=2e-3)


def test_a_delay_shifts_a_channel_by_its_time(bare):
    inputs, plain = bare
    out = simulate(
        P, inputs, effects={"channel_delay": {"displacement_s": 0.055, "temperature_s": 0.1}}
    )
    t, u = inputs.t_s, plain["extended"]["displacement_m"]
    np.testing.assert_allclose(
        out["displacement_m"][10:], np.interp(t - 0.055, t, u)[10:], atol=1e-12
    )
    T = plain["extended"]["rtd_x_degC"]
    np.testing.assert_allclose(out["rtd_x_degC"][20:], T[10:-10], atol=1e-9)
    np.testing.assert_array_equal(out["force_N"], plain["extended"]["force_N"])


def test_a_lagging_rtd_is_a_first_order_filter_of_the_wire(bare):
    inputs, plain = bare
    out = simulate(P, inputs, effects={"rtd_lag": {"tau_s": 0.5}})
    T = plain["extended"]["rtd_x_degC"]
    z = T[0]
    for n in range(1, 1500):
        dt = inputs.t_s[n] - inputs.t_s[n - 1]
        kept = math.exp(-dt / 0.5)
        z = T[n] - (T[n] - T[n - 1]) * 0.5 / dt * (1.0 - kept) + (z - T[n - 1]) * kept
        assert out["rtd_x_degC"][n] == pytest.approx(z, abs=1e-9)


def test_a_stop_of_a_few_samples_is_no_new_start_for_air_pockets():
    plain = alternating(seconds=14.0)
    begun = int(np.flatnonzero(plain.pump_duty[:, 0] > 0.0)[0]) + 100

    def pockets(stop):
        """What they change of the wire after a stop of so many samples."""
        duty = plain.pump_duty.copy()
        duty[begun : begun + stop] = 0.0
        inputs = Inputs(plain.t_s, plain.i_A, duty)
        ends = [simulate(P, inputs, effects={"air_pockets": {"share": s}}) for s in (0.0, 0.9)]
        return (ends[1]["rtd_x_degC"] - ends[0]["rtd_x_degC"])[begun + 40 :]

    never, short, long = (pockets(stop) for stop in (0, 10, 25))
    assert np.max(np.abs(short - never)) < 0.2 * np.max(np.abs(long - never))


def test_text_becomes_effects():
    wanted = resolve(from_texts(["tube_friction:coulomb_N=0.11,proportional=0.06", "rtd_lag"]))
    assert wanted["tube_friction"]["coulomb_N"] == 0.11
    assert wanted["rtd_lag"] == effect("rtd_lag").typical()
    found = resolve(dict([from_text("driver_gain:gain=0.05")]))
    assert found == {"driver_gain": {"gain": 0.05, "y_share": 1.0}}
    assert from_text("force_gain:gain=0.05") == ("force_gain", {"gain": 0.05})


def test_an_effect_that_is_given_twice_is_refused_since_the_last_would_win():
    with pytest.raises(EffectError, match="'rtd_lag' is given twice; give all its values at once"):
        from_texts(["rtd_lag:tau_s=0.5", "driver_gain", "rtd_lag:y_share=0"])


def test_a_parameter_that_is_given_twice_is_refused_since_the_last_would_win():
    with pytest.raises(EffectError, match="tau_s is given twice; give it once"):
        from_text("rtd_lag:tau_s=0.1, tau_s=0.2")


def test_strengths_left_out_are_zero_once_one_is_given_and_shapes_are_typical():
    chosen = resolve({"tube_friction": {"coulomb_N": 0.2}})["tube_friction"]
    assert chosen["proportional"] == 0.0
    assert chosen["velocity_m_s"] == effect("tube_friction").typical()["velocity_m_s"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("warp_drive", ["warp_drive", "not in the library"]),
        ("tube_fricton", ["tube_fricton", "did you mean tube_friction?"]),
        ("rtd_lag:tau=1", ["tau", "tau_s"]),
        ("rtd_lag:tau_s=-1", ["-1", "0 to 10", "s"]),
        ("rtd_lag:tau_s=nan", ["nan"]),
        ("rtd_lag:tau_s", ["PARAMETER=NUMBER"]),
        ("rtd_lag:tau_s=much", ["PARAMETER=NUMBER"]),
    ],
)
def test_wrong_effects_are_refused_with_what_is_known(text, words):
    with pytest.raises(EffectError) as error:
        from_text(text)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("water_warming", {}),
        ("flow_shortfall", {"cooling": "air"}),
        ("tendon_slack", {"fixture": "stretch"}),
    ],
)
def test_an_effect_that_cannot_act_in_this_plant_is_refused(name, options):
    with pytest.raises(EffectError, match=f"{name} needs"):
        Plant(P, effects={name: {}}, **options)
    Plant(P, effects={name: at_level(name, 0.0)}, **options)


def test_without_effects_all_terms_are_zero():
    for side in effect_terms({}):
        assert not any(side.values())
