"""The CSV form of a calorimetry, and a synthetic one to try the analysis on.

    # mass_mg = 18
    # rate_K_per_min = 5
    t_s,temperature_degC,heat_flow_mW,baseline_mW
    0.0,25.00,0.71,0.05
    …

Heat flow into the sample counts positive (endothermic up). `baseline_mW`, the same run with an
empty pan, is optional; without it there is no heat capacity.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_device.plant.parameters import ParameterSet
from sim_device.plant.units import ZERO_C
from smad.arrays import Array
from smad.experiments.errors import DataFileError
from smad.files import read_whole

COLUMNS = ("t_s", "temperature_degC", "heat_flow_mW")
FACTS = ("mass_mg", "rate_K_per_min")


@dataclass(frozen=True)
class DscData:
    """A calorimetry in SI: arrays of shape (n,), mass in kg, rate in K/s."""

    t_s: Array
    temperature_K: Array
    heat_flow_W: Array
    baseline_W: Array | None
    mass_kg: float
    rate_K_per_s: float


def read_dsc(path: Path) -> DscData:
    """Read a file of the form above. Raises DataFileError, naming the line or column at fault."""
    try:
        lines = read_whole(path).decode("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(
            "the calorimetry cannot be read", value=f"{path}: {error}", action="check the path"
        ) from None
    facts = _facts(lines, path)
    rows = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    header = [cell.strip() for cell in rows[0]] if rows else []
    for name in COLUMNS:
        if name not in header:
            raise DataFileError(
                f"{path.name} has no column {name}",
                value=", ".join(header) or "no header line",
                limit=", ".join((*COLUMNS, "baseline_mW (optional)")),
                action="see smad docs experiments/dsc for the form",
            )
    table = np.array([_numbers(row, len(header), path, k) for k, row in enumerate(rows[1:], 2)])
    if len(table) < 200:
        raise DataFileError(f"{path.name} is too short", value=len(table), limit="200 rows or more")
    column = dict(zip(header, table.T, strict=True))
    baseline = column.get("baseline_mW")
    return DscData(
        column["t_s"],
        column["temperature_degC"] + ZERO_C,
        column["heat_flow_mW"] * 1e-3,
        None if baseline is None else baseline * 1e-3,
        facts["mass_mg"] * 1e-6,
        facts["rate_K_per_min"] / 60.0,
    )


def _facts(lines: list[str], path: Path) -> dict[str, float]:
    facts: dict[str, float] = {}
    for line in lines:
        if line.startswith("#") and "=" in line:
            name, _, value = line.lstrip("# ").partition("=")
            try:
                facts[name.strip()] = float(value)
            except ValueError:
                continue
    for name in FACTS:
        if not facts.get(name, 0.0) > 0.0 or math.isinf(facts[name]):
            raise DataFileError(
                f"{path.name} does not say {name}",
                value=facts.get(name),
                limit="a positive number",
                action=f"add a line `# {name} = …` at its head",
            )
    return facts


def _numbers(row: list[str], width: int, path: Path, line: int) -> list[float]:
    try:
        values = [float(cell) for cell in row]
    except ValueError:
        values = []
    if len(values) != width or not all(map(math.isfinite, values)):
        raise DataFileError(
            f"{path.name}, table line {line}, is not {width} finite numbers",
            value=",".join(row)[:60],
            action="correct or delete the line",
        )
    return values


def synthetic_dsc(parameters: ParameterSet, *, seed: int, lag_s: float = 2.0) -> DscData:
    """A calorimetry of a sample with these parameters: cosine kinetics, Eqs (11), (12c), no stress.

    With an instrument's lag, a sloping baseline and noise. The paper scans from 25 °C, which leaves
    no baseline below A_S and M_F; this one begins lower.
    """
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    mass, rate = 18e-6, 5.0 / 60.0
    low_degC, high_degC = 10.0, 100.0
    half_s = (high_degC - low_degC) / rate
    t = np.arange(0.0, 2.0 * half_s, 1.0)
    temperature = low_degC + rate * np.where(t < half_s, t, 2.0 * half_s - t) + ZERO_C
    heating = t < half_s

    def density(low_K: float, high_K: float) -> Array:
        """Share of the transformation per kelvin."""
        a = (temperature - low_K) / (high_K - low_K)
        inside = (a > 0.0) & (a < 1.0)
        return np.where(inside, 0.5 * np.pi * np.sin(np.pi * a) / (high_K - low_K), 0.0)

    p = parameters
    up = p["heat_capacity_heating"] + p["latent_heating"] * density(
        p["austenite_start"], p["austenite_finish"]
    )
    down = p["heat_capacity_cooling"] + p["latent_cooling"] * density(
        p["martensite_finish"], p["martensite_start"]
    )
    flow = mass * rate * np.where(heating, up, -down)
    keep = math.exp(-1.0 / lag_s)
    lagged = flow[0] + lfilter([1.0 - keep], [1.0, -keep], flow - flow[0])
    baseline = 1e-3 * (0.05 + 0.002 * (temperature - ZERO_C))
    noise = rng.normal(0.0, 1e-5, size=(2, t.size))
    return DscData(t, temperature, lagged + baseline + noise[0], baseline + noise[1], mass, rate)
