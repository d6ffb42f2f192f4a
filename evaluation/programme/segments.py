"""Pieces of open-loop programmes for the spring pair, and runs made of them.

A piece is a list of (duration in s, current X, current Y in A, duty X, duty Y).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from smad.checkup.programme import ProgrammeRun
from smad.diagnosis.plant import Array

Step = tuple[float, float, float, float, float]
Piece = list[Step]

REST_S = 4.0
TAIL: tuple[Step, ...] = ((6.0, 0.0, 0.0, 1.0, 1.0), (3.0, 0.0, 0.0, 0.0, 0.0))


def _mirrored(piece: Sequence[Step], y_side: bool) -> Piece:
    return [(t, iy, ix, dy, dx) if y_side else (t, ix, iy, dx, dy) for t, ix, iy, dx, dy in piece]


def _heat_and_cool(rng: np.random.Generator) -> Piece:
    """Full cycles: heat, wait, water at one of three duties."""
    i, duty = float(rng.uniform(2.4, 3.8)), float(rng.choice([0.4, 0.7, 1.0]))
    cycle = [(3.0, i, 0.0, 0.0, 0.0), (1.5, 0.0, 0.0, 0.0, 0.0), (4.0, 0.0, 0.0, duty, 0.0),
             (1.5, 0.0, 0.0, 0.0, 0.0)]  # fmt: skip
    return cycle * 2


def _partial_cycles(rng: np.random.Generator) -> Piece:
    """Heats of growing length with short cooling between: reversal curves."""
    i, out = float(rng.uniform(2.8, 3.6)), []
    for heat in (1.2, 1.7, 2.2):
        out += [(heat, i, 0.0, 0.0, 0.0), (1.2, 0.0, 0.0, 0.5, 0.0)]
    return [*out, (4.0, 0.0, 0.0, 1.0, 0.0)]


def _current_stairs(rng: np.random.Generator) -> Piece:
    """Steps of current up and down under a little water."""
    duty, levels = float(rng.choice([0.15, 0.3, 0.5])), [0.8, 1.6, 2.4, 3.2, 4.0]
    ups = [(1.6, i, 0.0, duty, 0.0) for i in levels]
    downs = [(1.6, i, 0.0, duty, 0.0) for i in levels[-2::-1]]
    return [*ups, *downs, (3.0, 0.0, 0.0, 1.0, 0.0)]


def _pump_pulses(rng: np.random.Generator) -> Piece:
    """Pulses of water of many widths on a warm spring."""
    widths = (0.2, 0.4, 0.8, 1.6)
    i = float(rng.uniform(1.4, 2.2))
    out: Piece = [(2.6, 3.4, 0.0, 0.0, 0.0)]
    for width in rng.permutation(widths):
        out += [(float(width), i, 0.0, 1.0, 0.0), (1.6, i, 0.0, 0.0, 0.0)]
    return [*out, (4.0, 0.0, 0.0, 1.0, 0.0)]


def _binary(rng: np.random.Generator) -> Piece:
    """A random binary sequence of current on both sides, in turns, under water now and then."""
    out: Piece = []
    for _ in range(14):
        on = rng.random(2) < 0.45
        wet = rng.random(2) < 0.35
        i = float(rng.uniform(2.0, 4.0))
        out.append((float(rng.choice([0.4, 0.6, 1.0])), i * on[0], i * on[1],
                    0.6 * wet[0], 0.6 * wet[1]))  # fmt: skip
    return [*out, (3.0, 0.0, 0.0, 1.0, 1.0)]


def _slow_ramp(rng: np.random.Generator) -> Piece:
    """A slow rise of low current through the transformation, and down again."""
    top, n = float(rng.uniform(1.4, 2.0)), 8
    ups = [(1.5, top * (k + 1) / n, 0.0, 0.0, 0.0) for k in range(n)]
    return [*ups, (4.0, 0.4 * top, 0.0, 0.0, 0.0), (4.0, 0.0, 0.0, 0.3, 0.0)]


def _air(rng: np.random.Generator) -> Piece:
    """Heat, then nothing at all: cooling in air through filled tubes."""
    return [(2.8, float(rng.uniform(3.2, 3.8)), 0.0, 0.0, 0.0), (14.0, 0.0, 0.0, 0.0, 0.0)]


def _against(rng: np.random.Generator) -> Piece:
    """Both springs warm (a higher preload), then one pulls against the other and back."""
    i = float(rng.uniform(2.2, 2.8))
    return [(2.4, i, i, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0, 0.0), (2.0, i, 0.0, 0.0, 0.7),
            (2.0, 0.0, i, 0.7, 0.0), (2.0, i, 0.0, 0.0, 0.7),
            (4.0, 0.0, 0.0, 1.0, 1.0)]  # fmt: skip


def _hold(rng: np.random.Generator) -> Piece:
    """A long hold of one spring under a steady current: creep, drift, plateaus."""
    i = float(rng.uniform(0.9, 1.2))
    return [(2.0, 3.4, 0.0, 0.0, 0.0), (14.0, i, 0.0, 0.0, 0.0), (4.0, 0.0, 0.0, 1.0, 0.0)]


def _both_ways(rng: np.random.Generator) -> Piece:
    """X pulls, then Y, with dry and wet returns: both directions of motion at two rates."""
    i = float(rng.uniform(2.6, 3.4))
    return [(2.4, i, 0.0, 0.0, 0.0), (2.4, 0.0, i, 0.8, 0.0), (2.4, 0.8 * i, 0.0, 0.0, 0.8),
            (4.0, 0.0, 0.0, 0.0, 0.0), (2.4, 0.0, i, 0.3, 0.0),
            (4.0, 0.0, 0.0, 0.0, 1.0)]  # fmt: skip


def _edges(rng: np.random.Generator) -> Piece:
    """Short equal edges on both sides: timing."""
    i = float(rng.uniform(2.8, 3.6))
    return [(0.5, i, 0.0, 0.0, 0.0), (0.5, 0.0, i, 0.0, 0.0)] * 4 + [(5.0, 0.0, 0.0, 1.0, 1.0)]


FAMILY: dict[str, Callable[[np.random.Generator], Piece]] = {
    "full cycles": _heat_and_cool,
    "partial cycles": _partial_cycles,
    "current stairs": _current_stairs,
    "pump pulses": _pump_pulses,
    "binary sequence": _binary,
    "slow ramp": _slow_ramp,
    "air cooling": _air,
    "preload": _against,
    "hold": _hold,
    "both directions": _both_ways,
    "edges": _edges,
}


def candidate(name: str, seed: int, duration_s: float) -> ProgrammeRun:
    """A run of random pieces within `duration_s`, begun at rest and ended cold and at rest."""
    rng = np.random.default_rng([seed, 28])
    steps: Piece = [(REST_S, 0.0, 0.0, 0.0, 0.0)]
    left_s = duration_s - REST_S - sum(t for t, *_ in TAIL)
    titles: list[str] = []
    for kind in rng.permutation(list(FAMILY)):
        y_side = bool(rng.random() < 0.5)
        piece = _mirrored(FAMILY[str(kind)](rng), y_side)
        length = sum(t for t, *_ in piece)
        if length + 1.0 <= left_s:
            steps += [*piece, (1.0, 0.0, 0.0, 0.0, 0.0)]
            left_s -= length + 1.0
            titles.append(f"{kind} {'Y' if y_side else 'X'}")
    if left_s > 0.0:
        steps.append((left_s, 0.0, 0.0, 0.0, 0.0))
    return run_of(name, ", ".join(titles), [*steps, *TAIL])


def run_of(name: str, title: str, steps: Sequence[Step]) -> ProgrammeRun:
    """The steps as a run; times and values rounded to what a file keeps."""
    ends = np.round(np.cumsum([t for t, *_ in steps]), 3)
    inputs = np.round(np.array([row for _, *row in steps]), 3)
    t_s = np.r_[0.0, ends[:-1]]
    return ProgrammeRun(name=name, title=title, t_s=t_s, inputs=inputs, duration_s=float(ends[-1]))


def milder(run: ProgrammeRun, factor: float) -> ProgrammeRun:
    """The run with its currents times `factor`."""
    inputs: Array = run.inputs.copy()
    inputs[:, :2] = np.round(factor * inputs[:, :2], 3)
    return replace(run, inputs=inputs)
