"""The plant as a unit of FMI: it validates, it is the simulator, and it says what it refuses."""

import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.effects.registry import EFFECTS, resolve
from sim_device.plant.laws import Factor, Law, Term
from sim_device.plant.models import Model, read_model, save_model
from sim_device.plant.parameters import NAMES, ParameterSet, parameters_text
from smad.cli import execute
from smad.fmi.errors import FmiError
from smad.fmi.export import Mounted, export_unit
from smad.fmi.variables import outputs

from .units import loaded

OUTPUTS = [v.name for v in outputs()]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "better.toml"
    save_model(path, overrides={"density": 6300.0}, note="from a diagnosis")
    return path


@pytest.fixture(scope="module", params=[3, 2], ids=["fmi3", "fmi2"])
def unit(
    model: Path, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    # Made again where a worker takes over tests of another: into a folder of its own.
    path = tmp_path_factory.mktemp("unit") / f"model{request.param}.fmu"
    return export_unit(read_model(model), path, version=request.param).path


def a_run(parameters: ParameterSet, n: int = 601) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rng = np.random.default_rng(1)
    t_s = np.arange(n) * 0.01
    levels = np.repeat(rng.uniform(0.0, 1.0, (n // 50 + 1, 4)), 50, axis=0)[:n]
    warmer = np.where(t_s > 2.0, 2.0, 0.0)
    return t_s, {
        "i_applied_x_A": np.where(t_s < 5.0, 2.5 + 0.5 * levels[:, 0], 0.0),
        "i_applied_y_A": 0.5 * levels[:, 1],
        "duty_x": np.where(t_s > 5.0, levels[:, 2], 0.0),
        "duty_y": levels[:, 3],
        "drain_x": (levels[:, 2] > 0.7).astype(float),
        "inlet_K": parameters["water_temperature"] + warmer,
        "ambient_K": parameters["ambient_temperature"] + warmer,
    }


def replayed(
    parameters: ParameterSet, t_s: np.ndarray, inputs: dict[str, np.ndarray], **options: Any
) -> dict[str, np.ndarray]:
    def pair(stem: str) -> np.ndarray:
        none = np.zeros(len(t_s))
        return np.c_[inputs.get(stem.format("x"), none), inputs.get(stem.format("y"), none)]

    return simulate(
        parameters,
        Inputs(
            t_s,
            pair("i_applied_{}_A"),
            pair("duty_{}"),
            drain=pair("drain_{}"),
            inlet_K=inputs["inlet_K"],
            ambient_K=inputs["ambient_K"],
            **({"stage_m": inputs["stage_m"]} if "stage_m" in inputs else {}),
        ),
        **options,
    )


def difference(unit: Path, folder: Path, given: Model, mounted: Mounted) -> float:
    """The largest difference of an output of the unit from the replay, over its full scale."""
    t_s, inputs = a_run(given.parameters)
    if mounted.fixture != "antagonistic":
        inputs["stage_m"] = 2e-3 * np.sin(t_s)
    expected = replayed(
        given.parameters,
        t_s,
        inputs,
        variant=given.variant,
        effects=given.effects,
        laws=given.laws,
        fixture=mounted.fixture,
        cooling=mounted.cooling,
    )
    with loaded(unit, folder) as running:
        rows = running.run(t_s, inputs, OUTPUTS)
    assert np.ptp(expected["rtd_x_degC"]) > 1.0
    return max(
        float(np.abs(column - expected[name]).max() / (np.ptp(expected[name]) or 1.0))
        for name, column in zip(OUTPUTS, rows.T, strict=True)
    )


def test_fmpy_finds_no_problem_in_the_unit(unit: Path) -> None:
    assert validate_fmu(str(unit)) == []


def test_a_run_of_the_unit_is_the_replay_of_its_inputs(
    unit: Path, model: Path, tmp_path: Path
) -> None:
    assert difference(unit, tmp_path, read_model(model), Mounted()) <= 1e-9


HEAT = Law(
    "heat_into_wire",
    "both",
    (
        Term(
            name="drag",
            coefficient=0.4,
            factors=(
                Factor(state="current", kind="bend", lag_s=0.5, low=0, high=4, centre=1, scale=1),
            ),
        ),
    ),
)
WRONG_RTD = Law("reading_rtd", "x", (Term(name="offset", coefficient=0.7),))
CALM = {"unified_kinetics", "cooling_front", "water_warming"}
"""Effects for which other equations are solved; in units of their own."""
PLANTS: dict[str, tuple[str, set[str], tuple[Law, ...], Mounted]] = {
    "paper's kinetics": ("extended", {e.name for e in EFFECTS} - CALM, (), Mounted()),
    "unified kinetics": ("extended", {"unified_kinetics", "minor_loop"}, (), Mounted()),
    "cells": ("extended", {"cooling_front", "thermal_crosstalk"} & {e.name for e in EFFECTS}, (),
              Mounted()),
    "printed": ("printed", {"water_warming"}, (), Mounted()),
    "laws": ("extended", set(), (HEAT, WRONG_RTD), Mounted()),
    "stretched": ("extended", set(), (), Mounted(fixture="stretch")),
    "blocked, in air": ("extended", set(), (), Mounted(fixture="blocked", cooling="air")),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANTS)
def test_the_unit_of_every_kind_of_plant_is_its_replay(name: str, tmp_path: Path) -> None:
    variant, effects, laws, mounted = PLANTS[name]
    known = Model(load_parameters("A"), variant, {}, "A")
    given = replace(known, effects=resolve({effect: {} for effect in effects}), laws=laws)
    made = export_unit(given, tmp_path / "a.fmu", mounted=mounted).path
    assert difference(made, tmp_path / "unit", given, mounted) <= 1e-9


def test_a_state_that_was_kept_is_gone_on_from(unit: Path, tmp_path: Path) -> None:
    with loaded(unit, tmp_path) as running:
        running.put({"i_applied_x_A": 3.0})
        running.slave.exitInitializationMode()
        running.slave.doStep(0.0, 2.0)
        get = getattr(running.slave, "getFMUState", None) or running.slave.getFMUstate
        put = getattr(running.slave, "setFMUState", None) or running.slave.setFMUstate
        kept = get()
        running.slave.doStep(2.0, 1.0)
        first = running.get(OUTPUTS)
        put(kept)
        running.slave.doStep(2.0, 1.0)
        assert running.get(OUTPUTS) == first


def test_the_binary_needs_nothing_but_the_c_library(unit: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(unit) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".so"))
        archive.extract(name, tmp_path)
    shown = subprocess.run(
        ["readelf", "-d", str(tmp_path / name)], capture_output=True, text=True, check=True
    ).stdout
    needed = {line.split("[")[1].rstrip("]") for line in shown.splitlines() if "NEEDED" in line}
    assert needed <= {"libm.so.6", "libc.so.6"}


def test_a_parameter_that_is_set_before_the_start_counts(
    unit: Path, model: Path, tmp_path: Path
) -> None:
    parameters = read_model(model).parameters.replace(density=6000.0)
    t_s, inputs = a_run(parameters, 101)
    expected = replayed(parameters, t_s, inputs)["rtd_x_degC"]
    with loaded(unit, tmp_path) as running:
        running.put({"density": 6000.0})
        rows = running.run(t_s, inputs, ["rtd_x_degC"])
    np.testing.assert_allclose(rows[:, 0], expected, rtol=0, atol=1e-9)


def test_variables_have_units_ranges_and_the_values_of_the_model(unit: Path) -> None:
    described = fmpy.read_model_description(str(unit))
    by_name = {v.name: v for v in described.modelVariables}
    assert set(NAMES) <= set(by_name)
    assert (by_name["T_x_K"].unit, by_name["rtd_x_degC"].unit) == ("K", "degC")
    assert by_name["force_N"].causality == "output"
    assert by_name["i_applied_x_A"].causality == "input"
    assert float(by_name["density"].start) == 6300.0
    assert float(by_name["duty_x"].max) == 1.0


def test_the_model_file_lies_inside_and_needs_no_other(model: Path, tmp_path: Path) -> None:
    base = tmp_path / "mine.toml"
    base.write_text(parameters_text(load_parameters("B").replace(density=6001.7)))
    own = tmp_path / "own.toml"
    save_model(own, base=str(base), effects={"driver_lag": {}})
    made = export_unit(read_model(own), tmp_path / "own.fmu").path
    with zipfile.ZipFile(made) as archive:
        archive.extract("resources/model.toml", tmp_path)
    inside, given = read_model(tmp_path / "resources" / "model.toml"), read_model(own)
    values, wanted = ([e.value for e in m.parameters.entries] for m in (inside, given))
    assert values == wanted
    assert inside.effects == given.effects


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("duty_x", float("nan"), "duty_x is not finite; got nan; set a finite number"),
        ("i_applied_x_A", float("inf"), "i_applied_x_A is not finite"),
        ("i_applied_x_A", -0.1, "i_applied_x_A is out of range; got -0.1; allowed: at least 0"),
        ("duty_y", 1.5, "duty_y is out of range; got 1.5; allowed: 0 to 1"),
        ("density", 1.0, "density is out of range; got 1; allowed: 1000 to 20000"),
        ("rtd_x_degC", 20.0, "is an output or unknown; set inputs and parameters"),
    ],
)
def test_a_value_out_of_range_is_refused_in_one_line_that_the_unit_logs(
    unit: Path, tmp_path: Path, name: str, value: float, words: str
) -> None:
    with loaded(unit, tmp_path) as running:
        with pytest.raises(Exception, match="status 3"):
            running.put({name: value})
        assert words in running.said[-1]


def test_parameters_that_do_not_fit_together_are_refused(unit: Path, tmp_path: Path) -> None:
    with loaded(unit, tmp_path) as running:
        running.put({"austenite_start": 320.0, "austenite_finish": 310.0})
        with pytest.raises(Exception, match="status 3"):
            running.slave.exitInitializationMode()
        assert "austenite_start must be below austenite_finish" in running.said[-1]


def test_a_parameter_is_not_changed_while_the_unit_runs(unit: Path, tmp_path: Path) -> None:
    with loaded(unit, tmp_path) as running:
        running.slave.exitInitializationMode()
        running.slave.doStep(0.0, 0.01)
        with pytest.raises(Exception, match="status 3"):
            running.put({"density": 5900.0})
        assert "parameter density cannot be changed" in running.said[-1]


def test_without_a_compiler_the_unit_is_source_only(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    made = export_unit(read_model(model), tmp_path / "a.fmu")
    assert made.platform == ""
    with zipfile.ZipFile(made.path) as archive:
        assert not [name for name in archive.namelist() if name.startswith("binaries")]
        assert "sources/fmi3.c" in archive.namelist()


def test_a_compiler_that_fails_is_named(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "false")
    with pytest.raises(FmiError, match="false does not compile the unit"):
        export_unit(read_model(model), tmp_path / "a.fmu")


def test_what_cannot_be_exported_is_said_in_one_line(
    model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / "tank.toml"
    foreign.write_text('format = "tank-1"\n')
    there = tmp_path / "there.fmu"
    there.touch()
    for arguments, words in (
        ([str(foreign), "--fmi", str(tmp_path / "a.fmu")], "is not 'smad-model-1'"),
        ([str(tmp_path / "none.toml"), "--fmi", str(tmp_path / "a.fmu")], "none.toml"),
        ([str(model), "--fmi", str(tmp_path / "a.zip")], "ends with .fmu"),
        ([str(model), "--fmi", str(tmp_path / "no" / "a.fmu")], "cannot write"),
        ([str(model), "--fmi", str(there)], "is there already"),
    ):
        assert execute(["model", "export", *arguments]) == 1
        (line,) = capfd.readouterr().err.splitlines()
        assert words in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["tank.toml", "there.fmu"]
