"""Replays are smooth in their parameters: what a fit differentiates has a derivative."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest

from sim_device.plant import kernel as k
from sim_device.plant import load_parameters, simulate
from sim_device.plant.effects.record import Y_SHARE, EffectParameter
from sim_device.plant.effects.registry import EFFECTS
from tests.sim_device.plant.cases import alternating, still

P = load_parameters("A")
INPUTS = alternating(80.0, amps=2.9)
HAIR = 1e-10
# How far outputs may follow a relative change of A_S by a hair (30 nK).
FOLLOWS = {"rtd_x_degC": 1e-6, "rtd_y_degC": 1e-6, "displacement_m": 1e-9, "force_N": 1e-7}
UNIFIED = {"unified_kinetics": {"on": 1.0, "tails": 0.3}}
FRONT = {"cooling_front": {"share": 0.9, "place": 0.5}}
MINOR = {"minor_loop": {"kappa": 0.6, "memory": 0.2}}
LAWS = [e for e in EFFECTS if e.law]


def moved_by_a_hair(effects: Mapping[str, Mapping[str, float]], dt_s: float) -> dict[str, float]:
    """The largest difference of each output between A_S and A_S moved by a hair."""
    one, other = (
        simulate(
            P.replace(austenite_start=P["austenite_start"] * (1.0 + hair)),
            INPUTS,
            effects=effects,
            outputs=tuple(FOLLOWS),
            dt_s=dt_s,
        )
        for hair in (0.0, HAIR)
    )
    return {name: float(np.abs(one[name] - other[name]).max()) for name in FOLLOWS}


@pytest.mark.parametrize("dt_s", [0.005, 0.05])
@pytest.mark.parametrize(
    "effects",
    [{}, UNIFIED, FRONT, UNIFIED | FRONT, UNIFIED | MINOR, UNIFIED | FRONT | MINOR],
    ids=lambda effects: "+".join(effects) or "plain",
)
def test_parameters_moved_by_a_hair_move_a_replay_by_a_hair(effects, dt_s: float) -> None:
    for name, moved in moved_by_a_hair(effects, dt_s).items():
        assert moved < FOLLOWS[name], name


def within(parameter: EffectParameter, value: float) -> float:
    """The value, or the end of the parameter's range that it is beyond."""
    return float(np.clip(value, parameter.low, parameter.high))


@pytest.mark.parametrize("seed", range(16))
def test_so_they_do_with_any_values_of_the_laws(seed: int) -> None:
    rng = np.random.default_rng(seed)
    effects = {
        law.name: {
            q.name: 1.0 if q.switch else within(q, q.typical * np.exp(rng.normal(0.0, 0.5)))
            for q in law.parameters
            if q is not Y_SHARE
        }
        for law in LAWS
    }
    effects["cooling_front"]["share"] = float(rng.uniform(0.3, 1.0))
    effects["cooling_front"]["place"] = float(rng.uniform(0.1, 0.9))
    effects["unified_kinetics"]["tails"] = float(rng.uniform(0.0, 1.0))
    for law in LAWS:
        if Y_SHARE in law.parameters:
            effects[law.name][Y_SHARE.name] = float(rng.uniform(0.5, 1.5))
    for name, moved in moved_by_a_hair(effects, 0.01).items():
        assert moved < 10.0 * FOLLOWS[name], name


def ripples(noise_K: float) -> np.ndarray:
    """A temperature that goes up and down, every 10 ms with noise on it, degC."""
    corners = (27.0, 46.0, 36.0, 44.0, 37.0, 46.0, 34.0, 41.0, 35.0, 50.0, 30.0)
    T = np.concatenate([np.linspace(a, b, 500) for a, b in pairwise(corners)])
    return T + noise_K * np.random.default_rng(1).standard_normal(len(T))


def fractions(T_degC: np.ndarray, effects) -> np.ndarray:
    """The martensite fraction of X when its wire has these temperatures; Y stays cold."""
    fed = np.column_stack([T_degC, np.full(len(T_degC), 27.0)]) + 273.15
    inputs = still(0.01 * np.arange(len(T_degC)))
    out = simulate(P, inputs, effects=effects, feeds={"temperature_K": fed})
    return out["xi_S_x"] + out["xi_T_x"]


@pytest.mark.parametrize("noise_K", [0.0, 0.02, 0.2])
@pytest.mark.parametrize("effects", [UNIFIED, UNIFIED | MINOR, UNIFIED | FRONT])
def test_noise_on_a_fed_temperature_makes_nothing_jump(effects, noise_K: float) -> None:
    T = ripples(noise_K)
    moved = np.abs(fractions(T + 1e-7, effects) - fractions(T, effects))
    assert moved.max() < 2e-4


def test_a_cell_gets_its_latent_heat_in_the_step_in_which_it_transforms() -> None:
    """Given a step late, it rang: a cell cooled, froze, was warmed by 20 K, and waited."""
    effects = UNIFIED | FRONT
    shown = ("rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N")
    long, short = (
        simulate(P, INPUTS, effects=effects, outputs=shown, dt_s=dt) for dt in (0.05, 0.001)
    )
    for name in shown:
        off = np.sqrt(np.mean(np.square(long[name] - short[name]))) / np.ptp(short[name])
        assert off < 2e-3, name


def test_a_full_memory_forgets_the_innermost_loop() -> None:
    """The outermost turn is met again however many smaller loops were begun inside it."""
    shrinking = [46.0, 34.0]
    for n in range(k.TURNS + 4):
        shrinking += [44.0 - 0.3 * n, 36.0 + 0.2 * n]
    corners = [27.0, *shrinking, 46.0]
    T = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(corners)])
    xi = fractions(T, UNIFIED)
    assert abs(xi[-1] - xi[399]) < 2e-3
