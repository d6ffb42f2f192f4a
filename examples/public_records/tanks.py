"""Two cascaded tanks with free outlets, and twelve things that they may do beside.

Published (Wigren and Schoukens, ECC 2013, equation 7): x₁′ = −k₁·√x₁ + k₄·u, x₂′ = k₂·√x₁ − k₃·√x₂,
and of this record (doi 10.4121/12960104): above its rim the upper tank spills, in part into the
lower one. The model given here has no rims.
Levels are in volts of the sensor, which is not calibrated, and which ends at 10 V. The upper level
is not measured; k₂ = k₁ sets its unit: what leaves the upper tank arrives in the lower.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from smad.diagnosis.plant import Channel, Effect, EffectParameter, Parameter, Signal

STEP_S = 4.0
END_V = 10.0
_FINER = 8


def _shape(name: str, unit: str, typical: float, low: float, high: float) -> EffectParameter:
    return EffectParameter(
        name=name, unit=unit, typical=typical, low=low, high=high, strength=False
    )


def _effect(name: str, title: str, unit: str, high: float, *shapes, low: float = 0.0) -> Effect:
    size = EffectParameter(name="size", unit=unit, typical=high / 4, low=low, high=high)
    return Effect(name=name, title=title, parameters=(size, *shapes), signals=("level_V",))


_EFFECTS = (
    _effect("upper_overflow", "the upper tank spills over its rim", "1", 1.0,
            _shape("rim_V", "V", 15.0, 2.0, 40.0), _shape("to_lower", "1", 0.5, 0.0, 1.0)),
    _effect("lower_overflow", "the lower tank spills over its rim", "1", 1.0,
            _shape("rim_V", "V", 10.0, 5.0, 20.0)),
    _effect("upper_leak", "the upper tank leaks in proportion to its level", "1/s", 0.02),
    _effect("lower_leak", "the lower tank leaks in proportion to its level", "1/s", 0.02),
    _effect("upper_power", "outflow above with another power than ½", "1", 0.45, low=-0.45),
    _effect("lower_power", "outflow below with another power than ½", "1", 0.45, low=-0.45),
    _effect("pump_bend", "the pump's gain changes with its voltage", "1/V", 0.12, low=-0.12),
    _effect("pump_dead_zone", "no flow below a voltage", "V", 2.0),
    _effect("pump_lag", "the pump follows late", "s", 120.0),
    _effect("sensor_lag", "the level is shown late", "s", 120.0),
    _effect("sensor_bend", "the sensor's gain changes with the level", "1/V", 0.05, low=-0.05),
    _effect("splash", "a share of the inflow goes straight to the lower tank", "1", 0.9),
)  # fmt: skip


@dataclass(frozen=True)
class Tanks:
    """Pump voltage and the shown level of the lower tank, one sample every 4 s."""

    name: str = "cascaded tanks"
    version: str = "1"
    inputs = (Signal("pump_V", "V", 0.0, 10.0),)
    channels = (Channel(name="level_V", unit="V", quantum=0.01, low=0.0, high=10.01, noise=0.02),)
    parameters = (
        Parameter(
            name="upper_outlet", unit="√V/s", nominal=0.05, low=0.01, high=0.2, prior_sd=0.02
        ),
        Parameter(
            name="lower_outlet", unit="√V/s", nominal=0.05, low=0.01, high=0.2, prior_sd=0.02
        ),
        Parameter(name="pump", unit="1/s", nominal=0.05, low=0.01, high=0.2, prior_sd=0.02),
        Parameter(name="upper_start_V", unit="V", nominal=5.0, low=0.5, high=35.0, prior_sd=5.0),
        Parameter(name="lower_start_V", unit="V", nominal=5.0, low=3.0, high=7.0, prior_sd=0.5),
        Parameter(name="sensor_zero_V", unit="V", nominal=0.0, low=-3.0, high=3.0, prior_sd=1.0),
    )
    effects = _EFFECTS

    def simulate(self, point, run, *, fast=False):
        theta = np.array([point.theta.get(p.name, p.nominal) for p in self.parameters])
        values = [
            point.effects.get(e.name, {}).get(p.name, 0.0 if p.strength else p.typical)
            for e in self.effects
            for p in e.parameters
        ]
        course = _replay(run.inputs["pump_V"], STEP_S / _FINER, theta, np.array(values))
        return {"level_V": course}

    def regimes(self, run, side):
        level, flow = run.outputs["level_V"], run.inputs["pump_V"]
        rising = np.gradient(level) > 0
        return {
            "rest": np.zeros(len(level), dtype=bool),
            "rising": rising,
            "falling": ~rising,
            "much water": flow > 3.0,
        }


@numba.njit(nogil=True)
def _replay(pump, step_s, theta, values):
    k_upper, k_lower, k_pump, upper, lower, zero = theta
    upper_spill, upper_rim, to_lower, lower_spill, lower_rim = values[:5]
    upper_leak, lower_leak, upper_power, lower_power = values[5:9]
    pump_bend, dead_zone, pump_lag, sensor_lag, bend, splash = values[9:]
    course = np.empty(len(pump))
    lower -= zero
    shown, turning = lower, pump[0]
    for k in range(len(pump)):
        seen = shown * (1.0 - bend * shown) + zero
        course[k] = min(seen, END_V)
        for _ in range(_FINER):
            turning += (pump[k] - turning) * (
                1.0 if pump_lag == 0.0 else 1.0 - np.exp(-step_s / pump_lag)
            )
            driving = max(turning - dead_zone, 0.0)
            inflow = k_pump * driving * (1.0 - pump_bend * driving)
            down = k_upper * upper ** (0.5 + upper_power)
            out = k_lower * lower ** (0.5 + lower_power)
            out += lower_leak * lower
            upper += step_s * ((1.0 - splash) * inflow - down - upper_leak * upper)
            over = upper_spill * max(upper - upper_rim, 0.0)
            lower += step_s * (down + splash * inflow - out) + to_lower * over
            upper, lower = max(upper - over, 0.0), max(lower, 0.0)
            lower -= lower_spill * max(lower - lower_rim, 0.0)
            shown += (lower - shown) * (
                1.0 if sensor_lag == 0.0 else 1.0 - np.exp(-step_s / sensor_lag)
            )
    return course
