"""From a bench, a program and a seed to a run log: noise, converter steps, dropouts, jitter."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evaluation.bank.excitation import FAMILIES, REFERENCE, RUN_s, TICK_s, operate, strokes
from evaluation.plant.effects import Active, magnitudes
from evaluation.plant.kernel import at_rest
from evaluation.plant.layout import (
    AMBIENT,
    COLUMNS,
    DUTY_X,
    DUTY_Y,
    I_X,
    I_Y,
    INLET,
    INPUTS,
    LUCK_X,
    READINGS,
)
from evaluation.plant.parameters import Bench

Array = NDArray[np.float64]

WHITE = np.array([2e-3, 2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02, 0.02, 2e-3, 1.5e-3, 5e-3])
COLOURED = np.array([1e-3, 1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02, 0.02, 3e-3, 1.5e-3, 5e-3])
COLOUR_s = np.array([2.0, 2.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0, 1.5, 1.0, 0.5])
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-3, 0.01, 0.01, 0.01, 0.01, 5.2e-3, 5e-4, 1e-3])
"""Noise and converter steps of each of `layout.READINGS`, in its unit."""

SPREAD = {
    "loss_W_K": 0.012,
    "flow_W_K": 0.006,
    "film_static_W_K": 0.01,
    "turned_at_start": 0.012,
    "water_J_K": 0.003,
    "span_m": 1.5e-4,
}
"""What changes from run to run on one bench (relative standard deviations)."""

ARMED = 2.0
UNIX_START = 1_760_000_000.0


@dataclass(frozen=True)
class Run:
    """One recorded run: log columns by name, and the same run without time jitter or dropouts."""

    family: str
    log: dict[str, Array]
    grid: Array  # (n, 11) readings on the ideal clock
    inputs: Array  # (n, 8) commands, and inlet and ambient *as measured*


def _coloured(rng: np.random.Generator, n: int, scale: float, time_constant: float) -> Array:
    from scipy.signal import lfilter

    keep = np.exp(-TICK_s / time_constant)
    steps = rng.normal(0.0, scale * np.sqrt(1 - keep * keep), n)
    steps[0] = rng.normal(0.0, scale)
    return np.asarray(lfilter([1.0], [1.0, -keep], steps))


def _noise(rng: np.random.Generator, n: int) -> Array:
    out: Array = rng.normal(0.0, 1.0, (n, len(READINGS))) * WHITE
    for j in range(len(READINGS)):
        out[:, j] += _coloured(rng, n, COLOURED[j], COLOUR_s[j])
    return out


def _surroundings(rng: np.random.Generator, n: int, room_K: float) -> Array:
    inputs = np.zeros((n, len(INPUTS)))
    t = np.linspace(0.0, 1.0, n)
    for column, spread in ((INLET, 0.5), (AMBIENT, 1.0)):
        bend = rng.normal(0.0, 0.15) * np.sin(np.pi * t * rng.uniform(0.5, 2.0))
        inputs[:, column] = 26.85 + rng.normal(0.0, spread) + bend
    inputs[:, AMBIENT] += room_K
    inputs[:, LUCK_X:] = rng.uniform(size=(n, 2))
    return inputs


def today(rng: np.random.Generator, bench: Bench) -> Bench:
    """The bench as it is in one run: the small things that no log tells."""
    moved = {n: getattr(bench, n) * (1 + rng.normal(0.0, s)) for n, s in SPREAD.items()}
    return replace(bench, **moved)


def record(
    bench: Bench,
    active: tuple[Active, ...],
    family: str,
    seed: int,
    *,
    seconds: float = RUN_s,
    number: int = 1,
) -> Run:
    """Record one run of `family` on `bench` with `active` effects; everything follows from `seed`.

    The same seed gives the same program, noise and day whatever the effects are.
    """
    program = FAMILIES[family](np.random.default_rng((seed, 72)), seconds)
    return record_program(bench, active, program, seed, family=family, number=number)


def record_program(
    bench: Bench,
    active: tuple[Active, ...],
    program: Array,
    seed: int,
    *,
    family: str = "given",
    number: int = 1,
    room_K: float = 0.0,
) -> Run:
    """Record one run of a program (see `excitation`); noise and day follow from `seed`.

    As on a bench, strokes that no log has come before it. The room is warmer than usual by
    `room_K`.
    """
    rng = np.random.default_rng((seed, 71))
    n = len(program)
    inputs = _surroundings(rng, n, room_K)
    noise = _noise(rng, n)
    bench = today(rng, bench)
    effects = magnitudes(active)
    state = at_rest(
        bench, effects, water_degC=float(inputs[0, INLET]), ambient_degC=float(inputs[0, AMBIENT])
    )
    arrays = state.arrays()

    def operated(program: Array, inputs: Array, noise: Array) -> Array:
        out = np.zeros((len(program), len(COLUMNS)))
        operate(bench.vector(), effects, program, inputs, noise, STEPS, TICK_s, *arrays, out)
        return out

    before = strokes()
    quiet = np.zeros((len(before), len(READINGS)))
    operated(before, np.repeat(inputs[:1], len(before), axis=0), quiet)
    out = operated(program, inputs, noise)
    measured = inputs.copy()
    measured[:, INLET] = out[:, READINGS.index("rtd_inlet_degC")]
    measured[:, AMBIENT] = out[:, READINGS.index("rtd_ambient_degC")]
    readings = out[:, : len(READINGS)]
    log = _log(np.random.default_rng((seed, 73)), program, inputs, readings, number)
    return Run(family, log, readings, measured)


def _log(
    rng: np.random.Generator, program: Array, inputs: Array, readings: Array, number: int
) -> dict[str, Array]:
    n = len(program)
    t = np.arange(n) * TICK_s + np.clip(rng.normal(0.0, 2e-4, n), -8e-4, 8e-4)
    t = np.round(t - t[0] + rng.uniform(0.0, 5.0), 6)
    log = {"t_s": t, "host_time_s": UNIX_START + 600.0 * number + t + rng.normal(0.0, 1e-3, n)}
    commands = ((I_X, "i_{}_x_A"), (I_Y, "i_{}_y_A"))
    for column, name in commands:
        for stage in ("cmd", "applied"):
            log[name.format(stage)] = inputs[:, column].copy()
    for j, name in enumerate(READINGS):
        log[name] = np.round(readings[:, j], 6)
    log["duty_x"] = np.round(inputs[:, DUTY_X], 6)
    log["duty_y"] = np.round(inputs[:, DUTY_Y], 6)
    log["reference_mm"] = np.round(program[:, REFERENCE], 4)
    log["setpoint_age_ms"] = np.round(np.abs(rng.normal(4.0, 1.0, n)), 1)
    log["mode"] = np.full(n, ARMED)
    for quiet in ("limiter", "faults", "warnings"):
        log[quiet] = np.zeros(n)
    log["valid"] = np.ones(n)
    log["tick"] = np.arange(n) % 65536.0
    return _dropouts(rng, log)


def _dropouts(rng: np.random.Generator, log: dict[str, Array]) -> dict[str, Array]:
    n = len(log["t_s"])
    fragile = [c for c in READINGS if c.startswith(("rtd", "disp", "force", "v_"))]
    for _ in range(int(rng.integers(1, 4))):
        start, width = int(rng.integers(n - 20)), int(rng.integers(2, 15))
        channel = fragile[int(rng.integers(len(fragile)))]
        log[channel][start : start + width] = np.nan
        log["valid"][start : start + width] = 0.0
    keep = rng.uniform(size=n) > 1e-3
    gap = int(rng.integers(500, n - 40))
    keep[gap : gap + int(rng.integers(3, 16))] = False
    keep[0] = True
    return {name: values[keep] for name, values in log.items()}
