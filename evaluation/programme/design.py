"""Designs the check-up's programme and prints what it separates."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evaluation.programme.separations import Separations, design
from smad.checkup.programme import write_programme
from smad.diagnosis.spring_pair import SmaPlant

TARGET = Path(__file__).parents[2] / "smad/checkup/data/spring-pair"
_NEAR = 16.0
# A day's difference of one bin, over what sensors show: floors of channels in their units.
_REPEAT_SD = {"A": 0.004, "V": 0.004, "degC": 0.12, "mm": 0.04, "N": 0.008}
_ROWS_PER_NUMBER = 6.0
"""Bins of 0.2 s that together tell as much as one independent number."""


def main(arguments: Sequence[str]) -> None:
    """Design, write and print a programme."""
    parser = argparse.ArgumentParser(prog="python -m evaluation design", description=__doc__)
    parser.add_argument("--seed", type=int, default=28)
    parser.add_argument("--candidates", type=int, default=80)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--quick", type=int, default=2)
    parser.add_argument("--duration", type=float, default=75.0, help="of a run, in s")
    parser.add_argument("--out", type=Path, default=TARGET)
    options = parser.parse_args(arguments)
    plant = SmaPlant()
    sd = np.array([_REPEAT_SD[c.unit] for c in plant.channels]) * np.sqrt(2.0 * _ROWS_PER_NUMBER)
    programme, whole, part = design(
        plant,
        sd,
        runs=options.runs,
        quick=options.quick,
        duration_s=options.duration,
        candidates=options.candidates,
        seed=options.seed,
        progress=lambda text: print(text, end="\r", file=sys.stderr),
    )
    write_programme(programme, options.out)
    print(f"{programme.title}: {programme.duration_s / 60:.1f} min of runs")
    for run in programme.runs:
        print(f"  {run.name}{' (quick)' if run.quick else '':8}  {run.title}")
    for label, found in (("whole programme", whole), ("quick part", part)):
        _print_separations(label, found)


def _print_separations(label: str, found: Separations) -> None:
    both = np.minimum(found.d2, found.d2.T)
    upper = both[np.triu_indices(len(both))]
    shares = ", ".join(f"{100 * np.mean(upper > level):.0f} % above {level}" for level in (16, 100))
    print(f"{label}: {len(upper)} separations d², smallest {upper.min():.2g}, {shares}")
    for a, b, d2 in found.worst(30):
        if d2 < _NEAR:
            print(f"  not separated: {a} and {b}, d² {d2:.1f}")
    for i, name in enumerate(found.names):
        row = both[i].copy()
        row[i] = np.inf
        j = int(np.argmin(row))
        print(
            f"  {name:24} parameters {both[i, i]:9.1f}   nearest {found.names[j]:24} {row[j]:9.1f}"
        )
