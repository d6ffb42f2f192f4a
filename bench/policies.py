"""What a diagnosis is worth to who trains in simulation: policies trained on three simulators, and
tried on benches that none of them has seen.

`python -m bench.policies` prints the table of docs/guide/envs.md. The benches are those of the
withheld check's plant, which shares no code with the simulator: its constants differ from bench to
bench, and each has one effect. Its recorded runs are diagnosed as a user's would be, and the model
file of that is one of the simulators. No figure is chosen: every bench and every seed counts.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np
import numpy.typing as npt

from bench.independent import IndependentPairs
from evaluation.bank import files
from evaluation.bank.excitation import FOR_FITTING
from evaluation.bank.recorder import record
from evaluation.plant import effects as withheld
from evaluation.plant.parameters import Bench, another_bench
from sim_device.plant.effects.registry import effect
from sim_device.plant.models import read_model
from sim_device.plant.parameters import load_parameters
from smad.diagnosis import diagnose
from smad.diagnosis.spring_pair import SmaPlant, read_gap_run
from smad.envs.search import Search, tracking_error_mm
from smad.envs.vector import SpringPairVectorEnv

Array = npt.NDArray[np.float64]
EPISODE_S, TRIED = 12.0, 64
RUNS, RUN_S = 3, 40.0
EFFECTS = (("driver_gain", -0.5), ("rtd_lag", 0.5), ("tube_friction", 0.5))
"""Of the benches in turn: the effect, and its share of the most that the check ever uses."""
SIMULATORS = ("wrong simulator", "ranges by hand", "diagnosed posterior")
_SHARES = {"film_scale": 0.4, "flow_max": 0.3, "heat_capacity_heating": 0.1}
_SHIFT_K = 2.0


@dataclass(frozen=True)
class Withheld:
    """A bench of the independent plant, and its effect."""

    number: int
    bench: Bench
    active: withheld.Active

    @property
    def name(self) -> str:
        return f"{self.number} ({self.active.name})"

    def env(self, size: int) -> IndependentPairs:
        """Episodes on it."""
        return IndependentPairs(size, self.bench, (self.active,), episode_s=EPISODE_S)


def benches(count: int) -> Iterator[Withheld]:
    """Benches, each from its number."""
    for start in range(count):
        name, share = EFFECTS[start % len(EFFECTS)]
        active = withheld.Active(name, share * withheld.BY_NAME[name].limit)
        yield Withheld(start + 1, another_bench(np.random.default_rng([start, 46])), active)


def ranges_by_hand() -> dict[str, tuple[float, float]]:
    """What somebody may vary who knows the simulator and not the bench: parameters by a share that
    is usual, and of each effect above both signs or up to twice the typical."""
    a = load_parameters("A")
    ranges = {f"parameters.{n}": (a[n] * (1.0 - s), a[n] * (1.0 + s)) for n, s in _SHARES.items()}
    for name in ("martensite_start", "martensite_finish"):
        ranges[f"parameters.{name}"] = (a[name] - _SHIFT_K, a[name] + _SHIFT_K)
    for name, _ in EFFECTS:
        for p in effect(name).parameters:
            if p.is_strength and p.typical != 0.0:
                most = 2.0 * abs(p.typical)
                ranges[f"effects.{name}.{p.name}"] = (max(p.low, -most), min(p.high, most))
    return ranges


def diagnosed(bench: Withheld, path: Path) -> str:
    """Write the model file of a diagnosis of the bench's runs, unless it is there already; returns
    the verdict."""
    if not path.exists():
        runs = []
        for number, family in enumerate(FOR_FITTING[:RUNS]):
            seed = 100 * bench.number + number
            made = record(bench.bench, (bench.active,), family, seed, seconds=RUN_S, number=number)
            table = path.with_name(f"{bench.number}-{family}.parquet")
            files.write_run(table, made.log)
            runs.append(replace(read_gap_run(table), name=family))
        plant = SmaPlant()
        diagnose(runs, plant=plant).verdict.write_model(path)
    return read_model(path).note


def trained(search: Search, simulator: Mapping[str, Any], seed: int) -> list[float]:
    """The weights that a search in a simulator ends with."""
    env = SpringPairVectorEnv(
        search.num_envs, action="demand", episode_s=EPISODE_S, threads=1, **simulator
    )
    return list(search.run(env, seed))


def tried(weights: Array, bench: Withheld) -> float:
    """Mean distance from the reference on a bench, mm, over episodes that are always the same."""
    return float(tracking_error_mm(bench.env(TRIED), weights, 10_000).mean())


def line(name: str, values: Mapping[str, list[float]]) -> str:
    """Mean and, over seeds and benches, standard deviation, mm."""
    cells = (
        f"{np.mean(v):10.3f} ± {np.std(v, ddof=1) if len(v) > 1 else 0.0:5.3f}"
        for v in values.values()
    )
    return f"{name:20}{''.join(cells)}"


@dataclass(frozen=True, kw_only=True)
class Table:
    """What is measured, and where it is kept: what is there already is not made again."""

    search: Search
    seeds: int
    folder: Path
    pool: Executor

    def searched(self, name: str, **simulator: Any) -> list[list[float]]:
        """Weights of every search in a simulator."""
        paths = [
            self.folder / f"{name}-seed{seed}-{self.search.generations}.json"
            for seed in range(self.seeds)
        ]
        missing = [seed for seed, path in enumerate(paths) if not path.exists()]
        train = partial(trained, self.search, simulator)
        for seed, weights in zip(missing, self.pool.map(train, missing), strict=True):
            paths[seed].write_text(json.dumps(weights))
        return [json.loads(path.read_text()) for path in paths]

    def errors(self, bench: Withheld) -> dict[str, list[float]]:
        """Errors on a bench of every search in each of SIMULATORS, mm."""
        better = self.folder / f"{bench.number}-better.toml"
        diagnosed(bench, better)
        policies = (
            self.searched("wrong"),
            self.searched("by-hand", randomise=ranges_by_hand()),
            self.searched(f"{bench.number}-posterior", model=better, randomise="posterior"),
        )
        return {
            name: [tried(np.array(row), bench) for row in weights]
            for name, weights in zip(SIMULATORS, policies, strict=True)
        }

    def lines(self, count: int) -> Iterator[str]:
        """The table, a line a bench."""
        everywhere: dict[str, list[float]] = {name: [] for name in SIMULATORS}
        yield f"{'bench':20}{''.join(f'{name:>18}' for name in SIMULATORS)}"
        for bench in benches(count):
            errors = self.errors(bench)
            for name, values in errors.items():
                everywhere[name] += values
            yield line(bench.name, errors)
            yield f"    diagnosis: {diagnosed(bench, self.folder / f'{bench.number}-better.toml')}"
        yield line("all", everywhere)


@click.command()
@click.option("--benches", "count", default=3, show_default=True)
@click.option("--seeds", default=3, show_default=True, help="Searches in each simulator.")
@click.option("--generations", default=10, show_default=True)
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    help="Keep what was found here; broken off, the command goes on there.",
)
def main(count: int, seeds: int, generations: int, folder: Path | None) -> None:
    """Train, try, and print mean distance from the reference in mm."""
    begun_s = time.perf_counter()
    with TemporaryDirectory() as made, ProcessPoolExecutor(2, get_context("spawn")) as pool:
        place = Path(made) if folder is None else folder
        place.mkdir(parents=True, exist_ok=True)
        table = Table(search=Search(generations=generations), seeds=seeds, folder=place, pool=pool)
        for line in table.lines(count):
            print(line, flush=True)
    print(f"mm, mean ± standard deviation over seeds (all: over benches and seeds); {seeds} seeds,")
    print(f"{generations} generations; {time.perf_counter() - begun_s:.0f} s")


if __name__ == "__main__":
    main()
