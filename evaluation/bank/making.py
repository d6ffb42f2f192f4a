"""One case of a bank: find the strength, record the runs, ask the oracle, write the answer."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import strength
from evaluation.bank.cases import Case, commissioning, plan
from evaluation.bank.files import write_run
from evaluation.bank.oracle import SIGNALS
from evaluation.bank.quantities import true_quantity
from evaluation.bank.recorder import Run, record
from evaluation.bank.strength import Rig
from evaluation.plant.effects import BY_NAME, Active
from evaluation.plant.parameters import Bench, another_bench, changed_parameters

Array = NDArray[np.float64]
Entry = dict[str, Any]


@dataclass(frozen=True)
class Style:
    """How a bank is made: length of its runs, kind of its files, effort of the search."""

    seconds: float
    suffix: str = ".parquet"
    search: bool = True


def _rounded(values: Array) -> dict[str, float]:
    return {name: round(float(v), 4) for name, v in zip(SIGNALS, values, strict=True)}


def _at_strength(rig: Rig, case: Case, style: Style) -> tuple[tuple[Active, ...], bool]:
    """The first of the case's choices that reaches the strength, each of its effects alone."""
    best: tuple[tuple[Active, ...], bool] = ((), False)
    for choice in case.choices:
        if not style.search:
            return tuple(_usual(a, case.target) for a in choice), True
        found = [strength.find(rig, _usual(a, case.target), case.target) for a in choice]
        best = (tuple(f.active for f in found), all(f.reaches(case.target) for f in found))
        if best[1]:
            break
    return best


def _sign(active: Active) -> float:
    return -1.0 if active.magnitude < 0 else 1.0


def _usual(active: Active, target: float) -> Active:
    spec = BY_NAME[active.name]
    return replace(active, magnitude=_sign(active) * min(spec.usual * target / 3.0, spec.limit))


def make(case: Case, folder: Path, style: Style) -> tuple[Entry, Entry]:
    """Write the case's run files under `folder`; its manifest entry and its key entry."""
    rng = np.random.default_rng((case.seed, 2))
    bench = another_bench(rng)
    rig = strength.rig(bench, plan(rng, style.seconds))
    active, reached = _at_strength(rig, case, style)
    tested = changed_parameters(rng, bench) if case.kind == "parameters" else bench
    runs = rig.recorded(active, tested)
    files = _write_runs(case, folder, style, rig, runs, rng=rng)
    gap, refit = rig.after_refit(runs)
    entry: Entry = {
        "kind": case.kind,
        "target_floors": case.target,
        "reached": reached,
        "effects": [_effect_entry(a) for a in active],
        "floor": _rounded(np.sqrt(rig.floor_squares)),
        "raw_gap": _rounded(strength.raw_gap(rig, runs).by_signal),
        "gap": _rounded(gap.by_signal),
        "gap_worst": round(gap.worst, 4),
        "refit_steps": [round(float(s), 4) for s in refit.steps],
        "bench": {k: float(v) for k, v in asdict(bench).items()},
        "changed": _changed(bench, tested),
        "run_seeds": [seed for _, seed, _ in rig.plan.runs],
    }
    if active:
        exact = strength.exact_law(rig, runs, active)
        entry["gap_exact_law"] = _rounded(exact.by_signal)
        entry["shrink_exact_law"] = round(1.0 - exact.worst / max(gap.worst, 1e-9), 4)
    question = "differs" if case.kind == "differs" else "changed"
    return {"id": case.name, "question": question, "runs": files}, entry


def _effect_entry(active: Active) -> Entry:
    spec = BY_NAME[active.name]
    return {
        "name": active.name,
        "known": spec.kind == "known",
        "subsystem": spec.subsystem,
        "magnitude": active.magnitude,
        "unit": spec.unit,
        "y_share": active.y_share,
        "shape": active.shape,
        "quantity": true_quantity(active),
    }


def _changed(bench: Bench, tested: Bench) -> dict[str, list[float]]:
    before, after = asdict(bench), asdict(tested)
    return {k: [before[k], after[k]] for k in before if before[k] != after[k]}


def _write_runs(
    case: Case, folder: Path, style: Style, rig: Rig, runs: list[Run], *, rng: np.random.Generator
) -> list[Entry]:
    place = folder / "cases" / case.name
    place.mkdir(parents=True, exist_ok=True)
    files: list[Entry] = []

    def add(name: str, run: Run, role: str) -> None:
        path = place / f"{name}{style.suffix}"
        write_run(path, run.log)
        where = str(path.relative_to(folder))
        files.append({"file": where, "role": role, "family": run.family, "bench": "this"})

    for i, (run, (_, _, role)) in enumerate(zip(runs, rig.plan.runs, strict=True)):
        add(f"run-{i + 1}", run, role)
    if case.kind != "differs":
        for i, (family, seed) in enumerate(commissioning(rng)):
            good = record(rig.bench, (), family, seed, seconds=style.seconds, number=i - 1000)
            add(f"good-{i + 1}", good, "good")
    return files


def sisters(seed: int, count: int, folder: Path, style: Style) -> list[Entry]:
    """Write two known-good runs of each of `count` sister benches; their manifest entries."""
    place = folder / "sisters"
    place.mkdir(parents=True, exist_ok=True)
    entries: list[Entry] = []
    for i in range(count):
        rng = np.random.default_rng((seed, 3, i))
        bench = another_bench(rng)
        for j, (family, run_seed) in enumerate(commissioning(rng)[1:]):
            run = record(bench, (), family, run_seed, seconds=style.seconds, number=10 * i + j)
            path = place / f"sister-{i + 1}-run-{j + 1}{style.suffix}"
            write_run(path, run.log)
            where = str(path.relative_to(folder))
            entries.append(
                {"file": where, "role": "good", "family": family, "bench": f"sister-{i + 1}"}
            )
    return entries
