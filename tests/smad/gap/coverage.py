"""`python -m tests.smad.gap.coverage`: how often an interval holds the true value.

Each repetition records four runs of the tiny plant with one effect, other parameters and new noise,
asks for that effect, and looks whether each interval of its parameters holds what was put in.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence

from smad.gap import diagnose
from smad.gap.check.intervals import wilson
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, bank
from tests.smad.gap.heater_plant import HeaterPlant

_SEEDS_APART = 10
"""Seeds of one repetition's runs; the next begins behind them."""


def covered(
    effects: Sequence[str], repetitions: int, first: int = 0
) -> tuple[Counter[str], Counter[str]]:
    """How often each parameter's interval held the truth, and how often its effect was named.

    Keys are "effect.parameter". Repetitions that do not name the effect have no interval.
    """
    held: Counter[str] = Counter()
    asked: Counter[str] = Counter()
    for effect in effects:
        for repetition in range(first, first + repetitions):
            runs = bank(OTHER, {effect: SHOWN[effect]}, seed=1000 + _SEEDS_APART * repetition)
            found = diagnose(runs, plant=HeaterPlant(), settings=SETTINGS, candidates=[effect])
            for value in found.values:
                truth = SHOWN[effect][value.name]
                key = f"{effect}.{value.name}"
                asked[key] += 1
                held[key] += value.low <= truth <= value.high
    return held, asked


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each parameter: truth, repetitions with an interval, and the share held."""
    parser = argparse.ArgumentParser(prog="python -m tests.smad.gap.coverage")
    parser.add_argument("--repetitions", type=int, default=100)
    parser.add_argument("--effects", nargs="+", choices=sorted(SHOWN), default=sorted(SHOWN))
    options = parser.parse_args(arguments)
    print("| parameter | true value | intervals | hold it [95 % Wilson] | a repetition |")
    print("|---|---:|---:|---:|---:|")
    for effect in options.effects:
        began = time.perf_counter()
        held, asked = covered([effect], options.repetitions)
        seconds = (time.perf_counter() - began) / options.repetitions
        for key, count in sorted(asked.items()):
            low, high = wilson(held[key], count)
            truth = SHOWN[effect][key.partition(".")[2]]
            share = f"{held[key] / count:.2f} [{low:.2f}, {high:.2f}]"
            print(f"| `{key}` | {truth:g} | {count} | {share} | {seconds:.1f} s |", flush=True)


if __name__ == "__main__":
    main()
