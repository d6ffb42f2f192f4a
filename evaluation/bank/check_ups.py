"""The protocol *check-up*: programme files played on a bench, good on days of their own, and now.

    BANK/programme/programme.toml, run-1.csv …      what was played
    BANK/benches/bench-1/good-1/run-1.parquet …     the good bench, once a repeat
    BANK/cases/case-001/run-1.parquet …             the same bench now
    BANK-key/KEY.json                               apart

Cases of one bench share its good runs, so that a diagnosis commissions a bench once.
"""

import secrets
import shutil
import tomllib
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import files
from evaluation.bank.cases import Case, draw, scaled
from evaluation.bank.excitation import TICK_s
from evaluation.bank.recorder import Run, record_program
from evaluation.errors import BankError
from evaluation.plant.effects import BY_NAME, Active
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
SEALED = "sealed"
MIXTURE = {"single": 60, "none": 24, "parameters": 12, "unknown": 24, "pair": 12, "triple": 4}
OTHER_DAYS = {"none": 12, "room": 12, "preload": 12, "parameters": 12, "drift": 12}
"""Benches without an effect on days unlike those they were commissioned on."""
MIXTURES = {"scores": MIXTURE, "other-days": OTHER_DAYS}
ROOM_K = 4.0
STRENGTHS = (0.3, 30.0)
"""Weakest and strongest effect, in repeat floors of the signal that shows it most."""
_LEAST_GAP = 0.01
SIGNALS = ("i_meas_x_A", "v_x_V", "v_y_V", "rtd_x_degC", "rtd_y_degC", "displacement_mm", "force_N")


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
    at = np.searchsorted(table["t_s"], grid + 1e-9, side="right") - 1
    program = np.zeros((len(grid), 7))
    for column, name_ in enumerate(COLUMNS[1:], start=2):
        program[:, column] = table[name_][at]
    return Played(name, program)


@dataclass(frozen=True)
class Order:
    """A bank to make: how many cases on how many benches, how many good repeats.

    `sealed`: effects of no list come from the sealed ones, and the seed is drawn in secret.
    """

    folder: Path
    programme: Path
    cases: int
    benches: int
    repeats: int
    seed: int
    mixture: str = "scores"
    sealed: bool = False

    @property
    def name(self) -> str:
        """What manifest and key call the bank."""
        return SEALED if self.sealed else self.folder.name

    @property
    def key_folder(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}-key")


def bench_of(order: Order, number: int) -> Bench:
    """Bench `number` of the bank."""
    return another_bench(np.random.default_rng((order.seed, 28, number)))


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


def _good(order: Order, number: int) -> Array:
    """Write the good repeats of a bench; its floor: RMS between two of its good days, by signal."""
    programme = read_programme(order.programme)
    bench = bench_of(order, number)
    repeats = []
    for repeat in range(order.repeats):
        seed = int(np.random.default_rng((order.seed, 29, number, repeat)).integers(2**31))
        place = order.folder / "benches" / f"bench-{number + 1}" / f"good-{repeat + 1}"
        repeats.append(play(bench, (), programme, seed))
        _write(place, repeats[-1])
    if len(repeats) < 2:
        repeats.append(play(bench, (), programme, seed + 7))
    pairs = list(pairwise(repeats))
    return np.asarray(np.sqrt(np.mean([rms_difference(a, b) ** 2 for a, b in pairs], axis=0)))


def rms_difference(one: Sequence[Run], other: Sequence[Run]) -> Array:
    """RMS of what two recordings of the same runs differ by, for each of `SIGNALS`."""
    columns = [_column(s) for s in SIGNALS]
    off = np.concatenate([(a.grid - b.grid)[:, columns]
                          for a, b in zip(one, other, strict=True)])  # fmt: skip
    return np.asarray(np.sqrt(np.mean(off**2, axis=0)))


def _column(signal: str) -> int:
    from evaluation.plant.layout import READINGS

    return READINGS.index(signal)


def raised(active: tuple[Active, ...], tried: Array, target: float) -> tuple[Active, ...]:
    """Effects that gave the gaps `tried`, scaled to `target` floors within their limits."""
    factor = target / max(float(tried.max()), _LEAST_GAP)
    out = []
    for a in active:
        limit = BY_NAME[a.name].limit
        out.append(replace(a, magnitude=float(np.clip(a.magnitude * factor, -limit, limit))))
    return tuple(out)


def gap_entry(gap: Array) -> dict[str, Any]:
    """The gaps of a case as the key has them, in floors."""
    return {
        "gap_worst": round(float(gap.max()), 4),
        "gap_paired": {s: round(float(g), 3) for s, g in zip(SIGNALS, gap, strict=True)},
    }


def effect_entry(active: Active) -> dict[str, Any]:
    """One effect as the key has it."""
    spec = BY_NAME[active.name]
    return {
        "name": active.name,
        "known": spec.kind == "known",
        "subsystem": spec.subsystem,
        "magnitude": active.magnitude,
        "y_share": active.y_share,
        "shape": active.shape,
    }


def _make(order: Order, case: Case, floor: Array) -> tuple[dict[str, Any], dict[str, Any]]:
    """Write one case; its manifest entry and its key entry.

    An effect is tried at its usual size and scaled once, to a strength drawn evenly in its
    logarithm from `STRENGTHS`. `gap_paired` is what it then changes of each signal with day and
    noise held, in repeat floors, `gap_worst` the largest of these.
    """
    programme = read_programme(order.programme)
    number = case.number % order.benches
    bench = bench_of(order, number)
    rng = np.random.default_rng((case.seed, 2))
    tested = _on_its_day(case.kind, rng, bench, len(programme))
    room_K = ROOM_K if case.kind == "room" else 0.0
    seed = int(rng.integers(2**31))
    target = float(np.exp(rng.uniform(*np.log(STRENGTHS))))
    active = case.choices[0]
    gap = np.zeros(len(SIGNALS))
    without = play(bench, (), programme, seed)
    if active:
        tried = rms_difference(play(bench, active, programme, seed), without) / floor
        active = raised(active, tried, target)
    other = active or room_K or tested is not bench
    now = play(tested, active, programme, seed, room_K) if other else without
    gap = rms_difference(now, without) / floor
    _write(order.folder / "cases" / case.name, now)
    entry = {
        "kind": case.kind,
        "bench": number + 1,
        "target_floors": round(target, 4) if active else 0.0,
        **gap_entry(gap),
        "effects": [effect_entry(a) for a in active],
    }
    return {"id": case.name, "bench": f"bench-{number + 1}"}, entry


def make(order: Order, jobs: int = 2) -> str:
    """Write the bank and its key; the key's SHA-256. A folder that exists is refused.

    The seed of a sealed bank is drawn here and kept nowhere: its good repeats and cases would tell.
    """
    if order.sealed:
        order = replace(order, seed=secrets.randbits(48))
    if order.folder.exists() or order.key_folder.exists():
        raise BankError(f"{order.folder} or its key exists: give another folder, or remove both")
    shutil.copytree(order.programme, order.folder / "programme")
    counts = scaled(MIXTURES[order.mixture], order.cases)
    cases = draw(SEALED if order.sealed else "dev", order.seed, counts, 0)
    with ProcessPoolExecutor(jobs) as pool:
        floors = list(pool.map(_good, [order] * order.benches, range(order.benches)))
        own = [floors[case.number % order.benches] for case in cases]
        made = list(pool.map(_make, [order] * len(cases), cases, own))
    order.key_folder.mkdir(parents=True)
    key = {
        "format": "smad-key-1",
        "bank": order.name,
        "cases": {m["id"]: entry for m, entry in made},
    }
    files.write_json(order.key_folder / "KEY.json", key)
    sha256 = files.digest(order.key_folder / "KEY.json")
    manifest = {
        "format": FORMAT,
        "bank": order.name,
        "key_sha256": sha256,
        "columns": files.UNITS,
        "repeats": order.repeats,
        "cases": [m for m, _ in made],
    }
    files.write_json(order.folder / "manifest.json", manifest)
    return sha256
