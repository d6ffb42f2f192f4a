"""*Differs* on the tiny plant: where its model is wrong, and what would make the answer false."""

from __future__ import annotations

import importlib
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from smad.diagnosis import Verdict, diagnose
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CONTRADICTING, DIFFERS, PARAMETERS, PLACES, QUIET, REFUSED
from tests.smad.diagnosis.cases import FAR_OFF, GAIN, OTHER, ask, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

POWERS = {"reading_power_l_W", "reading_power_r_W"}


@pytest.fixture(scope="module")
def gain() -> Verdict:
    return ask(bank(OTHER, GAIN))


def slope(found: Verdict, place: str, state: str) -> float:
    told = next(p for p in found.places if p.place == place)
    return next(t.slopes["both"] for t in told.terms if t.state == state)


def timeless(found: Verdict) -> Verdict:
    return msgspec.structs.replace(found, seconds=0.0)


def test_the_simulator_against_itself_has_no_gap() -> None:
    found = ask(bank())
    assert (found.question, found.outcome, found.places) == (DIFFERS, QUIET, [])


def test_a_bench_with_other_parameters_is_told_their_values_and_no_place() -> None:
    found = ask(bank(FAR_OFF))
    assert (found.outcome, found.places) == (PARAMETERS, [])
    assert found.parameters_take > 0.95
    for q in found.parameters:
        assert q.after == pytest.approx(FAR_OFF[q.name], abs=5.0 * q.sd), q.name
        assert abs(q.after - q.before) > 10.0 * q.sd


def test_a_gain_of_5_percent_is_found_where_it_acts_with_its_size_and_name(gain: Verdict) -> None:
    assert gain.outcome == PLACES
    assert {p.place for p in gain.places} == POWERS
    for side in "lr":
        assert slope(gain, f"reading_power_{side}_W", f"cmd_{side}_W") == pytest.approx(
            0.05, abs=0.003
        )
    assert gain.places[0].name == "driver_gain"
    assert gain.places[0].values["driver_gain"]["g"] == pytest.approx(0.05, abs=0.003)


def test_the_gap_goes_to_the_floor_stage_by_stage(gain: Verdict) -> None:
    whole = gain.whole
    assert whole is not None
    assert len(whole.places) == len(gain.places) == 2
    assert whole.raw > whole.parameters > whole.places[0] > whole.final
    assert whole.final < 1.2
    assert sum(p.share for p in gain.places) > 0.4


def test_a_late_dial_is_a_law_of_its_reading_over_its_own_rate() -> None:
    found = ask(bank(OTHER, {"dial_delay": {"delay_s": 0.3}}))
    (told,) = found.places
    assert told.place == "reading_rod_um"
    assert max(told.names.items(), key=lambda one: one[1])[0] == "dial_delay"
    assert told.names["dial_delay"] > 0.5
    assert slope(found, told.place, "rod_um_rate") == pytest.approx(-0.3, abs=0.05)


def test_a_fan_that_spins_up_slowly_is_a_law_of_what_the_fan_does() -> None:
    found = ask(bank(OTHER, {"sticky_fan": {"tau_s": 1.5}}))
    assert [p.place for p in found.places] == ["input_fan"]
    assert found.places[0].name == "sticky_fan"
    assert {t.state for t in found.places[0].read} == {"fan"}


def test_what_no_library_has_is_placed_and_given_no_name() -> None:
    wax = HeaterPlant(tuple(e for e in HeaterPlant().library if e.name != "radiation"))
    found = ask(bank(OTHER, {"melt": {"J_K": 140.0}}), wax)
    assert found.outcome == PLACES
    assert all(p.name == "" for p in found.places)
    assert found.places[0].takes < 0.5


def test_the_order_of_the_runs_does_not_matter_and_the_answer_is_always_the_same(
    gain: Verdict,
) -> None:
    assert timeless(ask(bank(OTHER, GAIN)[::-1])) == timeless(gain)


def test_effects_that_may_not_be_named_are_not_and_a_foreign_one_is_refused() -> None:
    runs = bank(OTHER, GAIN)[:2]
    found = diagnose(runs, plant=HeaterPlant(), candidates=()).verdict
    assert {p.place for p in found.places} == POWERS
    assert all(not p.name and not p.nearest for p in found.places)
    with pytest.raises(PlantMismatch, match="driver_gain"):
        diagnose(runs, plant=HeaterPlant(), candidates=["driver_gian"])


@pytest.mark.parametrize("period_s", [0.1, 0.4])
def test_the_verdict_does_not_hang_on_the_length_of_a_row(
    gain: Verdict, period_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = importlib.import_module("smad.diagnosis.diagnose")
    monkeypatch.setattr(module, "row_length_s", lambda runs, plant: period_s)
    found = ask(bank(OTHER, GAIN))
    assert {p.place for p in found.places} == {p.place for p in gain.places}
    assert slope(found, "reading_power_l_W", "cmd_l_W") == pytest.approx(0.05, abs=0.003)


def every_second(run: GapRun) -> GapRun:
    """The record as a logger of half the rate would have written it."""
    return replace(
        run, t_s=run.t_s[1::2],
        inputs={k: v[1::2] for k, v in run.inputs.items()},
        outputs={k: v[1::2] for k, v in run.outputs.items()},
    )  # fmt: skip


def test_records_of_half_the_rate_give_the_same_places() -> None:
    found = ask([every_second(r) for r in bank(OTHER, GAIN)])
    assert {p.place for p in found.places[:2]} == POWERS
    assert slope(found, "reading_power_l_W", "cmd_l_W") == pytest.approx(0.05, abs=0.005)


def test_runs_held_out_are_judged_on_and_not_fitted() -> None:
    runs = bank(OTHER, GAIN)
    other = recorded("random", 9, {**OTHER, "rod_um_K": 3.4}, GAIN, duration_s=50.0)
    found = ask(runs[:3], hold_out=[other])
    assert found.judged_on == "1 run held out"
    fitted = {q.name: q.after for q in found.parameters}
    assert fitted["rod_um_K"] == pytest.approx(3.0, abs=0.02)
    rod = next(s for s in found.budget if s.signal == "rod_um")
    assert rod.final > 15 * rod.floor


def test_a_single_run_is_said_to_be_one_and_judged_by_its_own_stretches() -> None:
    found = ask(bank(OTHER, GAIN)[:1])
    assert found.judged_on == "stretches of the one run, each by a model of the others"
    assert [f.kind for f in found.findings] == ["few runs"]
    assert found.places[0].place in POWERS


def test_a_run_of_another_state_than_the_others_is_named() -> None:
    stuck = {"sticky_fan": {"tau_s": 4.0}}
    found = ask(bank(OTHER, stuck)[:3] + bank(OTHER)[3:])
    assert found.outcome == CONTRADICTING
    assert [r.run for r in found.by_run if r.contradicts] == ["sines 4"]
    assert "sines 4 is of another state" in found.headline


def test_runs_of_one_state_do_not_contradict_each_other(gain: Verdict) -> None:
    assert max(r.apart for r in gain.by_run) < 0.1


def test_a_channel_that_the_bench_lacks_is_not_judged_and_the_rest_is() -> None:
    runs = [
        r.with_columns(outputs={k: v for k, v in r.outputs.items() if k != "rod_um"})
        for r in bank(OTHER, GAIN)
    ]
    runs = [replace(r, outputs={k: v for k, v in r.outputs.items() if k != "rod_um"}) for r in runs]
    found = ask(runs)
    assert {p.place for p in found.places} == POWERS
    assert "rod_um" not in {s.signal for s in found.budget}
    assert any(f.kind == "channel missing" and "rod_um" in f.text for f in found.findings)


def test_swapped_cables_are_named_and_give_no_verdict() -> None:
    swapped = [
        r.with_columns(
            outputs={
                **r.outputs,
                "temp_l_degC": r.outputs["temp_r_degC"],
                "temp_r_degC": r.outputs["temp_l_degC"],
            }
        )
        for r in bank(OTHER)[:2]
    ]
    found = ask(swapped)
    assert found.outcome == REFUSED
    assert {f.kind for f in found.findings if f.refuses} == {"swapped channels"}
    assert "temp_l_degC" in found.findings[0].text


def test_lost_samples_and_a_cut_do_no_harm_and_are_said() -> None:
    runs = bank(OTHER, GAIN)
    spoilt = runs[0].outputs["temp_l_degC"].copy()
    spoilt[[40, 41, 200]] = np.nan
    valid = np.random.default_rng(1).random(len(runs[1].t_s)) > 0.1
    runs[0] = runs[0].with_columns(outputs={**runs[0].outputs, "temp_l_degC": spoilt})
    runs[1] = replace(runs[1], valid=valid)
    runs[2] = replace(runs[2].part(0, 300), cut_short=True)
    found = ask(runs)
    assert {"gaps", "samples lost", "truncated"} <= {f.kind for f in found.findings}
    assert slope(found, "reading_power_l_W", "cmd_l_W") == pytest.approx(0.05, abs=0.003)


def still(run: GapRun) -> GapRun:
    return replace(run, inputs={k: np.zeros(len(v)) for k, v in run.inputs.items()})


@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lambda r: r.part(0, 30), "too short"),
        (still, "no excitation"),
        (lambda r: replace(r, valid=np.arange(len(r.t_s)) % 30 == 0), "samples lost"),
    ],
)
def test_runs_that_cannot_be_used_give_no_verdict_but_the_reason(spoil, kind: str) -> None:  # type: ignore[no-untyped-def]
    found = ask([spoil(r) for r in bank(OTHER)[:2]])
    assert found.outcome == REFUSED
    assert found.headline == "no run to fit can be used"
    assert {f.kind for f in found.findings if f.refuses} == {kind}
    assert [r.role for r in found.runs] == ["refused", "refused"]


@pytest.mark.parametrize(
    ("role", "words"), [("good", "known to be good"), ("hold_out", "held out")]
)
def test_what_was_asked_is_not_exchanged_when_a_group_of_runs_is_refused(
    role: str, words: str
) -> None:
    short = [r.part(0, 30) for r in bank(OTHER, seed=9)[:2]]
    found = ask(bank(OTHER)[:2], **{role: short})
    assert (found.outcome, found.headline) == (REFUSED, f"no run {words} can be used")


def test_a_verdict_comes_back_from_its_file_as_it_was(gain: Verdict) -> None:
    assert Verdict.from_json(gain.to_json()) == gain
