"""`python -m tests.smad.gap.coverage`: how often an interval holds the true value.

Each repetition records runs of a plant with one effect and new noise, asks for that effect, and
looks whether each interval of its parameters holds what was put in. `--plant heater` is the tiny
plant with other parameters, `--plant pair` the simulated spring pair at its nominal ones.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from smad.gap import diagnose

from smad.diagnosis.bank.intervals import wilson
from smad.diagnosis.plant import ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, bank
from tests.smad.gap.heater_plant import HeaterPlant

_SEEDS_APART = 10
"""Seeds of one repetition's runs; the next begins behind them."""
_PAIR = SmaPlant()
_PAIR_RUN_S = 45.0
_OF_PAIR = ("driver_gain", "encoder_backlash", "force_offset", "rtd_lag")


@dataclass(frozen=True)
class Benches:
    """Benches with one effect each: its true values by effect, and the runs of a repetition."""

    plant: PlantModel
    shown: Mapping[str, Mapping[str, float]]
    runs: Callable[[str, int], list[GapRun]]


def _heater_runs(effect: str, repetition: int) -> list[GapRun]:
    return bank(OTHER, {effect: SHOWN[effect]}, seed=1000 + _SEEDS_APART * repetition)


def _pair_runs(effect: str, repetition: int) -> list[GapRun]:
    point = ModelPoint({}, {effect: PLANTS["pair"].shown[effect]})
    seed = 1000 + _SEEDS_APART * repetition
    return [
        recorded(name, _PAIR, point, seed + i, duration_s=_PAIR_RUN_S)
        for i, name in enumerate(("stairs", "levels"))
    ]


PLANTS: dict[str, Benches] = {
    "heater": Benches(HeaterPlant(), SHOWN, _heater_runs),
    "pair": Benches(
        _PAIR, {e.name: e.at(1.0) for e in _PAIR.effects if e.name in _OF_PAIR}, _pair_runs
    ),
}


def covered(
    benches: Benches, effect: str, repetitions: int, first: int = 0
) -> tuple[Counter[str], Counter[str]]:
    """How often each parameter's interval held the truth, and how often it was given.

    Repetitions that do not name the effect have no interval.
    """
    held: Counter[str] = Counter()
    asked: Counter[str] = Counter()
    for repetition in range(first, first + repetitions):
        found = diagnose(
            benches.runs(effect, repetition),
            plant=benches.plant,
            settings=SETTINGS,
            candidates=[effect],
        )
        for value in found.values:
            asked[value.name] += 1
            held[value.name] += value.low <= benches.shown[effect][value.name] <= value.high
    return held, asked


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each parameter: truth, intervals given, and the share that holds it."""
    parser = argparse.ArgumentParser(prog="python -m tests.smad.gap.coverage")
    parser.add_argument("--plant", choices=sorted(PLANTS), default="heater")
    parser.add_argument("--repetitions", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=60.0, help="begin no repetition later")
    parser.add_argument("--effects", nargs="+", metavar="EFFECT", help="default: all there are")
    options = parser.parse_args(arguments)
    benches = PLANTS[options.plant]
    effects = options.effects or sorted(benches.shown)
    if strangers := set(effects) - set(benches.shown):
        parser.error(f"{', '.join(sorted(strangers))}: take of {', '.join(sorted(benches.shown))}")
    began = time.monotonic()
    held: Counter[tuple[str, str]] = Counter()
    asked: Counter[tuple[str, str]] = Counter()
    for repetition, effect in product(range(options.repetitions), effects):
        if time.monotonic() - began > 60.0 * options.minutes:
            break
        for total, found in zip(
            (held, asked), covered(benches, effect, 1, repetition), strict=True
        ):
            total.update({(effect, name): count for name, count in found.items()})
    print("| parameter | true value | intervals | hold it [95 % Wilson] |")
    print("|---|---:|---:|---:|")
    for (effect, name), count in sorted(asked.items()):
        low, high = wilson(held[effect, name], count)
        share = f"{held[effect, name] / count:.2f} [{low:.2f}, {high:.2f}]"
        print(f"| `{effect}.{name}` | {benches.shown[effect][name]:g} | {count} | {share} |")


if __name__ == "__main__":
    main()
