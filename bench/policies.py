"""What a diagnosis is worth to who trains in simulation: policies trained on four simulators, tried
on benches that none of them has seen.

`python -m bench.policies` prints the table of docs/guide/envs.md. Each bench differs from the
simulator in parameters and by one effect; its runs are diagnosed, and the model file of that is one
of the simulators. No figure is chosen: every bench and every seed of the search counts.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np
import numpy.typing as npt

from bench.controls import FAMILIES
from sim_device.plant.effects.registry import effect
from sim_device.plant.models import read_model
from sim_device.plant.parameters import load_parameters
from smad.envs.search import Search, tracking_error_mm
from smad.envs.vector import SpringPairVectorEnv
from smad.gap.apply import apply
from smad.gap.diagnose import diagnose
from smad.gap.plant import ModelPoint
from smad.gap.sma import SmaPlant
from smad.gap.sma.recorded import recorded

Array = npt.NDArray[np.float64]
EPISODE_S, TRIED = 12.0, 64
EFFECTS = (("driver_gain", -1.5), ("rtd_lag", 1.5), ("tube_friction", 1.5))
"""Of the benches in turn: the effect and its level, in typical ones."""
SIMULATORS = ("wrong simulator", "ranges by hand", "diagnosed posterior", "the bench itself")
_SHARES = {"film_scale": 0.4, "flow_max": 0.3, "heat_capacity_heating": 0.1}
_SHIFT_K = 2.0


@dataclass(frozen=True)
class Bench:
    """A bench that is withheld, and what it is."""

    name: str
    point: ModelPoint


def benches(count: int) -> Iterator[Bench]:
    """Benches, each from its number."""
    a = load_parameters("A")
    for number in range(count):
        rng = np.random.default_rng([number, 46])
        theta = {n: a[n] * (1.0 + rng.uniform(-s, s)) for n, s in _SHARES.items()}
        shift = rng.uniform(-_SHIFT_K, _SHIFT_K)
        theta |= {n: a[n] + shift for n in ("martensite_start", "martensite_finish")}
        name, level = EFFECTS[number % len(EFFECTS)]
        yield Bench(f"{number + 1} ({name})", ModelPoint(theta, {name: effect(name).at(level)}))


def ranges_by_hand() -> dict[str, tuple[float, float]]:
    """What somebody may vary who knows the simulator and not the bench: of each effect above both
    signs or up to twice the typical, and of each parameter what the benches are drawn from."""
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


def diagnosed(bench: Bench, path: Path) -> str:
    """Write the model file of a diagnosis of the bench's runs, unless it is there already; returns
    the verdict."""
    if path.exists():
        return read_model(path).note
    plant = SmaPlant()
    runs = [recorded(f, plant, bench.point, i) for i, f in enumerate(FAMILIES)]
    found = diagnose(runs, plant=plant)
    apply(found, plant, path)
    return found.verdict.plain


def trained(search: Search, seed: int, **simulator: Any) -> Array:
    """The weights that a search in a simulator ends with."""
    env = _env(search.num_envs, **simulator)
    weights = search.run(env, seed)
    env.close()
    return weights


def tried(weights: Array, model: Path) -> float:
    """Mean distance from the reference on a bench, mm, over episodes that are always the same."""
    env = _env(TRIED, model=model)
    error = float(tracking_error_mm(env, weights, 10_000).mean())
    env.close()
    return error


def _env(size: int, **options: Any) -> SpringPairVectorEnv:
    return SpringPairVectorEnv(size, action="demand", episode_s=EPISODE_S, **options)


def line(name: str, values: Mapping[str, list[float]]) -> str:
    """Mean and, over seeds and benches, standard deviation, mm."""
    cells = (
        f"{np.mean(v):10.3f} ± {np.std(v, ddof=1) if len(v) > 1 else 0.0:5.3f}"
        for v in values.values()
    )
    return f"{name:20}{''.join(cells)}"


@click.command()
@click.option("--benches", "count", default=3, show_default=True)
@click.option("--seeds", default=3, show_default=True, help="Searches in each simulator.")
@click.option("--generations", default=10, show_default=True)
@click.option("--folder", type=click.Path(path_type=Path), help="Keep the diagnosed models here.")
def main(count: int, seeds: int, generations: int, folder: Path | None) -> None:
    """Train, try, and print mean distance from the reference in mm."""
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        return _table(count, Search(generations=generations), seeds, folder)
    with TemporaryDirectory() as made:
        return _table(count, Search(generations=generations), seeds, Path(made))


def _table(count: int, search: Search, seeds: int, folder: Path) -> None:
    begun_s = time.perf_counter()
    everywhere: dict[str, list[float]] = {name: [] for name in SIMULATORS}
    alike = {
        "wrong simulator": [trained(search, seed) for seed in range(seeds)],
        "ranges by hand": [
            trained(search, seed, randomise=ranges_by_hand()) for seed in range(seeds)
        ],
    }
    print(f"{'bench':20}{''.join(f'{name:>18}' for name in SIMULATORS)}", flush=True)
    for bench in benches(count):
        own, better = (folder / f"{bench.name[0]}-{n}.toml" for n in ("own", "better"))
        SmaPlant().save_model(bench.point, own, "")
        verdict = diagnosed(bench, better)
        policies = alike | {
            "diagnosed posterior": [
                trained(search, seed, model=better, randomise="posterior") for seed in range(seeds)
            ],
            "the bench itself": [trained(search, seed, model=own) for seed in range(seeds)],
        }
        errors = {n: [tried(w, own) for w in policies[n]] for n in SIMULATORS}
        for name, values in errors.items():
            everywhere[name] += values
        print(line(bench.name, errors), flush=True)
        print(f"    diagnosis: {verdict}", flush=True)
    print(line("all", everywhere))
    print(f"mm, mean ± standard deviation over seeds (all: over benches and seeds); {seeds} seeds,")
    print(f"{search.generations} generations; {time.perf_counter() - begun_s:.0f} s")


if __name__ == "__main__":
    main()
