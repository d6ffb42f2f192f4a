"""A unit of FMI as a plant of the diagnosis, and what is said of units and maps that do not fit."""

import gc
import math
import re
import shutil
import tempfile
import tomllib
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from smad.cli import execute
from smad.diagnosis.plant import ModelPoint
from smad.errors import SmadError
from smad.fmi.asked import declare_unit
from smad.fmi.errors import FmiError
from smad.fmi.map_file import Map, read_map
from smad.fmi.unit_file import MOST_BYTES, open_unit
from smad.simulators.bind import Bound, bind
from smad.simulators.errors import SimulatorError
from smad.simulators.plant import SimulatedPlant
from tests.smad.diagnosis.cases import strong
from tests.smad.runlog.helpers import write_small_run

from .heater import MAP, compiled_unit, heater_unit, read_mapped, run_file


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return heater_unit(tmp_path_factory.mktemp("heater"))


def read_map_of(folder: Path, text: str) -> Map:
    path = folder / "map.toml"
    path.write_text(text)
    return read_map(path)


def bound_unit(unit: Path, folder: Path, text: str = MAP, run: Path | None = None) -> Bound:
    run = run or run_file(folder / "bound.csv", 1)
    declared, (tables,) = declare_unit(open_unit(unit), read_map_of(folder, text), [run])
    return bind(declared, tables)


def plant_of(unit: Path, folder: Path, text: str = MAP, run: Path | None = None) -> SimulatedPlant:
    return bound_unit(unit, folder, text, run).plant.plain


def test_the_missing_radiation_of_a_heater_is_found_in_what_heats_it(
    unit: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("smad.simulators.expected._SLOW_S", 0.0)
    monkeypatch.setattr("smad.simulators.expected._IN_MINUTES_S", math.inf)
    (tmp_path / "map.toml").write_text(MAP)
    runs = [str(run_file(tmp_path / f"{s}.csv", s, radiated=8.0)) for s in range(4)]
    ask = ["gap", "diagnose", *runs, "--fmu", str(unit), "--map", str(tmp_path / "map.toml")]
    assert execute([*ask, "--report", str(tmp_path / "gap.html")]) == 0
    said, warned = capfd.readouterr()
    assert f"smad: {unit} contains code that runs with your permissions; " in warned
    assert re.search(r"^a replay takes [\d.e-]+ s: .*\d+ s in all", warned, re.MULTILINE)
    assert said.startswith("the simulator lacks something at the ")
    assert re.search(r"^  name   radiation", said, re.MULTILINE)
    before, after = re.findall(r"from ([\d.]+) to ([\d.]+) floors", said)[0]
    assert float(before) > 50.0
    assert float(after) < 1.5
    assert "smad gap verify" not in said
    assert "power_W" in (tmp_path / "gap.html").read_text()


def test_a_unit_that_nobody_uses_any_more_leaves_the_disk(
    unit: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    plant = plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    plant.simulate(ModelPoint({}), run)
    assert len(list(tmp_path.glob("smad-unit-*"))) == 1
    del plant
    gc.collect()
    assert list(tmp_path.glob("smad-unit-*")) == []


def test_a_replay_is_the_run_of_a_bench_without_noise(unit: Path, tmp_path: Path) -> None:
    plant = plant_of(unit, tmp_path)
    bench = {"tau_s": 1.5, "capacity": 33.0, "radiated": 6.0}
    path = run_file(tmp_path / "a.csv", 1, noise=0.0, **bench)
    run = read_mapped(path, read_map(tmp_path / "map.toml"))
    point = ModelPoint(
        {"capacity_J_K": 33.0, "loss_W_K": 0.74},
        {"radiation": {"size": -6.0}, "temperature_degC_lag": {"tau_s": 1.5}},
    )
    shown = plant.simulate(point, run)
    measured = run.outputs["temperature_degC"]
    assert np.abs(shown["temperature_degC"] - measured).max() < 0.0051


def test_replays_do_not_depend_on_those_before_or_on_the_thread(unit: Path, tmp_path: Path) -> None:
    plant = plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    points = [ModelPoint({"capacity_J_K": c}) for c in np.linspace(20.0, 40.0, 80)]

    def replay(point: ModelPoint) -> np.ndarray:
        return plant.simulate(point, run)["temperature_degC"]

    once = [replay(point) for point in points]
    with ThreadPoolExecutor(4) as pool:
        again = list(pool.map(replay, points[::-1]))[::-1]
    for a, b in zip(once, again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_processes_replay_a_unit_as_one_does(unit: Path, tmp_path: Path) -> None:
    here, there = plant_of(unit, tmp_path), plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    points = [ModelPoint({"capacity_J_K": c}) for c in np.linspace(20.0, 40.0, 6)]
    with there.in_processes(2), ThreadPoolExecutor(2) as threads:
        assert there.traits.together == 2
        shown = list(threads.map(lambda point: there.simulate(point, run), points))
    for point, other in zip(points, shown, strict=True):
        alone = here.simulate(point, run)["temperature_degC"]
        np.testing.assert_array_equal(alone, other["temperature_degC"])
    # Its page replays afterwards, in this process.
    assert np.isfinite(there.simulate(ModelPoint({}), run)["temperature_degC"]).all()


def test_a_compiled_unit_without_python_gives_the_same(unit: Path, tmp_path: Path) -> None:
    script, compiled = plant_of(unit, tmp_path), plant_of(compiled_unit(tmp_path, unit), tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    for capacity in (25.0, 35.0, 25.0):
        point = ModelPoint({"capacity_J_K": capacity}, {"radiation": {"size": -6.0}})
        one, other = (
            plant.simulate(point, run)["temperature_degC"] for plant in (script, compiled)
        )
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def test_an_effect_that_is_off_leaves_the_replay_as_it_is(unit: Path, tmp_path: Path) -> None:
    plant = plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    off = {e.name: {p.name: 0.0 for p in e.parameters} for e in plant.effects}
    plain = plant.simulate(ModelPoint({}), run)["temperature_degC"]
    for name, values in off.items():
        same = plant.simulate(ModelPoint({}, {name: values}), run)
        np.testing.assert_array_equal(same["temperature_degC"], plain, err_msg=name)
    for effect in plant.effects:
        other = plant.simulate(ModelPoint({}, {effect.name: strong(effect)}), run)
        assert np.abs(other["temperature_degC"] - plain).max() > 0.01, effect.name


def test_inputs_from_a_row_on_act_one_row_later(unit: Path, tmp_path: Path) -> None:
    until = plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    shown = until.simulate(ModelPoint({}), run)["temperature_degC"]
    since = plant_of(unit, tmp_path, f'held = "from"\n{MAP}')
    late = since.simulate(ModelPoint({}), run)["temperature_degC"]
    first = int(np.flatnonzero(run.inputs["power_W"])[0])
    assert (shown[first] > 22.0, late[first] > 22.0, late[first + 1] > 22.0) == (True, False, True)


def test_a_unit_that_gives_up_predicts_nothing_from_there_and_can_be_run_again(
    unit: Path, tmp_path: Path
) -> None:
    plant = plant_of(unit, tmp_path)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    hot = run.with_columns(inputs={"power_W": np.where(run.t_s > 30.0, 1e7, 0.0)})
    shown = plant.simulate(ModelPoint({}), hot)["temperature_degC"]
    assert np.isfinite(shown[:300]).all()
    assert np.isnan(shown[-1])
    again = plant.simulate(ModelPoint({}), run)["temperature_degC"]
    assert np.isfinite(again).all()


def test_an_input_may_be_held_in_its_own_way(unit: Path, tmp_path: Path) -> None:
    since = plant_of(unit, tmp_path, MAP.replace('"power"', '"power"\nheld = "from"'))
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    late = since.simulate(ModelPoint({}), run)["temperature_degC"]
    first = int(np.flatnonzero(run.inputs["power_W"])[0])
    assert (late[first] > 22.0, late[first + 1] > 22.0) == (False, True)


@pytest.mark.parametrize("of", ["temperature_degC", "power_W"])
@pytest.mark.parametrize("shape", ["sign", "deadband"])
def test_a_term_may_go_with_the_sign_or_beyond_a_deadband(
    unit: Path, tmp_path: Path, of: str, shape: str
) -> None:
    text = MAP.replace("power = 4.0", f'shape = "{shape}"')
    text = text.replace('of = "temperature_degC"', f'of = "{of}"')
    plant = plant_of(unit, tmp_path, text.replace("-273.15", "22.0").replace("300.0", "10.0"))
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    point = ModelPoint({}, {"radiation": {"size": -6.0}})
    shown = plant.simulate(point, run)["temperature_degC"]
    plate, f = 22.0, {"sign": np.tanh, "deadband": lambda x: x - np.clip(x, -1.0, 1.0)}[shape]
    for power in run.inputs["power_W"][1:]:
        x = ((plate if of == "temperature_degC" else power) - 22.0) / 10.0
        plate += 0.1 * (power - 6.0 * f(x) - 0.8 * (plate - 22.0)) / 30.0
    assert shown[-1] == pytest.approx(plate, abs=1e-9)


def test_a_unit_begins_from_the_readings_of_a_channel_in_each_window(
    unit: Path, tmp_path: Path
) -> None:
    # This unit begins at the temperature of the room.
    head, _, rest = MAP.partition("[parameters.room_degC]")
    text = head + rest[rest.index("[terms") :] + '[start]\nroom = "temperature_degC"\n'
    plant = plant_of(unit, tmp_path, text)
    run = read_mapped(run_file(tmp_path / "a.csv", 1), read_map(tmp_path / "map.toml"))
    warm = run.with_columns(outputs={"temperature_degC": run.outputs["temperature_degC"] + 10.0})
    shown = plant.simulate(ModelPoint({}), warm)["temperature_degC"]
    assert shown[0] == pytest.approx(32.0, abs=0.1)
    plant.window_s = 10.0
    parts = plant.simulate(ModelPoint({}), warm)["temperature_degC"]
    np.testing.assert_array_equal(parts[:100], shown[:100])
    np.testing.assert_allclose(parts[::100], warm.outputs["temperature_degC"][::100], atol=1.0)


def test_a_unit_does_not_begin_from_a_channel_that_no_run_has(unit: Path, tmp_path: Path) -> None:
    head, _, rest = MAP.partition("[parameters.room_degC]")
    other = '[channels.plate_degC]\nvariable = "temperature"\nunit = "degC"\n'
    text = head + rest[rest.index("[terms") :] + f'{other}[start]\nroom = "plate_degC"\n'
    with pytest.raises(SimulatorError, match="asks for 'plate_degC', which is neither a column"):
        plant_of(unit, tmp_path, text)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("lag_s = 2.0", "lag_s = 2.0\nwindow_s = 2.0", "sets window_s, but no [start]"),
        ("lag_s = 2.0", 'lag_s = 2.0\nstart = {temperature = "speed"}', "start.temperature is no"),
        ("power = 4.0", 'power = 4.0\nshape = "sign"', "has a power and another shape"),
        ('variable = "loss"', 'variable = "los"', "has no variable los, which the map has at"),
        ('unit = "W/K"\n', "", "missing required field `unit`"),
        ('variable = "power"\n', "", "inputs"),
        ("high = 1.1", "high = nan", "parameters"),
        ("high = 1.1", "high = 0.5", "parameters.loss_W_K has no range"),
        ('of = "temperature_degC"', 'of = "speed"', "terms.radiation.of is neither an input nor"),
        ('variable = "temperature"', 'variable = "power"', "has another causality in heater.fmu"),
        ("lag_s = 2.0", "lag_s = 2.0\nlags = 1", "unknown field `lags`"),
        ("low = 0.5", "low = 0.9", "does not begin within its range; got 0.8"),
    ],
)
def test_a_map_that_does_not_fit_is_told_in_one_line(
    unit: Path, tmp_path: Path, old: str, new: str, words: str
) -> None:
    assert old in MAP
    with pytest.raises(SmadError) as caught:
        plant_of(unit, tmp_path, MAP.replace(old, new))
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_what_a_map_leaves_out_is_taken_from_the_records(unit: Path, tmp_path: Path) -> None:
    left_out = r"(?m)^(lag_s|quantum|noise) .*$|^low = (0.0|-20.0)\nhigh = .*$|^span.*$|^power.*$"
    text = re.sub(left_out, "", MAP) + 'shape = "sign"\n'
    bound = bound_unit(unit, tmp_path, text)
    plant, run = bound.plant.plain, bound.groups[0][0]
    (power,), (reading,) = plant.inputs, plant.channels
    shown = run.outputs["temperature_degC"]
    assert (power.low, power.high) == (np.min(run.inputs["power_W"]), np.max(run.inputs["power_W"]))
    assert reading.high - reading.low == pytest.approx(3.0 * np.ptp(shown))
    assert reading.quantum == pytest.approx(0.01, rel=0.01)
    assert 0.02 < reading.noise < 0.05
    (lag, term) = (
        next(e for e in plant.effects if e.name == n) for n in ("temperature_degC_lag", "radiation")
    )
    assert 0.1 < lag.parameters[0].typical < 2.0
    assert f"/{0.01 * np.ptp(shown):g})" in term.equation
    assert bound.said[0].endswith("Ranges, quanta and noise are those of the records, unless given")
    (given,) = plant_of(unit, tmp_path, MAP).channels
    assert (given.low, given.high, given.quantum, given.noise) == (-20.0, 150.0, 0.01, 0.03)


def test_a_sign_of_a_channel_without_range_or_column_is_refused(unit: Path, tmp_path: Path) -> None:
    more = MAP.replace("low = -20.0\nhigh = 150.0\n", "").replace("power = 4.0", 'shape = "sign"')
    (tmp_path / "a.csv").write_text("t_s,power_W,temperature_degC\n")
    mapped = read_map_of(tmp_path, more.replace("span = 300.0\n", ""))
    with pytest.raises(FmiError, match="temperature_degC has no range, and no run has its column"):
        declare_unit(open_unit(unit), mapped, [])


def rewritten(unit: Path, target: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """The unit with each member as `change` makes it; None leaves it out."""
    with zipfile.ZipFile(unit) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = change(name, old.read(name))
            if content is not None:
                new.writestr(name, content)
    return target


def of_fmi_3(name: str, content: bytes) -> bytes:
    return content.replace(b'fmiVersion="2.0"', b'fmiVersion="3.0"')


def without_description(name: str, content: bytes) -> bytes | None:
    return None if name == "modelDescription.xml" else content


def without_binary(name: str, content: bytes) -> bytes | None:
    return None if name.startswith("binaries/linux64") else content


def torn_description(name: str, content: bytes) -> bytes:
    return content[: len(content) // 2] if name == "modelDescription.xml" else content


def with_units(reading: str) -> Callable[[str, bytes], bytes]:
    """The unit with `reading` as the attributes of its temperature, and other units, as FMI
    writes them, of its input and its loss."""
    types = """<UnitDefinitions><Unit name="K"/><Unit name="N.m"/><Unit name="W.m/(m.K)"/>
        </UnitDefinitions>
        <TypeDefinitions><SimpleType name="Kelvin"><Real unit="K"/></SimpleType></TypeDefinitions>
        <LogCategories>"""

    def change(_: str, content: bytes) -> bytes:
        content = content.replace(b"<LogCategories>", types.encode(), 1)
        for start, is_in in (("0", "N.m"), ("0.8", "W.m/(m.K)")):
            real = f'<Real start="{start}"'
            content = content.replace(f"{real}/>".encode(), f'{real} unit="{is_in}"/>'.encode(), 1)
        return content.replace(b"<Real/>", f"<Real {reading}/>".encode(), 1)

    return change


@pytest.mark.parametrize("reading", ['unit="K"', 'declaredType="Kelvin"'])
def test_a_column_is_converted_to_the_unit_that_a_variable_or_its_type_has(
    unit: Path, tmp_path: Path, reading: str
) -> None:
    kelvin = rewritten(unit, tmp_path / "kelvin.fmu", with_units(reading))
    text = MAP.replace('"W"\nlow = 0.0', '"N m"\ncolumn = "Torque [mNm]"\nscale = -1\nlow = 0.0')
    table = run_file(tmp_path / "bench.csv", 1)
    table.write_text(table.read_text().replace("power_W", "Torque [mNm]"))
    with pytest.raises(
        FmiError,
        match=r"temperature is in another unit in kelvin.fmu; got degC; "
        "allowed: K; use that unit: a column whose name",
    ):
        bound_unit(kelvin, tmp_path, text, table)
    text = text.replace('unit = "degC"\nlow = -20.0', 'unit = "K"\nlow = 250.0')
    text = text.replace("high = 150.0", "high = 420.0")
    ((run,),) = bound_unit(kelvin, tmp_path, text, table).groups
    assert run.outputs["temperature_degC"][0] == pytest.approx(295.15, abs=0.2)
    assert run.inputs["power_W"].min() == pytest.approx(-0.045)
    assert run.notes == ("temperature_degC is read in degC, as its name ends",)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (of_fmi_3, "is of another version of FMI; got 3.0; allowed: 2.0"),
        (without_description, "it has no modelDescription.xml"),
        (without_binary, "has no binary for this machine; got win64"),
        (torn_description, "modelDescription.xml is not valid"),
    ],
)
def test_a_unit_that_cannot_be_used_is_told_in_one_line(
    unit: Path, tmp_path: Path, change: Callable[[str, bytes], bytes | None], words: str
) -> None:
    with pytest.raises(FmiError) as caught:
        open_unit(rewritten(unit, tmp_path / "a.fmu", change))
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_torn_archive_and_one_that_unpacks_to_too_much_are_refused(
    unit: Path, tmp_path: Path
) -> None:
    torn = tmp_path / "torn.fmu"
    torn.write_bytes(unit.read_bytes()[:5000])
    with pytest.raises(FmiError, match="missing, cut short or damaged"):
        open_unit(torn)
    bomb = shutil.copyfile(unit, tmp_path / "bomb.fmu")
    with zipfile.ZipFile(bomb, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", b"\0" * 1000)
        archive.getinfo("resources/zeros").file_size = MOST_BYTES
    with pytest.raises(FmiError, match="larger than a unit may be"):
        open_unit(bomb)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("t_s,temperature_degC\n0,22\n1,23\n", "has no column 'power_W'"),
        ("t_s,power_W\n0,0\n1,1\n", "has no column 'temperature_degC'"),
        ("time,power_W,temperature_degC\n0,0,22\n", "has no time column 't_s'"),
        ("t_s,power_W,temperature_degC\n0,0,22\n0,0,22\n", "does not increase at row 2"),
    ],
)
def test_a_run_that_the_map_does_not_fit_is_told_in_one_line(
    tmp_path: Path, table: str, words: str
) -> None:
    (tmp_path / "map.toml").write_text(MAP)
    (tmp_path / "a.csv").write_text(table)
    with pytest.raises(SimulatorError) as caught:
        read_mapped(tmp_path / "a.csv", read_map(tmp_path / "map.toml"))
    assert words in str(caught.value)


def test_a_run_log_is_read_by_its_channels_and_converted(unit: Path, tmp_path: Path) -> None:
    log = write_small_run(tmp_path / "run.mcap", 50)
    text = MAP.replace(
        'variable = "power"', 'variable = "power"\ncolumn = "i_cmd_x_A"\nscale = 12.0'
    )
    text = text.replace(
        'variable = "temperature"', 'variable = "temperature"\ncolumn = "rtd_x_degC"\noffset = 1.0'
    )
    plant = plant_of(unit, tmp_path, text, log)
    run = read_mapped(log, read_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(run.inputs["power_W"], 12.0 * np.arange(50) / 1000)
    np.testing.assert_allclose(run.outputs["temperature_degC"], 20 + np.arange(50) / 100)
    shown = plant.simulate(ModelPoint({}), run)["temperature_degC"]
    plate = 22.0
    for k in range(1, 50):
        plate += 0.01 * (12.0 * k / 1000 - 0.8 * (plate - 22.0)) / 30.0
    assert shown[-1] == pytest.approx(plate + 1.0, abs=1e-9)


def test_a_unit_needs_its_map(
    unit: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run = str(run_file(tmp_path / "a.csv", 1))
    for options, words in (
        (["--fmu", str(unit)], "--fmu needs --map"),
        (["--processes", "2"], "--processes needs --fmu or --mjcf"),
    ):
        assert execute(["gap", "diagnose", run, *options]) == 2
        (line,) = capfd.readouterr().err.splitlines()
        assert words in line


def test_the_better_values_of_a_unit_are_written_with_their_units(
    unit: Path, tmp_path: Path
) -> None:
    plant = bound_unit(unit, tmp_path, MAP).plant
    effects = {"power_W_zero": {"b": -2.0}, "power_W_gain": {"g": 0.1}}
    point = ModelPoint({"loss_W_K": 0.7}, effects)
    plant.save_model(point, tmp_path / "better.toml", "note")
    better = tomllib.loads((tmp_path / "better.toml").read_text())
    assert better["parameters"] == {"capacity_J_K": 30.0, "loss_W_K": 0.7, "room_degC": 22.0}
    assert better["units"] == {
        "capacity_J_K": "J/K", "loss_W_K": "W/K", "room_degC": "degC",
        "power_W_zero.b": "W", "power_W_gain.g": "1",
    }  # fmt: skip


def test_a_point_at_which_a_unit_stops_is_counted_and_said(tmp_path: Path) -> None:
    # Units of one script's name share a module in this process.
    script = tmp_path / "script" / "heater_that_stops.py"
    script.parent.mkdir()
    text = Path(__file__).with_name("heater_unit.py").read_text()
    script.write_text(text.replace("self.temperature < 1e4", "self.loss > 0.745"))
    plant = plant_of(Path(FmuBuilder.build_FMU(script, dest=tmp_path / "heater.fmu")), tmp_path)
    run = read_mapped(run_file(tmp_path / "0.csv", 0), read_map(tmp_path / "map.toml"))
    for loss in (0.8, 0.76):
        plant.simulate(ModelPoint({"loss_W_K": loss}), run)
    assert plant.failures.notes == []
    plant.simulate(ModelPoint({"loss_W_K": 0.7}), run)
    (said,) = plant.failures.notes
    assert re.match(
        r"1 of 3 replays gave no numbers.*dropped: temperature_degC runs away, or is not a "
        r"number, from 0\.\d s on at .*loss_W_K = 0\.7.* in run 0",
        said,
    )
