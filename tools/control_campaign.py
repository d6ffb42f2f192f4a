"""The displacement loop over many benches, with the shipped gains and after tuning.

    python tools/control_campaign.py run FILE [--first 0] [--last 100] [--rate 100] [--minutes 30]
    python tools/control_campaign.py table FILE [FILE …] [--figure TO]
    python tools/control_campaign.py constants FILE [--first 1] [--last 21]

`run` appends a line of JSON for each case to FILE and goes on where FILE ends. Benches 0 and 1 are
sets A and B; from 2 on every parameter is drawn evenly within its range, as in the harsh campaign
(tests/sim_device/harsh.py), with the sensor noise of set A, once and three times. With `--shipped`
no bench is tuned. `constants` holds the development benches with each constant of the quiet hold
changed alone, and prints how far each choice is from the goals.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import control_runs as runs
import msgspec
import numpy as np

from sim_device.plant import ParameterSet, load_parameters
from smad.config import Config, ControlConfig, HoldConfig, LinkConfig
from smad.control.commands import Step
from smad.errors import SmadError
from smad.experiments.tuning import tune_displacement
from smad.experiments.virtual import VirtualDriver

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from tests.sim_device.harsh import bench_of

LEVELS_MM = (0.0, 5.0, -10.0)
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
    out |= {"settling_s": step.settling_time_s, "overshoot": step.overshoot_fraction}
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
        "starts": sum(quality.pump_starts), "ripple_mA": 1e3 * quality.ripple_A,
        "error_um": 1e3 * quality.error_rms, "reached": off_mm < REACHED_MM,
        "true_um": runs.true_error_um(trace, to_s - runs.HOLD_S, to_s),
    }  # fmt: skip


GOALS = {"starts": 2.0, "ripple_mA": 50.0, "error_um": 20.0}
"""What a hold of a minute should not exceed."""
CHOICES = {
    "damping_A_per_K": (0.5, 2.0),
    "ease_s": (10.0, 40.0),
    "smooth_s": (0.05, 0.2),
    "reversal_A": (0.15, 0.6),
    "near_bands": (3.0, 10.0),
    "settled_s": (0.0, 1.0),
    "band_mm": (0.005, 0.02),
    "reversal_smooth_s": (0.01, 0.1),
}
"""Every constant of the quiet hold, with what it is compared with."""


def constants(file: Path, first: int, last: int) -> None:
    """Hold benches `first` to `last` - 1 with each choice, noise ×3, at 0 mm after 5 mm."""
    done = [json.loads(line) for line in file.open()] if file.exists() else []
    shipped = msgspec.to_builtins(HoldConfig())
    changes = [{}, *({name: v} for name, values in CHOICES.items() for v in values)]
    print("| changed | to | mean score | 5 % | starts > 2 | ripple > 50 mA | error > 20 µm |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    with file.open("a") as out:
        for change in changes:
            chosen = shipped | change
            config = msgspec.structs.replace(ControlConfig(), hold=HoldConfig(**chosen))
            part = []
            for seed in range(first, last):
                case = {**chosen, "bench": seed}
                found = next((c for c in done if case.items() <= c.items()), None)
                if found is None:
                    found = case | held(bench(seed, 3.0), config, 0.0, seed, 100)
                    out.write(json.dumps(found) + "\n")
                    out.flush()
                part.append(found)
            print(scored(change, [c for c in part if c["reached"]]), flush=True)
    print(f"\nholds of benches {first} to {last - 1}; score: the largest of starts, ripple and "
          "error, each over its goal")  # fmt: skip


def scored(change: dict[str, float], holds: list[dict[str, Any]]) -> str:
    """The row of the table for these holds."""
    scores = sorted(max(c[key] / goal for key, goal in GOALS.items()) for c in holds)
    missed = " | ".join(str(sum(c[key] > goal for c in holds)) for key, goal in GOALS.items())
    name, value = next(((f"`{k}`", f"{v:g}") for k, v in change.items()), ("nothing", ""))
    return (f"| {name} | {value} | {np.mean(scores):.2f} | "
            f"{scores[round(0.95 * (len(scores) - 1))]:.1f} | {missed} |")  # fmt: skip


def cases(first: int, last: int, rate_hz: int) -> Iterator[dict[str, Any]]:
    """Which cases there are, in the order in which they are run."""
    for seed in range(first, last):
        for noise in (1.0, 3.0):
            yield {"bench": seed, "noise": noise, "rate": rate_hz}


def run(file: Path, first: int, last: int, rate_hz: int, minutes: float, *, shipped: bool) -> None:
    """Carry out the cases that FILE does not hold yet."""
    done = set()
    if file.exists():
        done = {(c["bench"], c["noise"], c["rate"]) for c in map(json.loads, file.open())}
    until_s = time.monotonic() + 60.0 * minutes
    with file.open("a") as out:
        for case in cases(first, last, rate_hz):
            if (case["bench"], case["noise"], case["rate"]) in done:
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
            out.write(json.dumps(case) + "\n")
            out.flush()


QUANTITIES = {
    "R² of 2 mm, 7 s": ("r2", False, "{:.4f}"),
    "settling of 2 mm to 2 %, s": ("settling_s", True, "{:.2f}"),
    "overshoot of 2 mm, %": ("overshoot", True, "{:.2f}"),
    "pump starts a cycle": ("cycle_starts", True, "{:.1f}"),
    "energy a cycle, J": ("energy_J", True, "{:.0f}"),
    "pump starts in a hold of 60 s": ("starts", True, "{:.0f}"),
    "ripple in a hold, mA": ("ripple_mA", True, "{:.0f}"),
    "error of a hold, µm": ("error_um", True, "{:.1f}"),
}
"""Quantity: its key, whether large is bad, and how it is printed."""


def values(results: list[dict[str, Any]], key: str) -> list[float]:
    """The values of a quantity; of a hold the worst of the levels that were reached."""
    if key in ("starts", "ripple_mA", "error_um"):
        holds = [[r[f"hold {level:g}"] for level in LEVELS_MM] for r in results]
        reached = [[h[key] for h in level if h["reached"]] for level in holds]
        return [max(found) for found in reached if found]
    scale = 100.0 if key == "overshoot" else 1.0
    return [math.inf if math.isnan(r[key]) else scale * r[key] for r in results]


def table(files: list[Path]) -> None:
    """Print median, bad 5 % and worst of each quantity, by rate, noise and gains."""
    found = [json.loads(line) for file in files for line in file.open()]
    for rate in sorted({c["rate"] for c in found}):
        for noise in sorted({c["noise"] for c in found}):
            part = [c for c in found if c["rate"] == rate and c["noise"] == noise]
            if not part:
                continue
            refused = sum(bool(c["refused"]) for c in part)
            both = [c for c in part if c["shipped"] and c["tuned"]]
            print(f"\n{rate} Hz, noise ×{noise:g}: {len(part)} benches, tuning refused {refused}, "
                  f"not comparable {len(part) - len(both)}; shipped: of all\n")  # fmt: skip
            print("| | shipped: median | 5 % | worst | tuned: median | 5 % | worst |")
            print("|---|---:|---:|---:|---:|---:|---:|")
            for name, (key, large_is_bad, form) in QUANTITIES.items():
                cells = []
                for which in ("shipped", "tuned"):
                    v = np.sort(values([c[which] for c in part if c[which]], key))
                    if v.size == 0:
                        cells += ["–"] * 3
                        continue
                    bad = 0.95 if large_is_bad else 0.05
                    worst = v[-1] if large_is_bad else v[0]
                    at = v[min(v.size - 1, round(bad * (v.size - 1)))]
                    cells += [form.format(x) for x in (v[v.size // 2], at, worst)]
                print(f"| {name} | " + " | ".join(cells) + " |")
            ran = [c for c in part if c["shipped"]]
            worst = sorted(ran, key=lambda c: max(values([c["shipped"]], "starts") or [0.0]))[-3:]
            print("\nmost pump starts in a hold, shipped gains: " + ", ".join(
                f"bench {c['bench']} ({max(values([c['shipped']], 'starts') or [0.0]):.0f})"
                for c in reversed(worst)))  # fmt: skip


def figure_data(files: list[Path], to: Path) -> None:
    """Write what the figure on the page of `smad run fig11-tracking` is drawn from."""
    found = [json.loads(line) for file in files for line in file.open()]
    groups = []
    for rate, noise in sorted({(c["rate"], c["noise"]) for c in found}):
        part = [c for c in found if (c["rate"], c["noise"]) == (rate, noise)]
        both = [c for c in part if c["shipped"] and c["tuned"]]
        groups.append(
            {
                "rate_Hz": rate, "noise": noise, "refused": len(part) - len(both),
                "shipped": sorted(round(c["shipped"]["r2"], 4) for c in both),
                "tuned": sorted(round(c["tuned"]["r2"], 4) for c in both),
            }
        )  # fmt: skip
    to.write_text(json.dumps(groups, indent=1) + "\n")


def main() -> None:
    """Run or print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["run", "table", "constants"])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=100)
    parser.add_argument("--rate", type=int, default=100)
    parser.add_argument("--shipped", action="store_true")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--figure", type=Path)
    chosen = parser.parse_args()
    if chosen.what == "table":
        table(chosen.files)
        if chosen.figure is not None:
            figure_data(chosen.files, chosen.figure)
    elif chosen.what == "constants":
        constants(chosen.files[0], chosen.first, chosen.last)
    else:
        run(
            chosen.files[0], chosen.first, chosen.last, chosen.rate, chosen.minutes,
            shipped=chosen.shipped,
        )  # fmt: skip


if __name__ == "__main__":
    main()
