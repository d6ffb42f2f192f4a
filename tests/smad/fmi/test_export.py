"""The plant as a unit of FMI: it validates, it is the simulator, and it says what it refuses."""

import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.models import read_model, save_model
from sim_device.plant.parameters import NAMES, ParameterSet, parameters_text
from smad.cli import execute
from smad.fmi.errors import FmiError
from smad.fmi.export import export_unit
from smad.fmi.pair import UnitOfPair
from smad.fmi.variables import outputs

from .units import loaded

OUTPUTS = [v.name for v in outputs()]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "better.toml"
    save_model(path, overrides={"density": 6300.0}, note="from a diagnosis")
    return path


@pytest.fixture(scope="module")
def unit(model: Path) -> Path:
    return export_unit(read_model(model), model.with_name("model.fmu"))


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
    parameters: ParameterSet, t_s: np.ndarray, inputs: dict[str, np.ndarray]
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
        ),
    )


def test_fmpy_finds_no_problem_in_the_unit(unit: Path) -> None:
    assert validate_fmu(str(unit)) == []


def test_a_run_of_the_unit_is_the_replay_of_its_inputs(
    unit: Path, model: Path, tmp_path: Path
) -> None:
    parameters = read_model(model).parameters
    t_s, inputs = a_run(parameters)
    expected = replayed(parameters, t_s, inputs)
    with loaded(unit, tmp_path) as running:
        rows = running.run(t_s, inputs, OUTPUTS)
    for name, column in zip(OUTPUTS, rows.T, strict=True):
        full_scale = np.ptp(expected[name]) or 1.0
        assert np.abs(column - expected[name]).max() <= 1e-6 * full_scale, name
    assert np.ptp(expected["displacement_m"]) > 1e-3


def test_a_parameter_that_is_set_before_the_start_counts(unit: Path, model: Path,
                                                         tmp_path: Path) -> None:  # fmt: skip
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
    made = export_unit(read_model(own), tmp_path / "own.fmu")
    with zipfile.ZipFile(made) as archive:
        archive.extract("resources/model.toml", tmp_path)
    inside, given = read_model(tmp_path / "resources" / "model.toml"), read_model(own)
    assert inside.parameters.vector() == given.parameters.vector()
    assert inside.effects == given.effects


def test_nan_is_refused_in_one_line_that_the_unit_logs(unit: Path, tmp_path: Path) -> None:
    # In a process of its own: after a fatal status the standard forbids every further call.
    code = (
        "import sys; from pathlib import Path; from tests.smad.fmi.units import Loaded\n"
        "unit = Loaded(Path(sys.argv[1]), Path(sys.argv[2]))\n"
        "try: unit.put({'duty_x': float('nan')})\n"
        "except Exception as error: print(error)\n"
        "print(*unit.said, sep='\\n'); sys.stdout.flush(); import os; os._exit(0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(unit), str(tmp_path)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "duty_x is not finite; got nan; set a finite number" in done.stdout


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("i_applied_x_A", float("inf"), "i_applied_x_A is not finite"),
        ("i_applied_x_A", -0.1, "i_applied_x_A is out of range; got -0.1; allowed: at least 0"),
        ("duty_y", 1.5, "duty_y is out of range; got 1.5; allowed: 0 to 1"),
    ],
)
def test_an_input_out_of_range_is_refused(
    unit: Path, tmp_path: Path, name: str, value: float, words: str
) -> None:
    with zipfile.ZipFile(unit) as archive:
        archive.extractall(tmp_path)
    pair = UnitOfPair(tmp_path / "resources")
    with pytest.raises(FmiError, match=words):
        pair.set(name, value)


def test_a_parameter_is_not_changed_while_the_unit_runs(unit: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(unit) as archive:
        archive.extractall(tmp_path)
    pair = UnitOfPair(tmp_path / "resources")
    pair.step(0.01)
    with pytest.raises(FmiError, match="parameter density cannot be changed"):
        pair.set("density", 5900.0)


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
        ([str(model), "--fmi", str(tmp_path / "a.zip")], "ends in .fmu"),
        ([str(model), "--fmi", str(tmp_path / "no" / "a.fmu")], "cannot write"),
        ([str(model), "--fmi", str(there)], "is there already"),
    ):
        assert execute(["model", "export", *arguments]) == 1
        (line,) = capfd.readouterr().err.splitlines()
        assert words in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["tank.toml", "there.fmu"]


def test_exporting_leaves_the_path_of_modules_as_it_was(model: Path, tmp_path: Path) -> None:
    path, modules = list(sys.path), "spring_pair" in sys.modules
    export_unit(read_model(model), tmp_path / "a.fmu")
    assert (sys.path, "spring_pair" in sys.modules) == (path, modules)
