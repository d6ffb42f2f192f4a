"""Make `data/water.csv` with CoolProp: `python -m sim_device.plant.make_water_table`.

A development tool. The table is committed, so that nothing but this script needs CoolProp.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

PRESSURE_PA = 101325.0
FIRST_K, LAST_K, NODES = 280.0, 372.0, 93
COLUMNS = ("T_K", "rho_kg_m3", "cp_J_kgK", "k_W_mK", "mu_Pa_s", "beta_1_K")
TARGET = Path(__file__).parent / "data" / "water.csv"


def rows() -> list[tuple[float, ...]]:
    """Liquid water at 1 atm, IAPWS-95: one row per kelvin, columns as COLUMNS."""
    from CoolProp.CoolProp import PropsSI

    keys = ("D", "C", "L", "V", "ISOBARIC_EXPANSION_COEFFICIENT")
    return [
        (float(T), *(PropsSI(key, "T", float(T), "P", PRESSURE_PA, "Water") for key in keys))
        for T in np.linspace(FIRST_K, LAST_K, NODES)
    ]


def main() -> int:
    with TARGET.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([f"{value:.10g}" for value in row] for row in rows())
    print(f"{TARGET.name}: {NODES} rows, {FIRST_K} to {LAST_K} K")
    return 0


if __name__ == "__main__":
    sys.exit(main())
