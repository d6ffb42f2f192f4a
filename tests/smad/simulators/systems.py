"""Two small systems as their authors would write them, and runs of benches that have one more."""

from __future__ import annotations

from collections.abc import Mapping

import numba
import numpy as np

from smad.diagnosis.plant import Array
from smad.simulators import Simulator, simulator

HEATER_DT, PENDULUM_DT = 0.1, 0.01


@numba.njit(cache=True)
def _plate(power, dt, capacity, loss, room, tau):  # noqa: PLR0917
    plate = shown = room
    out = np.empty(len(power))
    for k in range(len(power)):
        out[k] = shown
        plate += dt * (power[k] - loss * (plate - room)) / capacity
        shown = plate if tau == 0.0 else shown + (plate - shown) * (1.0 - np.exp(-dt / tau))
    return out


def heater(t, inputs, values, start):
    """A heated plate whose thermometer may be slow."""
    shown = _plate(
        np.array(inputs["power_W"]),
        HEATER_DT,
        values["capacity_J_K"],
        values["loss_W_K"],
        values["room_degC"],
        values["slow_sensor"],
    )
    return {"temperature_degC": shown}


def declared_heater(**more) -> Simulator:
    return simulator(
        heater,
        parameters={
            "capacity_J_K": (30.0, 20.0, 40.0, 3.0),
            "loss_W_K": (0.8, 0.5, 1.1, 0.1),
            "room_degC": (22.0, 17.0, 27.0, 1.0),
        },
        effects={"slow_sensor": (2.0, 0.0, 8.0)},
        **more,
    )


def heater_run(seed: int, *, tau: float = 1.5, samples: int = 600) -> dict[str, Array]:
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.choice([0.0, 15.0, 30.0, 45.0], samples // 50), 50)
    power[:50] = 0.0
    values = {"capacity_J_K": 32.0, "loss_W_K": 0.74, "room_degC": 22.0, "slow_sensor": tau}
    shown = heater(None, {"power_W": power}, values, {})["temperature_degC"]
    shown = np.round(shown + 0.03 * rng.standard_normal(samples), 2)
    return {"t_s": np.arange(samples) * HEATER_DT, "power_W": power, "temperature_degC": shown}


@numba.njit(cache=True)
def _swing(torque, dt, mass, length, damping, friction, angle, rate):  # noqa: PLR0917
    out = np.empty(len(torque))
    inertia, weight = mass * length**2, 9.81 * mass * length
    for k in range(len(torque)):
        out[k] = angle
        for _ in range(2):
            rate += 0.5 * dt * (torque[k] - damping * rate - weight * np.sin(angle)) / inertia
            stopped = 0.5 * dt * friction / inertia
            rate -= min(max(rate, -stopped), stopped)
            angle += 0.5 * dt * rate
    return out


def pendulum(t, inputs, values, start):
    """A driven pendulum that may rub."""
    shown = _swing(
        np.array(inputs["torque_N_m"]),
        PENDULUM_DT,
        values["mass_kg"],
        values["length_m"],
        values["damping"],
        values["dry_friction"],
        start["angle_rad"],
        start["angle_rad_rate"],
    )
    return {"angle_rad": shown}


def declared_pendulum(**more) -> Simulator:
    return simulator(
        pendulum,
        parameters={
            "mass_kg": (1.0, 0.5, 2.0),
            "length_m": (0.5, 0.3, 0.8),
            "damping": (0.05, 0.0, 0.3),
        },
        effects={"dry_friction": (0.05, 0.0, 0.5)},
        **more,
    )


def pendulum_run(
    seed: int, *, friction: float = 0.06, seconds: float = 20.0, values: Mapping[str, float] = {}
) -> dict[str, Array]:
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds / PENDULUM_DT)) * PENDULUM_DT
    knots = np.arange(0.0, seconds + 0.5, 0.5)
    torque = np.interp(t_s, knots, rng.uniform(-1.5, 1.5, len(knots)))
    truth = {"mass_kg": 1.1, "length_m": 0.48, "damping": 0.03, "dry_friction": friction, **values}
    at_rest = {"angle_rad": 0.0, "angle_rad_rate": 0.0}
    shown = pendulum(t_s, {"torque_N_m": torque}, truth, at_rest)["angle_rad"]
    shown = np.round(shown + 1e-3 * rng.standard_normal(len(t_s)), 4)
    return {"t_s": t_s, "torque_N_m": torque, "angle_rad": shown}
