"""Heat along the tube: wire and water in cells, one implicit solve with error control.

Each step is done once whole and twice halved (implicit Euler); the difference controls the step
and the extrapolated result is kept (Deuflhard's extrapolation idea, lowest order).
"""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.layout import CELLS, PLAY, PLAYS, T, W
from evaluation.plant.phase import WEIGHT as _WEIGHT
from evaluation.plant.phase import martensite

Array = NDArray[np.float64]

(
    HEAT_WIRE,
    HEAT_WATER,
    FILM,
    WATER_HEAT,
    LOSS,
    TO_CLAMP,
    SHIFT_HEAT,
    SHIFT_COOL,
    LATENT,
    STORES,
    ROW_WIDTH,
) = range(11)
"""Columns of the per-cell coefficients that hold over one tick."""

TOLERANCE_K = 0.01
QUIET_K = 0.0008  # step errors below which the next ticks go unchecked
QUIET_TICKS = 4
MOST_HALVINGS = 6
NEWTON_STEPS = 3


@compiled
def solve(
    start: Array,
    rows: Array,
    flow: float,
    mix: float,
    inlet: float,
    ambient: float,
    h: float,
    p: Array,
    out: Array,
    work: Array,
) -> None:
    """One implicit Euler step of length `h` from `start` into `out` (columns T, W and plays)."""
    for i in range(CELLS):
        work[i, 0] = start[i, T]
        fraction = 0.0
        for k in range(PLAYS):
            fraction += _WEIGHT[k] * start[i, PLAY + k]
        work[i, 6] = fraction
        work[i, 5] = rows[i, STORES] / h
        work[i, 7] = rows[i, LATENT] / h
        work[i, 8] = rows[i, WATER_HEAT] / h
    for _ in range(NEWTON_STEPS):
        moved = 0.0
        for i in range(CELLS):
            row = rows[i]
            fraction, slope = martensite(
                start[i], work[i, 0], row[SHIFT_HEAT], row[SHIFT_COOL], p, out[i, PLAY:]
            )
            gain = work[i, 7]
            film = row[FILM]
            storage = work[i, 5]
            denominator = storage + film + row[TO_CLAMP] - gain * slope
            base = (
                storage * start[i, T]
                + row[HEAT_WIRE]
                + row[TO_CLAMP] * ambient
                + gain * (fraction - work[i, 6] - slope * work[i, 0])
            )
            work[i, 1] = base / denominator
            work[i, 2] = film / denominator
            lower = flow + mix if i > 0 else flow
            upper = mix if i < CELLS - 1 else 0.0
            diagonal = work[i, 8] + film * (1.0 - work[i, 2]) + row[LOSS] + lower + upper
            right = (
                work[i, 8] * start[i, W] + film * work[i, 1] + row[HEAT_WATER] + row[LOSS] * ambient
            )
            if i == 0:
                right += flow * inlet
                work[0, 3] = upper / diagonal
                work[0, 4] = right / diagonal
            else:
                pivot = diagonal - lower * work[i - 1, 3]
                work[i, 3] = upper / pivot
                work[i, 4] = (right + lower * work[i - 1, 4]) / pivot
        water = work[CELLS - 1, 4]
        for j in range(CELLS):
            i = CELLS - 1 - j
            if j > 0:
                water = work[i, 4] + work[i, 3] * water
            out[i, W] = water
            wire = work[i, 1] + work[i, 2] * water
            moved = max(moved, abs(wire - work[i, 0]))
            work[i, 0] = wire
        if moved < 1e-4:
            break
    for i in range(CELLS):
        out[i, T] = work[i, 0]
        row = rows[i]
        martensite(start[i], out[i, T], row[SHIFT_HEAT], row[SHIFT_COOL], p, out[i, PLAY:])


@compiled
def advance(
    cells: Array,
    rows: Array,
    flow: float,
    mix: float,
    inlet: float,
    ambient: float,
    dt: float,
    p: Array,
    scratch: Array,
    unchecked: int,
) -> int:
    """Carry one tube's `cells` over `dt`, halving steps as needed; how many ticks may now follow
    without a check. With `unchecked` above zero the step is taken whole.
    """
    whole = scratch[0]
    half = scratch[1]
    end = scratch[2]
    work = scratch[3]
    if unchecked > 0:
        solve(cells, rows, flow, mix, inlet, ambient, dt, p, whole, work)
        for i in range(CELLS):
            cells[i, T] = whole[i, T]
            cells[i, W] = whole[i, W]
            for k in range(PLAYS):
                cells[i, PLAY + k] = whole[i, PLAY + k]
        return unchecked - 1
    h = dt
    left = dt
    largest = 0.0
    smallest = dt / 2**MOST_HALVINGS
    while left > 1e-12:
        h = min(h, left)
        solve(cells, rows, flow, mix, inlet, ambient, h, p, whole, work)
        solve(cells, rows, flow, mix, inlet, ambient, 0.5 * h, p, half, work)
        solve(half, rows, flow, mix, inlet, ambient, 0.5 * h, p, end, work)
        error = 0.0
        for i in range(CELLS):
            error = max(error, abs(end[i, T] - whole[i, T]))
        if error > TOLERANCE_K and h > smallest * 1.01:
            h *= 0.5
            continue
        largest = max(largest, error)
        for i in range(CELLS):
            row = rows[i]
            temperature = 2.0 * end[i, T] - whole[i, T]
            martensite(half[i], temperature, row[SHIFT_HEAT], row[SHIFT_COOL], p, end[i, PLAY:])
            cells[i, T] = temperature
            cells[i, W] = 2.0 * end[i, W] - whole[i, W]
            for k in range(PLAYS):
                cells[i, PLAY + k] = end[i, PLAY + k]
        left -= h
        if error < 0.25 * TOLERANCE_K:
            h *= 2.0
    return QUIET_TICKS if largest < QUIET_K else 0


@compiled
def film(static: float, forced: float, exponent: float, across_K: float, share: float) -> float:
    """Film conductance of the whole wire: static and forced parts added as cubes."""
    still = static * (max(across_K, 0.3) / 4.0) ** exponent
    moved = forced * math.sqrt(share)
    return float((still**3 + moved**3) ** (1.0 / 3.0))
