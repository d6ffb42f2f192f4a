"""Banks of *any inputs*: runs that repeat no programme, with and without good runs.

    BANK/manifest.json, BANK/cases/case-001/good-1.parquet, run-1.parquet …
    BANK-key/KEY.json                                          apart

Every case has a bench of its own. A case that asks what has *changed* has three or four good runs
of mixed inputs and three or four in question, some of which repeat a good run's commands on
another day. A case that asks where the model *differs* has four to six runs and no good ones.
"""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import files
from evaluation.bank.cases import DIFFERS, Case, draw, scaled
from evaluation.bank.excitation import CURRENT_X, FAMILIES, PUMP_Y
from evaluation.bank.making import (
    Entry,
    Order,
    answer,
    begun,
    made,
    raised,
    rms_difference,
    sealed_up,
)
from evaluation.bank.recorder import Run, record_program
from evaluation.plant.effects import Active
from evaluation.plant.layout import DUTY_Y, I_X
from evaluation.plant.own import own_differences
from evaluation.plant.parameters import Bench, another_bench, changed_parameters

Array = NDArray[np.float64]

MIXTURE = {"single": 10, "none": 4, "parameters": 3, "unknown": 5, "pair": 2}
STRENGTHS = {"changed": (1.0, 30.0), DIFFERS: (3.0, 30.0)}
"""Weakest and strongest effect, in repeat floors of the signal that shows it most."""
OPEN = ("open_loop", "slow_heat", "air")
FOLLOWING = ("steps", "staircase", "sines", "random_levels", "chirp")
SECONDS = (30.0, 60.0)
REPEATED = 0.35  # share of the runs in question that repeat a good run's commands
REACHED = 0.7  # of the wanted strength, or as much above it; else another effect is tried
OTHER_DAY = 7


@dataclass(frozen=True, kw_only=True)
class AnyInputs(Order):
    """A bank of so many cases of each question."""

    changed: int = 24
    differs: int = 8


@dataclass(frozen=True)
class Planned:
    """One run before it is recorded; `program` as in `excitation`, `repeats` a good run."""

    role: str
    family: str
    program: Array
    seed: int
    repeats: str = ""


def commands_of(run: Run) -> Array:
    """The program that gives a run's commands again, whatever the bench reads."""
    program = np.zeros((len(run.inputs), 7))
    program[:, CURRENT_X : PUMP_Y + 1] = run.inputs[:, I_X : DUTY_Y + 1]
    return program


def _mixed(rng: np.random.Generator, count: int) -> list[tuple[str, Array, int]]:
    """`count` runs of different families: one open loop, one followed, then either."""
    pools = [OPEN, FOLLOWING] + [OPEN + FOLLOWING] * (count - 2)
    runs: list[tuple[str, Array, int]] = []
    for pool in pools:
        family = str(rng.choice([f for f in pool if f not in [r[0] for r in runs]]))
        seconds = float(np.round(rng.uniform(*SECONDS)))
        program = FAMILIES[family](np.random.default_rng(int(rng.integers(2**31))), seconds)
        runs.append((family, program, int(rng.integers(2**31))))
    return [runs[i] for i in rng.permutation(count)]


def planned(
    rng: np.random.Generator, question: str, bench: Bench
) -> tuple[list[Run], list[Planned]]:
    """The good runs of a case, recorded, and its runs in question, not yet recorded."""
    good: list[Run] = []
    if question == DIFFERS:
        count = int(rng.integers(4, 7))
        held_out = 2 if count > 4 else 1
    else:
        for i, (family, program, seed) in enumerate(_mixed(rng, int(rng.integers(3, 5)))):
            run = record_program(bench, (), program, seed, family=family, number=i - 1000)
            good.append(run)
        count, held_out = int(rng.integers(3, 5)), 1
    unrepeated = list(rng.permutation(len(good)))
    plans: list[Planned] = []
    for i, (family, program, seed) in enumerate(_mixed(rng, count)):
        role = "hold_out" if i >= count - held_out else "fit"
        if unrepeated and rng.uniform() < REPEATED:
            n = int(unrepeated.pop())
            again = f"good-{n + 1}"
            plans.append(Planned(role, good[n].family, commands_of(good[n]), seed, again))
        else:
            plans.append(Planned(role, family, program, seed))
    return good, plans


def _recorded(bench: Bench, active: tuple[Active, ...], plans: list[Planned]) -> list[Run]:
    return [
        record_program(bench, active, p.program, p.seed, family=p.family, number=i)
        for i, p in enumerate(plans)
    ]


def _again(bench: Bench, runs: list[Run], plans: list[Planned], day: int = 0) -> list[Run]:
    """The same commands once more on a bench without effect; `day` 0: the same day and noise."""
    return [
        record_program(bench, (), commands_of(run), p.seed + day)
        for run, p in zip(runs, plans, strict=True)
    ]


def make_case(folder: Path, case: Case) -> tuple[Entry, Entry]:
    """Write one case; its manifest entry and its key entry.

    `gap_paired` is what effect or parameters change of each signal under the same commands, day
    and noise held, in floors; the floor is the RMS between two days under the same commands.
    """
    question = DIFFERS if case.kind == DIFFERS else "changed"
    rng = np.random.default_rng((case.seed, 2))
    bench = another_bench(rng)
    good, plans = planned(rng, question, bench)
    tested = changed_parameters(rng, bench) if case.kind == "parameters" else bench
    target = float(np.exp(rng.uniform(*np.log(STRENGTHS[question]))))
    now = _recorded(tested, (), plans)
    floor = rms_difference(now, _again(tested, now, plans, OTHER_DAY))
    gap = rms_difference(now, _again(bench, now, plans)) / floor
    active: tuple[Active, ...] = ()
    for choice in case.choices if case.choices[0] else ():
        tried = _recorded(bench, choice, plans)
        active = raised(choice, rms_difference(tried, _again(bench, tried, plans)) / floor, target)
        now = _recorded(bench, active, plans)
        gap = rms_difference(now, _again(bench, now, plans)) / floor
        if REACHED < gap.max() / target < 1.0 / REACHED:
            break
    runs = _written(folder, case, good, now, plans)
    entry = answer(case.kind, active, target, gap) | {
        "question": question,
        "repeats": {f"run-{i + 1}": p.repeats for i, p in enumerate(plans) if p.repeats},
        "own": own_differences() if question == DIFFERS else [],
    }
    return {"id": case.name, "question": question, "runs": runs}, entry


def _written(
    folder: Path, case: Case, good: list[Run], now: list[Run], plans: list[Planned]
) -> list[Entry]:
    place = Path("cases") / case.name
    (folder / place).mkdir(parents=True, exist_ok=True)
    named = [(f"good-{i + 1}", "good", run) for i, run in enumerate(good)]
    named += [(f"run-{i + 1}", plans[i].role, run) for i, run in enumerate(now)]
    for name, _, run in named:
        files.write_run(folder / place / f"{name}.parquet", run.log)
    return [
        {"file": str(place / f"{name}.parquet"), "role": role, "family": run.family}
        for name, role, run in named
    ]


def make(order: AnyInputs) -> str:
    """Make a bank or go on with it; the SHA-256 of its key, empty when time ran out.

    Raises BankError when another bank is in the way.
    """
    until = time.monotonic() + 60.0 * order.minutes
    order = begun(order)
    counts = scaled(MIXTURE, order.changed) | {DIFFERS: order.differs}
    assert order.seed is not None
    cases = draw(order.seed, counts, sealed=order.sealed)
    done = made(order, until, make_case, {c.name: (order.folder, c) for c in cases})
    return sealed_up(order, done, {"format": files.FORMAT}) if done is not None else ""
