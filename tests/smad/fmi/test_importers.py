"""The exported unit in importers that are not Python, of FMI 3.0 and 2.0.

ecos and libcosim (2.0 only) are C++, the container of FMU Manipulation Toolbox is C; their Python
packages only call them. A process of its own each, since they unpack and log as they please.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from sim_device.plant import load_parameters
from sim_device.plant.models import Model
from smad.fmi.export import export_unit

SHOWN = ["rtd_x_degC", "displacement_m", "T_water_x_K"]
ECOS = """
import sys
from ecospy import EcosSimulation, EcosSimulationStructure
with EcosSimulationStructure() as structure:
    structure.add_model("pair", sys.argv[1])
    structure.add_parameter_set("given", {"pair::i_applied_x_A": 2.5})
    with EcosSimulation(structure=structure, step_size=0.01) as run:
        run.init(parameter_set="given")
        run.step(600)
        print("shown", *(run.get_real(f"pair::{name}") for name in sys.argv[2:]))
"""
LIBCOSIM = """
import sys
from fmpy import read_model_description
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
unit, *names = sys.argv[1:]
references = {v.name: v.valueReference for v in read_model_description(unit).modelVariables}
run = CosimExecution.from_step_size(10_000_000)
slave = CosimLocalSlave(fmu_path=unit, instance_name="pair")
at = run.add_local_slave(slave)
setting, seen = CosimManipulator.create_override(), CosimObserver.create_last_value()
run.add_manipulator(setting)
run.add_observer(seen)
setting.slave_real_values(at, [references["i_applied_x_A"]], [2.5])
run.step(600)
print("shown", *seen.last_real_values(at, [references[name] for name in names]))
"""
CONTAINER = """
import json, sys
from pathlib import Path
import fmpy
from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer
unit, *names = sys.argv[1:]
version = fmpy.read_model_description(unit).fmiVersion[0]
box = {"name": "box.fmu", "step_size": 0.01, "fmu": [Path(unit).name]}
Path("box.json").write_text(json.dumps(box))
sys.argv[1:] = ["-container", "box.json", "-fmi", version]
fmucontainer()
shown = fmpy.simulate_fmu(
    "box.fmu", stop_time=6.0, step_size=0.01, start_values={"i_applied_x_A": 2.5}, output=names
)[-1]
print("shown", *(shown[name] for name in names))
"""


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[int, tuple[Path, list[float]]]:
    """The unit of each version, and what it gives in fmpy."""
    plant = Model(load_parameters("A"), "extended", {}, "A")
    units = {}
    for version in (3, 2):
        unit = export_unit(
            plant, tmp_path_factory.mktemp("unit") / "pair.fmu", version=version
        ).path
        shown = fmpy.simulate_fmu(
            str(unit),
            stop_time=6.0,
            step_size=0.01,
            start_values={"i_applied_x_A": 2.5},
            output=SHOWN,
        )[-1]
        units[version] = unit, [float(shown[name]) for name in SHOWN]
    return units


@pytest.mark.parametrize(
    ("script", "needs", "version"),
    [
        (ECOS, "ecospy", 3),
        (ECOS, "ecospy", 2),
        (LIBCOSIM, "libcosimpy", 2),
        (CONTAINER, "fmu_manipulation_toolbox", 3),
        (CONTAINER, "fmu_manipulation_toolbox", 2),
    ],
    ids=["ecos, FMI 3", "ecos, FMI 2", "libcosim, FMI 2", "container, FMI 3", "container, FMI 2"],
)
def test_the_unit_gives_the_same_in_an_importer_that_is_not_python(
    script: str,
    needs: str,
    version: int,
    exported: dict[int, tuple[Path, list[float]]],
    tmp_path: Path,
) -> None:
    made, expected = exported[version]
    unit = shutil.copy(made, tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", script, str(unit), *SHOWN],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    missing = ("No module named", "GLIBC", "cannot open shared object")
    if (
        any(words in done.stderr for words in missing)
        and "SMAD_REQUIRE_IMPORTERS" not in os.environ
    ):
        pytest.skip(f"{needs} does not load here: {done.stderr.splitlines()[-1]}")
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("shown")] or [done]
    found = [float(number) for number in str(line).split()[1:]]
    assert found == pytest.approx(expected, rel=1e-9)
