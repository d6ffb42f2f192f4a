"""What the spring pair's model leaves of known-good runs, with and without its laws.

`python -m smad.gap.leftover FOLDER…`: each folder holds the known-good runs of one bench as
good-*.parquet (as a case of a bank does). Prints the root mean square of the residual of each local
output, in its unit, after the fit of parameters and baseline.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from smad.gap.admission import admit
from smad.gap.check.bank import read_columns
from smad.gap.errors import GapError
from smad.gap.plant import Effect
from smad.gap.runs import GapRun
from smad.gap.settings import Settings
from smad.gap.sma import SmaPlant
from smad.gap.sma_signals import run_from_columns
from smad.gap.stages import known_good

SHOWN = ("rtd_x_degC", "rtd_y_degC", "displacement_mm", "force_N")


@dataclass(frozen=True)
class Lawless(SmaPlant):
    """The same plant with a library in which nothing is a law, and the cells are missing."""

    @cached_property
    def effects(self) -> Sequence[Effect]:
        own = SmaPlant(self.parameter_set, self.variant).effects
        return tuple(replace(e, law=False) for e in own if e.name != "cooling_front")


def leftover(runs: Sequence[GapRun], plant: SmaPlant) -> dict[str, float]:
    """RMS residual of each channel over the good runs, in channel units, by channel."""
    settings = Settings()
    admission = admit(runs, plant, settings)
    admitted = admission.admitted
    if not admitted:
        reasons = "; ".join(f"{f.run}: {f.text}" for f in admission.findings)
        raise GapError("no good run can be used", value=reasons or "no run")
    with ThreadPoolExecutor(max_workers=2) as pool:
        background = known_good(admitted, plant, settings, executor=pool)
    evidence = background.fit.problem.evidence
    residual = evidence.residual(background.fit.predicted)
    out = {}
    for segment in evidence.segments:
        if segment.view != "phase":
            rows = np.concatenate(
                [residual[s.rows][evidence.valid[s.rows]] for s in evidence.rows_of(segment.key)]
            )
            out[segment.channel] = float(np.sqrt(np.mean(np.square(rows))))
    return out


def main(folders: Sequence[str]) -> None:
    """Prints one line for each folder and library."""
    if not folders:
        raise SystemExit("give folders with good-*.parquet, such as BANK/cases/case-001")
    print(f"{'':24s}{'library':14s}" + "".join(f"{name:>17s}" for name in SHOWN))
    for folder in folders:
        files = sorted(Path(folder).glob("good-*.parquet"))
        runs = [run_from_columns(p.stem, read_columns(p)) for p in files]
        for name, plant in (("without laws", Lawless()), ("with laws", SmaPlant())):
            try:
                left = leftover(runs, plant)
            except GapError as error:
                raise SystemExit(f"{folder}: {error}") from None
            row = "".join(f"{left.get(c, float('nan')):17.4f}" for c in SHOWN)
            print(f"{Path(folder).name:24s}{name:14s}{row}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
