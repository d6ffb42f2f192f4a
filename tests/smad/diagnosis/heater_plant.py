"""A second, tiny plant for the engine: two heated plates, their thermometers, and a rod.

Plate: C Ṫ = P − hA(1 + fan)(T − T_a) − effects. The rod between them grows with the mean
temperature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.signal import lfilter

from smad.diagnosis.plant import (
    Array,
    Channel,
    Effect,
    EffectParameter,
    Experiment,
    Mask,
    ModelPoint,
    Parameter,
    Signal,
)
from smad.diagnosis.runs import GapRun

DT = 0.1
DIVERGED = 1e12
"""Beyond it, in °C, a step was too long for the heat flow of a plate, and the plant diverges."""


@njit(cache=True)
def _plates(  # noqa: PLR0917
    dt, p_l, p_r, fan, c, ha, fan_gain, t_a, t0_l, t0_r, lag, rad, coupling, melt, sticky
):
    n = len(p_l)
    out = np.empty((4, n))
    t_l, t_r, s_l, s_r, blown = t0_l, t0_r, t0_l, t0_r, 0.0
    k_a = t_a + 273.15
    for i in range(n):
        out[0, i], out[1, i], out[2, i], out[3, i] = t_l, t_r, s_l, s_r
        blown += dt * (fan[i] - blown) / sticky if sticky > 0 else fan[i] - blown
        wind = ha * (1.0 + fan_gain * blown)
        q = coupling * (t_l - t_r)
        d_l = p_l[i] - wind * (t_l - t_a) - q
        d_r = p_r[i] - wind * (t_r - t_a) + q
        if rad > 0:
            d_l -= rad * (((t_l + 273.15) / 300.0) ** 4 - (k_a / 300.0) ** 4)
            d_r -= rad * (((t_r + 273.15) / 300.0) ** 4 - (k_a / 300.0) ** 4)
        # Wax that softens between 45 and 55 degC adds to the capacity.
        c_l = c + melt * np.exp(-(((t_l - 50.0) / 4.0) ** 2))
        c_r = c + melt * np.exp(-(((t_r - 50.0) / 4.0) ** 2))
        t_l += dt * d_l / c_l
        t_r += dt * d_r / c_r
        if lag > 0:
            share = 1.0 - np.exp(-dt / lag)
            s_l += share * (t_l - s_l)
            s_r += share * (t_r - s_r)
        else:
            s_l, s_r = t_l, t_r
    return out


@njit(cache=True)
def _backlash(x, gap):
    y = np.empty_like(x)
    at = x[0]
    for i in range(len(x)):
        at = min(max(at, x[i] - gap / 2), x[i] + gap / 2)
        y[i] = at
    return y


def _channel(name, unit, quantum, span, noise, side="", twin=""):  # noqa: PLR0917
    return Channel(
        name=name,
        unit=unit,
        quantum=quantum,
        low=span[0],
        high=span[1],
        noise=noise,
        side=side,
        twin=twin,
    )


def _effect(name, title, sub_model, parameters, signals, equation=""):  # noqa: PLR0917
    return Effect(
        name=name,
        title=title,
        sub_model=sub_model,
        parameters=parameters,
        signals=signals,
        equation=equation,
    )


def _strength(name, unit, typical, high, low=0.0):
    return EffectParameter(name=name, unit=unit, typical=typical, low=low, high=high)


EFFECTS = (
    _effect("sensor_lag", "slow thermometers", "thermal", (_strength("tau_s", "s", 1.5, 6.0),),
           ("temp_l_degC", "temp_r_degC"), "τ Ṡ = T − S"),
    _effect("radiation", "radiation to the room", "thermal", (_strength("rad_W", "W", 4.0, 20.0),),
           ("temp_l_degC", "temp_r_degC", "rod_um"), "q = r[(T/300)⁴ − (T_a/300)⁴]"),
    _effect("coupling", "heat flow between the plates", "thermal",
           (_strength("g_W_K", "W/K", 0.15, 0.8),), ("temp_l_degC", "temp_r_degC", "rod_um")),
    _effect("driver_gain", "gain error of the power stage", "power",
           (_strength("g", "1", 0.05, 0.2, -0.2),), ("power_l_W", "power_r_W")),
    _effect("backlash", "play in the rod's dial", "rod", (_strength("gap_um", "um", 4.0, 20.0),),
           ("rod_um",)),
    _effect("dial_delay", "late dial", "rod", (_strength("delay_s", "s", 0.4, 2.0),), ("rod_um",)),
    _effect("sticky_fan", "fan that spins up slowly", "thermal",
           (_strength("tau_s", "s", 2.0, 8.0),), ("temp_l_degC", "temp_r_degC", "rod_um")),
)  # fmt: skip
MELT = _effect("melt", "softening wax", "thermal", (_strength("J_K", "J/K", 12.0, 60.0),), ())

PARAMETERS = (
    Parameter(name="c_J_K", unit="J/K", nominal=30.0, low=20.0, high=40.0, prior_sd=3.0),
    Parameter(name="ha_W_K", unit="W/K", nominal=0.6, low=0.4, high=0.8, prior_sd=0.06),
    Parameter(name="fan_gain", unit="1", nominal=1.5, low=1.0, high=2.0, prior_sd=0.15),
    Parameter(name="t_a_degC", unit="degC", nominal=22.0, low=17.0, high=27.0, prior_sd=1.0),
    Parameter(name="rod_um_K", unit="um/K", nominal=3.0, low=2.2, high=3.8, prior_sd=0.3),
)
NOMINAL = {p.name: p.nominal for p in PARAMETERS}


@dataclass(frozen=True)
class HeaterPlant:
    """Satisfies `PlantModel`. `library` are the candidates; it can simulate one more."""

    library: tuple[Effect, ...] = EFFECTS
    name: str = "heater"
    version: str = "1"
    inputs: Sequence[Signal] = (
        Signal("cmd_l_W", "W", 0.0, 60.0),
        Signal("cmd_r_W", "W", 0.0, 60.0),
        Signal("fan", "1", 0.0, 1.0),
    )
    channels: Sequence[Channel] = (
        _channel("power_l_W", "W", 0.02, (-5.0, 80.0), 0.05, "L", "power_r_W"),
        _channel("power_r_W", "W", 0.02, (-5.0, 80.0), 0.05, "R", "power_l_W"),
        _channel("temp_l_degC", "degC", 0.01, (-20.0, 150.0), 0.03, "L", "temp_r_degC"),
        _channel("temp_r_degC", "degC", 0.01, (-20.0, 150.0), 0.03, "R", "temp_l_degC"),
        _channel("rod_um", "um", 0.1, (-50.0, 800.0), 0.2),
    )
    parameters: Sequence[Parameter] = PARAMETERS

    @property
    def effects(self) -> Sequence[Effect]:
        return self.library

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        del fast
        theta = {**NOMINAL, **point.theta}
        gain = 1.0 + _value(point.effects, "driver_gain", "g")
        sent = {s: gain * run.inputs[f"cmd_{s}_W"] for s in "lr"}
        state = self._thermal(theta, point.effects, run, sent["l"], sent["r"])
        state = np.where(np.abs(state) < DIVERGED, state, np.nan)
        out: dict[str, Array] = {}
        for s, i in (("l", 0), ("r", 1)):
            out[f"power_{s}_W"] = sent[s]
            out[f"temp_{s}_degC"] = state[2 + i]
        return out | {"rod_um": _rod(theta, point.effects, run.dt_s, state[0], state[1])}

    def _thermal(self, theta, effects, run, p_l, p_r):  # type: ignore[no-untyped-def]
        start = theta["t_a_degC"]
        return _plates(
            run.dt_s,
            p_l,
            p_r,
            run.inputs["fan"],
            theta["c_J_K"],
            theta["ha_W_K"],
            theta["fan_gain"],
            start,
            start,
            start,
            _value(effects, "sensor_lag", "tau_s"),
            _value(effects, "radiation", "rad_W"),
            _value(effects, "coupling", "g_W_K"),
            _value(effects, "melt", "J_K"),
            _value(effects, "sticky_fan", "tau_s"),
        )

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        own = "lr" if side == "" else side.lower()
        power = sum(run.inputs[f"cmd_{s}_W"] for s in own)
        total = run.inputs["cmd_l_W"] + run.inputs["cmd_r_W"]
        fan = run.inputs["fan"] > 0.5
        recent = lfilter([1.0], [1.0, -0.98], (total > 0.5).astype(float)) > 0.1
        return {
            "rest": ~recent & ~fan,
            "fan on": fan,
            "heating": power > 0.5,
            "cooling": power <= 0.5,
        }

    def catalogue(self) -> Sequence[Experiment]:
        return (
            Experiment("one side", "heat the left plate only", 60.0),
            Experiment("still", "slow ramp without the fan", 60.0),
            Experiment("fan pulses", "fan pulses on warm plates", 60.0),
        )

    def perform(self, experiment: str, point: ModelPoint, seed: int) -> GapRun:
        inputs = make_inputs(experiment, 60.0, seed)
        return simulated(self, experiment, inputs, point)


def _value(effects: Mapping[str, Mapping[str, float]], name: str, parameter: str) -> float:
    return float(effects.get(name, {}).get(parameter, 0.0))


def _rod(theta, effects, dt, t_l, t_r):  # type: ignore[no-untyped-def]
    length = theta["rod_um_K"] * (0.5 * (t_l + t_r) - theta["t_a_degC"])
    gap, delay = _value(effects, "backlash", "gap_um"), _value(effects, "dial_delay", "delay_s")
    if gap > 0:
        length = _backlash(length, gap)
    if delay > 0:
        t = np.arange(len(length)) * dt
        length = np.interp(t - delay, t, length)
    return np.where(np.isnan(t_l + t_r), np.nan, length)


def make_inputs(family: str, duration_s: float, seed: int) -> dict[str, Array]:
    """Inputs of a run: a rest of 4 s, then one of several families of excitation."""
    rng = np.random.default_rng([seed, *family.encode()])
    n = round(duration_s / DT)
    t = np.arange(n) * DT
    left, right, fan = np.zeros(n), np.zeros(n), np.zeros(n)
    if family == "sines":
        left = 22 * (1 - np.cos(2 * np.pi * t / rng.uniform(18, 30)))
        right = 20 * (1 - np.cos(2 * np.pi * t / rng.uniform(12, 22)))
        fan = (np.sin(2 * np.pi * t / 17.0) > 0.3).astype(float)
    elif family in ("one side", "still"):
        left = 45.0 * (t % 40 < 25)
        right = left.copy() if family == "still" else right
    else:
        for column, levels in ((left, 50.0), (right, 45.0), (fan, 1.0)):
            at = 0.0
            while at < duration_s:
                hold = rng.uniform(4.0, 11.0)
                level = (
                    levels * (rng.random() < 0.5) * (1 if column is fan else rng.uniform(0.4, 1))
                )
                column[(t >= at) & (t < at + hold)] = level
                at += hold
    for column in (left, right, fan):
        column[t < 4.0] = 0.0
    return {"cmd_l_W": left, "cmd_r_W": right, "fan": fan}


def simulated(
    plant: HeaterPlant, name: str, inputs: Mapping[str, Array], point: ModelPoint
) -> GapRun:
    """The noise-free run that a plant at `point` gives."""
    n = len(inputs["fan"])
    bare = GapRun(name, np.arange(n) * DT, dict(inputs), {})
    return bare.with_columns(outputs=plant.simulate(point, bare))


def recorded(
    family: str,
    seed: int,
    theta: Mapping[str, float] | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
    duration_s: float = 60.0,
    *,
    day: int = 99,
) -> GapRun:
    """A run through sensors: noise of its day and quanta of every channel added."""
    plant = HeaterPlant()
    point = ModelPoint({**NOMINAL, **(theta or {})}, effects or {})
    run = simulated(plant, f"{family} {seed}", make_inputs(family, duration_s, seed), point)
    rng = np.random.default_rng([seed, day])
    outputs = {}
    for c in plant.channels:
        y = run.outputs[c.name] + c.noise * rng.standard_normal(len(run.t_s))
        outputs[c.name] = np.round(y / c.quantum) * c.quantum
    return run.with_columns(outputs=outputs)
