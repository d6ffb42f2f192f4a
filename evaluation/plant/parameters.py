"""What one bench is: its constants, in this plant's own parameterisation, and how benches differ.

Whole-spring quantities (J/K, W/K, N/m) instead of material constants, because that is what the
published facts fix. Stress is in MPa and temperature in °C, as the material's data sheets have it.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Bench:
    """Constants of one bench; the defaults are the nominal bench of the published facts."""

    span_m: float = 0.050  # both deflections together, twice the 25 mm prestretch
    k_mart_N_m: float = 58.5
    k_aust_N_m: float = 116.2
    strain_m: float = 0.0391  # deflection set free when all martensite is turned
    stress_MPa_N: float = 45.87
    heat_centre_degC: float = 33.5  # stress-free centre of M → A
    heat_spread_K: float = 5.0
    cool_centre_degC: float = 33.0  # stress-free centre of A → M
    cool_spread_K: float = 1.6
    heat_slope_MPa_K: float = 8.0
    cool_slope_MPa_K: float = 4.6
    turn_onset_MPa: float = 58.0  # stress from which twinned martensite is turned
    turn_scale_MPa: float = 55.0
    turn_power: float = 2.1
    turned_at_start: float = 0.0976
    wire_J_K: float = 0.45
    latent_J: float = 9.5
    water_J_K: float = 2.56
    loss_W_K: float = 0.0204
    loss_power: float = 0.12
    film_static_W_K: float = 1.3
    film_forced_W_K: float = 8.0
    flow_W_K: float = 0.549  # heat capacity rate of the water at full pump duty
    mixing: float = 0.45  # axial mixing between neighbours, as a share of the flow
    conduction_W_K: float = 0.004
    resistance_ohm: float = 0.76
    driver_lag_s: float = 0.006
    pump_lag_s: float = 0.15
    rtd_lag_s: float = 0.10
    rtd_place: float = 0.55  # where along the tube the RTD is tied on, 0 inlet … 1 outlet
    supply_V: float = 12.0
    supply_ohm: float = 0.05
    y_stiffness: float = 1.0  # spring Y as a multiple of spring X
    y_resistance: float = 1.0
    y_loss: float = 1.0
    y_flow: float = 1.0

    def vector(self) -> NDArray[np.float64]:
        """All constants in the order of the fields, for the compiled code."""
        return np.array([getattr(self, f.name) for f in fields(self)])


NAMES = tuple(f.name for f in fields(Bench))


def index(name: str) -> int:
    """Position of one constant in :meth:`Bench.vector`."""
    return NAMES.index(name)


RELATIVE = (
    "k_mart_N_m",
    "k_aust_N_m",
    "strain_m",
    "heat_spread_K",
    "cool_spread_K",
    "heat_slope_MPa_K",
    "cool_slope_MPa_K",
    "turn_scale_MPa",
    "turned_at_start",
    "wire_J_K",
    "latent_J",
    "water_J_K",
    "loss_W_K",
    "film_static_W_K",
    "film_forced_W_K",
    "flow_W_K",
    "mixing",
    "resistance_ohm",
    "pump_lag_s",
    "rtd_lag_s",
)
"""Constants that differ from bench to bench by a factor."""

SHIFTED_K = ("heat_centre_degC", "cool_centre_degC")
"""Constants that differ by a shift in kelvin."""

SIDES = ("y_stiffness", "y_resistance", "y_loss", "y_flow")
"""How far spring Y is from spring X."""


def _either_side(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high) * rng.choice((-1.0, 1.0)))


def another_bench(rng: np.random.Generator, nominal: Bench | None = None) -> Bench:
    """A bench whose every constant is 3–10 % (0.4–1.5 K, sides 0.5–3 %) off the nominal one."""
    base = nominal or Bench()
    changes = {n: getattr(base, n) * (1 + _either_side(rng, 0.03, 0.10)) for n in RELATIVE}
    changes |= {n: getattr(base, n) + _either_side(rng, 0.4, 1.5) for n in SHIFTED_K}
    changes |= {n: 1 + _either_side(rng, 0.005, 0.03) for n in SIDES}
    changes["turn_onset_MPa"] = base.turn_onset_MPa * (1 + _either_side(rng, 0.01, 0.03))
    changes["span_m"] = base.span_m * (1 + _either_side(rng, 0.001, 0.006))
    changes["rtd_place"] = float(rng.uniform(0.45, 0.65))
    return replace(base, **changes)


def changed_parameters(rng: np.random.Generator, bench: Bench, count: int = 4) -> Bench:
    """The same bench with `count` refittable constants moved by 3–10 % (or 0.4–1.5 K)."""
    pool = list(REFITTED)
    chosen = rng.choice(len(pool), size=count, replace=False)
    changes: dict[str, float] = {}
    for name in (pool[i] for i in chosen):
        value = getattr(bench, name)
        if name in SHIFTED_K:
            changes[name] = value + _either_side(rng, 0.4, 1.5)
        elif name == "span_m":
            changes[name] = value * (1 + _either_side(rng, 0.001, 0.006))
        else:
            changes[name] = value * (1 + _either_side(rng, 0.03, 0.10))
    return replace(bench, **changes)


def mounted_anew(rng: np.random.Generator, bench: Bench) -> Bench:
    """The same bench with another preload: the springs are mounted 0.2–0.5 mm further or less."""
    return replace(bench, span_m=bench.span_m + _either_side(rng, 2e-4, 5e-4))


def drifting(rng: np.random.Generator, bench: Bench, count: int) -> list[Bench]:
    """The bench in `count` runs on end, while loss, film and flow drift by 3–6 % in all."""
    names = ("loss_W_K", "film_static_W_K", "film_forced_W_K", "flow_W_K")
    whole = {n: _either_side(rng, 0.03, 0.06) for n in names}
    return [
        replace(bench, **{n: getattr(bench, n) * (1.0 + x * share) for n, x in whole.items()})
        for share in np.linspace(0.0, 1.0, count)
    ]


REFITTED: dict[str, float] = {
    "span_m": 0.01,
    "k_mart_N_m": 0.12,
    "k_aust_N_m": 0.12,
    "strain_m": 0.12,
    "heat_centre_degC": 0.08,
    "cool_centre_degC": 0.08,
    "heat_slope_MPa_K": 0.12,
    "turn_scale_MPa": 0.12,
    "turned_at_start": 0.12,
    "wire_J_K": 0.12,
    "latent_J": 0.12,
    "water_J_K": 0.12,
    "loss_W_K": 0.12,
    "film_static_W_K": 0.12,
    "film_forced_W_K": 0.12,
    "flow_W_K": 0.12,
    "resistance_ohm": 0.12,
}
"""Constants an oracle refit may move, with the relative standard deviation of their prior."""
