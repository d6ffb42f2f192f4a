"""Runs are replayed from where they read at their start."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sim_device.plant.laws import Law, Term
from smad.checkup.programme import shipped
from smad.diagnosis import diagnose
from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.played import Played
from smad.diagnosis.data.starts import starting_as_read, usual_starts
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.replays import GivenPoint, GivenRun
from smad.diagnosis.verdict import QUIET
from smad.diagnosis.verify import verified
from tests.smad.checkup.short import PLANT, played
from tests.smad.diagnosis.cases import strong

RUN = shipped().runs[0]
TRUE = ModelPoint({})
STROKES_S = 60.0


def used(seed: int, first: str = "y", point: ModelPoint = TRUE) -> GapRun:
    """A run after a stroke of each spring that it does not have; that of `first` came first."""
    run = RUN.as_run(27.0, 27.0)
    before = np.arange(run.t_s[0] - STROKES_S, run.t_s[0], 0.1)
    inputs = {name: np.r_[np.zeros(len(before)), column] for name, column in run.inputs.items()}
    for k, side in enumerate((first, "xy".replace(first, ""))):
        since_s = before - before[0] - 30.0 * k
        heated, pumped = (slice(*np.searchsorted(since_s, ab)) for ab in ((0, 9), (11, 27)))
        inputs[f"i_applied_{side}_A"][heated] = 2.9
        inputs[f"duty_{side}"][pumped] = 1.0
    levels = {n: np.r_[np.full(len(before), c[0]), c] for n, c in run.outputs.items()}
    whole = GapRun(RUN.name, np.r_[before, run.t_s], inputs, levels)
    found, noise = PLANT.simulate(point, whole), np.random.default_rng(seed)
    shown = {
        c.name: found[c.name][len(before) :] + c.noise * noise.normal(size=len(run.t_s))
        for c in PLANT.channels
    }
    return GapRun(f"{RUN.name} {seed}", run.t_s, run.inputs, shown)


def test_an_unchanged_bench_that_was_used_before_leaves_its_floor() -> None:
    runs = [used(1), used(2, first="x"), played(3, what=RUN)]
    assert all(row.raw < 1.3 * row.floor for row in verified(PLANT, runs, TRUE))
    as_mounted = [replace(run, starts={"displacement_mm": 0.0}) for run in runs]
    *_, whole = verified(PLANT, as_mounted, TRUE)
    assert whole.raw > 5.0


LAW = Law("recoverable_strain", "both", (Term(name="level", coefficient=1e-3),))
POINTS = {e.name: ModelPoint({}, {e.name: strong(e)}) for e in PLANT.effects}
POINTS["a law"] = ModelPoint({}, laws=(LAW,))


@cache
def read() -> GapRun:
    return starting_as_read(PLANT, used(1).part(0, 20))


@pytest.mark.parametrize("name", POINTS)
def test_what_acts_on_no_sensor_leaves_a_start_where_it_reads(name: str) -> None:
    run, given = GivenRun(read()), GivenPoint(PLANT, POINTS[name])
    assert run.starts(given) == pytest.approx(run.less_sensors(given), abs=1e-9)


def test_nothing_is_missing_in_the_simulator_of_an_unchanged_bench_that_was_used_before() -> None:
    verdict = diagnose([used(1), used(2, first="x")], plant=PLANT).verdict
    assert verdict.outcome == QUIET
    assert verdict.whole is not None
    assert verdict.whole.raw < 1.3


def test_a_reading_that_is_off_at_the_start_is_a_drift_of_its_run() -> None:
    """The zero of the encoder moves the reading, and with it where the replay starts."""
    off = ModelPoint({"displacement_zero": 0.1})
    runs = [used(seed, point=off) for seed in (1, 2)]
    assert all(row.final < 1.3 * row.floor for row in verified(PLANT, runs, off))


def test_a_run_starts_with_what_it_reads_temperatures_above_those_of_the_water() -> None:
    run = starting_as_read(PLANT, used(1))
    read = run.at_start(PLANT.traits.starts)
    water = run.at_start(["rtd_inlet_degC"])["rtd_inlet_degC"]
    assert run.starts["displacement_mm"] == read["displacement_mm"]
    assert "force_N" not in run.starts
    assert run.starts["rtd_x_degC"] == pytest.approx(read["rtd_x_degC"] - water)
    assert run.starts["rtd_x_degC"] > 0.1
    shown = PLANT.simulate(TRUE, run)
    for name, tolerance in (("displacement_mm", 0.01), ("rtd_x_degC", 0.05)):
        assert shown[name][0] == pytest.approx(read[name], abs=tolerance)


def test_a_group_without_a_reading_starts_at_the_mean_of_the_others() -> None:
    one, other, blind = used(1), used(2, first="x"), used(3)
    blind = replace(blind, outputs={"force_N": blind.outputs["force_N"]})
    *others, alone = usual_starts(PLANT, [[one], [other], [blind]])
    assert alone["displacement_mm"] == pytest.approx(
        np.mean([starts["displacement_mm"] for starts in others])
    )


@pytest.mark.parametrize(
    ("column", "more"), [("displacement_mm", 20.0), ("displacement_mm", -5.0), ("rtd_x_degC", 12.0)]
)
def test_a_reading_that_no_cold_bench_has_is_no_start_of_its_run_or_group(
    column: str, more: float
) -> None:
    one, other = used(1), used(2)
    off = one.with_columns(outputs={column: one.outputs[column] + more})
    assert column not in starting_as_read(PLANT, off).starts
    assert column in starting_as_read(PLANT, other).starts
    assert all(column not in starts for starts in usual_starts(PLANT, [[off], [other]]))


def test_admission_says_of_a_run_that_starts_warm_that_its_replay_does_not() -> None:
    cold = used(1)
    warmer = 12.0 * np.exp(-0.05 * (cold.t_s - cold.t_s[0]))
    warm = cold.with_columns(outputs={"rtd_x_degC": cold.outputs["rtd_x_degC"] + warmer})

    def said(run: GapRun) -> list[str]:
        texts = [finding.text for finding in admit([run], PLANT, PERIOD_S).findings]
        return [text for text in texts if "let the springs cool" in text]

    (text,) = said(warm)
    assert "rtd_x_degC reads 12." in text
    assert "°C above rtd_inlet_degC at the start" in text
    assert said(cold) == []


def test_a_run_that_is_driven_from_its_first_sample_starts_where_that_reads() -> None:
    cold = used(1)
    driven = {name: np.array(column) for name, column in cold.inputs.items()}
    driven["i_applied_x_A"][:300] = 3.0
    run = GapRun("driven", cold.t_s, driven, cold.outputs)
    hot = run.with_columns(outputs=PLANT.simulate(TRUE, replace(run, starts={})))
    read = starting_as_read(PLANT, hot).starts
    assert hot.at_start(["rtd_x_degC"])["rtd_x_degC"] > hot.outputs["rtd_x_degC"][0] + 0.3
    assert read["rtd_x_degC"] == pytest.approx(
        hot.outputs["rtd_x_degC"][0] - hot.outputs["rtd_inlet_degC"][0]
    )


def test_a_thinned_run_starts_as_the_one_it_was_thinned_from() -> None:
    run = used(1)
    bad = np.zeros(len(run.t_s), dtype=bool)
    bad[:100:4] = True
    marked = replace(run, valid=~bad)
    quick = Played.of(marked, PLANT.inputs).run
    assert len(quick.t_s) < len(run.t_s)
    names = ("rtd_inlet_degC", "displacement_mm")
    assert quick.at_start(names) == marked.at_start(names)


def test_a_sensor_that_is_off_reads_at_the_start_what_the_run_reads() -> None:
    effect = {"rtd_offset": {"offset_K": 1.0}}
    plant = SmaPlant(only=tuple(effect))
    shown = plant.simulate(ModelPoint({}, effect), starting_as_read(plant, used(1)))
    assert shown["rtd_x_degC"][0] == pytest.approx(used(1).outputs["rtd_x_degC"][0], abs=0.1)


def test_a_start_that_the_caller_gave_is_kept() -> None:
    given = {"displacement_mm": 0.6}
    assert starting_as_read(PLANT, replace(used(1), starts=given)).starts == given


def test_samples_that_are_marked_bad_say_nothing_of_a_start() -> None:
    run = used(1)
    bad = run.t_s < run.t_s[0] + 0.9
    shown = np.where(bad, 2.0, run.outputs["displacement_mm"])
    marked = replace(run.with_columns(outputs={"displacement_mm": shown}), valid=~bad)
    (starts,) = usual_starts(PLANT, [[marked]])
    assert starts["displacement_mm"] == pytest.approx(
        run.at_start(["displacement_mm"])["displacement_mm"], abs=0.02
    )
