"""The figures of the displacement loop on the shipped plants, on virtual time.

    python tools/control_figures.py [hold sine step frequency demo tune spread]
                                    [--parameters A|B] [--rate HZ]

Without a name: all of them but `frequency` and `spread`, which take minutes.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import control_runs as runs
import msgspec

from sim_device.plant import load_parameters
from smad.config import ControlConfig
from smad.control.commands import Step, Trajectory, Tune
from smad.control.tuning.tuned import Trial
from smad.demo.job import CYCLE, DWELL_S, LENGTH_S
from smad.experiments.inverse import feedforward_of

LEVELS_MM = (0.0, 5.0, -5.0, 10.0, -10.0)
BEGIN = "| {:26} | {:>8} | {:>9} | {:>9} | {:>9} | {:>9} |"


class Bench:
    """A shipped plant at a rate, with the shipped configuration for it."""

    def __init__(self, name: str, rate_hz: int) -> None:
        self.parameters = load_parameters(name)
        self.rate_hz = rate_hz
        self.config = ControlConfig()
        self.title = f"set {name}, {rate_hz} Hz"
        self.with_model = msgspec.structs.replace(
            self.config, feedforward=feedforward_of(self.parameters)
        )


def hold(bench: Bench) -> None:
    """Sixty seconds at each level, reached by a step from rest, or back to 0 from 5 mm."""
    print(BEGIN.format("hold of 60 s", "noise", "starts", "ripple mA", "error µm", "true µm"))
    for scale in (1.0, 3.0):
        parameters = runs.noisy(bench.parameters, scale)
        for level in LEVELS_MM:
            pieces: tuple[Trajectory, ...] = (
                Step(displacement_mm=level, duration_s=runs.REACH_S + runs.HOLD_S),
            )
            if level == 0.0:
                pieces = (Step(displacement_mm=5.0, duration_s=runs.REACH_S), *pieces)
            trace = runs.follow(parameters, bench.config, pieces, seed=1, rate_hz=bench.rate_hz)
            to_s = float(trace.t_s[-1])
            from_s = to_s - runs.HOLD_S
            held = runs.hold_at(trace, from_s, to_s)
            print(
                BEGIN.format(
                    f"{level:g} mm", f"×{scale:g}", sum(held.pump_starts),
                    f"{1e3 * held.ripple_A:.0f}", f"{1e3 * held.error_rms:.1f}",
                    f"{runs.true_error_um(trace, from_s, to_s):.1f}",
                )
            )  # fmt: skip


CONTROLS = {
    "switch (shipped)": Tune(),
    "proportional": Tune(cooling="proportional"),
    "feed-forward": Tune(cooling="proportional", feedforward=True),
    "drained": Tune(cooling="proportional", drain_before_heating=True),
    "feed-forward, drained": Tune(
        cooling="proportional", feedforward=True, drain_before_heating=True
    ),
    "feed-forward, switch": Tune(feedforward=True),
}


def sine(bench: Bench) -> None:
    """The sinusoid of Fig. 11 with each control."""
    print(BEGIN.format("2 mm, 7 s", "R²", "with 1st", "still s", "J/cycle", "starts"))
    for name, tune in CONTROLS.items():
        trace = runs.follow(
            bench.parameters, bench.with_model, [runs.demo_sine()], tune=tune, seed=1,
            rate_hz=bench.rate_hz,
        )  # fmt: skip
        score = runs.sine_score(trace, 7.0)
        print(
            BEGIN.format(
                name, f"{score.r2:.4f}", f"{score.r2_all:.4f}", f"{score.standstill_s:.2f}",
                f"{score.energy_J:.1f}", f"{score.pump_starts:.1f}",
            )
        )  # fmt: skip


STEPS_MM = ((0.0, 2.0), (0.0, 5.0), (0.0, 10.0), (5.0, 0.0), (10.0, -10.0), (-10.0, 0.0))


def step(bench: Bench) -> None:
    """Steps: rise, settling to 2 %, overshoot, final error, of the true displacement."""
    print(BEGIN.format("step", "", "rise s", "settle s", "over %", "final µm"))
    for from_mm, to_mm in STEPS_MM:
        r = runs.step_score(
            bench.parameters, bench.config, from_mm, to_mm, seed=1, rate_hz=bench.rate_hz
        )
        print(
            BEGIN.format(
                f"{from_mm:g} to {to_mm:g} mm", "", f"{r.rise_time_s:.2f}",
                f"{r.settling_time_s:.2f}", f"{100 * r.overshoot_fraction:.2f}",
                f"{1e3 * r.final_error:.1f}",
            )
        )  # fmt: skip


def demo(bench: Bench) -> None:
    """The motion of `smad demo`: what each part of it costs the pumps, and how it is held."""
    print(BEGIN.format("demo", "R²", "starts", "ripple mA", "error µm", "true µm"))
    for scale in (1.0, 3.0):
        parameters = runs.noisy(bench.parameters, scale)
        trace = runs.follow(parameters, bench.config, CYCLE, seed=1, rate_hz=bench.rate_hz)
        sine_s = 3 * DWELL_S
        parts = {
            "at 10 mm": (10.0, DWELL_S - 0.1),
            "at −10 mm": (DWELL_S + 10.0, 2 * DWELL_S - 0.1),
            "at 0 mm": (2 * DWELL_S + 10.0, sine_s - 0.1),
            "after the sinusoid": (LENGTH_S - 8.0, LENGTH_S),
        }
        for name, (from_s, to_s) in parts.items():
            held = runs.hold_at(trace, from_s, to_s)
            print(
                BEGIN.format(
                    f"{name}, noise ×{scale:g}", "", sum(held.pump_starts),
                    f"{1e3 * held.ripple_A:.0f}", f"{1e3 * held.error_rms:.1f}",
                    f"{runs.true_error_um(trace, from_s, to_s):.1f}",
                )
            )  # fmt: skip
        part = trace.between(sine_s, LENGTH_S - 10.0)
        score = runs.sine_score(part, 7.0)
        whole = runs.hold_at(trace, 0.0, math.inf)
        print(BEGIN.format(f"sinusoid, noise ×{scale:g}", f"{score.r2:.4f}", "", "", "", ""))
        print(BEGIN.format(f"whole, noise ×{scale:g}", "", sum(whole.pump_starts), "", "", ""))


def frequency(bench: Bench) -> None:
    """The largest frequencies of Fig. 12, plain PI with water, both ways to cool."""
    from smad.experiments.fig12_frequency import AMPLITUDES_MM, START_HZ, largest_frequency
    from smad.experiments.tracking import Score

    print("largest Hz with R² > 0.9 at " + ", ".join(f"{a} mm" for a in AMPLITUDES_MM))
    for name in ("proportional", "switch (shipped)"):
        found = []
        for amplitude in AMPLITUDES_MM:

            def followed(
                frequency_Hz: float, amplitude: float = amplitude, name: str = name
            ) -> Score:
                piece = runs.demo_sine(6, float(amplitude), 1.0 / frequency_Hz)
                trace = runs.follow(
                    bench.parameters, bench.config, [piece], tune=CONTROLS[name], seed=1,
                    rate_hz=bench.rate_hz,
                )  # fmt: skip
                score = runs.sine_score(trace, 1.0 / frequency_Hz)
                return Score(score.r2, score.r2_all, (), math.nan, math.nan)

            scale, power = START_HZ["water"]
            found.append(
                largest_frequency(
                    followed, scale / amplitude**power,
                    lowest_Hz=0.002, highest_Hz=3.0, resolution=0.02,
                ).frequency_Hz
            )  # fmt: skip
        print(f"{name:26} " + "  ".join(f"{f:.4f}" for f in found), flush=True)


def tune(bench: Bench) -> None:
    """What `smad tune` says on a bench whose resistivity and flow are 30 % less."""
    from smad.cli.tune import lines
    from smad.config import Config, LinkConfig
    from smad.experiments.tuning import tune_displacement
    from smad.experiments.virtual import VirtualDriver

    changed = {name: 0.7 * bench.parameters[name] for name in ("resistivity", "flow_max")}
    config = Config(link=LinkConfig(rate_hz=bench.rate_hz), control=bench.config)
    driver = VirtualDriver(bench.parameters.replace(**changed), config=config, seed=1)
    print("\n".join(lines(tune_displacement(driver, config.control))))


SEEDS = range(1, 13)


def spread(bench: Bench) -> None:
    """The gains that `smad tune` gives on the plant itself with other noise, and its verdict."""
    from smad.config import Config, LinkConfig
    from smad.experiments.tuning import tune_displacement
    from smad.experiments.virtual import VirtualDriver

    config = Config(link=LinkConfig(rate_hz=bench.rate_hz), control=bench.config)
    row = "| {:>4} | {:>7} | {:>12} | {:>8} | {:>6} | {:>6} | {:>8} |"
    print(row.format("seed", "kp A/mm", "ki A/(mm s)", "delay ms", "R² now", "R² new", "verdict"))
    for seed in SEEDS:
        driver = VirtualDriver(bench.parameters, config=config, seed=seed)
        session = tune_displacement(driver, config.control)
        gains, delay_s = session.tuned.after, max(m.delay_s for m in session.tuned.models.values())
        assert session.trials is not None
        now, new = (trial.r2 for trial in session.trials if isinstance(trial, Trial))
        print(
            row.format(
                seed, f"{gains.kp:g}", f"{gains.ki:g}", f"{1e3 * delay_s:.1f}", f"{now:.4f}",
                f"{new:.4f}", "rejected" if session.worse else "accepted",
            ),
            flush=True,
        )  # fmt: skip


TABLES: dict[str, Callable[[Bench], None]] = {
    "hold": hold,
    "sine": sine,
    "step": step,
    "demo": demo,
    "frequency": frequency,
    "tune": tune,
    "spread": spread,
}
MINUTES = ("frequency", "spread")  # fmt: skip


def main() -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--parameters", default="A")
    parser.add_argument("--rate", type=int, default=100)
    chosen = parser.parse_intermixed_args()
    unknown = sorted(set(chosen.tables) - set(TABLES))
    if unknown:
        parser.error(f"no table {unknown[0]}; there are: {', '.join(TABLES)}")
    bench = Bench(chosen.parameters, chosen.rate)
    print(bench.title)
    for name in chosen.tables or [name for name in TABLES if name not in MINUTES]:
        print(flush=True)
        TABLES[name](bench)


if __name__ == "__main__":
    main()
