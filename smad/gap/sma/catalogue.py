"""Safe experiments on the spring pair, as timelines of controller commands.

Two uses: the next-experiment stage chooses among `CATALOGUE`, and `ROUTINE` makes varied everyday
runs for tests, controls and benchmarks. Every timeline stays within the host's limits: at most 4 A,
springs below 65 °C in the model, ±9 mm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from smad.control.commands import (
    DriveCurrent,
    Follow,
    HoldTemperature,
    Idle,
    ModeCommand,
    Ramp,
    RandomLevels,
    Sine,
    Staircase,
    Step,
    Tune,
)
from smad.control.plan import Action, Do, Pause, Plan
from smad.gap.errors import GapError

REST_S = 4.0


@dataclass(frozen=True, slots=True)
class At:
    """A command at a time of the run."""

    t_s: float
    command: ModeCommand


@dataclass(frozen=True, slots=True)
class Timeline:
    """One experiment: what it separates is in the title."""

    name: str
    title: str
    duration_s: float
    make: Callable[[np.random.Generator], Sequence[At]]


def _sequence(*parts: tuple[float, ModeCommand], start: float = REST_S) -> list[At]:
    """Commands one after the other, each with its duration; idle after the last."""
    out, t = [], start
    for duration, command in parts:
        out.append(At(t, command))
        t += duration
    return [*out, At(t, Idle())]


def _current(x: float = 0.0, y: float = 0.0, px: float = 0.0, py: float = 0.0) -> DriveCurrent:
    return DriveCurrent(i_x_A=x, i_y_A=y, pump_x_duty=px, pump_y_duty=py, stop_above_degC=62.0)


def _follow(*pieces: Step | Ramp | Sine | RandomLevels | Staircase) -> Follow:
    return Follow(trajectories=pieces)


def _pulses(duration_s: float, rng: np.random.Generator) -> Sequence[At]:
    """Open-loop pulses of heat and water on both sides, with rests between."""
    parts: list[tuple[float, ModeCommand]] = []
    t = REST_S
    while t < duration_s - 8.0:
        x_side = bool(rng.random() < 0.5)
        heat, hold = float(rng.uniform(1.5, 3.8)), float(rng.uniform(1.5, 4.5))
        cool, rest = float(rng.uniform(2.0, 5.0)), float(rng.uniform(0.5, 3.0))
        duty = float(rng.choice([0.4, 0.7, 1.0]))
        on = _current(x=heat) if x_side else _current(y=heat)
        off = _current(px=duty) if x_side else _current(py=duty)
        parts += [(hold, on), (rest, Idle()), (cool, off)]
        t += hold + rest + cool
    return _sequence(*parts)


def _levels(amplitude: float, dwell: float, rng: np.random.Generator) -> Sequence[At]:
    seed = int(rng.integers(2**31))
    piece = RandomLevels(amplitude_mm=amplitude, levels=60, dwell_s=dwell, seed=seed)
    return _sequence((61.0, _follow(piece)))


def _sines(rng: np.random.Generator) -> Sequence[At]:
    first = Sine(
        amplitude_mm=float(rng.uniform(1.5, 3)), period_s=float(rng.uniform(6, 9)), cycles=4
    )
    second = Sine(
        amplitude_mm=float(rng.uniform(4, 7)), period_s=float(rng.uniform(14, 20)), cycles=3
    )
    return _sequence((61.0, _follow(first, second)))


def _stairs(rng: np.random.Generator) -> Sequence[At]:
    step = float(rng.uniform(1.2, 2.2)) * (1 if rng.random() < 0.5 else -1)
    piece = Staircase(step_mm=step, steps=4, dwell_s=3.5, there_and_back=True)
    other = Staircase(step_mm=-step, steps=4, dwell_s=3.5, there_and_back=True)
    return _sequence((61.0, _follow(piece, other)))


def _mixed(rng: np.random.Generator) -> Sequence[At]:
    parts: list[tuple[float, ModeCommand]] = [
        (22.0, _follow(Sine(amplitude_mm=3.0, period_s=7.0, cycles=3)))
    ]
    return [*_sequence(*parts)[:-1], At(26.0, Idle()), *_sequence(
        (3.0, _current(x=float(rng.uniform(2, 3.5)))), (4.0, Idle()), (4.0, _current(px=1.0)),
        (3.0, _current(y=float(rng.uniform(2, 3.5)))), (4.0, _current(py=0.6)), (5.0, Idle()),
        start=31.0,
    )]  # fmt: skip


def _pump_widths(rng: np.random.Generator) -> Sequence[At]:
    """Pump pulses of many widths on a warm spring."""
    parts: list[tuple[float, ModeCommand]] = []
    for width in (0.2, 0.4, 0.8, 1.6, 3.2):
        parts += [(3.2, _current(x=3.2)), (width, _current(px=1.0)), (2.5, Idle())]
    parts += [(3.0, _current(y=3.2)), (2.0, _current(py=0.5)), (3.0, Idle())]
    return _sequence(*parts)


def _current_stairs(rng: np.random.Generator) -> Sequence[At]:
    """A staircase of current on each side, against full water."""
    ups = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
    x = [(2.5, _current(x=i, px=0.5)) for i in ups]
    y = [(2.5, _current(y=i, py=0.5)) for i in ups]
    return _sequence(*x, (6.0, _current(px=1.0)), *y, (6.0, _current(py=1.0)))


def _edges(rng: np.random.Generator) -> Sequence[At]:
    """The same short edges at the start and at the end."""
    burst: list[tuple[float, ModeCommand]] = [(0.5, _current(x=3.5)), (0.5, _current(y=3.5))] * 4
    return [*_sequence(*burst)[:-1], At(8.0, _current(px=1.0, py=1.0)), At(20.0, Idle()),
            *_sequence(*burst, start=60.0)[:-1], At(64.0, _current(px=1.0, py=1.0))]  # fmt: skip


def _two_rates(rng: np.random.Generator) -> Sequence[At]:
    """Temperature ramps of X at two rates, cooling between."""
    slow = HoldTemperature(spring="x", temperature_degC=52.0, rate_K_per_s=1.0)
    fast = HoldTemperature(spring="x", temperature_degC=52.0, rate_K_per_s=6.0)
    return _sequence((28.0, slow), (12.0, _current(px=1.0)), (8.0, fast), (14.0, _current(px=1.0)))


def _slow_sweep(rng: np.random.Generator) -> Sequence[At]:
    """Low current through the transformation and back, one side after the other."""
    return _sequence((24.0, _current(x=1.8)), (18.0, _current(x=0.3, px=0.15)),
                     (14.0, _current(y=2.2)), (12.0, _current(y=0.3, py=0.2)))  # fmt: skip


def _preloads(rng: np.random.Generator) -> Sequence[At]:
    """Small reversals, then the same with both springs warm (a higher preload)."""
    small = _follow(Sine(amplitude_mm=1.5, period_s=8.0, cycles=3))
    warm: list[tuple[float, ModeCommand]] = [(4.0, _current(x=2.6, y=2.6)), (3.0, Idle())]
    waves: list[tuple[float, ModeCommand]] = [
        (3.0, _current(x=3.0, py=0.6)),
        (3.0, _current(y=3.0, px=0.6)),
    ] * 3
    return _sequence((25.0, small), (6.0, _current(px=1.0, py=1.0)), *warm, *waves,
                     (6.0, _current(px=1.0, py=1.0)))  # fmt: skip


def _reversal_curves(rng: np.random.Generator) -> Sequence[At]:
    """Partial cycles of growing depth: first-order reversal curves."""
    parts: list[tuple[float, ModeCommand]] = []
    for heat in (1.5, 2.0, 2.5, 3.0):
        parts += [(heat, _current(x=3.4)), (2.5, _current(px=0.5)), (heat, _current(x=3.4)),
                  (5.0, _current(px=1.0))]  # fmt: skip
    return _sequence(*parts)


def _isotherm(rng: np.random.Generator) -> Sequence[At]:
    """Warm up, then nothing at all: plateaus, drift, cooling in air."""
    return _sequence((3.2, _current(x=3.6)), (24.0, Idle()), (3.2, _current(y=3.6)), (24.0, Idle()),
                     (6.0, _current(px=1.0, py=1.0)))  # fmt: skip


def _one_side(rng: np.random.Generator) -> Sequence[At]:
    """Only X is driven; Y must not notice more than the tendon."""
    cycle: list[tuple[float, ModeCommand]] = [
        (3.0, _current(x=3.2)),
        (3.0, _current(px=1.0)),
        (3.0, Idle()),
    ]
    return _sequence(*(cycle * 6))


def _repeats(rng: np.random.Generator) -> Sequence[At]:
    """The same full cycle many times: first against last."""
    return _sequence(*([(2.6, _current(x=3.6)), (3.6, _current(px=1.0))] * 11))


def _dry_and_wet(rng: np.random.Generator) -> Sequence[At]:
    """The same motion without and with water."""
    wave = _follow(Sine(amplitude_mm=2.0, period_s=8.0, cycles=3))
    return [At(0.5, Tune(cooling="off")), *_sequence((25.0, wave)),
            At(30.0, _current(px=1.0, py=1.0)),
            At(38.0, Tune(cooling="switch")), *_sequence((25.0, wave), start=39.0)]  # fmt: skip


def _cold_hold(rng: np.random.Generator) -> Sequence[At]:
    """Displacement held for long at both ends, then let go: creep, slack, near-zero force."""
    return _sequence((22.0, _follow(Step(displacement_mm=6.0, duration_s=22.0))),
                     (22.0, _follow(Step(displacement_mm=-6.0, duration_s=22.0))),
                     (10.0, _current(px=1.0, py=1.0)))  # fmt: skip


ROUTINE: tuple[Timeline, ...] = (
    Timeline("pulses", "open-loop pulses of heat and water", 75.0, partial(_pulses, 75.0)),
    Timeline("levels", "random displacement levels", 75.0, partial(_levels, 6.0, 4.0)),
    Timeline("sines", "sines of two amplitudes and periods", 75.0, _sines),
    Timeline("stairs", "displacement staircases", 75.0, _stairs),
    Timeline("mixed", "a sine, then open-loop pulses", 75.0, _mixed),
    Timeline("quick levels", "small quick levels", 75.0, partial(_levels, 3.0, 2.0)),
)
"""Everyday runs. The first families are for fitting, the last for holding out."""

CATALOGUE: tuple[Timeline, ...] = (
    Timeline("pump widths", "pump pulses of many widths on a warm spring", 60.0, _pump_widths),
    Timeline("current stairs", "current staircases against water", 65.0, _current_stairs),
    Timeline("edges", "equal short edges at start and end", 75.0, _edges),
    Timeline("two rates", "temperature ramps at two rates", 70.0, _two_rates),
    Timeline("slow sweep", "low current through the transformation and back", 75.0, _slow_sweep),
    Timeline("two preloads", "reversals at two preloads", 75.0, _preloads),
    Timeline("reversal curves", "partial cycles of growing depth", 60.0, _reversal_curves),
    Timeline("isotherm", "warm up, then rest", 70.0, _isotherm),
    Timeline("one side", "one side driven, the other idle", 60.0, _one_side),
    Timeline("repeats", "the same cycle many times", 75.0, _repeats),
    Timeline("dry and wet", "the same motion without and with water", 75.0, _dry_and_wet),
    Timeline("long holds", "long holds at both ends", 65.0, _cold_hold),
)
"""Experiments to tell confused causes apart."""

BY_NAME = {t.name: t for t in (*ROUTINE, *CATALOGUE)}


def plan_named(name: str, seed: int) -> Plan:
    """An experiment as a plan, which a bench or a simulated one carries out.

    Raises GapError for a name that is not in the catalogue.
    """
    timeline = timeline_named(name)
    rng = np.random.default_rng([seed, *timeline.name.encode()])
    actions: list[Action] = []
    now = 0.0
    for at in sorted(timeline.make(rng), key=lambda a: a.t_s):
        if at.t_s > now:
            actions.append(Pause(at.t_s - now))
            now = at.t_s
        actions.append(Do(at.command))
    if timeline.duration_s > now:
        actions.append(Pause(timeline.duration_s - now))
    return Plan(f"gap {timeline.name}", tuple(actions))


def timeline_named(name: str) -> Timeline:
    """The experiment of that name. Raises GapError for one that is not in the catalogue."""
    if name not in BY_NAME:
        raise GapError(
            "no such experiment in the catalogue",
            value=name,
            limit=", ".join(BY_NAME),
            action="choose one of these",
        )
    return BY_NAME[name]
