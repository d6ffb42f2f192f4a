"""The heater of the tests: its unit, its map, and runs of a bench that is not quite like it."""

import csv
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
from pythonfmu.builder import FmuBuilder

from smad.diagnosis.runs import GapRun
from smad.fmi.map_file import Map
from smad.simulators.by_map import tables_by_map
from smad.simulators.columns import require_time, run_of

DT = 0.1
MAP = """
lag_s = 2.0

[inputs.power_W]
variable = "power"
unit = "W"
low = 0.0
high = 50.0

[channels.temperature_degC]
variable = "temperature"
unit = "degC"
low = -20.0
high = 150.0
quantum = 0.01
noise = 0.03

[parameters.capacity_J_K]
variable = "capacity"
unit = "J/K"
low = 20.0
high = 40.0

[parameters.loss_W_K]
variable = "loss"
unit = "W/K"
low = 0.5
high = 1.1

[parameters.room_degC]
variable = "room"
unit = "degC"
low = 17.0
high = 27.0

[terms.radiation]
title = "heat that goes with the fourth power"
variable = "extra"
unit = "W"
typical = -5.0
low = -30.0
high = 0.0
of = "temperature_degC"
zero = -273.15
span = 300.0
power = 4.0
"""


def read_mapped(path: Path, mapped: Map) -> GapRun:
    """A run by a map."""
    ((table,),) = tables_by_map([path], mapped, mapped.inputs, mapped.channels)
    require_time(table)
    return run_of(table, list(mapped.inputs), list(mapped.channels))


def heater_unit(folder: Path) -> Path:
    """The unit, built here; pythonfmu packs every file beside the script, so it has a folder."""
    script = folder / "script" / "heater_unit.py"
    script.parent.mkdir(parents=True)
    shutil.copyfile(Path(__file__).with_name("heater_unit.py"), script)
    return Path(FmuBuilder.build_FMU(script, dest=folder / "heater.fmu"))


def compiled_unit(folder: Path, of: Path) -> Path:
    """The unit `of`, with a binary of C that needs no Python in place of pythonfmu's."""
    library, target = folder / "Heater.so", folder / "compiled.fmu"
    source = Path(__file__).with_name("heater_unit.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source], check=True)
    with zipfile.ZipFile(of) as old, zipfile.ZipFile(target, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
        new.write(library, "binaries/linux64/Heater.so")
    return target


def run_file(
    path: Path,
    seed: int,
    *,
    capacity: float = 32.0,
    loss: float = 0.74,
    tau_s: float = 0.0,
    radiated: float = 0.0,
    noise: float = 0.03,
) -> Path:
    """A run of a bench whose thermometer lags by `tau_s`; power holds up to the row's time."""
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.choice([0.0, 15.0, 30.0, 45.0], 12), 50)
    power[:50] = 0.0
    plate = shown = 22.0
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["t_s", "power_W", "temperature_degC"])
        for k, given in enumerate(power):
            if k:
                lost = loss * (plate - 22.0) + radiated * ((plate + 273.15) / 300.0) ** 4
                plate += DT * (given - lost) / capacity
                share = 1.0 if tau_s == 0.0 else 1.0 - np.exp(-DT / tau_s)
                shown += share * (plate - shown)
            read = round((shown + noise * rng.standard_normal()) / 0.01) * 0.01
            table.writerow([f"{k * DT:.1f}", given, f"{read:.2f}"])
    return path
