"""Designs the check-up's programme, or prints what a programme separates."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evaluation.programme.separations import Separations, design, merit, separations_of
from evaluation.programme.writing import write_programme
from smad.checkup.programme import read_programme
from smad.diagnosis.spring_pair import SmaPlant

_CLOSE = 0.3
"""Pairs are printed of which a free law at the rival leaves less than this share."""
_MOST = 40
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
    parser.add_argument("--out", type=Path, help="folder to write the programme to")
    parser.add_argument("--of", type=Path, help="design none: print what this folder's separates")
    options = parser.parse_args(arguments)
    plant = SmaPlant()
    sd = np.array([_REPEAT_SD[c.unit] for c in plant.channels]) * np.sqrt(2.0 * _ROWS_PER_NUMBER)
    if options.of is not None:
        programme = read_programme(options.of)
        whole, part = separations_of(plant, sd, programme)
    else:
        programme, whole, part = design(
            plant,
            sd,
            runs=options.runs,
            quick=options.quick,
            duration_s=options.duration,
            candidates=options.candidates,
            seed=options.seed,
            progress=_progress,
        )
    if options.out is not None:
        write_programme(programme, options.out)
    print(f"{programme.title}: {programme.duration_s / 60:.1f} min of runs")
    for run in programme.runs:
        print(f"  {run.name}{' (quick)' if run.quick else '':8}  {run.title}")
    for label, pairs in (("whole programme", whole), ("quick part", part)):
        _print_separations(label, pairs)


def _progress(text: str) -> None:
    """The line so far on a terminal, nothing elsewhere."""
    if sys.stderr.isatty():
        print(f"{text}\x1b[K", end="\r", file=sys.stderr, flush=True)


def _print_separations(label: str, pairs: Separations) -> None:
    print(f"{label}: {len(pairs.share)} pairs of a law and a rival place, merit {merit(pairs):.3f}")
    print("  what a free law at the rival leaves of a law: the share, and its d²")
    for a, b, d2, share in pairs.worst(_MOST):
        if share < _CLOSE:
            print(f"  {share:5.3f}  {d2:8.2f}  {a:28} beside {b}")
