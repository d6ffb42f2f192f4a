"""Laws of the library: fitted to good runs first; and what a thinned replay keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bench.leftover import Lawless, leftover, main
from smad.gap import Settings, diagnose
from smad.gap.compare.tracks import follow_tracks
from smad.gap.fit.baseline import choices
from smad.gap.fit.judge import judge
from smad.gap.fit.stages import known_good, prepare
from smad.gap.records import Outcome
from smad.gap.report import page_of

from smad.diagnosis.data.grid import Grid, thinned
from smad.diagnosis.plant import Array, Effect, EffectParameter, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from smad.report.page import render
from tests.smad.gap.cases import OTHER, SETTINGS, ask, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant

LAWFUL = HeaterPlant(tuple(replace(e, law=e.name == "sensor_lag") for e in EFFECTS))
SLOW = {"sensor_lag": {"tau_s": 0.6}}
SLOWER = {"sensor_lag": {"tau_s": 1.6}}


def test_a_law_takes_its_value_from_the_good_runs() -> None:
    good = known_good(bank(OTHER, SLOW, seed=40)[:3], LAWFUL, SETTINGS)
    assert good.fit.point.effects["sensor_lag"]["tau_s"] == pytest.approx(0.6, abs=0.1)


def test_a_law_that_good_runs_do_not_follow_stays_near_nothing() -> None:
    good = known_good(bank(OTHER, seed=40)[:3], LAWFUL, SETTINGS)
    assert good.fit.point.effects["sensor_lag"]["tau_s"] < 0.1


def test_a_law_that_has_grown_since_is_named() -> None:
    good = bank(OTHER, SLOW, seed=40)[:3]
    verdict = ask(bank(OTHER, SLOWER), LAWFUL, good=good).verdict
    assert verdict.effects == ["sensor_lag"], verdict.text


def test_a_law_that_has_grown_is_named_although_a_parameter_has_moved_as_well() -> None:
    good = bank(OTHER, SLOW, seed=40)[:3]
    runs = bank(OTHER | {"ha_W_K": 0.6}, SLOWER)
    prepared = prepare(runs[:2], LAWFUL, SETTINGS, good=good, hold_out=runs[2:])
    track = follow_tracks(prepared, LAWFUL.effects)
    assert track.free_gain > SETTINGS.standard_errors * track.free_gain_se
    assert track.tied
    assert track.selection.best.names == ("sensor_lag",)


def test_the_free_refit_may_have_other_laws_than_the_good_runs_and_counts_them_as_no_cause() -> (
    None
):
    good = bank(OTHER, SLOW, seed=40)[:3]
    runs = bank(OTHER, SLOWER)
    prepared = prepare(runs[:2], LAWFUL, SETTINGS, good=good, hold_out=runs[2:])
    assert prepared.tied is not None
    assert prepared.tied.point.effects["sensor_lag"]["tau_s"] == pytest.approx(0.6, abs=0.1)
    assert prepared.fit.point.effects["sensor_lag"]["tau_s"] == pytest.approx(1.6, abs=0.2)
    assert prepared.fit.space.effects == ()
    (stiff,) = judge([prepared.tied], prepared.hold)
    assert prepared.free.excess() < 0.5 * stiff.excess()


def test_a_report_without_a_cause_says_which_laws_moved_and_how_far() -> None:
    good = bank(OTHER, SLOW, seed=40)[:3]
    asked = {"plant": LAWFUL, "good": good, "settings": SETTINGS, "candidates": ["backlash"]}
    found = diagnose(bank(OTHER, SLOWER), **asked)
    assert found.verdict.outcome is Outcome.PARAMETERS, found.verdict.text
    (lag,) = found.laws
    assert (lag.law, lag.name, lag.unit) == ("sensor_lag", "tau_s", "s")
    assert (lag.before, lag.after) == (pytest.approx(0.6, abs=0.1), pytest.approx(1.6, abs=0.2))
    assert f"{lag.after:.4g} s" in render(page_of(found))


def test_what_may_be_named_does_not_narrow_what_good_runs_are_asked_for() -> None:
    good = bank(OTHER, SLOW, seed=40)[:3]
    runs = bank(OTHER, SLOW | {"driver_gain": {"g": 0.04}})
    asked = {"plant": LAWFUL, "good": good, "settings": SETTINGS}
    verdict = diagnose(runs, candidates=["driver_gain"], **asked).verdict
    assert verdict.effects == ["driver_gain"], verdict.text
    assert "driver_gain" not in diagnose(runs, candidates=["backlash"], **asked).verdict.effects


def thinned_replays(
    point: ModelPoint, run: GapRun, views: Sequence[str]
) -> Iterator[tuple[int, dict[str, Array]]]:
    """A replay for each of three thinnings of a run: pieces of a bin, and bin means by key."""
    plant, period_s = SmaPlant(), Settings().period_s
    for pieces in (1, 2, 5):
        thin, coarse = thinned(run, Grid.of(run, period_s), pieces, period_s)
        rough = plant.simulate(point, thin, views, fast=True)
        yield pieces, {key: coarse.mean(values) for key, values in rough.items()}


def test_currents_of_a_thinned_replay_are_means_of_those_at_full_pace() -> None:
    plant, settings = SmaPlant(), Settings()
    run = recorded("mixed", plant, ModelPoint({}), 1, duration_s=20.0)
    point = ModelPoint({}, {"driver_lag": {"tau_s": 0.006}})
    grid = Grid.of(run, settings.period_s)
    whole = plant.simulate(point, run, ["actuator"], fast=True)
    for _, rough in thinned_replays(point, run, ["actuator"]):
        for key, values in whole.items():
            assert rough[key] == pytest.approx(grid.mean(values), abs=1e-9)


def test_a_thinned_replay_is_neither_early_nor_late() -> None:
    """Read at the ends of its samples it led by half of one, 5 to 45 ms."""
    plant, settings = SmaPlant(), Settings()
    run = recorded("mixed", plant, ModelPoint({}), 1, duration_s=40.0)
    point = ModelPoint({}, {"rtd_lag": {"tau_s": 0.1}, "pump_lag": {"dead_s": 0, "spinup_s": 0.2}})
    grid = Grid.of(run, settings.period_s)
    views = ["thermal", "mechanics"]
    whole = plant.simulate(point, run, views)
    for pieces, rough in thinned_replays(point, run, views):
        for key in ("thermal:rtd_x_degC", "mechanics:displacement_mm"):
            shown = grid.mean(whole[key])
            rate = np.gradient(shown, settings.period_s)
            off = rough[key] - shown
            late_s = -float(off @ rate) / float(rate @ rate)
            assert abs(late_s) < 0.1 * settings.period_s / pieces, (key, pieces)


def test_a_current_that_chatters_heats_as_much_in_a_thinned_replay() -> None:
    """Its mean does not: the heat goes with its square.

    With one heat capacity and the law on which ripples do nothing: the paper's capacity changes
    with the sign of the heat, and its kinetics ratchet, at every tick here.
    """
    plant, settings = SmaPlant(), Settings()
    capacity = plant.parameter_set["heat_capacity_heating"]
    point = ModelPoint({"heat_capacity_cooling": capacity}, {"unified_kinetics": {"tails": 0.3}})
    run = recorded("mixed", plant, ModelPoint({}), 1, noise=False, duration_s=30.0)
    ticks = np.arange(len(run.t_s)) % 2
    chatter = {"i_applied_x_A": 1.3 * run.inputs["i_applied_x_A"] * ticks}
    shown = {"i_meas_x_A": chatter["i_applied_x_A"]}
    run = run.with_columns(inputs=chatter, outputs=shown)
    grid = Grid.of(run, settings.period_s)
    views = ["thermal", "electrical"]
    whole = plant.simulate(point, run, views)
    for pieces, rough in thinned_replays(point, run, views):
        for key, limit in (("thermal:rtd_x_degC", 0.1), ("electrical:v_x_V", 0.01)):
            off = rough[key] - grid.mean(whole[key])
            assert np.sqrt(np.mean(np.square(off))) < limit, (key, pieces)


def test_inlet_and_room_as_measured_do_not_hide_what_the_model_says_of_them() -> None:
    plant = SmaPlant()
    run = recorded("mixed", plant, ModelPoint({}), 1, duration_s=20.0)
    warmer = run.with_columns(
        outputs={"rtd_inlet_degC": run.outputs["rtd_inlet_degC"] + 0.1 * (run.t_s - run.t_s[0])}
    )
    before, after = (
        plant.simulate(ModelPoint({}), r, ["thermal"], fast=True) for r in (run, warmer)
    )
    inlet = "thermal:rtd_inlet_degC"
    assert np.abs(after[inlet] - before[inlet]).max() < 0.05
    assert (after["thermal:rtd_x_degC"] - before["thermal:rtd_x_degC"]).max() > 0.05


def test_the_model_with_laws_leaves_less_of_a_bench_with_a_cooling_front(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = ModelPoint({}, {"cooling_front": {"share": 0.8, "place": 0.6}})
    good = [
        recorded(f, SmaPlant(), bench, 3 + i, duration_s=20.0)
        for i, f in enumerate(("mixed", "repeats"))
    ]
    monkeypatch.setattr("smad.gap.fit.baseline._ROUNDS", 0)
    few = ("cooling_front", "rtd_lag")
    (with_laws, unseen) = leftover(good, SmaPlant(only=few), good, SETTINGS)
    (without,) = leftover(good, Lawless(only=few), settings=SETTINGS)
    assert unseen["rtd_x_degC"] < 1.5 * with_laws["rtd_x_degC"]  # here the runs it was fitted to
    assert with_laws["rtd_x_degC"] < 0.5 * without["rtd_x_degC"]


def test_a_law_that_replaces_another_is_tried_both_ways() -> None:
    def law(name: str, *, strength: bool) -> Effect:
        q = EffectParameter("q", "1", 1.0, 0.0, 2.0, strength=strength)
        return Effect(name, name, "phase", (q,), ("force_N",), law=True)

    added, other = law("added", strength=True), law("other", strength=False)
    assert choices([added]) == [(added,)]
    assert choices([added, other]) == [(added, other), (added,)]
    switch = next(e for e in SmaPlant().effects if e.name == "unified_kinetics")
    assert switch.law
    assert [q.name for q in switch.parameters if q.strength] == []


def test_leftover_asks_for_a_folder() -> None:
    with pytest.raises(SystemExit, match="give folders"):
        main([])
    with pytest.raises(SystemExit, match="no run can be used"):
        main([str(Path(__file__).parent)])
