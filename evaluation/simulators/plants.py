"""Plants whose causes are rated and then simulated: simulators, inputs, and what the bench is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from scipy.signal import lfilter

from smad.diagnosis.plant import Array
from smad.simulators import Missing, Simulator, simulator

SAMPLES = 600
_HEATER_S = 0.1
_TANK_MIN = 1.0 / 60.0


@dataclass(frozen=True, kw_only=True)
class RatedPlant:
    """A simulator, its inputs by seed, its bench's parameters; readings: noise and decimals."""

    declared: Callable[[], Simulator]
    inputs: Callable[[int], dict[str, Array]]
    bench: Mapping[str, float]
    readings: Mapping[str, tuple[float, int]]


def heater(t: Array, inputs: Mapping[str, Array], values: Mapping[str, float], start: Any) -> Any:
    """A heated plate with a thermometer and a fan, linear up to what may be missing."""
    drive = inputs["power_W"] - values["leak_W_K2"] * np.maximum(inputs["power_W"] - 20.0, 0.0)
    # No inputs here reach so far.
    drive = drive - values["overload_W_W2"] * np.maximum(inputs["power_W"] - 60.0, 0.0)
    net_W = drive - values["fan_W"] * inputs["fan"]
    keep = 1.0 - _HEATER_S * values["loss_W_K"] / values["capacity_J_K"]
    above = lfilter([0.0, _HEATER_S / values["capacity_J_K"]], [1.0, -keep], net_W)
    return {"temperature_degC": values["room_degC"] + above}


def _heater() -> Simulator:
    at_power = ("input_power_W",)
    return simulator(
        heater,
        parameters={
            "capacity_J_K": (30.0, 20.0, 40.0, 3.0),
            "loss_W_K": (0.8, 0.5, 1.1, 0.1),
            "room_degC": (22.0, 17.0, 27.0, 1.0),
            "fan_W": (4.0, 1.0, 9.0, 2.0),
        },
        effects={
            "leak_W_K2": Missing(typical=0.1, low=-0.5, high=0.5, places=at_power),
            "overload_W_W2": Missing(typical=0.1, low=-0.5, high=0.5, places=at_power),
        },
        noise={"temperature_degC": 0.03},
        transducers=True,
    )


def _heater_inputs(seed: int) -> dict[str, Array]:
    """Steps of power and of a fan."""
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.uniform(0.0, 45.0, SAMPLES // 50), 50)
    fan = np.repeat(rng.uniform(0.0, 1.0, SAMPLES // 30), 30)
    power[:50] = fan[:50] = 0.0
    t_s = np.asarray(np.arange(SAMPLES) * _HEATER_S, dtype=np.float64)
    return {"t_s": t_s, "power_W": power, "fan": fan}


def mixing_tank(
    t: Array, inputs: Mapping[str, Array], values: Mapping[str, float], start: Any
) -> Any:
    """Water flows into a tank that is dosed with salt, and out by a valve; filled to 5 dm first."""
    sizes = np.array([values[n] for n in (*_TANK, *_TANK_EFFECTS)])
    flow, valve, dose = (np.array(inputs[n]) for n in ("flow_L_min", "valve", "dose_g_min"))
    level, salt = _mixed(flow, valve, dose, sizes)
    return {"level_dm": level, "salt_g_L": salt}


@numba.njit(nogil=True)
def _mixed(
    flow: Array, valve: Array, dose: Array, sizes: Array
) -> tuple[Array, Array]:  # pragma: no cover - compiled
    area, outlet, purity = sizes[:3]
    bend, stall, spill, water, worn, leak, decay, impure, layered, warped = sizes[3:]
    level, salt = np.empty(len(flow)), np.empty(len(flow))
    volume, mass = 5.0 * area, 5.0 * area
    for k in range(len(flow)):
        high, strong = volume / area, mass / volume
        level[k] = high + warped * (high - 5.0) ** 2
        salt[k] = strong * (1.0 + layered * (high - 5.0))
        come = flow[k] * (1.0 - bend * (flow[k] - 10.0))
        # No flow of the inputs here is below its stall, no level above the rim.
        come = (0.0 if flow[k] < stall else come) - spill * max(high - 25.0, 0.0)
        come += water
        outflow = ((outlet + worn) * valve[k] + leak) * np.sqrt(max(high, 0.0))
        dosed = dose[k] * (purity + impure)
        volume = max(volume + _TANK_MIN * (come - outflow), 0.1)
        mass = max(mass + _TANK_MIN * (dosed - strong * outflow - decay * mass), 0.0)
    return level, salt


_TANK = {
    "area_dm2": (5.0, 4.0, 6.0, 0.3), "outlet": (9.0, 6.0, 12.0, 1.0),
    "purity": (1.0, 0.7, 1.3, 0.1),
}  # fmt: skip


def _missing(typical: float, place: str, *, both: bool = True) -> Missing:
    high = 10.0 * typical
    return Missing(typical=typical, low=-high if both else 0.0, high=high, places=(place,))


_TANK_EFFECTS = {
    "pump_bend": _missing(0.005, "input_flow_L_min"),
    "pump_stall": Missing(typical=1.0, high=4.0, places=("input_flow_L_min",)),
    "spill_L_min_dm": _missing(1.0, "input_flow_L_min", both=False),
    "water_L_min": _missing(0.3, "input_flow_L_min"),
    "worn_valve": _missing(0.1, "input_valve"),
    "valve_leak": _missing(0.3, "input_valve", both=False),
    "decay_1_min": _missing(0.02, "input_dose_g_min", both=False),
    "impure_dose": _missing(0.02, "input_dose_g_min"),
    "layered_1_dm": _missing(0.01, "reading_salt_g_L"),
    "warped_1_dm": _missing(0.01, "reading_level_dm"),
}


def _tank() -> Simulator:
    return simulator(
        mixing_tank,
        parameters=_TANK,
        effects=_TANK_EFFECTS,
        noise={"level_dm": 0.01, "salt_g_L": 0.01},
        transducers=True,
    )


def _tank_inputs(seed: int) -> dict[str, Array]:
    """Steps of the flow, the valve and the dose."""
    rng = np.random.default_rng(seed)

    def steps(low: float, high: float, each: int) -> Array:
        return np.repeat(rng.uniform(low, high, -(-SAMPLES // each)), each)[:SAMPLES]

    return {
        "t_s": np.arange(SAMPLES, dtype=np.float64),
        "flow_L_min": steps(5.0, 14.0, 60),
        "valve": steps(0.35, 0.65, 90),
        "dose_g_min": steps(5.0, 25.0, 45),
    }


PLANTS = {
    "heater": RatedPlant(
        declared=_heater, inputs=_heater_inputs,
        bench={"capacity_J_K": 31.5, "loss_W_K": 0.77, "room_degC": 22.3, "fan_W": 4.3},
        readings={"temperature_degC": (0.03, 2)},
    ),
    "mixing tank": RatedPlant(
        declared=_tank, inputs=_tank_inputs,
        bench={"area_dm2": 5.1, "outlet": 9.4, "purity": 1.04},
        readings={"level_dm": (0.01, 3), "salt_g_L": (0.01, 3)},
    ),
}  # fmt: skip
