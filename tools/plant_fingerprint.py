"""Whether two states of the code compute the same plant.

PYTHONPATH=OLD python tools/plant_fingerprint.py write old.npz    results of the code in folder OLD
PYTHONPATH=.   python tools/plant_fingerprint.py write new.npz    results of this code
python tools/plant_fingerprint.py compare old.npz new.npz         worst difference by output

Only the public interface of the plant is used, so that states far apart can be compared. The cases
are seeded: every effect alone with each law of the phase change and with one and five cells, many
effects at once, every option, every feed, and the plant sample by sample.
"""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sim_device.plant import Drive, Inputs, Plant, load_parameters, simulate
from sim_device.plant.effects.record import Y_SHARE, Effect
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.errors import EffectError, SolverError

Array = npt.NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float]]
ALLOWED = 1e-9
"""Largest difference that is let pass, as a share of the output's full scale over all cases."""
KEPT_ROWS = 12
UNIFIED: Effects = {"unified_kinetics": {"on": 1.0, "tails": 0.4}}
FRONT: Effects = {"cooling_front": {"share": 0.8, "place": 0.4}}


def driven(seed: int, seconds: float = 24.0, step_s: float = 0.02) -> Inputs:
    """Currents and pumps held for some time each; the stage moves, water drains at times."""
    rng = np.random.default_rng(seed)
    n = int(seconds / step_s)
    t = np.arange(n) * step_s
    i_A, duty, drain = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    for side in (0, 1):
        row = int(rng.integers(1, 60))
        while row < n:
            heat, cool = (int(rng.uniform(a, b) / step_s) for a, b in ((2, 6), (2, 7)))
            i_A[row : row + heat, side] = rng.uniform(2.0, 4.0)
            duty[row + heat : row + heat + cool, side] = rng.uniform(0.1, 1.0)
            drain[row + heat + cool : row + heat + cool + 40, side] = rng.integers(0, 2)
            row += heat + cool + int(rng.integers(0, 60))
    stage = 0.004 * np.sin(2 * np.pi * t / rng.uniform(5.0, 15.0)) ** 2
    return Inputs(t, i_A, duty, drain=drain, stage_m=stage)


def drawn(entry: Effect, rng: np.random.Generator) -> dict[str, float]:
    """Values somewhere between nothing and twice the typical one, within the range."""
    return {
        p.name: 1.0
        if p.switch
        else float(np.clip(p.typical * rng.uniform(0.2, 2.0), p.low, p.high))
        for p in entry.parameters
        if p is not Y_SHARE or rng.random() < 0.5
    }


def with_options() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Name, parameter set and arguments of `simulate` for each case."""
    for name, variant, fixture, cooling in product(
        ("A", "B", "conserving"),
        ("extended", "printed"),
        ("antagonistic", "stretch", "blocked"),
        ("water", "air"),
    ):
        options = {"variant": variant, "fixture": fixture, "cooling": cooling}
        yield f"options {' '.join((name, *options.values()))}", name, options


def with_one_effect() -> Iterator[tuple[str, str, dict[str, Any]]]:
    laws: dict[str, Effects] = {
        "": {},
        "unified": UNIFIED,
        "front": FRONT,
        "unified front": UNIFIED | FRONT,
    }
    for entry, name, (label, law) in product(EFFECTS, ("A", "B"), laws.items()):
        rng = np.random.default_rng(len(entry.name))
        for level, values in (("typical", entry.typical()), ("drawn", drawn(entry, rng))):
            case = {"effects": {**law, entry.name: values}, "dt_s": 0.005}
            yield f"{entry.name} {level} {name} {label}", name, case
        if not law:
            for fixture in ("stretch", "blocked"):
                case = {"effects": {entry.name: {}}, "fixture": fixture, "dt_s": 0.005}
                yield f"{entry.name} {fixture} {name}", name, case
        if entry.name == "water_warming":
            case = {"effects": {**law, entry.name: {}}, "variant": "printed", "dt_s": 0.005}
            yield f"{entry.name} printed {name} {label}", name, case


def with_many_effects() -> Iterator[tuple[str, str, dict[str, Any]]]:
    names = [entry for entry in EFFECTS if entry.name != "water_warming"]
    for seed in range(60):
        rng = np.random.default_rng(seed)
        share = rng.uniform(0.1, 1.0)
        chosen = {e.name: drawn(e, rng) for e in names if rng.random() < share}
        dt_s = float(rng.choice([0.001, 0.005, 0.02]))
        yield f"many {seed}", "AB"[seed % 2], {"effects": chosen, "dt_s": dt_s}


def with_feeds() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """What a run showed, fed to a plant with other effects: every choice of feeds."""
    source = simulate(load_parameters("A"), driven(5))
    series = {
        "i_A": np.column_stack([source["i_x_A"], source["i_y_A"]]) * 1.02,
        "temperature_K": np.column_stack([source["T_x_K"], source["T_y_K"]]),
        "force_N": source["force_N"],
        "displacement_m": source["displacement_m"],
        "surroundings_K": np.column_stack(
            [source["rtd_inlet_degC"] + 274.0, source["rtd_ambient_degC"] + 272.0]
        ),
    }
    friction: Effects = {"tube_friction": {}, "viscous_drag": {}, "tendon_slack": {}}
    for bits in range(1, 2 ** len(series)):
        chosen = {name: series[name] for n, name in enumerate(series) if bits >> n & 1}
        for label, effects in (
            ("", {}),
            ("unified", UNIFIED),
            ("unified front", UNIFIED | FRONT),
            ("rough", friction),
        ):
            case = {"feeds": chosen, "effects": effects, "dt_s": 0.01}
            yield f"feeds {'+'.join(chosen)} {label}", "A", case


def sampled(name: str, effects: Effects, cooling: str) -> dict[str, Array]:
    """The plant sample by sample: readings with noise, truth, energy, a changing environment."""
    plant = Plant(load_parameters(name), effects=effects, cooling=cooling, seed=3, max_step_s=0.002)
    inputs = driven(9, 16.0)
    rows = []
    for n, row in enumerate(inputs.rows):
        drive = Drive((row[0], row[1]), (row[2], row[3]), (bool(row[4]), bool(row[5])), 0.0)
        if n % 100 == 50:
            plant.set_environment(inlet_K=298.0 + n % 7, ambient_K=295.0 + n % 5)
        plant.advance(drive, 0.02 if n % 3 else 0.013)
        seen, truth = plant.read(), plant.truth
        shown = (*seen.i_A, *seen.v_V, *seen.rtd_degC, seen.displacement_m, seen.force_N)
        rows.append((*shown, seen.supply_V, *truth.T_K, *truth.xi_S, *truth.xi_T, truth.force_N))
    book = plant.energy
    energy = np.array([book.heat_in, book.work_on, book.unequal, book.stored, book.omitted_work])
    return {"samples": np.array(rows), "energy": energy}


def results() -> Iterator[tuple[str, dict[str, Array]]]:
    """All cases and what they give; a refusal or a failure is kept as its words."""
    inputs = [driven(seed) for seed in range(5)]
    cases = (*with_options(), *with_one_effect(), *with_many_effects(), *with_feeds())
    for n, (label, name, options) in enumerate(cases):
        chosen = driven(5) if "feeds" in options else inputs[n % len(inputs)]
        try:
            yield label, simulate(load_parameters(name), chosen, **options)
        except (EffectError, SolverError) as error:
            yield label, {f"error: {error}": np.zeros(1)}
    for effects, cooling in (({}, "water"), (UNIFIED | FRONT, "water"), ({}, "air")):
        for name in ("A", "B"):
            yield f"sampled {name} {'+'.join(effects)} {cooling}", sampled(name, effects, cooling)
    everything = {e.name: {} for e in EFFECTS if e.name != "water_warming"}
    yield "sampled with every effect", sampled("A", everything, "water")


def write(path: Path) -> int:
    """Keep of each case a hash of all bits, some rows, and each output's largest value."""
    start = time.perf_counter()
    columns: dict[str, Array] = {}
    for label, out in results():
        for name, column in out.items():
            every = max(1, len(column) // KEPT_ROWS)
            columns[f"{label}|{name}|rows"] = np.concatenate([column[::every], column[-1:]])
            digest = hashlib.sha256(column.tobytes()).digest()
            columns[f"{label}|{name}|bits"] = np.frombuffer(digest, dtype=np.uint8)
    np.savez_compressed(path, **columns)
    print(f"{len(columns) // 2} series in {time.perf_counter() - start:.0f} s: {path}")
    return 0


def compare(first: Path, second: Path) -> int:
    """Print how many series agree to the bit, and what differs most. Status 1: too far."""
    before, other = np.load(first), np.load(second)
    shared = [key for key in before.files if key in other]
    alone = sorted({key.split("|")[1] for key in set(before.files) ^ set(other.files)})
    if alone:
        print(f"in one of the two only: {', '.join(alone)}")
    same = 0
    scale: dict[str, float] = {}
    worst: dict[str, tuple[float, str]] = {}
    for key in shared:
        label, name, kind = key.split("|")
        if kind == "bits":
            same += bool((before[key] == other[key]).all())
            continue
        scale[name] = max(scale.get(name, 0.0), float(np.abs(before[key]).max()))
        off = float(np.abs(before[key] - other[key]).max())
        if not off <= worst.get(name, (0.0, ""))[0]:
            worst[name] = (off, label)
    print(f"{same} of {len(shared) // 2} series agree in every bit")
    # A case that fails in one state only has an output named after its error.
    far = any(name.startswith("error") for name in alone)
    for name, (off, label) in sorted(worst.items()):
        share = off / scale[name] if scale[name] else off
        far = far or not share <= ALLOWED
        print(f"{name:24} {off:10.3g}  {share:10.3g} of full scale  {label}")
    return int(far)


def main(arguments: list[str]) -> int:
    match arguments:
        case ["write", path]:
            return write(Path(path))
        case ["compare", first, second]:
            return compare(Path(first), Path(second))
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
