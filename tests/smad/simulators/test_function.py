"""A Python function as a simulator: asked about its gap, and what is said of one that is none."""

from __future__ import annotations

import os
import re
import signal
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from unittest.mock import ANY

import numpy as np
import pytest
from scipy.signal import lfilter

from smad.diagnosis.data.admission import admit
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.report.words import lines
from smad.diagnosis.rivals.evidence import recorded_evidence
from smad.diagnosis.runs import GapRun
from smad.simulators import Missing, diagnose, plan, simulator
from smad.simulators.bind import bind
from smad.simulators.columns import csv_format, tables_of
from smad.simulators.errors import SimulatorError
from smad.simulators.expected import Expected, expected, spaced
from smad.simulators.starts import Starts
from smad.simulators.windows import choose_window, forgets_its_start, other_starts
from tests.smad.simulators.systems import (
    declared_heater,
    declared_pendulum,
    heater,
    heater_run,
    pendulum_run,
)

RUNS = [heater_run(seed) for seed in range(4)]
PARAMETERS = {"capacity_J_K": (30.0, 20.0, 40.0), "loss_W_K": (0.8, 0.5, 1.1)}


def test_the_gap_of_a_function_is_named_sized_and_goes_into_a_model_file(tmp_path: Path) -> None:
    answer = diagnose(RUNS, declared_heater())
    assert str(answer) == f"<Answer: {answer.verdict.headline}>"
    assert answer.model is not None
    answer.verdict.write_model(tmp_path / "better.toml")
    better = tomllib.loads((tmp_path / "better.toml").read_text())
    assert better["parameters"] == pytest.approx(dict(answer.model.theta))
    assert better["effects"] == {"slow_sensor": pytest.approx(answer.model.effects["slow_sensor"])}
    (cause,) = answer.verdict.causes
    assert cause.name == "slow_sensor"
    assert cause.values[0].value == pytest.approx(1.5, abs=0.1)
    assert any("inputs: power_W; measured: temperature_degC" in n for n in answer.verdict.notes)


def test_an_effect_without_a_unit_is_said_without_a_blank_at_its_end() -> None:
    unseen = diagnose([heater_run(seed, tau=0.0) for seed in range(4)], declared_heater()).verdict
    assert [re.sub(r"[.\d]+", "…", text) for text in unseen.unseen] == [
        "slow_sensor, size: less than …"
    ]


def test_runs_may_be_files_a_pattern_tables_or_made_runs(tmp_path: Path) -> None:
    for n, run in enumerate(RUNS[:2]):
        rows = np.column_stack(list(run.values()))
        np.savetxt(tmp_path / f"r{n}.csv", rows, delimiter=",", header=",".join(run), comments="")
    made = GapRun(
        "made",
        RUNS[0]["t_s"],
        {"power_W": RUNS[0]["power_W"]},
        {"temperature_degC": RUNS[0]["temperature_degC"]},
    )
    for given in (
        str(tmp_path / "r*.csv"),
        [tmp_path / "r0.csv", tmp_path / "r1.csv"],
        RUNS[:2],
        RUNS[0],
        made,
    ):
        (fit,) = bind(declared_heater(), given).groups
        np.testing.assert_allclose(fit[0].inputs["power_W"], RUNS[0]["power_W"])
        np.testing.assert_allclose(
            fit[0].outputs["temperature_degC"], RUNS[0]["temperature_degC"], atol=1e-9
        )


def test_ranges_quanta_and_noise_are_those_of_the_records() -> None:
    plant = bind(declared_heater(), RUNS).plant
    (signal,), (channel,) = plant.inputs, plant.channels
    assert (signal.name, signal.unit, signal.low, signal.high) == ("power_W", "W", 0.0, 45.0)
    assert channel.unit == "degC"
    assert channel.quantum == pytest.approx(0.01, rel=0.01)
    assert 0.02 < channel.noise < 0.05


def test_a_thinned_run_shows_the_means_of_the_run_as_it_was_recorded() -> None:
    bound = bind(declared_heater(), RUNS[:1])
    ((run,),) = bound.groups
    point = ModelPoint({})
    each = bound.plant.simulate(point, run)["temperature_degC"]
    thin = GapRun(
        "thin",
        run.t_s[4::5],
        {"power_W": run.inputs["power_W"].reshape(-1, 5).mean(axis=1)},
        {},
        whole=run,
    )
    means = bound.plant.simulate(point, thin)["temperature_degC"]
    np.testing.assert_allclose(means, each.reshape(-1, 5).mean(axis=1), atol=1e-9)
    pushed = thin.with_columns(inputs={"power_W": thin.inputs["power_W"] + 2.0})
    more = run.with_columns(inputs={"power_W": run.inputs["power_W"] + 2.0})
    np.testing.assert_allclose(
        bound.plant.simulate(point, pushed)["temperature_degC"],
        bound.plant.simulate(point, more)["temperature_degC"].reshape(-1, 5).mean(axis=1),
        atol=1e-9,
    )


def with_input(name, values):
    return [{**run, name: np.asarray(values(run), dtype=float)} for run in RUNS]


def gated(t, inputs, values, start):
    return heater(t, {"power_W": inputs["power_W"] * (inputs["enable"] > 0.5)}, values, start)


def test_an_exact_input_is_no_place_and_an_observed_column_may_be_in_a_law() -> None:
    runs = with_input("enable", lambda r: r["power_W"] >= 0.0)
    runs = [{**r, "wind_m_s": np.sin(0.1 * r["t_s"])} for r in runs]
    runs[0]["enable"][:10] = 0.0
    declared = simulator(
        gated,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
        exact=("enable",),
        observed=("wind_m_s",),
    )
    bound = bind(declared, runs)
    assert [p.name for p in bound.plant.places] == ["reading_temperature_degC", "input_power_W"]
    assert all("wind_m_s" in p.states for p in bound.plant.places)
    ((first, *_),) = bound.groups
    assert "wind_m_s" in bound.plant.trajectory(ModelPoint({}), first)
    (said,) = bound.said
    assert "exact, no places: enable" in said
    assert "may go with: wind_m_s" in said


def test_what_drives_a_heater_beside_its_power_is_found_as_a_law_over_the_observed_column() -> None:
    def blown(seed: int):
        run = heater_run(seed, tau=0.0)
        wind = np.repeat(np.random.default_rng(90 + seed).uniform(0.0, 4.0, 20), 30)
        values = {"capacity_J_K": 32.0, "loss_W_K": 0.74, "room_degC": 22.0, "slow_sensor": 0.0}
        given = {"power_W": run["power_W"] - 3.0 * wind}
        shown = heater(None, given, values, {})["temperature_degC"]
        return {**run, "wind_m_s": wind, "temperature_degC": np.round(shown, 2)}

    runs = [blown(seed) for seed in range(4)]
    verdict = diagnose(runs, declared_heater(observed=("wind_m_s",))).verdict
    first, *_ = verdict.causes
    assert first.place == "input_power_W"
    assert first.read[0].state == "wind_m_s"
    # What else stands in it is within its standard deviation.
    assert all(abs(t.slopes[x]) < t.sd[x] for t in first.read[1:] for x in t.slopes)
    # A straight line that is fitted as a bend is steeper beyond its knot.
    assert -6.0 < first.read[0].slopes["both"] < -2.0
    assert verdict.whole is not None
    assert verdict.whole.final < 0.25 * verdict.whole.parameters


def test_a_column_that_no_run_changes_and_one_that_is_not_read_are_said() -> None:
    runs = with_input("enable", lambda r: np.ones(len(r["t_s"])))
    runs = [{**r, "humidity": r["t_s"]} for r in runs]
    declared = simulator(
        gated,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": 2.0},
    )
    bound = bind(declared, runs)
    assert [s.name for s in bound.plant.inputs] == ["power_W"]
    (said,) = bound.said
    assert "that no run changes, no places: enable" in said
    assert "does not read: humidity" in said


def test_a_value_that_changes_nothing_is_said() -> None:
    def deaf(t, inputs, values, start):
        known = {"slow_sensor": 0.0} | {n: v for n, v in values.items() if n != "slow_sensr"}
        return heater(t, inputs, known, start)

    declared = simulator(
        deaf,
        effects={"slow_sensr": 2.0},
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0), "volume_L": (2.0, 1.0, 3.0)},
    )
    (said,) = bind(declared, RUNS).said
    assert "values that change nothing in run 1: volume_L, slow_sensr." in said


def test_so_long_a_record_that_its_rows_are_longer_than_its_signal_says_what_to_give() -> None:
    t_s = 0.01 * np.arange(20_000)
    drive = np.sin(40.0 * t_s) + np.sin(57.0 * t_s)

    def amplifier(t, inputs, values, start):
        return {"out_V": values["gain"] * inputs["in_V"]}

    declared = simulator(amplifier, parameters={"gain": (1.0, 0.5, 2.0)})
    runs = [{"t_s": t_s, "in_V": drive, "out_V": 1.1 * drive}] * 3
    said = bind(declared, runs).said[-1]
    assert said.startswith("out_V changes within a row, which is 0.1 s long since all runs")
    seconds = float(re.search(r"runs, (\S+) s in all", said)[1])
    short = [{n: y[: int(seconds / 3 / 0.01)] for n, y in run.items()} for run in runs]
    assert not any("changes within a row" in text for text in bind(declared, short).said)


@pytest.mark.parametrize("column", ["cooler_degF", "coler_degC", "cooler"])
def test_an_output_that_is_likely_a_column_under_another_name_is_asked_about(column: str) -> None:
    def two(t, inputs, values, start):
        shown = heater(t, inputs, {**values, "room_degC": 22.0, "slow_sensor": 0.0}, start)
        return {**shown, "cooler_degC": shown["temperature_degC"], "charge_A_s": t}

    declared, run = simulator(two, parameters=PARAMETERS), RUNS[0]
    (said,) = bind(declared, [run]).said
    assert "outputs without a column: cooler_degC, charge_A_s" in said
    words = (
        f"two returns cooler_degC, but no column has that name, and does not read column {column}"
    )
    if column == "cooler_degF":  # it is converted
        (said,) = bind(declared, [{**run, column: 1.8 * run["temperature_degC"] + 32.0}]).said
        assert "outputs without a column: charge_A_s" in said
    else:
        with pytest.raises(SimulatorError, match=words):
            bind(declared, [{**run, column: run["temperature_degC"]}])


class Drawing:
    def __init__(self) -> None:
        self.rng = np.random.default_rng(0)

    def __call__(self, t, inputs, values, start):
        shown = heater(t, inputs, {**values, "room_degC": 22.0, "slow_sensor": 0.0}, start)
        return {n: y + self.rng.standard_normal(len(y)) for n, y in shown.items()}


def writing(t, inputs, values, start):
    inputs["power_W"][:] *= 2.0
    return {"temperature_degC": inputs["power_W"]}


def setting(t, inputs, values, start):
    values["loss_W_K"] = 1.0
    return {"temperature_degC": t}


def short(t, inputs, values, start):
    return {"temperature_degC": inputs["power_W"][1:]}


def bare_array(t, inputs, values, start):
    return inputs["power_W"]


def misspelt(t, inputs, values, start):
    return {"temperature_degC": inputs["powr_W"]}


def peeking(t, inputs, values, start):
    return {"temperature_degC": inputs["temperature_degC"] + inputs["power_W"]}


def elsewhere(t, inputs, values, start):
    return {"pressure": inputs["power_W"]}


def rotating(t, inputs, values, start):
    return {"temperature_degC": np.exp(1j * inputs["power_W"])}


def failing(t, inputs, values, start):
    raise ZeroDivisionError("capacity")


def leaving(t, inputs, values, start):
    sys.exit("no solution")


def endless(t, inputs, values, start):
    return {"temperature_degC": inputs["power_W"] * np.inf}


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (Drawing(), "another temperature_degC for the same run and values.*give what is random"),
        (writing, "writing changes what it is given.*work on a copy"),
        (setting, "setting changes what it is given"),
        (short, r"fails on run 1.*temperature_degC has shape \(599,\); the run has \(600,\)"),
        (bare_array, "returns ndarray, not outputs by name"),
        (misspelt, "asks for 'powr_W', which is neither a column nor a value.*power_W"),
        (peeking, r"reads temperature_degC, which it returns; begin from start\["),
        (elsewhere, "returns nothing that was measured; got pressure"),
        (rotating, "temperature_degC is complex"),
        (failing, "fails on run 1 with the values it begins with; got ZeroDivisionError"),
        (leaving, r"ValueError: it ends the program: SystemExit\('no solution'\)"),
        (endless, "gives no numbers for temperature_degC"),
    ],
)
def test_a_function_that_cannot_be_asked_is_refused_by_what_is_wrong_with_it(
    function, words: str
) -> None:
    with pytest.raises(SimulatorError, match=words):
        diagnose(RUNS, simulator(function, parameters=PARAMETERS))


@pytest.mark.parametrize(
    "given", [{"exact": ("fan",)}, {"ranges": {"fan": (0.0, 1.0)}}, {"units": {"fan": "1"}}]
)
def test_what_is_declared_of_a_signal_that_the_function_has_not_is_refused(given) -> None:
    with pytest.raises(SimulatorError, match="names fan, which heater neither reads nor returns"):
        bind(declared_heater(**given), RUNS)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"parameters": {"a": (1.0, 2.0, 3.0)}}, "parameter a does not begin within its range"),
        ({"parameters": {"a": (1.0, 2.0)}}, r"parameter a is not \(value, low, high\)"),
        ({"parameters": {"a": (1.0, np.nan, 3.0)}}, r"parameter a is not \(value, low, high\)"),
        ({"parameters": {}, "effects": {"e": (0.0, 0.0, 1.0)}}, "effect e must allow 0"),
        ({"parameters": {}, "effects": {"e": (2.0, 1.0, 3.0)}}, "effect e must allow 0"),
        ({"parameters": {"a": (1.0, 0.0, 3.0)}, "effects": {"a": 1.0}}, "two values .* one name"),
        (
            {"parameters": {"mass_m": (1.0, 0.5, 2.0)}},
            r"mass_m is a mass by its name.* of a length; got m; allowed: kg, g; name it mass_kg",
        ),
        (
            {"parameters": {"k": (1.0, 0.0, 2.0, 0.0)}},
            "parameter k has a prior that it cannot leave",
        ),
        ({"parameters": {}, "effects": {"valve_delay_mm": 1.0}}, "valve_delay_mm is a time by"),
    ],
)
def test_numbers_that_cannot_be_a_parameter_or_an_effect_are_refused(given, words: str) -> None:
    with pytest.raises(SimulatorError, match=words):
        simulator(heater, **given)


def test_a_value_that_is_called_by_another_unit_is_used_where_its_unit_is_given() -> None:
    given = {"mass_m": (1.0, 0.5, 2.0)}
    declared = simulator(heater, parameters=given, units={"mass_m": "kg"}, effects={"rub": 1.0})
    assert declared.parameters[0].unit == "kg"
    assert declared.effects[0].places == ("equation of heater with rub",)


def test_shapes_of_an_effect_reach_the_function_beside_its_size() -> None:
    seen = {}

    def noting(t, inputs, values, start):
        seen.update(values)
        return {"temperature_degC": inputs["power_W"]}

    rim = Missing(typical=0.5, high=1.0, shapes={"rim_m": (2.0, 1.0, 3.0)}, places=("input_x",))
    declared = simulator(noting, parameters=PARAMETERS, effects={"overflow": rim})
    bound = bind(declared, RUNS[:1])
    bound.plant.simulate(
        ModelPoint({}, {"overflow": {"size": 0.7, "rim_m": 1.5}}), bound.groups[0][0]
    )
    assert (seen["overflow"], seen["rim_m"]) == (0.7, 1.5)
    assert bound.plant.effects[0].places == ("input_x",)


def test_a_model_that_gives_no_numbers_for_the_true_values_is_asked_up_to_there() -> None:
    def fragile(t, inputs, values, start):
        shown = heater(t, inputs, values, start)
        return shown if values["loss_W_K"] > 0.745 else {n: np.nan * c for n, c in shown.items()}

    runs = [heater_run(seed, tau=2.0) for seed in range(3)]
    declared = simulator(
        fragile,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
    )
    assert diagnose(runs, declared).verdict.causes[0].name == "slow_sensor"


@pytest.mark.parametrize(
    "forces", [("torque_N_m",), {"torque_N_m": (0.002, -0.02, 0.02)}, {"torque_N_m": 0.02}]
)
def test_forces_are_declared_by_low_and_high(forces: object) -> None:
    with pytest.raises(SimulatorError, match=r"\(low, high\)"):
        simulator(heater, parameters=PARAMETERS, forces=forces)


@pytest.mark.parametrize("code", [-127.0, 9999.0, -999.0])
def test_a_code_in_place_of_a_reading_is_left_out_and_said(code: float) -> None:
    runs = [heater_run(seed, tau=2.0) for seed in range(3)]
    runs[1]["temperature_degC"][[150, 151, 300]] = code
    verdict = diagnose(runs, declared_heater()).verdict
    assert verdict.causes[0].name == "slow_sensor"
    assert verdict.whole is not None
    assert verdict.whole.final < 1.5
    assert any(f"holds {code:g} in 3 samples" in line for line in lines(verdict))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: {k: v for k, v in r.items() if k != "t_s"}, "no column of the time; got"),
        (lambda r: {**r, "t_s": r["t_s"][::-1]}, "time does not increase at row 2"),
        (lambda r: {**r, "t_s": np.floor(r["t_s"])}, "at row 2; got 0.0; write it with more digi"),
        (
            lambda r: {"time" if k == "t_s" else k: 1e3 * v for k, v in r.items()},
            "'time' has no unit, and its samples would be seconds apart; got 100 s",
        ),
        (lambda r: {k: v[:5] for k, v in r.items()}, "only 5 samples"),
        (lambda r: 7, "neither a file nor a table"),
        (lambda r: "nowhere/*.csv", "no file is 'nowhere"),
    ],
)
def test_runs_that_cannot_be_read_are_refused(change, words: str) -> None:
    with pytest.raises(SimulatorError, match=words):
        diagnose([change(RUNS[0])], declared_heater())


def test_what_lacks_in_a_column_does_not_count_and_a_run_ends_at_its_first_hole() -> None:
    gaps = [{n: c.copy() for n, c in run.items()} for run in RUNS]
    gaps[0]["power_W"][300:303] = np.nan
    gaps[0]["temperature_degC"][::40] = np.nan
    gaps[1]["power_W"][500:] = np.nan
    verdict = diagnose(gaps, declared_heater()).verdict
    assert verdict.causes[0].name == "slow_sensor"
    said = {(f.run, f.kind) for f in verdict.findings}
    assert {("run 1", "gaps"), ("run 2", "hole")} <= said
    assert not any(f.refuses for f in verdict.findings)


def test_a_run_is_as_long_as_the_simulator_says_it_must_be_or_as_what_is_measured_asks_for() -> (
    None
):
    short = [pendulum_run(seed, seconds=4.0) for seed in range(2)]
    assert diagnose(short, declared_pendulum(shortest_s=8.0)).verdict.outcome == "refused"
    assert bind(declared_heater(), RUNS).plant.traits.shortest_s == 8.0
    assert bind(declared_pendulum(), short).plant.traits.shortest_s < 2.0
    quick = diagnose(short, declared_pendulum()).verdict
    assert not any(f.refuses for f in quick.findings)
    with pytest.raises(SimulatorError, match="shortest_s is not a length"):
        declared_pendulum(shortest_s=0.0)


def test_a_run_that_is_trusted_is_so_by_its_name_or_path(tmp_path: Path) -> None:
    for n, run in enumerate(RUNS[:2]):
        rows = np.column_stack(list(run.values()))
        np.savetxt(tmp_path / f"r{n}.csv", rows, delimiter=",", header=",".join(run), comments="")
    paths = [tmp_path / "r0.csv", tmp_path / "r1.csv"]
    for called in ("r1", "r1.csv", str(paths[1])):
        (runs,) = bind(declared_heater(), paths, trusted=(called,)).groups
        assert [r.trusted for r in runs] == [False, True]


def test_a_second_run_that_lacks_an_input_is_named() -> None:
    lacking = {k: v for k, v in RUNS[1].items() if k != "power_W"}
    with pytest.raises(SimulatorError, match="run 2 has no column power_W, which the simulator"):
        diagnose([RUNS[0], lacking], declared_heater())


def test_a_channel_that_the_first_run_lacks_is_compared_in_the_others() -> None:
    def cooling(t, inputs, values, start):
        shown = heater(t, inputs, values, start)
        loss = values["loss_W_K"] * (shown["temperature_degC"] - values["room_degC"])
        return {**shown, "cooling_W": loss}

    declared = simulator(
        cooling,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
    )
    fuller = {**RUNS[1], "cooling_W": 0.74 * (RUNS[1]["temperature_degC"] - 22.0)}
    other = {**RUNS[0], "humidity_pct": RUNS[0]["t_s"], "door": RUNS[0]["t_s"]}
    for runs in ([RUNS[0], fuller], [fuller, other]):
        bound = bind(declared, runs)
        assert [c.name for c in bound.plant.channels] == ["temperature_degC", "cooling_W"]

    def begun(t, inputs, values, start):
        assert np.isfinite(start["cooling_W_rate"])
        return cooling(t, inputs, values, start)

    with pytest.raises(SimulatorError, match="run 1 has no reading of cooling_W, which begun begi"):
        bind(replace(declared, function=begun, name="begun"), [RUNS[0], fuller])


def test_a_run_that_begins_in_another_state_than_the_model_is_asked_about() -> None:
    def risen(rise: float, lasts_s: float) -> list[dict[str, Array]]:
        more = [rise * k * np.exp(-r["t_s"] / lasts_s) for k, r in enumerate(RUNS, 1)]
        return [
            {**r, "temperature_degC": r["temperature_degC"] + m}
            for r, m in zip(RUNS, more, strict=True)
        ]

    late = RUNS[0]["temperature_degC"].copy()
    late[:150] = np.nan
    for same in (RUNS, risen(10.0, np.inf), [{**RUNS[0], "temperature_degC": late}]):
        bound = bind(declared_heater(), same)
        assert other_starts(bound.plant.plain, bound.groups[0]) == []
    bound = bind(declared_heater(), risen(10.0, 30.0))
    bound.plant.plain.window_s = 100.0
    assert len(other_starts(bound.plant.plain, bound.groups[0])) == 1
    verdict = diagnose(risen(10.0, 30.0), declared_heater()).verdict
    (said,) = (line for line in lines(verdict) if "begins at" in line)
    assert re.match(r"run 4: temperature_degC begins at 6[12].* °C, in the model at 22, and", said)


def test_a_model_without_a_state_is_not_asked_to_begin_in_another() -> None:
    def at_once(t, inputs, values, start):
        return {"temperature_degC": values["gain"] * inputs["power_W"]}

    t_s = np.arange(600) * 0.1
    power = np.repeat([30.0, 0.0, 15.0, 45.0, 20.0, 20.0], 100)
    shown = lfilter([0.1], [1.0, -0.9], 2.0 * power)
    run = {"t_s": t_s, "power_W": power, "temperature_degC": np.round(shown, 2)}
    bound = bind(simulator(at_once, parameters={"gain": (2.0, 1.0, 3.0)}, effects={}), [run])
    assert other_starts(bound.plant.plain, bound.groups[0]) == []


def test_models_that_explode_are_dropped_and_said() -> None:
    def explosive(t, inputs, values, start):
        if values["burst"] > 1.0:
            raise FloatingPointError("it burst")
        if values["burst"] < 0.0:
            return {"temperature_degC": np.full(len(t), 1e12)}
        return heater(t, inputs, values, start)

    declared = simulator(
        explosive,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0), "burst": (0.5, -5.0, 5.0)},
    )
    verdict = diagnose(RUNS, declared).verdict
    assert verdict.causes[0].name == "slow_sensor"
    (said,) = (n for n in verdict.notes if "gave no numbers" in n)
    assert re.search(r"\d+ of \d+ replays gave no numbers.*dropped: .*burst", said)


def test_an_effect_with_which_no_model_runs_is_said_to_be_no_rival() -> None:
    plant = bind(declared_heater(), RUNS[:1]).plant.plain

    def broken(t, inputs, values, start):
        if values["slow_sensor"] > 0.0:
            raise FloatingPointError("it burst")
        return heater(t, inputs, values, start)

    plant.declared = replace(plant.declared, function=broken)
    ((run,),) = bind(declared_heater(), RUNS[:1]).groups
    for point in (ModelPoint({}), ModelPoint({}, {"slow_sensor": {"size": 2.0}})):
        plant.simulate(point, run)
    dropped, no_rival = plant.failures.notes
    assert re.match(r"1 of 2 replays gave no numbers.*it burst at .*slow_sensor = 2", dropped)
    assert no_rival == "no replay with slow_sensor gave numbers: no rival"


def test_a_slow_function_says_beforehand_how_long_the_whole_will_take(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = iter(np.arange(0.0, 1e6, 1.0))
    monkeypatch.setattr("smad.simulators.checks.time.perf_counter", lambda: float(next(clock)))
    told: list[str] = []
    diagnose(RUNS, declared_heater(), progress=told.append, processes=1)
    assert re.match(r"smad: a replay takes 1 s: \d+ min to \d+ min in all", capsys.readouterr().err)
    assert "choosing a window" in told


@pytest.mark.parametrize(("candidates", "share"), [(None, "low_s"), ((), "high_s")])
def test_the_time_that_is_told_is_near_the_replays_that_are_made(candidates, share: str) -> None:
    bound = bind(declared_heater(), RUNS)
    takes = expected(bound.plant, bound.groups[0], 1.0)
    answer = diagnose(RUNS, declared_heater(), candidates=candidates)
    assert answer.search is not None
    made = answer.search.question.model.plant.plain.failures.replays
    assert made / 3 < getattr(takes, share) < 3 * made


def test_a_slow_function_replays_in_all_idle_cores_unless_it_cannot_be_forked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("smad.simulators.expected._cores", lambda: 8)
    monkeypatch.setattr("smad.simulators.expected._busy", lambda: 0)
    slow, quick = Expected(0.02, 20.0, 300.0, 5), Expected(0.001, 1.0, 15.0, 5)
    assert [e.processes(n) for e in (slow, quick) for n in (None, 3)] == [8, 3, 1, 3]
    text = "a replay takes 0.02 s: 4 s to 60 s in all in 8 processes (processes = 1: in this one)"
    assert slow.words(8, chosen=True) == text
    assert slow.words(1, chosen=False).endswith(
        "20 s to 5 min in all; with idle cores processes = 8 (--processes) shares out the runs"
    )
    for busy, count in ((5, 3), (20, 1)):
        monkeypatch.setattr("smad.simulators.expected._busy", lambda busy=busy: busy)
        assert slow.processes(None) == count
    monkeypatch.setattr("smad.simulators.expected._busy", lambda: 0)
    monkeypatch.setitem(sys.modules, "jax", None)
    assert slow.processes(None) == 1


def test_a_slow_function_says_every_ten_seconds_what_it_does() -> None:
    clock, said = iter([0.0, 4.0, 11.0, 15.0, 30.0]), list[str]()
    say = spaced(said.append, lambda: next(clock))
    for text in ("parameters", "fitting a", "fitting b", "fitting c"):
        say(text)
    assert said == ["11 s: fitting a", "30 s: fitting c"]


def test_a_pendulum_whose_whole_runs_are_lost_is_replayed_in_windows_and_its_friction_found() -> (
    None
):
    runs = [pendulum_run(seed) for seed in range(4)]
    verdict = diagnose(runs, declared_pendulum()).verdict
    (said,) = (n for n in verdict.notes if "windows" in n)
    assert re.match(r"replayed in windows of [\d.]+ s that begin from the readings: over a", said)
    first, *_ = verdict.causes
    assert first.name == "dry_friction"
    assert first.values[0].value == pytest.approx(0.06, rel=0.15)
    (law,) = diagnose(runs, declared_pendulum(), candidates=()).verdict.causes
    assert law.place == "input_torque_N_m"
    assert law.read[0].name == "angle_rad_rate_sign"
    assert law.read[0].slopes["both"] == pytest.approx(-0.06, rel=0.15)


def test_a_window_that_is_given_is_taken_and_whole_runs_are_asked_for_with_0() -> None:
    (runs,) = bind(declared_pendulum(), [pendulum_run(0)]).groups
    plant = bind(declared_pendulum(), [pendulum_run(0)]).plant.plain
    assert choose_window(plant, runs, 2.0) == (2.0, ANY)
    assert choose_window(plant, runs, 0.0) == (0.0, "")


def test_each_window_begins_from_the_readings_there() -> None:
    bound = bind(declared_pendulum(), [pendulum_run(0)])
    plant, ((run,),) = bound.plant.plain, bound.groups
    plant.window_s = 2.0
    assert plant.seams(run) == list(range(0, 2000, 200))
    shown = plant.simulate(ModelPoint({}), run)["angle_rad"]
    at = plant.seams(run)
    np.testing.assert_allclose(shown[at], run.outputs["angle_rad"][at], atol=3e-3)
    states = bound.plant.trajectory(ModelPoint({}), run)
    assert np.abs(states["angle_rad_rate"][at]).max() < 10.0
    pushed = run.with_columns(inputs={n: c + 0.1 for n, c in run.inputs.items()})
    assert plant.windows(pushed) is plant.windows(run)


def test_what_a_window_begins_from_is_free_by_what_the_readings_may_be_off_by() -> None:
    def cart(t, inputs, values, start):
        rate = start["x_m_rate"] + 0.01 * np.cumsum(inputs["force_N"]) / values["mass_kg"]
        return {"x_m": start["x_m"] + 0.01 * np.r_[0.0, np.cumsum(rate)[:-1]]}

    rng = np.random.default_rng(0)
    force = np.repeat(rng.uniform(-2.0, 2.0, 20), 50)
    x = cart(None, {"force_N": force}, {"mass_kg": 1.0}, {"x_m": 0.0, "x_m_rate": 0.0})["x_m"]
    read = x + 5e-3 * rng.standard_normal(1000)
    table = {"t_s": 0.01 * np.arange(1000), "force_N": force, "x_m": read}
    bound = bind(simulator(cart, parameters={"mass_kg": (1.0, 0.5, 2.0)}), table)
    plant, ((run,),), point = bound.plant, bound.groups, ModelPoint({})
    plant.plain.window_s = 2.5
    base = plant.simulate(point, run)["x_m"]
    changed = [np.flatnonzero(y["x_m"] != base) // 250 for y in plant.begun_otherwise(point, run)]
    assert [set(c.tolist()) for c in changed] == [{0}, {1}, {2}, {3}] * 2
    evidence = recorded_evidence(plant, [run], np.array([5e-3 / np.sqrt(10.0)]), 0.1, point)
    (played,) = evidence.played
    shown = np.stack([plant.simulate(point, played.run)["x_m"]])
    left = evidence.residual([np.ascontiguousarray(played.means(shown)).T])
    assert np.mean(left**2) > 20.0
    assert np.mean(evidence.less_drifts(left, evidence.valid) ** 2) < 1.5


def test_windows_that_are_too_short_or_do_not_begin_from_readings_are_refused() -> None:
    with pytest.raises(SimulatorError, match=r"windows are too short.*at least"):
        diagnose([pendulum_run(0)], declared_pendulum(), window_s=0.02)
    with pytest.raises(SimulatorError, match="does not begin from its readings"):
        diagnose(RUNS, declared_heater(), window_s=20.0)
    with pytest.raises(SimulatorError, match="window_s is not a length"):
        diagnose(RUNS, declared_heater(), window_s=-1.0)


def test_runs_that_a_model_follows_are_replayed_whole() -> None:
    bound = bind(declared_pendulum(), [pendulum_run(s, seconds=4.0, friction=0.0) for s in (0, 1)])
    assert choose_window(bound.plant.plain, bound.groups[0], None) == (0.0, "")
    heated = bind(declared_heater(), RUNS)
    assert choose_window(heated.plant.plain, heated.groups[0], None) == (0.0, "")


@pytest.mark.parametrize("forgotten", [0.0, 0.05])
def test_a_model_that_forgets_its_start_needs_no_windows(forgotten: float) -> None:
    def tank(t, inputs, values, start):
        level, shown = start["level_m"], []
        for flow in inputs["flow"].tolist():
            shown.append(level)
            level += values["gain"] * flow - forgotten * level
        return {"level_m": shown}

    rng = np.random.default_rng(1)
    flow, level = rng.standard_normal((2, 400))
    run = {"t_s": 0.1 * np.arange(400), "flow": flow, "level_m": 0.1 * level.cumsum()}
    bound = bind(simulator(tank, parameters={"gain": (0.1, 0.05, 0.2)}), run)
    ((admitted,),) = bound.groups
    assert forgets_its_start(bound.plant.plain, admitted) == bool(forgotten)


@pytest.mark.parametrize("value", [0.0, 0.3])
def test_a_transducer_of_no_size_changes_nothing_and_each_of_some_size_does(value: float) -> None:
    bound = bind(declared_heater(transducers=True), RUNS[:1])
    ((run,),) = bound.groups
    base = bound.plant.simulate(ModelPoint({}), run)["temperature_degC"]
    transducers = [e for e in bound.plant.effects if e.name != "slow_sensor"]
    assert {e.name for e in transducers} == {
        *(f"temperature_degC_{x}" for x in ("gain", "zero", "lag", "delay")),
        *(f"power_W_{x}" for x in ("gain", "zero", "lag", "delay", "saturation")),
    }
    for effect in transducers:
        (q,) = effect.parameters
        point = ModelPoint({}, {effect.name: {q.name: value}})
        moved = bound.plant.simulate(point, run)["temperature_degC"]
        assert np.array_equal(moved, base) == (value == 0.0), effect.name


def test_a_column_of_dates_in_another_form_is_named_whatever_it_is_called(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    days = [f"01.05.2026 10:00:{k:02d};{k};{k}" for k in range(40)]
    path.write_text("\n".join(["Datum;power_W;temperature_degC", *days]))
    with pytest.raises(SimulatorError, match=r'column .Datum. .*time_format = "%d.%m.%Y %H:%M:%S"'):
        bind(declared_heater(), path)
    assert tables_of(path, form=csv_format({"time_format": "%d.%m.%Y %H:%M:%S"}))[0].t_s[-1] == 39.0


def test_stamps_of_a_time_zone_are_a_time() -> None:
    class Zoned:
        """An index of pandas that has a time zone: numpy makes objects of it."""

        name, dtype = None, type("Type", (), {"tz": "UTC"})

        def __array__(self, dtype=None, copy=None):
            return np.array("2026-05-01", "M8[ns]") + np.arange(600) * np.timedelta64(100, "ms")

    class Frame(dict):
        index = Zoned()

    frame = Frame({n: c for n, c in RUNS[0].items() if n != "t_s"})
    np.testing.assert_allclose(tables_of(frame)[0].t_s, RUNS[0]["t_s"])


def test_runs_one_below_the_other_are_to_be_split() -> None:
    twice = {n: np.tile(c, 2) for n, c in RUNS[0].items()}
    with pytest.raises(SimulatorError, match=r"its time begins again at row 601; .*split it there"):
        bind(declared_heater(), twice)


def in_units(run: Mapping[str, Array], names: Mapping[str, tuple[str, float, float]]):
    """The run with columns renamed, as value · factor + offset."""
    return {
        names[n][0] if n in names else n: c * names[n][1] + names[n][2] if n in names else c
        for n, c in run.items()
    }


OTHER_UNITS = {
    "power_W": ("Power [mW]", 1e3, 0.0),
    "temperature_degC": ("temperature_degF", 1.8, 32.0),
}


def test_columns_in_other_units_are_converted_to_those_that_the_function_names() -> None:
    runs = [in_units(run, OTHER_UNITS) for run in RUNS[:2]]
    (fit,) = bind(declared_heater(), runs).groups
    np.testing.assert_allclose(fit[0].inputs["power_W"], RUNS[0]["power_W"])
    np.testing.assert_allclose(
        fit[1].outputs["temperature_degC"], RUNS[1]["temperature_degC"], atol=1e-9
    )
    assert fit[0].notes == (
        "power_W is column 'Power [mW]', converted",
        "temperature_degC is column 'temperature_degF', converted",
    )


def tank(t, inputs, values, start):
    level = np.cumsum(values["gain_mm_L"] * inputs["inflow_L_min"] / 60.0) * (t[1] - t[0])
    return {"level_mm": level}


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        ("Inflow [L/min]", 1.0), ("Inflow (L/min)", 1.0), ("inflow_l_min", 1.0),
        ("inflow_mL_min", 1e3), ("inflow_L_s", 1.0 / 60.0), ("inflow_m3_s", 1.0 / 60000.0),
        ("Inflow [m3/s]", 1.0 / 60000.0),
    ],
)  # fmt: skip
def test_a_column_in_a_compound_unit_is_converted(column: str, factor: float) -> None:
    inflow = np.repeat([0.0, 4.0, 8.0, 0.0], 50)
    run = {"t_s": 0.1 * np.arange(200), column: inflow * factor, "level_mm": np.cumsum(inflow)}
    declared = simulator(tank, parameters={"gain_mm_L": (1.0, 0.5, 2.0)})
    ((fit,),) = bind(declared, [run]).groups
    np.testing.assert_allclose(fit.inputs["inflow_L_min"], inflow, rtol=1e-12)
    assert fit.notes == (f"inflow_L_min is column {column!r}, converted",)


@pytest.mark.parametrize(
    ("column", "factor", "offset", "unit"),
    [("temperature_degC", 1.8, 32.0, "degF"), ("power_W", 1e3, 0.0, "mW")],
)
def test_a_column_that_is_likely_to_be_in_another_unit_than_its_name_says_is_named(
    column: str, factor: float, offset: float, unit: str
) -> None:
    runs = [in_units(run, {column: (column, factor, offset)}) for run in RUNS[:2]]
    doubts = [
        [f.text for f in admit(bound.groups[0], bound.plant, 0.1).findings if "?" in f.text]
        for bound in (bind(declared_heater(), given) for given in (runs, RUNS[:2]))
    ]
    assert [text.split("?")[0] for text in doubts[0]] == [f"is {column} in {unit}"] * 2
    assert doubts[1] == []


def test_a_reading_beyond_a_declared_range_is_refused_with_the_likely_unit() -> None:
    runs = [in_units(run, {"temperature_degC": ("temperature_degC", 1.8, 32.0)}) for run in RUNS]
    declared = declared_heater(ranges={"temperature_degC": (0.0, 80.0)})
    verdict = diagnose(runs, declared).verdict
    assert verdict.outcome == "refused"
    assert "declared 0 to 80 degC: in degF?" in verdict.findings[0].text


def test_columns_of_text_are_left_out_and_said_or_named_where_they_are_wanted(
    tmp_path: Path,
) -> None:
    head = "stamp,t_s,power_W,temperature_degC,operator"
    rows = [f"12:00,{0.1 * k},{k % 7},22,ada" for k in range(100)]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    ((run,),) = bind(declared_heater(), tmp_path / "a.csv").groups
    assert run.notes == ("columns left out, since they are not numbers: stamp, operator",)
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]).replace(",3,", ",three,"))
    with pytest.raises(SimulatorError, match="line 5: column 'power_W' is not a number; got three"):
        bind(declared_heater(), tmp_path / "a.csv")


def test_a_table_of_another_locale_is_read_as_it_is_said_to_be_written(tmp_path: Path) -> None:
    rows = [f"{0.1 * k:.1f};{15 * (k % 4)};{22 + 0.1 * (k % 9):.1f}" for k in range(100)]
    text = "\n".join(["Zeit [s];power_W;temperature_degC", *rows]).replace(".", ",")
    (tmp_path / "a.csv").write_text(text)
    german = csv_format({"decimal": ","})
    ((run,),) = bind(declared_heater(), tmp_path / "a.csv", time="Zeit [s]", form=german).groups
    assert run.dt_s == pytest.approx(0.1)
    assert run.outputs["temperature_degC"][:3].tolist() == [22.0, 22.1, 22.2]
    with pytest.raises(SimulatorError, match=r"or csv=… of smad\.simulators\.diagnose"):
        diagnose(tmp_path / "a.csv", declared_heater(), time="Zeit [s]")
    rows = [f"{k};{15 * (k % 4)};22,{k % 9}" for k in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(["t_s;power_W;Temperature [°C]", *rows]))
    with pytest.raises(SimulatorError, match=r"'Temperature \[°C\]' is not a number; got 22,0"):
        diagnose(tmp_path / "a.csv", declared_heater())
    with pytest.raises(SimulatorError, match=r"no column of the time; .*or say which it is: time"):
        diagnose({"Zeit": RUNS[0]["t_s"]}, declared_heater())
    with pytest.raises(SimulatorError, match=r"csv does not say how .*time_format; give"):
        diagnose(tmp_path / "a.csv", declared_heater(), csv={"decimals": ","})


def test_data_frames_have_their_time_in_stamps_or_in_the_index() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(RUNS[0])
    stamps = pandas.Timestamp("2026-11-27 08:00") + pandas.to_timedelta(frame.t_s, unit="s")
    rest = frame.drop(columns="t_s")
    for one in (
        frame.set_index("t_s"),
        rest.assign(time=stamps),
        rest.assign(time=pandas.to_timedelta(frame.t_s, unit="s")),
        rest.set_index(pandas.DatetimeIndex(stamps, name=None)),
        rest.set_index(pandas.DatetimeIndex(stamps, name="Datum")),
        frame.assign(logged=stamps),
    ):
        (table,) = tables_of(one)
        assert table.t_s == pytest.approx(RUNS[0]["t_s"], abs=1e-8)
        assert set(table.columns) >= {"power_W", "temperature_degC"}


def test_structured_arrays_and_structures_of_matlab_are_runs(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(tmp_path / "run.mat", {"log": RUNS[0]})
    structure = scipy_io.loadmat(tmp_path / "run.mat")["log"]
    for one in (np.rec.fromarrays([*RUNS[0].values()], names=[*RUNS[0]]), structure):
        for given in (one, [one]):
            (table,) = tables_of(given)
            assert table.columns["power_W"] == pytest.approx(RUNS[0]["power_W"])


def test_what_is_no_simulator_or_no_column_is_named() -> None:
    rows = {**RUNS[0], "power_W": RUNS[0]["power_W"][:-1]}
    with pytest.raises(SimulatorError, match=r"has the shape \(599,\), its time \(600,\)"):
        diagnose(rows, declared_heater())
    with pytest.raises(SimulatorError, match=r"run 1: column 'power_W' holds no number"):
        diagnose({**RUNS[0], "power_W": np.full(600, np.nan)}, declared_heater())
    with pytest.raises(
        SimulatorError, match=r"this is not a declared simulator; got function; give the runs first"
    ):
        diagnose(RUNS, heater)  # type: ignore[arg-type]
    with pytest.raises(SimulatorError, match=r"nor a table of columns; got NoneType"):
        diagnose(None, declared_heater())
    (table,) = tables_of({"fs": 10.0, **{n: c[:, None] for n, c in RUNS[0].items()}})
    assert list(table.columns) == ["power_W", "temperature_degC"]
    assert table.notes == ("columns left out, since they are not as long as their time: fs",)


def test_processes_answer_as_one_does_for_a_function_made_inside_another() -> None:
    run = {n: c[:200] for n, c in RUNS[0].items()}

    def inner(t, inputs, values, start):
        if values["loss_W_K"] > 1.0:
            raise ArithmeticError("too much")
        return heater(t, inputs, values, start)

    declared = simulator(
        inner,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
    )
    one, two = (diagnose([run, RUNS[1], RUNS[2]], declared, processes=n).verdict for n in (1, 2))
    assert one.causes == two.causes
    assert one.whole == two.whole
    with pytest.raises(SimulatorError, match="processes is not a count"):
        diagnose(RUNS, declared, processes=0)


def test_a_process_that_was_killed_ends_the_diagnosis() -> None:
    here = os.getpid()

    def killed(t, inputs, values, start):
        if os.getpid() != here and values["loss_W_K"] != 0.8:
            os.kill(os.getpid(), signal.SIGKILL)
        return heater(t, inputs, values, start)

    declared = simulator(
        killed,
        parameters={**PARAMETERS, "room_degC": (22.0, 17.0, 27.0)},
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
    )
    with pytest.raises(SimulatorError, match=r"a process of the simulator was killed, .*fewer"):
        diagnose(RUNS, declared, processes=2)


def test_what_is_replayed_from_its_readings_is_compared_with_no_good_run_of_the_same_inputs() -> (
    None
):
    noise = np.random.default_rng(9).normal(0.0, 0.03, 600)
    now = [{**r, "temperature_degC": r["temperature_degC"] + noise} for r in RUNS]
    answer = diagnose(now, declared_heater(), good=RUNS)
    assert answer.verdict.outcome == "quiet"
    assert not any("same inputs" in note for note in answer.verdict.notes)


def test_a_run_that_begins_with_a_step_begins_at_rest() -> None:
    """A motor whose speed follows within 50 ms, its angle read at 100 Hz."""
    rng = np.random.default_rng(0)
    t_s = np.arange(400) * 0.01
    angle = 10.0 * (t_s - 0.05 * (1.0 - np.exp(-t_s / 0.05)))
    rates = []
    for _ in range(20):
        read = angle + 1e-3 * rng.standard_normal(400)
        starts = Starts(GapRun("a", t_s, {}, {"angle_rad": read}), ("angle_rad",))
        rates.append(starts.start_of(0)[0]["angle_rad_rate"])
        assert starts.start_of(200)[0]["angle_rad_rate"] == pytest.approx(10.0, abs=0.1)
    assert abs(np.mean(rates)) < 0.2


def test_a_plan_prints_as_its_table() -> None:
    run = {n: c for n, c in RUNS[0].items() if n != "temperature_degC"}
    planned = plan([run], declared_heater(noise={"temperature_degC": 0.03}))
    assert repr(planned).splitlines()[0] == "parameters"
    assert "slow_sensor: noticed from" in str(planned)
