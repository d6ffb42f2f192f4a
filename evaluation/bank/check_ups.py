"""The protocol *check-up*: programme files played on a bench, good on days of their own, and now.

    BANK/programme/programme.toml, run-1.csv …      what was played
    BANK/benches/bench-1/good-1/run-1.parquet …     the good bench, once a repeat
    BANK/cases/case-001/run-1.parquet …             the same bench now
    BANK-key/KEY.json                               apart

Cases of one bench share its good runs, so that a diagnosis commissions a bench once.
"""

import shutil
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import files
from evaluation.bank.cases import Case, draw, scaled
from evaluation.bank.excitation import TICK_s
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
from evaluation.errors import BankError
from evaluation.plant.effects import Active
from evaluation.plant.parameters import (
    Bench,
    another_bench,
    changed_parameters,
    drifting,
    mounted_anew,
)

Array = NDArray[np.float64]

COLUMNS = ("t_s", "i_x_A", "i_y_A", "duty_x", "duty_y")
FORMAT = "smad-checkup-1"
MIXTURE = {"single": 60, "none": 24, "parameters": 12, "unknown": 24, "pair": 12, "triple": 4}
OTHER_DAYS = {"none": 12, "room": 12, "preload": 12, "parameters": 12, "drift": 12}
"""Benches without an effect on days unlike those they were commissioned on."""
MIXTURES = {
    "scores": MIXTURE,
    "other-days": OTHER_DAYS,
    "parameters": {"parameters": 12},
    "pairs": {"pair": 12},
}
ROOM_K = 4.0
STRENGTHS = (0.3, 30.0)
"""Weakest and strongest effect, in repeat floors of the signal that shows it most."""


@dataclass(frozen=True)
class Played:
    """A run of the programme at the recorder's rate.

    Columns of `program`: follow, reference_mm, i_x_A, i_y_A, duty_x, duty_y, cooling.
    """

    name: str
    program: Array


def read_programme(folder: Path) -> list[Played]:
    """The programme of a folder: `programme.toml` and a CSV for each run. Raises BankError."""
    try:
        listed = tomllib.loads((folder / "programme.toml").read_text())["runs"]
    except (OSError, KeyError, tomllib.TOMLDecodeError) as error:
        raise BankError(f"{folder} holds no programme ({error}): give the folder of one") from None
    return [_read_run(folder, r["name"], float(r["duration_s"])) for r in listed]


def _read_run(folder: Path, name: str, duration_s: float) -> Played:
    table = files.read_run(folder / f"{name}.csv")
    if tuple(table) != COLUMNS:
        raise BankError(f"{name}.csv: columns are {', '.join(COLUMNS)}, not {', '.join(table)}")
    grid = np.arange(round(duration_s / TICK_s)) * TICK_s
    index = np.searchsorted(table["t_s"], grid + 1e-9, side="right") - 1
    program = np.zeros((len(grid), 7))
    for column, name_ in enumerate(COLUMNS[1:], start=2):
        program[:, column] = table[name_][index]
    return Played(name, program)


@dataclass(frozen=True, kw_only=True)
class CheckUps(Order):
    """A bank of check-ups: how many cases on how many benches, how many good repeats."""

    programme: Path
    cases: int = 66
    benches: int = 6
    repeats: int = 2
    mixture: str = "scores"


def bench_of(order: CheckUps, number: int) -> Bench:
    """Bench `number` of the bank."""
    return another_bench(np.random.default_rng((_seed(order), 28, number)))


def _seed(order: CheckUps) -> int:
    assert order.seed is not None
    return order.seed


def play(
    bench: Bench | Sequence[Bench],
    active: tuple[Active, ...],
    programme: list[Played],
    seed: int,
    room_K: float = 0.0,
) -> list[Run]:
    """The whole programme, each run on a day of its own; `bench` may be one for each run."""
    benches = [bench] * len(programme) if isinstance(bench, Bench) else bench
    return [
        record_program(
            benches[i], active, p.program, seed + 17 * i, family=p.name, number=i, room_K=room_K
        )
        for i, p in enumerate(programme)
    ]


def _on_its_day(
    kind: str, rng: np.random.Generator, bench: Bench, count: int
) -> Bench | list[Bench]:
    """The bench as a case of this kind finds it, without its effect."""
    if kind == "parameters":
        return changed_parameters(rng, bench)
    if kind == "preload":
        return mounted_anew(rng, bench)
    return drifting(rng, bench, count) if kind == "drift" else bench


def _write(folder: Path, runs: list[Run]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs:
        files.write_run(folder / f"{run.family}.parquet", run.log)


def _good(order: CheckUps, number: int) -> list[float]:
    """Write the good repeats of a bench; its floor: RMS between two of its good days, by signal."""
    programme = read_programme(order.programme)
    bench = bench_of(order, number)
    repeats = []
    for repeat in range(order.repeats):
        seed = int(np.random.default_rng((_seed(order), 29, number, repeat)).integers(2**31))
        place = order.folder / "benches" / f"bench-{number + 1}" / f"good-{repeat + 1}"
        repeats.append(play(bench, (), programme, seed))
        _write(place, repeats[-1])
    if len(repeats) < 2:
        repeats.append(play(bench, (), programme, seed + 7))
    squares = [rms_difference(a, b) ** 2 for a, b in pairwise(repeats)]
    return [float(x) for x in np.sqrt(np.mean(squares, axis=0))]


def _make(order: CheckUps, case: Case, floor: list[float]) -> tuple[Entry, Entry]:
    """Write one case; its manifest entry and its key entry.

    Each effect is tried alone at its usual size and scaled once, all to one strength drawn evenly
    in its logarithm from `STRENGTHS`. `gap_paired` is what they then change of each signal with day
    and noise held, in repeat floors, `gap_worst` the largest of these; `gap_alone` is that of each
    of several effects without the others.
    """
    programme = read_programme(order.programme)
    number = case.number % order.benches
    bench = bench_of(order, number)
    rng = np.random.default_rng((case.seed, 2))
    tested = _on_its_day(case.kind, rng, bench, len(programme))
    room_K = ROOM_K if case.kind == "room" else 0.0
    seed = int(rng.integers(2**31))
    target = float(np.exp(rng.uniform(*np.log(STRENGTHS))))
    without = play(bench, (), programme, seed)

    def changes(*effects: Active) -> Array:
        return rms_difference(play(bench, effects, programme, seed), without) / floor

    active = tuple(a for tried in case.choices[0] for a in raised((tried,), changes(tried), target))
    other = active or room_K or tested is not bench
    now = play(tested, active, programme, seed, room_K) if other else without
    gap = rms_difference(now, without) / floor
    _write(order.folder / "cases" / case.name, now)
    entry = answer(case.kind, active, target, gap) | {"bench": number + 1}
    if len(active) > 1:
        for effect, described in zip(active, entry["effects"], strict=True):
            described["gap_alone"] = round(float(changes(effect).max()), 4)
    return {"id": case.name, "bench": f"bench-{number + 1}"}, entry


def make(order: CheckUps) -> str:
    """Make a bank or go on with it; the SHA-256 of its key, empty when time ran out.

    Raises BankError when another bank is in the way.
    """
    until = time.monotonic() + 60.0 * order.minutes
    order = begun(order)
    shutil.copytree(order.programme, order.folder / "programme", dirs_exist_ok=True)
    cases = draw(_seed(order), scaled(MIXTURES[order.mixture], order.cases), sealed=order.sealed)
    benches = {f"bench-{n + 1}": (order, n) for n in range(order.benches)}
    floors = made(order, until, _good, benches)
    if floors is None:
        return ""
    floor_of = {c.name: floors[f"bench-{c.number % order.benches + 1}"] for c in cases}
    done = made(order, until, _make, {c.name: (order, c, floor_of[c.name]) for c in cases})
    if done is None:
        return ""
    return sealed_up(order, done, {"format": FORMAT, "repeats": order.repeats})
