"""Runs of the displacement loop on simulated benches, and what is measured in them.

Shared by control_figures.py and control_campaign.py; virtual time, nothing of it ships.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_device.bench import SimulatedBench
from sim_device.plant import ParameterSet
from smad.config import ControlConfig
from smad.control.commands import Follow, Sine, Step, Trajectory, Tune
from smad.control.controller import Controller
from smad.control.metrics import (
    HoldQuality,
    StepResponse,
    hold_quality,
    starts,
    step_response,
    tracking_r2,
)
from smad.control.plan import Do, Plan, UntilDone
from smad.control.runner import run_virtual
from smad.control.sample import Sample

Array = NDArray[np.float64]
NOISES = ("temperature", "displacement", "force", "current", "voltage")
HOLD_S = 60.0
REACH_S = 20.0
"""Time to get there before a hold counts."""


@dataclass(frozen=True)
class Trace:
    """The columns of a run, from the first sample of the motion on."""

    t_s: Array
    reference_mm: Array
    displacement_mm: Array
    true_mm: Array
    i_x_A: Array
    i_y_A: Array
    duty_x: Array
    duty_y: Array
    heat_J: Array
    """Electrical heat so far, both springs."""

    def between(self, from_s: float, to_s: float) -> Trace:
        """The part of it from one time of the motion to another."""
        part = (self.t_s >= from_s) & (self.t_s < to_s)
        return Trace(*(getattr(self, name)[part] for name in self.__dataclass_fields__))


def noisy(parameters: ParameterSet, scale: float) -> ParameterSet:
    """The same bench with the noise of every sensor times `scale`, as far as its range goes."""
    changes = {}
    for name in NOISES:
        entry = next(e for e in parameters.entries if e.name == f"noise_{name}")
        changes[entry.name] = min(entry.high, parameters[entry.name] * scale)
    return parameters.replace(**changes)


def follow(
    parameters: ParameterSet,
    config: ControlConfig,
    pieces: Sequence[Trajectory],
    *,
    tune: Tune | None = None,
    seed: int = 0,
    rate_hz: int = 100,
    fixture: str = "antagonistic",
) -> Trace:
    """Follow `pieces` from rest. Raises PlanError when the bench stops."""
    bench = SimulatedBench(parameters=parameters, seed=seed, rate_hz=rate_hz, fixture=fixture)
    controller = Controller(config)
    rows: list[tuple[float, ...]] = []
    heat_J = 0.0

    def record(
        sample: Sample, state: object, setpoint: object, reference_m: float, _: float
    ) -> None:
        nonlocal heat_J
        if math.isnan(reference_m):
            return
        truth = bench.plant.truth
        # The plant's energy books are exact, and ten times as slow as the sample.
        heat_J += (
            sum(i * i * r for i, r in zip(truth.i_A, truth.resistance_Ohm, strict=True)) / rate_hz
        )
        rows.append(
            (
                sample.t_us * 1e-6,
                reference_m * 1e3,
                sample.displacement_m * 1e3,
                truth.displacement_m * 1e3,
                *sample.i_applied_A,
                *sample.pump_duty,
                heat_J,
            )
        )

    first = () if tune is None else (Do(tune),)
    plan = Plan("run", (*first, Do(Follow(trajectories=tuple(pieces))), UntilDone(36_000.0)))
    run_virtual(bench, controller, plan, recorder=record)
    columns = np.array(rows).T
    columns[0] -= columns[0][0]
    return Trace(*columns)


def hold_at(trace: Trace, from_s: float, to_s: float) -> HoldQuality:
    """Quality of the hold in a part of the run."""
    part = trace.between(from_s, to_s)
    error = part.reference_mm - part.displacement_mm
    return hold_quality(part.t_s, error, (part.i_x_A, part.i_y_A), (part.duty_x, part.duty_y))


def true_error_um(trace: Trace, from_s: float, to_s: float) -> float:
    """Root mean square of reference less true displacement, without the sensor's noise, µm."""
    part = trace.between(from_s, to_s)
    return 1e3 * math.sqrt(float(np.mean((part.reference_mm - part.true_mm) ** 2)))


def swings(trace: Trace, band_mm: float) -> int:
    """How often the true displacement went from beyond the band on one side to the other side."""
    error_mm = trace.reference_mm - trace.true_mm
    sides = np.sign(error_mm[np.abs(error_mm) > band_mm])
    return int(np.count_nonzero(sides[1:] != sides[:-1]))


@dataclass(frozen=True)
class SineScore:
    """How a sinusoid was followed. `energy_J` and `starts` are means over the later cycles."""

    r2: float
    r2_all: float
    energy_J: float
    pump_starts: float
    standstill_s: float


def sine_score(trace: Trace, period_s: float) -> SineScore:
    """The score of a run that is one `Sine` from rest."""
    later = trace.between(period_s, math.inf)
    cycles = (later.t_s[-1] - later.t_s[0]) / period_s
    return SineScore(
        tracking_r2(later.reference_mm, later.displacement_mm),
        tracking_r2(trace.reference_mm, trace.displacement_mm),
        float(later.heat_J[-1] - later.heat_J[0]) / cycles,
        (starts(later.duty_x) + starts(later.duty_y)) / cycles,
        standstill_s(later, period_s),
    )


def standstill_s(trace: Trace, period_s: float) -> float:
    """How long the displacement stays within 1 % of the stroke of its extreme, more than a
    sinusoid does; mean over the crests."""
    stroke = np.ptp(trace.true_mm)
    band = 0.01 * stroke
    near = 0.0
    t0 = trace.t_s[0]
    cycles = int((trace.t_s[-1] - t0 + 0.5) / period_s)
    step_s = float(np.median(np.diff(trace.t_s)))
    for k in range(cycles):
        part = trace.between(t0 + k * period_s, t0 + (k + 1) * period_s).true_mm
        near += step_s * np.count_nonzero((part > part.max() - band) | (part < part.min() + band))
    ideal_s = 2.0 * period_s / math.pi * math.acos(1.0 - 2.0 * band / stroke)
    return (near / cycles - ideal_s) / 2.0


def step_score(
    parameters: ParameterSet, config: ControlConfig, from_mm: float, to_mm: float,
    *, seed: int = 0, rate_hz: int = 100, tune: Tune | None = None, duration_s: float = 20.0,
) -> StepResponse:  # fmt: skip
    """The response to a step, from a place that was held before (or from rest at 0)."""
    begin = () if from_mm == 0.0 else (Step(displacement_mm=from_mm, duration_s=REACH_S),)
    pieces = (*begin, Step(displacement_mm=to_mm, duration_s=duration_s))
    trace = follow(parameters, config, pieces, seed=seed, rate_hz=rate_hz, tune=tune)
    part = trace.between(REACH_S if begin else 0.0, math.inf)
    return step_response(part.t_s, part.true_mm, to_mm, start=from_mm, band_fraction=0.02)


def demo_sine(cycles: int = 8, amplitude_mm: float = 2.0, period_s: float = 7.0) -> Sine:
    """The sinusoid of Fig. 11."""
    return Sine(amplitude_mm=amplitude_mm, period_s=period_s, cycles=cycles)
