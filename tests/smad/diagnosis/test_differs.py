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
from smad.diagnosis.verdict import CAUSES, DIFFERS, PARAMETERS, QUIET, REFUSED, Cause
from tests.smad.diagnosis.cases import FAR_OFF, GAIN, OTHER, ask, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

POWERS = {"reading_power_l_W", "reading_power_r_W"}


@pytest.fixture(scope="module")
def gain() -> Verdict:
    return ask(bank(OTHER, GAIN))


def value(found: Verdict, name: str, parameter: str) -> float:
    cause = next(c for c in found.causes if c.name == name)
    return next(v.value for v in cause.values if v.name == parameter)


def slope(cause: Cause, state: str) -> float:
    return next(t.slopes["both"] for t in cause.terms if t.state == state)


def timeless(found: Verdict) -> Verdict:
    return msgspec.structs.replace(found, seconds=0.0)


def test_the_simulator_against_itself_has_no_gap() -> None:
    found = ask(bank())
    assert (found.question, found.outcome, found.causes) == (DIFFERS, QUIET, [])
    assert found.rivals[0].words == "the simulator as configured"


def test_a_bench_with_other_parameters_is_told_their_values_and_no_cause() -> None:
    found = ask(bank(FAR_OFF))
    assert (found.outcome, found.causes) == (PARAMETERS, [])
    assert found.whole is not None
    assert found.whole.raw > 40.0
    assert found.whole.parameters < 1.0
    for q in found.parameters:
        assert q.after == pytest.approx(FAR_OFF[q.name], abs=5.0 * q.sd), q.name
        assert abs(q.after - q.before) > 10.0 * q.sd


def test_a_gain_of_5_percent_is_named_with_its_value_as_sure_as_can_be(gain: Verdict) -> None:
    assert gain.outcome == CAUSES
    (cause,) = gain.causes
    assert (cause.kind, cause.name) == ("effect", "driver_gain")
    assert cause.names["driver_gain"] > 0.99
    assert cause.outside < 0.01
    assert value(gain, "driver_gain", "g") == pytest.approx(0.05, abs=0.001)


def test_the_gap_goes_to_the_floor_and_every_rival_stands_beside(gain: Verdict) -> None:
    whole = gain.whole
    assert whole is not None
    assert whole.raw > whole.parameters > 10.0
    assert whole.final < 1.0
    first, *others = gain.causes[0].rivals
    assert first.words == "driver_gain"
    assert first.gap == whole.final
    assert {"parameters alone", "the simulator as configured"} <= {r.words for r in others}
    assert all(r.gap > 10.0 and r.probability < 0.01 for r in others)
    assert sum(r.probability for r in gain.causes[0].rivals) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("name", "parameter", "strength"),
    [("dial_delay", "delay_s", 0.3), ("sticky_fan", "tau_s", 1.5)],
)
def test_an_effect_of_the_library_runs_in_the_simulator_with_its_value(
    name: str, parameter: str, strength: float
) -> None:
    found = ask(bank(OTHER, {name: {parameter: strength}}))
    assert [c.name for c in found.causes] == [name]
    assert value(found, name, parameter) == pytest.approx(strength, rel=0.03)
    assert found.whole is not None
    assert found.whole.final < 1.0


def test_a_value_that_differs_from_run_to_run_is_known_no_better_than_it_scatters() -> None:
    gains = (0.03, 0.05, 0.06, 0.07)
    played = zip(("random", "random", "sines", "sines"), gains, strict=True)
    runs = [
        recorded(family, k, OTHER, {"driver_gain": {"g": g}}, duration_s=50.0, day=99)
        for k, (family, g) in enumerate(played, start=1)
    ]
    (gain,) = ask(runs).causes[0].values
    error = float(np.std(gains, ddof=1)) / len(gains) ** 0.5
    assert 0.5 * error < gain.sd < 2.0 * error


def test_two_effects_are_both_found() -> None:
    found = ask(bank(OTHER, {"dial_delay": {"delay_s": 0.5}, **GAIN}))
    assert {c.name for c in found.causes} == {"dial_delay", "driver_gain"}
    assert found.whole is not None
    assert found.whole.final < 1.0


def test_the_order_of_the_runs_does_not_matter_and_the_answer_is_always_the_same(
    gain: Verdict,
) -> None:
    assert timeless(ask(bank(OTHER, GAIN)[::-1])) == timeless(gain)


def test_what_no_effect_may_be_called_is_a_law_where_it_acts() -> None:
    runs = bank(OTHER, GAIN)[:2]
    found = diagnose(runs, plant=HeaterPlant(), candidates=()).verdict
    assert {c.place for c in found.causes} == POWERS
    assert all((c.kind, c.name, c.names) == ("law", "", {}) for c in found.causes)
    for cause in found.causes:
        state = cause.place.removeprefix("reading_").replace("power", "cmd")
        assert slope(cause, state) == pytest.approx(0.05, abs=0.003)
    with pytest.raises(PlantMismatch, match="driver_gain"):
        diagnose(runs, plant=HeaterPlant(), candidates=["driver_gian"])


@pytest.mark.parametrize("period_s", [0.1, 0.4])
def test_the_verdict_does_not_hang_on_the_length_of_a_row(
    gain: Verdict, period_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = importlib.import_module("smad.diagnosis.diagnose")
    monkeypatch.setattr(module, "row_of_admitted_s", lambda runs, plant: period_s)
    found = ask(bank(OTHER, GAIN))
    assert [c.name for c in found.causes] == [c.name for c in gain.causes]
    assert value(found, "driver_gain", "g") == pytest.approx(0.05, abs=0.001)


def every_second(run: GapRun) -> GapRun:
    """The record as a logger of half the rate would have written it."""
    return replace(
        run,
        t_s=run.t_s[1::2],
        inputs={k: v[1::2] for k, v in run.inputs.items()},
        outputs={k: v[1::2] for k, v in run.outputs.items()},
    )


def test_records_of_half_the_rate_give_the_same_places() -> None:
    found = ask([every_second(r) for r in bank(OTHER, GAIN)])
    assert value(found, "driver_gain", "g") == pytest.approx(0.05, abs=0.001)


def test_runs_held_out_are_judged_on_and_not_fitted() -> None:
    runs = bank(OTHER, GAIN)
    other = recorded("random", 9, {**OTHER, "rod_um_K": 3.4}, GAIN, duration_s=50.0)
    found = ask(runs[:3], hold_out=[other])
    assert found.judged_on == "1 run held out"
    fitted = {q.name: q.after for q in found.parameters}
    assert fitted["rod_um_K"] == pytest.approx(3.0, abs=0.02)
    rod = next(s for s in found.budget if s.signal == "rod_um")
    assert rod.final > 15 * rod.floor


@pytest.mark.parametrize("mode", ["no number", "lost"])
def test_runs_of_which_few_rows_are_whole_are_refused_with_the_reason(mode: str) -> None:
    # A quarter of the samples; of no channel more than a fifteenth.
    found = ask([lossy(run, 4 if mode == "lost" else 15, mode) for run in bank(OTHER, GAIN)])
    assert found.outcome == REFUSED
    said = " ".join(f.text for f in found.findings)
    assert "have 80% of their samples; at least 40 must" in said
    share = "24.9% of the samples are lost" if mode == "lost" else "no readings (of power_l_W"
    assert share in said


def lossy(run: GapRun, every: int, mode: str) -> GapRun:
    """A run that lost one sample in so many; with "no number" one of each channel, at other times.

    With "no number, at once" the same one of all channels.
    """
    place = np.arange(len(run.t_s)) % every
    if mode.startswith("no number"):
        step = 0 if mode.endswith("at once") else 3
        outputs = {
            name: np.where(place == (3 + step * k) % every, np.nan, y)
            for k, (name, y) in enumerate(run.outputs.items())
        }
        return run.with_columns(outputs=outputs)
    kept = place != 3
    inputs, outputs = (
        {name: y[kept] for name, y in columns.items()} for columns in (run.inputs, run.outputs)
    )
    return replace(run, t_s=run.t_s[kept], inputs=inputs, outputs=outputs, valid=None)


@pytest.mark.parametrize("mode", ["no number, at once", "lost"])
def test_a_sixteenth_of_lost_samples_hides_no_cause_and_makes_none(mode: str) -> None:
    # The plant takes equal steps: a lost sample must not shorten its time.
    found = ask([lossy(run, 16, mode) for run in bank(OTHER, GAIN)])
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert value(found, "driver_gain", "g") == pytest.approx(0.05, abs=0.001)
    assert found.causes[0].gap < 1.0
    healthy = ask([lossy(run, 16, mode) for run in bank(OTHER)])
    assert not healthy.causes
    assert "samples lost" in {f.kind for f in healthy.findings}


def test_two_runs_are_said_to_be_judged_by_stretches() -> None:
    found = ask(bank(OTHER, GAIN)[:2])
    assert found.judged_on == "stretches of 2 runs, each by a model fitted to the others"


def test_a_single_run_is_said_to_be_one_and_judged_by_its_own_stretches() -> None:
    found = ask(bank(OTHER, GAIN)[:1])
    assert found.judged_on == "stretches of the one run, each by a model fitted to the others"
    assert [f.kind for f in found.findings] == ["few runs"]
    assert found.causes[0].name == "driver_gain"


def test_what_hangs_on_one_run_is_not_sure() -> None:
    late = {"dial_delay": {"delay_s": 0.5}}
    all_alike = ask(bank(OTHER, late)).causes[0]
    one_unlike = ask(bank(OTHER, late)[:1] + bank(OTHER)[1:])
    assert all_alike.probability > 0.99
    assert all(c.probability < 0.95 for c in one_unlike.causes)


def test_a_channel_that_the_bench_lacks_is_not_judged_and_the_rest_is() -> None:
    runs = [
        r.with_columns(outputs={k: v for k, v in r.outputs.items() if k != "rod_um"})
        for r in bank(OTHER, GAIN)
    ]
    runs = [replace(r, outputs={k: v for k, v in r.outputs.items() if k != "rod_um"}) for r in runs]
    found = ask(runs)
    assert [c.name for c in found.causes] == ["driver_gain"]
    assert "rod_um" not in {s.signal for s in found.budget}
    missing = [f for f in found.findings if f.kind == "channel missing"]
    assert {f.text for f in missing} == {"rod_um not recorded, so not compared"}
    assert [f.run for f in missing] == sorted(r.name for r in runs)


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
    assert value(found, "driver_gain", "g") == pytest.approx(0.05, abs=0.001)


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


def test_files_are_no_runs_until_they_are_read() -> None:
    with pytest.raises(PlantMismatch, match="a run is no GapRun; got str; read a file with"):
        diagnose(["run.mcap"], plant=HeaterPlant())  # type: ignore[list-item]
