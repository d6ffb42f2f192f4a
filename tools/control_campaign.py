"""The displacement loop over many benches, with the shipped gains and after tuning.

    python tools/control_campaign.py run [--first 0] [--last 100] [--rate 100] [--minutes 30]
    python tools/control_campaign.py table
    python tools/control_campaign.py worst
    python tools/control_campaign.py constants --file FILE

`run` appends a line of JSON for each case to smad/experiments/data/benches.jsonl (or to `--file`)
and leaves out those that it has: after a change of the controller remove them. Benches 0 and 1 are
sets A and B; from 21 on every parameter is drawn evenly within its range, as in the harsh campaign
(tests/sim_device/harsh.py), with the sensor noise of set A, once and three times. From 200 on what
sets B apart from A is kept. With `--shipped` no bench is tuned. `table` prints median, bad 5 % and
worst, as `make generate` puts them into the guide; `worst` names benches. `constants` holds the
development benches 2 to 20, which no table counts, with each constant of the quiet hold changed
alone.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, TextIO

import control_runs as runs
import msgspec
import numpy as np

from sim_device.plant import ParameterSet, load_parameters
from smad.config import Config, ControlConfig, HoldConfig, LinkConfig
from smad.control.commands import Step
from smad.errors import SmadError
from smad.experiments import over_benches
from smad.experiments.over_benches import LEVELS_MM, QUANTITIES, values
from smad.experiments.tuning import tune_displacement
from smad.experiments.virtual import VirtualDriver

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from tests.sim_device.harsh import AROUND_B, bench_of

DEVELOPMENT = range(2, 21)
"""The benches on which constants are chosen. They score nothing."""
SHIPPED = Path(over_benches.__file__).parent / over_benches.DATA
REACHED_MM = 0.05
"""A level whose hold errs more, on average, is out of the bench's reach."""


def bench(seed: int, noise: float) -> ParameterSet:
    """Bench `seed` with the noise of set A times `noise`."""
    drawn, nominal = bench_of(seed), load_parameters("A")
    names = [f"noise_{name}" for name in runs.NOISES]
    return runs.noisy(drawn.replace(**{name: nominal[name] for name in names}), noise)


def tuned(parameters: ParameterSet, seed: int, rate_hz: int) -> tuple[ControlConfig | None, str]:
    """The configuration after tuning, the same where the trial went worse.

    None and the reason where tuning refused.
    """
    config = Config(link=LinkConfig(rate_hz=rate_hz, baud=921_600))
    driver = VirtualDriver(parameters, config=config, seed=seed)
    try:
        session = tune_displacement(driver, config.control)
    except SmadError as error:
        return None, str(error)
    if session.worse:
        return config.control, ""
    found = session.tuned
    return msgspec.structs.replace(
        config.control,
        kp_A_per_mm=found.after.kp,
        ki_A_per_mm_s=found.after.ki,
        hold=msgspec.structs.replace(config.control.hold, band_mm=found.band_mm),
    ), ""


def measured(
    parameters: ParameterSet, config: ControlConfig, seed: int, rate_hz: int
) -> dict[str, Any]:
    """What the table is made of, for one bench and configuration."""
    out: dict[str, Any] = {"kp": config.kp_A_per_mm, "ki": config.ki_A_per_mm_s}
    trace = runs.follow(parameters, config, [runs.demo_sine(4)], seed=seed, rate_hz=rate_hz)
    score = runs.sine_score(trace, 7.0)
    out |= {"r2": score.r2, "energy_J": score.energy_J, "cycle_starts": score.pump_starts}
    step = runs.step_score(parameters, config, 0.0, 2.0, seed=seed, rate_hz=rate_hz)
    out |= {"settling_s": step.settling_time_s, "overshoot": 100.0 * step.overshoot_fraction}
    for level in LEVELS_MM:
        out[f"hold {level:g}"] = held(parameters, config, level, seed, rate_hz)
    return out


def held(
    parameters: ParameterSet, config: ControlConfig, level_mm: float, seed: int, rate_hz: int
) -> dict[str, Any]:
    """A minute at a level, reached by a step from rest, or back to 0 from 5 mm."""
    pieces = [Step(displacement_mm=level_mm, duration_s=runs.REACH_S + runs.HOLD_S)]
    if level_mm == 0.0:
        pieces.insert(0, Step(displacement_mm=5.0, duration_s=runs.REACH_S))
    trace = runs.follow(parameters, config, pieces, seed=seed, rate_hz=rate_hz)
    to_s = float(trace.t_s[-1])
    quality = runs.hold_at(trace, to_s - runs.HOLD_S, to_s)
    part = trace.between(to_s - runs.HOLD_S, to_s)
    off_mm = abs(float(np.mean(part.reference_mm - part.true_mm)))
    return {
        "starts": sum(quality.pump_starts), "swings": runs.swings(part, HoldConfig().band_mm),
        "ripple_mA": 1e3 * quality.ripple_A,
        "error_um": 1e3 * quality.error_rms, "reached": off_mm < REACHED_MM,
    }  # fmt: skip


GOALS = {"starts": 2.0, "swings": 2.0, "ripple_mA": 50.0, "error_um": 20.0}
"""What a hold of a minute should not exceed."""
COMPARED_AT_MM = (0.0, 5.0)
"""Levels at which constants are compared: both springs warm, and one of them pulling."""
CHOICES = {
    "ease_s": (2.5, 10.0),
    "arrive_s": (2.5, 10.0),
    "kept_A_per_K": (0.25, 1.0),
    "kept_A_per_K_s": (0.05, 0.2),
    "kept_K_per_mm": (15.0, 60.0),
    "kept_K_per_mm_s": (5.0, 20.0),
    "reversal_A": (0.15, 0.6),
    "smooth_s": (0.1, 0.4),
    "near_bands": (3.0, 10.0),
    "settled_s": (0.0, 1.0),
    "band_mm": (0.005, 0.02),
    "reversal_smooth_s": (0.01, 0.1),
}
"""Every constant of the quiet hold, with what it is compared with."""


def constants(file: Path) -> None:
    """Hold the development benches with each choice, noise ×3, at two levels."""
    done = [json.loads(line) for line in file.open()] if file.exists() else []
    shipped = msgspec.to_builtins(HoldConfig())

    def scores(change: dict[str, float], out: TextIO) -> dict[int, float]:
        """Of each bench the largest of what a hold has a goal for, each over its goal."""
        chosen = shipped | change
        config = msgspec.structs.replace(ControlConfig(), hold=HoldConfig(**chosen))
        by_bench = {}
        for seed, level in product(DEVELOPMENT, COMPARED_AT_MM):
            case = {**chosen, "bench": seed, "level_mm": level}
            found = next((c for c in done if case.items() <= c.items()), None)
            if found is None:
                found = case | held(bench(seed, 3.0), config, level, seed, 100)
                out.write(json.dumps(found) + "\n")
                out.flush()
            if found["reached"]:
                worst = max(found[key] / goal for key, goal in GOALS.items())
                by_bench[seed] = max(worst, by_bench.get(seed, 0.0))
        return by_bench

    with file.open("a") as out:
        kept = scores({}, out)
        print(f"score {np.mean(list(kept.values())):.2f}, mean over benches {DEVELOPMENT[0]} to "
              f"{DEVELOPMENT[-1]} of the largest of starts, swings, ripple and error, each over "
              "its goal; change of it ± standard error:\n")  # fmt: skip
        print("| constant | shipped | less | more |\n|---|---:|---:|---:|", flush=True)
        for name, choices in CHOICES.items():
            cells = []
            for value in choices:
                other = scores({name: value}, out)
                change = np.array([other[seed] - kept[seed] for seed in kept.keys() & other.keys()])
                error = change.std(ddof=1) / math.sqrt(change.size)
                cells.append(f"{value:g}: {change.mean():+.2f} ± {error:.2f}")
            print(f"| `{name}` | {shipped[name]:g} | {cells[0]} | {cells[1]} |", flush=True)


def kind_of(seed: int) -> str:
    """What a bench is called in the table."""
    if seed < DEVELOPMENT[0]:
        return over_benches.KINDS[seed]
    return over_benches.KINDS[3 if seed >= AROUND_B else 2]


def cases(first: int, last: int, rate_hz: int) -> Iterator[dict[str, Any]]:
    """Which cases there are, in the order in which they are run."""
    for seed in (n for n in range(first, last) if n not in DEVELOPMENT):
        for noise in (1.0, 3.0):
            yield {"bench": seed, "kind": kind_of(seed), "rate_Hz": rate_hz, "noise": noise}


def rounded(found: Any) -> Any:
    """Four digits of every number; null for nan, which JSON lacks."""
    if isinstance(found, dict):
        return {key: rounded(value) for key, value in found.items()}
    if isinstance(found, float):
        return None if math.isnan(found) else float(f"{found:.4g}")
    return found


def run(file: Path, first: int, last: int, rate_hz: int, minutes: float, *, shipped: bool) -> None:
    """Carry out the cases that FILE does not hold yet."""
    done = {(c["bench"], c["noise"], c["rate_Hz"]) for c in cases_of(file)}
    until_s = time.monotonic() + 60.0 * minutes
    with file.open("a") as out:
        for case in cases(first, last, rate_hz):
            if (case["bench"], case["noise"], case["rate_Hz"]) in done:
                continue
            if time.monotonic() > until_s:
                return
            seed = case["bench"]
            parameters = bench(seed, case["noise"])
            config, case["refused"] = None, ""
            if not shipped:
                config, case["refused"] = tuned(parameters, seed, rate_hz)
            for name, chosen in (("shipped", ControlConfig()), ("tuned", config)):
                try:
                    case[name] = chosen and measured(parameters, chosen, seed, rate_hz)
                except SmadError as error:
                    case[name], case[f"{name} failed"] = None, str(error)
            out.write(json.dumps(rounded(case)) + "\n")
            out.flush()


def cases_of(file: Path) -> list[dict[str, Any]]:
    """The cases that a file has so far."""
    return over_benches.read_cases(file.read_text()) if file.exists() else []


def worst(found: list[dict[str, Any]]) -> None:
    """Count the holds that meet each goal, and name the worst benches; with the shipped gains."""
    found = [c for c in found if c["kind"].startswith("drawn")]
    holds = [c["shipped"][f"hold {level:g}"] for c in found for level in LEVELS_MM]
    holds = [h for h in holds if h["reached"]]
    for key, goal in GOALS.items():
        print(f"{key}: {sum(h[key] <= goal for h in holds)} of {len(holds)} holds meet {goal:g}")
    for key, quantity in QUANTITIES.items():
        by_case = [(values([c["shipped"]], key), c) for c in found]
        ordered = sorted(
            ((math.inf if math.isnan(v[0]) else v[0], c) for v, c in by_case if v),
            key=lambda pair: pair[0], reverse=quantity.much_is_bad,
        )  # fmt: skip
        named = (f"{c['bench']} ×{c['noise']:g} {c['rate_Hz']} Hz ({v:g})" for v, c in ordered[:8])
        print(f"{quantity.words}: bench " + ", ".join(named))
    for case in found:
        if case["refused"]:
            print(f"bench {case['bench']} ×{case['noise']:g} refused: {case['refused']}")


def main() -> None:
    """Run or print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["run", "table", "worst", "constants"])
    parser.add_argument("--file", type=Path, default=SHIPPED)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=100)
    parser.add_argument("--rate", type=int, default=100)
    parser.add_argument("--shipped", action="store_true")
    parser.add_argument("--minutes", type=float, default=30.0)
    chosen = parser.parse_args()
    if chosen.what == "table":
        print(over_benches.table(over_benches.groups(cases_of(chosen.file))))
    elif chosen.what == "worst":
        worst(cases_of(chosen.file))
    elif chosen.what == "constants":
        if chosen.file == SHIPPED:
            parser.error("constants keeps what it measured in a file of its own: give --file")
        constants(chosen.file)
    else:
        run(
            chosen.file, chosen.first, chosen.last, chosen.rate, chosen.minutes,
            shipped=chosen.shipped,
        )  # fmt: skip


if __name__ == "__main__":
    main()
