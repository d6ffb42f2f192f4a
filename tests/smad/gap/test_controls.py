"""Negative controls: what is wrong with a file is named for what it is, with no cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smad.gap.records import Outcome

from smad.diagnosis.data.admission import admit
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, ask, bank
from tests.smad.gap.heater_plant import HeaterPlant, recorded


def kinds(diagnosis) -> set[str]:  # type: ignore[no-untyped-def]
    return {f.kind for f in diagnosis.findings}


def test_swapped_sides_are_named_as_swapped() -> None:
    runs = [
        r.with_columns(
            outputs={
                "temp_l_degC": r.outputs["temp_r_degC"],
                "temp_r_degC": r.outputs["temp_l_degC"],
            }
        )
        for r in bank(OTHER)[:2]
    ]
    diagnosis = ask(runs)
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "swapped channels" in kinds(diagnosis)
    assert "temp_l_degC" in diagnosis.verdict.text


def test_inputs_of_another_run_are_named_as_not_driving_the_outputs() -> None:
    a, b = recorded("random", 1, OTHER), recorded("random", 2, OTHER)
    crossed = [a.with_columns(inputs=b.inputs), b.with_columns(inputs=a.inputs)]
    diagnosis = ask(crossed)
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "inputs do not drive the outputs" in kinds(diagnosis)


def test_shuffled_inputs_are_named_as_not_driving_the_outputs() -> None:
    rng = np.random.default_rng(3)
    runs = []
    for run in bank(OTHER)[:2]:
        order = rng.permutation(len(run.t_s))
        runs.append(run.with_columns(inputs={k: v[order] for k, v in run.inputs.items()}))
    diagnosis = ask(runs)
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "inputs do not drive the outputs" in kinds(diagnosis)


def test_a_run_of_which_some_channels_follow_the_inputs_is_admitted_with_a_warning() -> None:
    """Something that the model lacks may drive the others, and may be the very cause."""
    other = recorded("random", 2, OTHER)
    odd = {k: other.outputs[k] for k in ("temp_l_degC", "temp_r_degC", "rod_um")}
    runs = [recorded("random", seed, OTHER).with_columns(outputs=odd) for seed in (1, 3)]
    for run in runs:
        kept = admit([run], HeaterPlant(), SETTINGS)
        assert kept.refused == []
        (text,) = [f.text for f in kept.findings if f.kind == "channels do not follow"]
        assert text.startswith("temp_l_degC, temp_r_degC, rod_um move otherwise")
        assert "while power_l_W, power_r_W follow" in text


def test_a_constant_channel_is_named_and_taken_out() -> None:
    runs = [
        r.with_columns(outputs={"temp_l_degC": np.full_like(r.t_s, 21.37)}) for r in bank(OTHER)
    ]
    diagnosis = ask(runs)
    assert "constant channel" in kinds(diagnosis)
    assert diagnosis.verdict.effects == []
    assert diagnosis.verdict.outcome in (Outcome.PARAMETERS, Outcome.NO_GAP)
    assert any("temp_l_degC" in text for text in diagnosis.missing)


def test_a_run_of_three_seconds_is_refused_as_too_short() -> None:
    short = [r.part(0, 30) for r in bank(OTHER)[:2]]
    diagnosis = ask(short)
    assert diagnosis.verdict.outcome is Outcome.NO_EXCITATION
    assert kinds(diagnosis) == {"too short"}


def test_a_run_in_which_nothing_is_driven_is_refused_for_want_of_excitation() -> None:
    idle = [
        replace(r.part(0, 200), inputs={k: np.zeros(200) for k in r.inputs})
        for r in bank(OTHER)[:1]
    ]
    diagnosis = ask(idle)
    assert diagnosis.verdict.outcome is Outcome.NO_EXCITATION
    assert kinds(diagnosis) == {"no excitation"}


def test_a_truncated_log_is_used_up_to_the_cut_and_said_to_be() -> None:
    runs = bank(OTHER, {"sensor_lag": SHOWN["sensor_lag"]})
    runs[0] = replace(runs[0].part(0, 300), cut_short=True)
    diagnosis = ask(runs)
    assert "truncated" in kinds(diagnosis)
    assert diagnosis.verdict.effects == ["sensor_lag"]


def test_a_run_with_a_third_of_its_samples_lost_is_refused() -> None:
    run = bank(OTHER)[0]
    valid = np.random.default_rng(0).random(len(run.t_s)) > 0.33
    diagnosis = ask([replace(run, valid=valid)])
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "samples lost" in kinds(diagnosis)


def test_a_few_lost_samples_do_no_harm() -> None:
    rng = np.random.default_rng(1)
    runs = []
    for r in bank(OTHER, {"coupling": SHOWN["coupling"]}):
        valid = rng.random(len(r.t_s)) > 0.03
        spoilt = {k: np.where(valid, v, np.nan) for k, v in r.outputs.items()}
        filled = {k: np.interp(r.t_s, r.t_s[valid], v[valid]) for k, v in spoilt.items()}
        runs.append(replace(r, outputs=filled, valid=valid))
    diagnosis = ask(runs)
    assert diagnosis.verdict.effects == ["coupling"]
    assert "samples lost" in kinds(diagnosis)


@pytest.mark.parametrize("missing", ["rod_um", "power_l_W"])
def test_a_channel_that_the_bench_lacks_switches_its_residual_off(missing: str) -> None:
    runs = [
        replace(r, outputs={k: v for k, v in r.outputs.items() if k != missing})
        for r in bank(OTHER, {"sensor_lag": SHOWN["sensor_lag"]})
    ]
    diagnosis = ask(runs)
    assert any(missing in text for text in diagnosis.missing)
    assert "channel missing" in kinds(diagnosis)
    if missing == "rod_um":
        assert diagnosis.verdict.effects == ["sensor_lag"]


def lacking(runs: list[GapRun], *channels: str) -> list[GapRun]:
    return [
        replace(r, outputs={k: v for k, v in r.outputs.items() if k not in channels}) for r in runs
    ]


@pytest.mark.parametrize("role", ["fit", "good", "hold_out"])
def test_a_channel_that_one_group_of_runs_lacks_is_switched_off_in_all(role: str) -> None:
    runs = bank(OTHER, {"driver_gain": SHOWN["driver_gain"]})
    roles = {"fit": runs[:2], "hold_out": runs[2:], "good": bank(OTHER, seed=40)[:3]}
    roles[role] = lacking(roles[role], "rod_um")
    diagnosis = ask(roles["fit"], good=roles["good"], hold_out=roles["hold_out"])
    assert "channel not shared" in kinds(diagnosis)
    assert any("rod_um" in f.text for f in diagnosis.findings)
    assert "rod_um" not in {f.channel for f in diagnosis.floors}
    assert diagnosis.verdict.effects == ["driver_gain"], diagnosis.verdict.text


def test_groups_of_runs_that_share_no_channel_are_refused_by_name() -> None:
    channels = [c.name for c in HeaterPlant().channels]
    runs = bank(OTHER)[:2]
    diagnosis = ask(lacking(runs, channels[0]), good=lacking(runs, *channels[1:]))
    assert diagnosis.verdict.outcome is Outcome.REFUSED
    assert "no channel" in diagnosis.verdict.text


def test_runs_of_one_name_are_told_apart_by_number() -> None:
    good, short = bank(OTHER)[:2]
    named = [replace(good, name="push"), replace(short.part(0, 30), name="push")]
    diagnosis = ask(named)
    assert {r.name for r in diagnosis.runs} == {"push", "push (2)"}
    assert sorted(r.role for r in diagnosis.runs) == ["fit", "refused"]
    (short_one,) = (f for f in diagnosis.findings if f.kind == "too short")
    assert {r.role for r in diagnosis.runs if r.name == short_one.run} == {"refused"}


def test_an_output_that_only_some_groups_can_feed_is_left_out_of_all() -> None:
    """The good runs have both channels, but never in the same run."""
    good = bank(OTHER, seed=40)[:3]
    good = [*lacking(good[:1], "temp_l_degC", "temp_r_degC"), *lacking(good[1:], "rod_um")]
    diagnosis = ask(bank(OTHER, {"driver_gain": SHOWN["driver_gain"]}), good=good)
    assert diagnosis.verdict.effects == ["driver_gain"], diagnosis.verdict.text
    assert any(text.startswith("rod") and "not every group" in text for text in diagnosis.missing)


def test_a_run_that_cannot_be_judged_by_any_view_is_refused() -> None:
    runs = bank(OTHER)[:3]
    fed_only = lacking(runs[:1], *(c.name for c in HeaterPlant().channels if c.name != "rod_um"))
    diagnosis = ask([*fed_only, *runs[1:]])
    assert [r.role for r in diagnosis.runs if r.name == fed_only[0].name] == ["refused"]
    (said,) = (f.text for f in diagnosis.findings if f.kind == "no channel")
    assert "temp_l_degC" in said


def test_a_run_that_lacks_a_channel_of_the_first_one_does_no_harm() -> None:
    runs = bank(OTHER, {"driver_gain": SHOWN["driver_gain"]})
    runs[1] = lacking(runs[1:2], "rod_um")[0]
    assert ask(runs).verdict.effects == ["driver_gain"]


def test_a_gap_in_a_channel_is_bridged_and_does_not_count() -> None:
    runs = bank(OTHER, {"sensor_lag": SHOWN["sensor_lag"]})
    spoilt = runs[0].outputs["temp_l_degC"].copy()
    spoilt[[40, 41, 200]] = np.nan
    runs[0] = runs[0].with_columns(outputs={"temp_l_degC": spoilt})
    diagnosis = ask(runs)
    assert "gaps" in kinds(diagnosis)
    assert diagnosis.verdict.effects == ["sensor_lag"], diagnosis.verdict.text
    assert all(np.isfinite(f.sigma) for f in diagnosis.floors)


@pytest.mark.parametrize(("what", "kind"), [("input", "input broken"), ("time", "time runs back")])
def test_an_input_or_a_time_that_is_no_number_is_refused(what: str, kind: str) -> None:
    run = bank(OTHER)[0]
    column = (run.t_s if what == "time" else next(iter(run.inputs.values()))).copy()
    column[7] = np.nan
    name = next(iter(run.inputs))
    broken = replace(run, t_s=column) if what == "time" else run.with_columns(inputs={name: column})
    assert kinds(ask([broken])) == {kind}
