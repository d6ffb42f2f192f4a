"""What the spring pair's model leaves of known-good runs, with and without its laws.

`python -m bench.leftover FOLDER…`: each folder holds the known-good runs of one bench as
good-*.parquet (as a case of a bank does). Prints the root mean square of the residual of each local
output, in its unit, after the fit of parameters and baseline. Where the folder holds run-*.parquet
too, a second line tells what the same fit leaves of those, which it has not seen: of a bench that
has not changed, that is the background which an effect has to stand out of.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.grid import Dataset
from smad.diagnosis.data.views import local_views
from smad.diagnosis.errors import GapError
from smad.gap.fit.stages import known_good
from smad.diagnosis.plant import Array, Effect
from smad.diagnosis.runs import GapRun
from smad.gap.settings import Settings
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.signals import read_gap_run

SHOWN = ("rtd_x_degC", "rtd_y_degC", "displacement_mm", "force_N")


@dataclass(frozen=True)
class Lawless(SmaPlant):
    """The same plant with a library in which nothing is a law, and the cells are missing."""

    @cached_property
    def effects(self) -> Sequence[Effect]:
        own = SmaPlant(self.parameter_set, self.variant, self.only).effects
        return tuple(replace(e, law=False) for e in own if e.name != "cooling_front")


@dataclass(frozen=True)
class PapersKinetics(SmaPlant):
    """The same plant without the law of phase change that replaces the paper's."""

    @cached_property
    def effects(self) -> Sequence[Effect]:
        own = SmaPlant(self.parameter_set, self.variant, self.only).effects
        return tuple(e for e in own if e.name != "unified_kinetics")


LIBRARIES: dict[str, SmaPlant] = {
    "without laws": Lawless(),
    "paper's kinetics": PapersKinetics(),
    "with laws": SmaPlant(),
}


def leftover(
    runs: Sequence[GapRun],
    plant: SmaPlant,
    others: Sequence[GapRun] = (),
    settings: Settings | None = None,
) -> list[dict[str, float]]:
    """RMS residual of each channel, in channel units, by channel: of the good runs, and of others.

    The second is there only with `others`, runs that nothing is fitted to.
    """
    settings = settings or Settings()
    admitted = _admitted(runs, plant, settings)
    with ThreadPoolExecutor(max_workers=2) as pool:
        fit = known_good(admitted, plant, settings, executor=pool).fit
        out = [_left(fit.problem.dataset, fit.predicted)]
        if others:
            unseen = _admitted(others, plant, settings)
            dataset = Dataset(plant, unseen, local_views(plant), settings, pool, fast=False)
            out.append(_left(dataset, dataset.predict([fit.point])[0]))
    return out


def _admitted(runs: Sequence[GapRun], plant: SmaPlant, settings: Settings) -> Sequence[GapRun]:
    admission = admit(runs, plant, settings)
    if not admission.admitted:
        reasons = "; ".join(f"{f.run}: {f.text}" for f in admission.findings)
        raise GapError(
            "no run can be used",
            value=reasons or "no run",
            action="give folders with runs that the diagnosis admits",
        )
    return admission.admitted


def _left(dataset: Dataset, predicted: Array) -> dict[str, float]:
    residual = dataset.residual(predicted)
    out = {}
    for segment in dataset.segments:
        if segment.view != "phase":
            rows = dataset.valid_rows(segment.key, residual)
            out[segment.channel] = float(np.sqrt(np.mean(np.square(rows))))
    return out


def _runs(folder: str, pattern: str) -> list[GapRun]:
    return [read_gap_run(path) for path in sorted(Path(folder).glob(pattern))]


def main(folders: Sequence[str]) -> None:
    """Prints one line, or two, for each folder and library."""
    if not folders:
        raise SystemExit("give folders with good-*.parquet, such as BANK/cases/case-001")
    print(f"{'':14s}{'library':18s}{'of':7s}" + "".join(f"{name:>17s}" for name in SHOWN))
    for folder in folders:
        good, others = _runs(folder, "good-*.parquet"), _runs(folder, "run-*.parquet")
        for name, plant in LIBRARIES.items():
            try:
                left = leftover(good, plant, others)
            except GapError as error:
                raise SystemExit(f"{folder}: {error}") from None
            for of, values in zip(("good", "others"), left, strict=False):
                row = "".join(f"{values.get(c, float('nan')):17.4f}" for c in SHOWN)
                print(f"{Path(folder).name:14s}{name:18s}{of:7s}{row}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
