"""What a control step costs, and how fast virtual time runs: python -m bench.control

Times are ratios to something measured in the same run: a step to a bare Python call with the same
number of floats, virtual time to the time it simulates.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from sim_device.bench import SimulatedBench
from smad.config import ControlConfig, CoolingConfig, FeedforwardConfig
from smad.control.commands import Follow, Sine
from smad.control.controller import Controller
from smad.control.plan import Do, Plan, UntilDone
from smad.control.runner import run_virtual
from smad.control.sample import Sample
from smad.control.setpoint import setpoint_of

STEPS = 20_000
VIRTUAL_S = 600.0


def samples(count: int) -> list[Sample]:
    """A pair that moves, so that every branch of the step is taken."""

    def warm(k: int) -> float:
        return 4.0 * math.sin(0.009 * k)

    return [
        Sample(
            t_us=k * 10_000,
            tick=k & 0xFFFF,
            armed=True,
            displacement_m=0.0019 * math.sin(0.009 * k),
            force_N=1.4,
            rtd_degC=(36.0 + warm(k), 36.0 - warm(k), 27.0, 27.0),
        )
        for k in range(count)
    ]


def per_call_us(call: Callable[[Sample], object], given: list[Sample]) -> float:
    """Microseconds of one call, the best of three passes."""
    passes = []
    for _ in range(3):
        began = time.perf_counter()
        for sample in given:
            call(sample)
        passes.append((time.perf_counter() - began) / len(given) * 1e6)
    return min(passes)


def step_us(config: ControlConfig) -> float:
    """Microseconds from a sample to its setpoint, following a sinusoid."""
    controller = Controller(config)
    follow = Follow(trajectories=(Sine(amplitude_mm=2.0, period_s=7.0, cycles=10_000),))
    given = samples(STEPS)
    controller.step(given[0])
    controller.command(follow)
    began = time.perf_counter()
    for piece in given[1:]:
        setpoint_of(controller.step(piece), t_ref_us=piece.t_us)
    return (time.perf_counter() - began) / (STEPS - 1) * 1e6


def virtual_s(config: ControlConfig) -> tuple[float, int]:
    """Wall seconds and samples of ten minutes at 100 Hz."""
    sine = Sine(amplitude_mm=2.0, period_s=7.0, cycles=round(VIRTUAL_S / 7.0))
    plan = Plan("bench", (Do(Follow(trajectories=(sine,))), UntilDone(VIRTUAL_S + 60.0)))
    run_virtual(SimulatedBench(), Controller(config), Plan("warm", (UntilDone(1.0),)))
    began = time.perf_counter()
    run = run_virtual(SimulatedBench(), Controller(config), plan)
    return time.perf_counter() - began, run.samples


def main() -> None:
    """Print the table."""
    plain = ControlConfig(cooling=CoolingConfig(mode="proportional"))
    ahead = ControlConfig(
        cooling=CoolingConfig(mode="proportional"), feedforward=FeedforwardConfig(enabled=True)
    )
    call_us = per_call_us(
        lambda sample: sample.displacement_m * 2.0 + sample.force_N, samples(STEPS)
    )
    print(f"a bare call on a sample       {call_us:8.2f} µs")
    for name, config in (("PI", plain), ("with the inverse model", ahead)):
        cost = step_us(config)
        print(f"step, {name:24}{cost:8.2f} µs   {cost / call_us:6.0f} bare calls (goal ≤ 20 µs)")
    wall_s, count = virtual_s(plain)
    print(
        f"ten minutes at 100 Hz         {wall_s:8.2f} s    "
        f"{VIRTUAL_S / wall_s:6.0f} times real time, {wall_s / count * 1e6:.0f} µs a sample"
    )


if __name__ == "__main__":
    main()
