"""Families of runs: what the bench is asked to do, tick by tick, and its own small controller.

A program is an array (n, 7); a run starts and ends at rest. The families differ in kind, so that
held-out runs can come from others than the runs a model was fitted to.
"""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.kernel import tick
from evaluation.plant.layout import DUTY_X, DUTY_Y, I_X, I_Y

Array = NDArray[np.float64]

TICK_s = 0.01
RUN_s = 75.0
FOLLOW, REFERENCE, CURRENT_X, CURRENT_Y, PUMP_X, PUMP_Y, COOLING = range(7)

KP_A_mm = 6.0
KI_A_mms = 1.5
HOT_degC = 57.0
TOO_HOT_degC = 62.0


def _blank(seconds: float) -> Array:
    return np.zeros((round(seconds / TICK_s), 7))


def _following(reference_mm: Array, rest_end_s: float = 6.0) -> Array:
    program = np.zeros((len(reference_mm), 7))
    begin, end = round(4.0 / TICK_s), len(reference_mm) - round(rest_end_s / TICK_s)
    program[begin:end, FOLLOW] = 1.0
    program[begin:end, REFERENCE] = reference_mm[begin:end]
    program[begin:end, COOLING] = 1.0
    return program


def _held(rng: np.random.Generator, seconds: float, levels: list[float], dwell: float) -> Array:
    out = np.zeros(round(seconds / TICK_s))
    row = round(4.0 / TICK_s)
    i = 0
    while row < len(out):
        until = row + round(dwell * rng.uniform(0.8, 1.2) / TICK_s)
        out[row:until] = levels[i % len(levels)]
        row, i = until, i + 1
    return out


def steps(rng: np.random.Generator, seconds: float) -> Array:
    """Steps to either side, held 8–12 s."""
    sign = rng.choice((-1.0, 1.0))
    levels = [float(sign * (-1) ** i * rng.uniform(2.0, 9.0)) for i in range(12)]
    return _following(_held(rng, seconds, levels, rng.uniform(8.0, 12.0)))


def staircase(rng: np.random.Generator, seconds: float) -> Array:
    """Up and down in stairs of 1.5–2.5 mm."""
    sign, stair = rng.choice((-1.0, 1.0)), rng.uniform(1.5, 2.5)
    way = [1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -3, -2, -1, 0]
    levels = [float(sign * stair * n) for n in way]
    return _following(_held(rng, seconds, levels, rng.uniform(4.0, 5.5)))


def sines(rng: np.random.Generator, seconds: float) -> Array:
    """Sines, larger and slower in the second half."""
    t = np.arange(round(seconds / TICK_s)) * TICK_s
    first, second = rng.uniform(7.0, 10.0), rng.uniform(11.0, 18.0)
    half = seconds / 2
    small = rng.uniform(1.5, 3.0) * np.sin(2 * np.pi * (t - 4.0) / first)
    large = rng.uniform(3.5, 7.0) * np.sin(2 * np.pi * (t - half) / second)
    return _following(np.where(t < half, small, large))


def random_levels(rng: np.random.Generator, seconds: float) -> Array:
    """Random levels joined by ramps."""
    knots = np.concatenate(([0.0, 4.0], 4.0 + np.cumsum(rng.uniform(2.5, 6.0, 40))))
    levels = np.clip(np.cumsum(rng.normal(0.0, 3.0, len(knots))), -8.0, 8.0)
    levels[:2] = 0.0
    t = np.arange(round(seconds / TICK_s)) * TICK_s
    return _following(np.interp(t, knots, levels))


def chirp(rng: np.random.Generator, seconds: float) -> Array:
    """One sine whose period falls from 25 to 8 s."""
    t = np.arange(round(seconds / TICK_s)) * TICK_s
    low, high = 1 / 25.0, 1 / rng.uniform(8.0, 11.0)
    s = np.maximum(t - 4.0, 0.0)
    phase = 2 * np.pi * (low * s + 0.5 * (high - low) / seconds * s * s)
    return _following(rng.choice((-1.0, 1.0)) * rng.uniform(2.5, 5.0) * np.sin(phase))


def open_loop(rng: np.random.Generator, seconds: float) -> Array:
    """Current pulses and pump pulses on both springs, on their own clocks."""
    program = _blank(seconds)
    end = len(program) - round(6.0 / TICK_s)
    for current, pump in ((CURRENT_X, PUMP_X), (CURRENT_Y, PUMP_Y)):
        row = round((4.0 + rng.uniform(0.0, 12.0) * (current == CURRENT_Y)) / TICK_s)
        while row < end:
            amperes = rng.uniform(1.0, 4.0)
            heat = round(min(12.0, 60.0 / amperes**2) * rng.uniform(0.5, 1.0) / TICK_s)
            pause = round(rng.uniform(0.5, 4.0) / TICK_s)
            cool = round(rng.uniform(2.0, 7.0) / TICK_s)
            program[row : row + heat, current] = amperes
            start = row + heat + pause
            program[start : start + cool, pump] = rng.choice((0.5, 0.75, 1.0))
            row = start + cool + round(rng.uniform(0.5, 5.0) / TICK_s)
    program[end:] = 0.0
    return program


def slow_heat(rng: np.random.Generator, seconds: float) -> Array:
    """One spring after the other heated slowly, left to the air, then pumped in short pulses."""
    program = _blank(seconds)
    first = bool(rng.integers(2))
    half = (seconds - 10.0) / 2
    for turn in range(2):
        x = first == (turn == 0)
        current, pump = (CURRENT_X, PUMP_X) if x else (CURRENT_Y, PUMP_Y)
        begin = 4.0 + turn * half
        amperes = rng.uniform(1.5, 2.1)
        warm = min(0.55 * half, 62.0 / amperes**2)
        program[round(begin / TICK_s) : round((begin + warm) / TICK_s), current] = amperes
        at_s = begin + warm + rng.uniform(2.0, 6.0)
        while at_s < begin + half - 1.0:
            width = rng.uniform(0.4, 1.5)
            program[round(at_s / TICK_s) : round((at_s + width) / TICK_s), pump] = 1.0
            at_s += width + rng.uniform(1.0, 3.0)
    return program


def air(rng: np.random.Generator, seconds: float) -> Array:
    """Steps and sines with the pumps held off for the middle third."""
    program = steps(rng, seconds) if rng.integers(2) else sines(rng, seconds)
    n = len(program)
    program[:, REFERENCE] *= 0.6
    program[n // 3 : 2 * n // 3, COOLING] = 0.0
    return program


def strokes() -> Array:
    """Each spring once heated to about 45 °C and cooled, X first; a bench has such a past, too."""
    program = _blank(60.0)
    for begin_s, current, pump in ((0.0, CURRENT_X, PUMP_X), (30.0, CURRENT_Y, PUMP_Y)):
        row = round(begin_s / TICK_s)
        program[row : row + round(9.0 / TICK_s), current] = 2.9
        program[row + round(11.0 / TICK_s) : row + round(27.0 / TICK_s), pump] = 1.0
    return program


FAMILIES: dict[str, Callable[[np.random.Generator, float], Array]] = {
    "steps": steps,
    "staircase": staircase,
    "open_loop": open_loop,
    "slow_heat": slow_heat,
    "air": air,
    "sines": sines,
    "random_levels": random_levels,
    "chirp": chirp,
}
FOR_FITTING = ("steps", "staircase", "open_loop", "slow_heat", "air")


@compiled
def operate(
    p: Array,
    e: Array,
    program: Array,
    inputs: Array,
    noise: Array,
    steps: Array,
    dt: float,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    rows: Array,
    heat: Array,
    scratch: Array,
    out: Array,
) -> None:
    """Run a program with the bench's own controller on its own noisy, rounded readings.

    `noise` (n, 11) and `steps` (11) belong to the readings; commands are written to `inputs`,
    what was read and what is true to `out`.
    """
    integral = 0.0
    travel = 0.0
    hottest_x = 0.0
    hottest_y = 0.0
    for k in range(program.shape[0]):
        wish = program[k]
        i_x = wish[CURRENT_X]
        i_y = wish[CURRENT_Y]
        pump_x = wish[PUMP_X]
        pump_y = wish[PUMP_Y]
        if wish[FOLLOW] > 0.5:
            error = wish[REFERENCE] - travel
            effort = KP_A_mm * error + integral
            if abs(effort) < 4.0 or effort * error < 0.0:
                integral += KI_A_mms * error * dt
            size = min(abs(effort), 4.0)
            i_x = size if effort > 0.0 else 0.0
            i_y = 0.0 if effort > 0.0 else size
            pump_x = 0.0 if effort > 0.0 else wish[COOLING] * size / 4.0
            pump_y = wish[COOLING] * size / 4.0 if effort > 0.0 else 0.0
        if hottest_x > HOT_degC:
            i_x = 0.0
        if hottest_y > HOT_degC:
            i_y = 0.0
        if hottest_x > TOO_HOT_degC:
            pump_x = 1.0
        if hottest_y > TOO_HOT_degC:
            pump_y = 1.0
        inputs[k, I_X] = round(1e3 * i_x) / 1e3
        inputs[k, I_Y] = round(1e3 * i_y) / 1e3
        inputs[k, DUTY_X] = round(255.0 * pump_x) / 255.0
        inputs[k, DUTY_Y] = round(255.0 * pump_y) / 255.0
        tick(p, e, inputs[k], dt, cells, side, pair, ring, rows, heat, scratch, out[k])
        for j in range(11):
            out[k, j] = steps[j] * round((out[k, j] + noise[k, j]) / steps[j])
        travel = out[k, 8]
        hottest_x = out[k, 4]
        hottest_y = out[k, 5]
