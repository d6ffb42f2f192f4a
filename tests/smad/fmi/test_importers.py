"""The exported unit in importers that are not Python: ecos (FMI 3.0 and 2.0), libcosim (2.0).

Both are C++; their Python packages only call them. A process of its own each, since they unpack and
log as they please.
"""

import os
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


@pytest.mark.parametrize(
    ("script", "needs", "version"),
    [(ECOS, "ecospy", 3), (ECOS, "ecospy", 2), (LIBCOSIM, "libcosimpy", 2)],
    ids=["ecos, FMI 3", "ecos, FMI 2", "libcosim, FMI 2"],
)
def test_the_unit_gives_the_same_in_an_importer_that_is_not_python(
    script: str, needs: str, version: int, tmp_path: Path
) -> None:
    loads = subprocess.run(
        [sys.executable, "-c", f"import {needs}"], capture_output=True, text=True, check=False
    )
    if loads.returncode and "SMAD_REQUIRE_IMPORTERS" not in os.environ:
        pytest.skip(f"{needs} does not load here: {loads.stderr.splitlines()[-1]}")
    plant = Model(load_parameters("A"), "extended", {}, "A")
    unit = export_unit(plant, tmp_path / "pair.fmu", version=version).path
    expected = fmpy.simulate_fmu(
        str(unit), stop_time=6.0, step_size=0.01, start_values={"i_applied_x_A": 2.5}, output=SHOWN
    )[-1]
    done = subprocess.run(
        [sys.executable, "-c", script, str(unit), *SHOWN],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("shown")] or [done]
    found = [float(number) for number in str(line).split()[1:]]
    assert found == pytest.approx([expected[name] for name in SHOWN], rel=1e-9)
