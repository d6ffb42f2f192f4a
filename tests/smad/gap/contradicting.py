"""`python -m tests.smad.gap.contradicting`: how often runs of several states are told from others.

Four runs of the tiny plant: all of one state (nothing, each effect, each effect that the library
lacks), or one or three of them with an effect. The first should not be said to contradict each
other, and of the others the odd run should be named.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence

from smad.gap.records import Diagnosis, Outcome

from smad.diagnosis.bank.intervals import wilson
from smad.diagnosis.runs import GapRun
from tests.smad.gap.cases import OTHER, SHOWN, ask, bank, without

_SEEDS_APART = 100


def mixed(effect: str, count: int, seed: int = 0) -> list[GapRun]:
    """Four runs, the first `count` of which have the effect."""
    changed, unchanged = bank(OTHER, {effect: SHOWN[effect]}, seed), bank(OTHER, seed=seed)
    return changed[:count] + unchanged[count:]


def apart(found: Diagnosis) -> set[str]:
    """The runs that are said to contradict the others."""
    return {r.run for r in found.agreement if r.contradicts}


def counted(effects: Sequence[str], seed: int) -> dict[str, Counter[str]]:
    """How often each kind of four runs was said to contradict, and the odd run alone named."""
    kinds: dict[str, Counter[str]] = {}

    def note(kind: str, found: Diagnosis, odd: str = "") -> None:
        count = kinds.setdefault(kind, Counter())
        count["asked"] += 1
        count["said"] += found.verdict.outcome is Outcome.CONTRADICTING
        count["named"] += apart(found) == {odd}

    unchanged = bank(OTHER, seed=seed)
    note("one state, nothing", ask(unchanged))
    for effect in effects:
        runs = bank(OTHER, {effect: SHOWN[effect]}, seed)
        note("one state, an effect", ask(runs))
        note("one state, an effect that the library lacks", ask(runs, without(effect)))
        for count, odd in ((1, 0), (3, 3)):
            # A fan that is never switched does not stick.
            if runs[odd].digest != unchanged[odd].digest:
                four = runs[:count] + unchanged[count:]
                note(f"{count} of 4 with an effect", ask(four), four[odd].name)
    return kinds


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each kind of four runs."""
    parser = argparse.ArgumentParser(prog="python -m tests.smad.gap.contradicting")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--effects", nargs="+", choices=sorted(SHOWN), default=sorted(SHOWN))
    parser.add_argument("--minutes", type=float, default=60.0, help="begin no seed later")
    options = parser.parse_args(arguments)
    began = time.monotonic()
    total: dict[str, Counter[str]] = {}
    for k in range(options.seeds):
        if time.monotonic() - began > 60.0 * options.minutes:
            break
        for kind, count in counted(options.effects, _SEEDS_APART * k).items():
            total.setdefault(kind, Counter()).update(count)
    print("| four runs | sets | said to contradict [95 % Wilson] | the odd one alone named |")
    print("|---|---:|---:|---:|")
    for kind, count in total.items():
        low, high = wilson(count["said"], count["asked"])
        share = f"{count['said'] / count['asked']:.2f} [{low:.2f}, {high:.2f}]"
        named = f"{count['named'] / count['asked']:.2f}" if "of 4" in kind else ""
        print(f"| {kind} | {count['asked']} | {share} | {named} |")


if __name__ == "__main__":
    main()
