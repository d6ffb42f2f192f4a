"""The exported FMI unit beside the simulator it was made of: sizes, needs, speed, difference.

python -m bench.units
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
import zipfile
from pathlib import Path

import fmpy
import numpy as np

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.models import Model
from smad.fmi.export import export_unit

LENGTH_S, STEP_S = 60.0, 0.01
CURRENT_A = 2.5
SHOWN = "rtd_x_degC"


def needs(unit: Path, folder: Path) -> str:
    """Return the shared libraries that the unit's binary names."""
    with zipfile.ZipFile(unit) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".so"))
        archive.extract(name, folder)
    tool = shutil.which("readelf")
    if tool is None:
        return "not known without readelf"
    shown = subprocess.run(
        [tool, "-d", str(folder / name)], capture_output=True, text=True, check=True
    ).stdout
    return " ".join(line.split("[")[1][:-1] for line in shown.splitlines() if "NEEDED" in line)


def seconds(run: object) -> tuple[float, np.ndarray]:
    """Return the time of the second of two calls, and what it returned."""
    assert callable(run)
    run()
    begun_s = time.perf_counter()
    out = run()
    return time.perf_counter() - begun_s, np.asarray(out)


def main() -> int:
    """Measure and print; return 1 where a unit differs from the simulator by more than 1e-9."""
    parameters = load_parameters("A")
    t_s = np.arange(0.0, LENGTH_S + STEP_S / 2, STEP_S)
    i_A = np.tile([CURRENT_A, 0.0], (len(t_s), 1))
    inputs = Inputs(t_s, i_A, np.zeros_like(i_A))
    took_s, expected = seconds(lambda: simulate(parameters, inputs)[SHOWN])
    print(f"simulator          {took_s * 1e3:7.1f} ms for {LENGTH_S:g} s in steps of {STEP_S:g} s")
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        for version in (3, 2):
            folder = Path(name) / str(version)
            folder.mkdir()
            unit = export_unit(
                Model(parameters, "extended", {}, "A"), folder / "pair.fmu", version=version
            ).path
            unpacked = fmpy.extract(str(unit))

            def run(unpacked: str = unpacked) -> np.ndarray:
                shown = fmpy.simulate_fmu(
                    unpacked,
                    stop_time=LENGTH_S,
                    step_size=STEP_S,
                    output=[SHOWN],
                    output_interval=STEP_S,
                    start_values={"i_applied_x_A": CURRENT_A},
                )
                return np.asarray(shown[SHOWN])

            took_s, outputs = seconds(run)
            shutil.rmtree(unpacked)
            worst = max(worst, float(np.abs(outputs - expected).max() / np.ptp(expected)))
            print(
                f"unit of FMI {version}.0    {took_s * 1e3:7.1f} ms in fmpy, "
                f"{unit.stat().st_size / 1e3:.0f} kB, needs {needs(unit, folder)}"
            )
    print(f"largest difference {worst:.1e} of full scale, goal 1e-9")
    return 0 if worst <= 1e-9 else 1


if __name__ == "__main__":
    raise SystemExit(main())
