"""Banks of *any inputs*: runs that repeat no programme, with and without good runs.

    BANK/manifest.json, BANK/cases/case-001/good-1.parquet, run-1.parquet …
    BANK-key/KEY.json                                          apart

Every case has a bench of its own. A case that asks what has *changed* has three or four good runs
of mixed inputs and three or four in question, some of which repeat a good run's commands on
another day. A case that asks where the model *differs* has four to six runs and no good ones.
"""

import secrets
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import files
from evaluation.bank.cases import Case, draw, drawn_differs, scaled
from evaluation.bank.check_ups import (
    SEALED,
    effect_entry,
    gap_entry,
    raised,
    rms_difference,
)
from evaluation.bank.excitation import CURRENT_X, FAMILIES, PUMP_Y
from evaluation.bank.recorder import Run, record_program
from evaluation.errors import BankError
from evaluation.plant.effects import Active
from evaluation.plant.layout import DUTY_Y, I_X
from evaluation.plant.parameters import Bench, another_bench, changed_parameters

Array = NDArray[np.float64]
Entry = dict[str, Any]

MIXTURE = {"single": 10, "none": 4, "parameters": 3, "unknown": 5, "pair": 2}
STRENGTHS = {"changed": (1.0, 30.0), "differs": (3.0, 30.0)}
"""Weakest and strongest effect, in repeat floors of the signal that shows it most."""
OPEN = ("open_loop", "slow_heat", "air")
FOLLOWING = ("steps", "staircase", "sines", "random_levels", "chirp")
SECONDS = (30.0, 60.0)
REPEATED = 0.35  # share of the runs in question that repeat a good run's commands
OTHER_DAY = 7
REACHED = 0.7  # of the wanted strength; below, another effect is tried


@dataclass(frozen=True)
class Order:
    """A bank to make: how many cases of each question; `sealed` draws the seed in secret."""

    folder: Path
    changed: int
    differs: int
    seed: int
    sealed: bool = False

    @property
    def name(self) -> str:
        """What manifest and key call the bank."""
        return SEALED if self.sealed else self.folder.name

    @property
    def key_folder(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}-key")


@dataclass(frozen=True)
class Planned:
    """One run before it is recorded; `program` as in `excitation`."""

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
    """`count` runs of mixed inputs: the first open loop, the second followed, then either."""
    pools = [OPEN, FOLLOWING] + [OPEN + FOLLOWING] * (count - 2)
    runs = []
    used: list[str] = []
    for pool in pools:
        family = str(rng.choice([f for f in pool if f not in used]))
        used.append(family)
        seconds = float(np.round(rng.uniform(*SECONDS)))
        program = FAMILIES[family](np.random.default_rng(int(rng.integers(2**31))), seconds)
        runs.append((family, program, int(rng.integers(2**31))))
    order = rng.permutation(count)
    return [runs[i] for i in order]


def planned(rng: np.random.Generator, question: str, bench: Bench) -> tuple[list[Run], list[Planned]]:
    """The good runs of a case, recorded, and its runs in question, not yet recorded."""
    good: list[Run] = []
    if question == "changed":
        for i, (family, program, seed) in enumerate(_mixed(rng, int(rng.integers(3, 5)))):
            run = record_program(bench, (), program, seed, family=family, number=i - 1000)
            good.append(run)
        count = int(rng.integers(3, 5))
        held_out = 1
    else:
        count = int(rng.integers(4, 7))
        held_out = 1 + (count > 4)
    left = list(rng.permutation(len(good)))
    asked: list[Planned] = []
    for i, (family, program, seed) in enumerate(_mixed(rng, count)):
        role = "hold_out" if i >= count - held_out else "fit"
        again = ""
        if left and rng.uniform() < REPEATED:
            source = int(left.pop())
            family, program, again = good[source].family, commands_of(good[source]), f"good-{source + 1}"
        asked.append(Planned(role, family, program, seed, again))
    return good, asked


def _recorded(bench: Bench, active: tuple[Active, ...], asked: list[Planned]) -> list[Run]:
    return [
        record_program(bench, active, p.program, p.seed, family=p.family, number=i)
        for i, p in enumerate(asked)
    ]


def _again(bench: Bench, runs: list[Run], asked: list[Planned], day: int = 0) -> list[Run]:
    """The same commands once more on a bench without effect; `day` 0: the same day and noise."""
    return [
        record_program(bench, (), commands_of(run), p.seed + day)
        for run, p in zip(runs, asked, strict=True)
    ]


def _make(order: Order, case: Case) -> tuple[Entry, Entry]:
    """Write one case; its manifest entry and its key entry.

    `gap_paired` is what effect or parameters change of each signal under the same commands, day
    and noise held, in floors; the floor is the RMS between two days under the same commands.
    """
    question = "differs" if case.kind == "differs" else "changed"
    rng = np.random.default_rng((case.seed, 2))
    bench = another_bench(rng)
    good, asked = planned(rng, question, bench)
    tested = changed_parameters(rng, bench) if case.kind == "parameters" else bench
    target = float(np.exp(rng.uniform(*np.log(STRENGTHS[question]))))
    now = _recorded(bench, (), asked)
    floor = rms_difference(now, _again(bench, now, asked, OTHER_DAY))
    active: tuple[Active, ...] = ()
    gap = np.zeros(len(floor))
    for choice in case.choices if case.choices[0] else ():
        tried = _recorded(bench, choice, asked)
        active = raised(choice, rms_difference(tried, _again(bench, tried, asked)) / floor, target)
        now = _recorded(bench, active, asked)
        gap = rms_difference(now, _again(bench, now, asked)) / floor
        if gap.max() > REACHED * target:
            break
    if tested is not bench:
        now = _recorded(tested, (), asked)
        gap = rms_difference(now, _again(bench, now, asked)) / floor
    entry = {
        "kind": case.kind,
        "question": question,
        "target_floors": round(target, 4) if active else 0.0,
        **gap_entry(gap),
        "effects": [effect_entry(a) for a in active],
        "repeats": {f"run-{i + 1}": p.repeats for i, p in enumerate(asked) if p.repeats},
    }
    return {"id": case.name, "question": question, "runs": _written(order, case, good, now, asked)}, entry


def _written(
    order: Order, case: Case, good: list[Run], now: list[Run], asked: list[Planned]
) -> list[Entry]:
    place = Path("cases") / case.name
    (order.folder / place).mkdir(parents=True, exist_ok=True)
    listed = []
    for i, run in enumerate(good):
        listed.append({"file": str(place / f"good-{i + 1}.parquet"), "role": "good", "family": run.family})
        files.write_run(order.folder / listed[-1]["file"], run.log)
    for i, (run, p) in enumerate(zip(now, asked, strict=True)):
        listed.append({"file": str(place / f"run-{i + 1}.parquet"), "role": p.role, "family": run.family})
        files.write_run(order.folder / listed[-1]["file"], run.log)
    return listed


def make(order: Order, jobs: int = 2) -> str:
    """Write the bank and its key; the key's SHA-256. A folder that exists is refused.

    The seed of a sealed bank is drawn here and kept nowhere.
    """
    if order.sealed:
        order = replace(order, seed=secrets.randbits(48))
    if order.folder.exists() or order.key_folder.exists():
        raise BankError(f"{order.folder} or its key exists: give another folder, or remove both")
    kind = SEALED if order.sealed else "dev"
    cases = draw(kind, order.seed, scaled(MIXTURE, order.changed), 0) if order.changed else []
    cases += drawn_differs(kind, order.seed, order.differs, first=len(cases) + 1)
    with ProcessPoolExecutor(jobs) as pool:
        made = list(pool.map(_make, [order] * len(cases), cases))
    order.key_folder.mkdir(parents=True)
    key = {
        "format": "smad-key-1",
        "bank": order.name,
        "cases": {m["id"]: entry for m, entry in made},
    }
    files.write_json(order.key_folder / "KEY.json", key)
    sha256 = files.digest(order.key_folder / "KEY.json")
    manifest = {
        "format": files.FORMAT,
        "bank": order.name,
        "key_sha256": sha256,
        "columns": files.UNITS,
        "cases": [m for m, _ in made],
    }
    files.write_json(order.folder / "manifest.json", manifest)
    return sha256
