"""What the pipeline says of the tiny plant: every outcome, from recorded runs to the verdict."""

from __future__ import annotations

import pytest
from smad.gap import diagnose
from smad.gap.records import NAMED, Diagnosis, Outcome

from smad.diagnosis.errors import PlantMismatch
from tests.smad.gap.cases import FAR_OFF, OTHER, SETTINGS, SHOWN, ask, bank, without
from tests.smad.gap.heater_plant import HeaterPlant, recorded


def test_the_simulator_against_itself_has_no_gap() -> None:
    verdict = ask(bank()).verdict
    assert verdict.outcome is Outcome.NO_GAP
    assert verdict.effects == []
    assert verdict.probability > 0.8


def test_a_bench_whose_parameters_are_15_percent_off_ends_as_parameters_only() -> None:
    verdict = ask(bank(FAR_OFF)).verdict
    assert verdict.outcome is Outcome.PARAMETERS
    assert verdict.gap_raw > 5.0
    assert verdict.gap_refit < 0.35


@pytest.fixture(scope="module", params=sorted(SHOWN))
def single(request: pytest.FixtureRequest) -> tuple[str, Diagnosis]:
    name = str(request.param)
    return name, ask(bank(OTHER, {name: SHOWN[name]}))


def test_an_effect_of_the_library_is_named_with_an_interval_that_holds_the_truth(
    single: tuple[str, Diagnosis],
) -> None:
    name, diagnosis = single
    verdict = diagnosis.verdict
    assert verdict.outcome is Outcome.EFFECT, verdict.text
    assert verdict.effects == [name]
    assert verdict.probability > 0.9
    for value in diagnosis.values:
        width = value.high - value.low
        truth = SHOWN[name][value.name]
        assert value.low - 0.6 * width <= truth <= value.high + 0.6 * width
        assert width < 0.2 * truth


def test_the_shrink_on_runs_left_out_reaches_the_floor(single: tuple[str, Diagnosis]) -> None:
    verdict = single[1].verdict
    assert verdict.shrink > 0.75
    assert verdict.shrink_low <= verdict.shrink <= verdict.shrink_high
    assert verdict.gap_final < 0.35 < verdict.gap_refit <= verdict.gap_raw * 1.05
    assert verdict.ceiling >= verdict.shrink - 1e-9


def test_the_gap_is_put_into_the_sub_model_of_the_effect(single: tuple[str, Diagnosis]) -> None:
    name, diagnosis = single
    home = {"driver_gain": "power", "backlash": "rod", "dial_delay": "rod"}.get(name, "thermal")
    assert diagnosis.verdict.sub_model == home
    share = dict.fromkeys(("power", "thermal", "rod"), 0.0)
    for cell in diagnosis.heat:
        share[cell.sub_model] = max(share[cell.sub_model], cell.refit)
    assert max(share, key=lambda m: share[m]) == home


@pytest.mark.parametrize("name", sorted(set(SHOWN) - {"backlash"}))
def test_with_the_true_effect_taken_out_of_the_library_the_verdict_is_unknown(name: str) -> None:
    diagnosis = ask(bank(OTHER, {name: SHOWN[name]}), without(name))
    verdict = diagnosis.verdict
    assert verdict.outcome is Outcome.UNKNOWN, verdict.text
    assert verdict.effects == []
    # What entered and was not believed is no part of the model that is handed on.
    assert diagnosis.model["effects"] == {}


def test_a_near_twin_of_a_missing_effect_is_never_called_the_whole_cause() -> None:
    """A late dial looks like a dial with play: more than nothing, less than the cause."""
    verdict = ask(bank(OTHER, {"backlash": SHOWN["backlash"]}), without("backlash")).verdict
    assert verdict.outcome in (Outcome.UNKNOWN, Outcome.PLUS_REST), verdict.text
    assert verdict.probability < 0.95 or verdict.outcome is Outcome.UNKNOWN


def test_an_effect_that_no_library_holds_is_unknown() -> None:
    verdict = ask(bank(OTHER, {"melt": {"J_K": 140.0}})).verdict
    assert verdict.outcome is Outcome.UNKNOWN, verdict.text
    assert verdict.sub_model == "thermal"


def test_two_effects_are_both_found_the_larger_first() -> None:
    both = {"sensor_lag": {"tau_s": 1.2}, "coupling": {"g_W_K": 0.12}}
    diagnosis = ask(bank(OTHER, both))
    assert diagnosis.verdict.outcome in NAMED
    assert diagnosis.verdict.effects == ["sensor_lag", "coupling"]
    small = {"sensor_lag": {"tau_s": 0.25}, "coupling": {"g_W_K": 0.4}}
    assert ask(bank(OTHER, small)).verdict.effects == ["coupling", "sensor_lag"]


def test_known_good_runs_of_a_sister_bench_set_the_background() -> None:
    """Both benches have softening wax, which the model lacks; only one has slow thermometers."""
    wax = {"melt": {"J_K": 25.0}}
    good = bank({"c_J_K": 29.0, "ha_W_K": 0.62}, wax, seed=50)
    quiet = ask(bank(OTHER, wax), good=good)
    assert quiet.verdict.outcome in (Outcome.PARAMETERS, Outcome.NO_GAP), quiet.verdict.text
    changed = ask(bank(OTHER, {**wax, "sensor_lag": {"tau_s": 1.2}}), good=good)
    assert changed.verdict.outcome is Outcome.EFFECT, changed.verdict.text
    assert changed.verdict.effects == ["sensor_lag"]
    assert changed.question.startswith("what has changed")


def test_runs_named_to_be_held_out_are_judged_on_and_not_fitted() -> None:
    runs = bank(OTHER, {"sensor_lag": {"tau_s": 1.2}})
    diagnosis = ask(runs[:3], hold_out=runs[3:])
    assert diagnosis.verdict.effects == ["sensor_lag"]
    assert diagnosis.judged_on == "runs held out"
    assert {t.run for t in diagnosis.traces} == {runs[3].name}


def test_two_causes_of_a_library_of_two_are_probable_each_in_its_place() -> None:
    both = {"sensor_lag": {"tau_s": 1.2}, "coupling": {"g_W_K": 0.12}}
    runs = bank(OTHER, both)
    found = diagnose(runs, plant=HeaterPlant(), settings=SETTINGS, candidates=sorted(both))
    assert found.verdict.effects == ["sensor_lag", "coupling"]
    assert found.verdict.probability > 0.9
    assert found.verdict.probabilities["sensor_lag"] > 0.9
    assert {place: table[place] > 0.9 for place, table in found.places.items()} == {
        "coupling": True,
        "sensor_lag": True,
    }


def test_a_library_of_nothing_names_nothing_and_a_foreign_name_is_refused() -> None:
    runs = bank(OTHER, {"sensor_lag": {"tau_s": 1.2}})
    found = diagnose(runs, plant=HeaterPlant(), settings=SETTINGS, candidates=())
    assert found.verdict.outcome is Outcome.UNKNOWN
    with pytest.raises(PlantMismatch, match="no effect of this plant; got sensor_lug"):
        diagnose(runs, plant=HeaterPlant(), settings=SETTINGS, candidates=["sensor_lug"])


def test_a_single_run_is_said_to_be_judged_where_it_was_fitted() -> None:
    found = ask(bank(OTHER, {"sensor_lag": {"tau_s": 1.2}})[:1])
    assert found.judged_on == "the run it was fitted to"
    assert "on the run it was fitted to" in found.verdict.text
    assert any("single run" in limit for limit in found.limits)


def test_a_single_run_shows_a_rest_that_no_entry_takes_and_names_no_entry_for_it() -> None:
    wax = recorded("sines", 1, OTHER, {"melt": {"J_K": 140.0}}, duration_s=200.0)
    verdict = ask([wax]).verdict
    assert verdict.outcome is Outcome.UNKNOWN, verdict.text
    assert verdict.ceiling > 0.1


@pytest.mark.parametrize("role", ["good", "hold_out"])
def test_what_was_asked_is_not_exchanged_when_a_group_of_runs_is_refused(role: str) -> None:
    short = [r.part(0, 30) for r in bank(OTHER)[:2]]
    found = ask(bank(OTHER), **{role: short})
    assert found.verdict.outcome is Outcome.NO_EXCITATION
    said = {"good": "known to be good", "hold_out": "held out"}[role]
    assert f"No run {said} can be used (too short)" in found.verdict.text
