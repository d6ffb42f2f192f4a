"""What a hole in the guide's recordings makes of its answer: the slow temperature sensor.

`python -m tests.smad.records.holes` records the runs of docs/guide/diagnose-a-gap.md, takes some
seconds out of each, diagnoses them, and prints a table.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from smad.cli import execute
from smad.diagnosis import diagnose
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant, read_gap_run

HOLES_S = (0.0, 1.0, 3.0, 12.0)
AT = 0.6
"""Of a run, where its hole begins."""
RUNS = {"slow-sensor": ("pulses", "levels"), "later": ("quick levels",)}


def recorded(folder: Path) -> tuple[list[GapRun], list[GapRun]]:
    """The runs to fit and to judge on, as the guide records them."""
    for place, names in RUNS.items():
        for name in names:
            words = ["gap", "next", "--sim", "--run", name, "--effect", "rtd_lag:tau_s=0.6"]
            assert execute([*words, "--folder", str(folder / place)]) == 0
    fit, held_out = (
        [read_gap_run(path) for path in sorted((folder / place).glob("*.mcap"))] for place in RUNS
    )
    return fit, held_out


def torn(run: GapRun, hole_s: float) -> GapRun:
    """The run without the samples of so many seconds."""
    begin_s = run.t_s[0] + AT * run.duration_s
    kept = (run.t_s <= begin_s) | (run.t_s > begin_s + hole_s)
    return replace(
        run,
        t_s=run.t_s[kept],
        inputs={n: c[kept] for n, c in run.inputs.items()},
        outputs={n: c[kept] for n, c in run.outputs.items()},
    )


def rows(fit: Sequence[GapRun], held_out: Sequence[GapRun]) -> Iterator[str]:
    """Lines of a table of Markdown, one a hole."""
    yield "| hole in each run | first cause | place | value | floors left |"
    yield "|---|---|---|---|---:|"
    for hole_s in HOLES_S:
        runs, judged_on = ([torn(run, hole_s) for run in group] for group in (fit, held_out))
        found = diagnose(runs, plant=SmaPlant(), hold_out=judged_on).verdict
        causes = ", ".join(c.name for c in found.causes) or found.outcome
        place = found.causes[0].place if found.causes else ""
        values = found.causes[0].values if found.causes else []
        value = ", ".join(f"{v.name} = {v.value:.3f} ± {v.sd:.3f} {v.unit}" for v in values[:1])
        left = found.whole.final if found.whole is not None else float("nan")
        yield f"| {hole_s:g} s | {causes} | {place} | {value} | {left:.2f} |"


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        for line in rows(*recorded(Path(name))):
            print(line, flush=True)


if __name__ == "__main__":
    main()
