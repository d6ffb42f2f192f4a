"""Safe experiments on the spring pair, as timelines of controller commands.

`smad gap next` chooses among `CATALOGUE`; `ROUTINE` are varied everyday runs for tests and
benchmarks. Every timeline stays within the host's limits: at most 4 A, springs below 65 °C in the
model, ±9 mm.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from firmware_protocol.nearest import instead
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
from smad.diagnosis.errors import GapError

REST_S = 4.0

Part = tuple[float, ModeCommand]
"""A command with its duration in s."""


@dataclass(frozen=True, slots=True)
class Timeline:
    """One experiment; its title says what it separates.

    `make` draws commands that follow each other from `start_s` on, idle after the last.
    """

    name: str
    title: str
    duration_s: float
    make: Callable[[np.random.Generator], Sequence[Part]]
    start_s: float = REST_S

    def commands(self, seed: int) -> list[tuple[float, ModeCommand]]:
        """Start time in s and command, in order; `seed` draws what is random."""
        out, t_s = list[tuple[float, ModeCommand]](), self.start_s
        for duration_s, command in self.make(np.random.default_rng([seed, *self.name.encode()])):
            out.append((t_s, command))
            t_s += duration_s
        return [*out, (t_s, Idle())] if t_s < self.duration_s else out


def _current(x: float = 0.0, y: float = 0.0, px: float = 0.0, py: float = 0.0) -> DriveCurrent:
    return DriveCurrent(i_x_A=x, i_y_A=y, pump_x_duty=px, pump_y_duty=py, stop_above_degC=62.0)


def _follow(*pieces: Step | Ramp | Sine | RandomLevels | Staircase) -> Follow:
    return Follow(trajectories=pieces)


def _pulses(rng: np.random.Generator) -> Sequence[Part]:
    """Open-loop pulses of heat and water on both sides, with rests between."""
    parts: list[Part] = []
    t = REST_S
    while t < 67.0:  # The last pulse ends before the 75 s of the run do.
        x_side = bool(rng.random() < 0.5)
        heat, hold = float(rng.uniform(1.5, 3.8)), float(rng.uniform(1.5, 4.5))
        cool, rest = float(rng.uniform(2.0, 5.0)), float(rng.uniform(0.5, 3.0))
        duty = float(rng.choice([0.4, 0.7, 1.0]))
        on = _current(x=heat) if x_side else _current(y=heat)
        off = _current(px=duty) if x_side else _current(py=duty)
        parts += [(hold, on), (rest, Idle()), (cool, off)]
        t += hold + rest + cool
    return parts


def _levels(amplitude: float, dwell: float, rng: np.random.Generator) -> Sequence[Part]:
    seed = int(rng.integers(2**31))
    piece = RandomLevels(amplitude_mm=amplitude, levels=60, dwell_s=dwell, seed=seed)
    return [(61.0, _follow(piece))]


def _sines(rng: np.random.Generator) -> Sequence[Part]:
    ranges = (((1.5, 3), (6, 9), 4), ((4, 7), (14, 20), 3))
    sines = (
        Sine(
            amplitude_mm=float(rng.uniform(*amplitude)),
            period_s=float(rng.uniform(*period)),
            cycles=cycles,
        )
        for amplitude, period, cycles in ranges
    )
    return [(61.0, _follow(*sines))]


def _stairs(rng: np.random.Generator) -> Sequence[Part]:
    step = float(rng.uniform(1.2, 2.2)) * (1 if rng.random() < 0.5 else -1)
    stairs = (
        Staircase(step_mm=mm, steps=4, dwell_s=3.5, there_and_back=True) for mm in (step, -step)
    )
    return [(61.0, _follow(*stairs))]


def _mixed(rng: np.random.Generator) -> Sequence[Part]:
    return [
        (22.0, _wave(3.0, period_s=7.0)),
        (5.0, Idle()),
        (3.0, _current(x=float(rng.uniform(2, 3.5)))),
        (4.0, Idle()),
        (4.0, _current(px=1.0)),
        (3.0, _current(y=float(rng.uniform(2, 3.5)))),
        (4.0, _current(py=0.6)),
        (5.0, Idle()),
    ]


def _fixed(
    name: str, title: str, duration_s: float, *parts: Part, start_s: float = REST_S
) -> Timeline:
    """A timeline in which nothing is random."""
    return Timeline(name, title, duration_s, lambda rng: parts, start_s)


def _cycles(of: Callable[[float], Sequence[Part]], values: Iterable[float]) -> list[Part]:
    """The commands of a cycle for each of some values, one after the other."""
    return [part for value in values for part in of(value)]


def _wave(amplitude_mm: float, period_s: float = 8.0) -> Follow:
    return _follow(Sine(amplitude_mm=amplitude_mm, period_s=period_s, cycles=3))


def _ramp_x(rate_K_per_s: float) -> HoldTemperature:
    return HoldTemperature(spring="x", temperature_degC=52.0, rate_K_per_s=rate_K_per_s)


_WASH = _current(px=1.0, py=1.0)
_STAIRS_A = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
_EDGES = [(0.5, _current(x=3.5)), (0.5, _current(y=3.5))] * 4

ROUTINE: tuple[Timeline, ...] = (
    Timeline("pulses", "open-loop pulses of heat and water", 75.0, _pulses),
    Timeline("levels", "random displacement levels", 75.0, partial(_levels, 6.0, 4.0)),
    Timeline("sines", "sines of two amplitudes and periods", 75.0, _sines),
    Timeline("stairs", "displacement staircases", 75.0, _stairs),
    Timeline("mixed", "a sine, then open-loop pulses", 75.0, _mixed),
    Timeline("quick levels", "small quick levels", 75.0, partial(_levels, 3.0, 2.0)),
)
"""Everyday runs. The first families are for fitting, the last for holding out."""

CATALOGUE: tuple[Timeline, ...] = (
    _fixed("pump widths", "pump pulses of many widths on a warm spring", 60.0,
        *_cycles(lambda width: [(3.2, _current(x=3.2)), (width, _current(px=1.0)), (2.5, Idle())],
                 (0.2, 0.4, 0.8, 1.6, 3.2)),
        (3.0, _current(y=3.2)), (2.0, _current(py=0.5)), (3.0, Idle())),
    _fixed("current stairs", "current staircases against water", 65.0,
        *((2.5, _current(x=i, px=0.5)) for i in _STAIRS_A), (6.0, _current(px=1.0)),
        *((2.5, _current(y=i, py=0.5)) for i in _STAIRS_A), (6.0, _current(py=1.0))),
    _fixed("edges", "equal short edges at start and end", 75.0,
        *_EDGES, (12.0, _WASH), (40.0, Idle()), *_EDGES, (11.0, _WASH)),
    _fixed("two rates", "temperature ramps at two rates", 70.0,
        (28.0, _ramp_x(1.0)), (12.0, _current(px=1.0)),
        (8.0, _ramp_x(6.0)), (14.0, _current(px=1.0))),
    # One side after the other.
    _fixed("slow sweep", "low current through the transformation and back", 75.0,
        (24.0, _current(x=1.8)), (18.0, _current(x=0.3, px=0.15)),
        (14.0, _current(y=2.2)), (12.0, _current(y=0.3, py=0.2))),
    # Small reversals, then the same with both springs warm, at a higher preload.
    _fixed("two preloads", "reversals at two preloads", 75.0,
        (25.0, _wave(1.5)), (6.0, _WASH), (4.0, _current(x=2.6, y=2.6)), (3.0, Idle()),
        *[(3.0, _current(x=3.0, py=0.6)), (3.0, _current(y=3.0, px=0.6))] * 3, (6.0, _WASH)),
    # First-order reversal curves.
    _fixed("reversal curves", "partial cycles of growing depth", 60.0,
        *_cycles(lambda heat: [(heat, _current(x=3.4)), (2.5, _current(px=0.5)),
                               (heat, _current(x=3.4)), (5.0, _current(px=1.0))],
                 (1.5, 2.0, 2.5, 3.0))),
    # Plateaus, drift, cooling in air.
    _fixed("isotherm", "warm up, then rest", 70.0,
        (3.2, _current(x=3.6)), (24.0, Idle()), (3.2, _current(y=3.6)), (24.0, Idle()),
        (6.0, _WASH)),
    # Y must not notice more than the tendon.
    _fixed("one side", "one side driven, the other idle", 60.0,
        *_cycles(lambda _: [(3.0, _current(x=3.2)), (3.0, _current(px=1.0)), (3.0, Idle())],
                 range(6))),
    # The first cycle against the last.
    _fixed("repeats", "the same cycle many times", 75.0,
        *[(2.6, _current(x=3.6)), (3.6, _current(px=1.0))] * 11),
    _fixed("dry and wet", "the same motion without and with water", 75.0,
        (3.5, Tune(cooling="off")), (25.0, _wave(2.0)), (1.0, Idle()), (8.0, _WASH),
        (1.0, Tune(cooling="switch")), (25.0, _wave(2.0)), start_s=0.5),
    # Held at both ends, then let go: creep, slack, near-zero force.
    _fixed("long holds", "long holds at both ends", 65.0,
        (22.0, _follow(Step(displacement_mm=6.0, duration_s=22.0))),
        (22.0, _follow(Step(displacement_mm=-6.0, duration_s=22.0))), (10.0, _WASH)),
)  # fmt: skip
"""Experiments to tell confused causes apart."""

_BY_NAME = {t.name: t for t in (*ROUTINE, *CATALOGUE)}


def plan_named(name: str, seed: int) -> Plan:
    """An experiment as a plan, which a bench or a simulated one carries out.

    Raises GapError for a name that is not in the catalogue.
    """
    timeline = timeline_named(name)
    actions: list[Action] = []
    now = 0.0
    for t_s, command in timeline.commands(seed):
        if t_s > now:
            actions.append(Pause(t_s - now))
            now = t_s
        actions.append(Do(command))
    if timeline.duration_s > now:
        actions.append(Pause(timeline.duration_s - now))
    return Plan(f"gap {timeline.name}", tuple(actions))


def timeline_named(name: str) -> Timeline:
    """The experiment of that name. Raises GapError for one that is not in the catalogue."""
    if name not in _BY_NAME:
        raise GapError(
            "there is no such experiment in the catalogue",
            value=name,
            action=instead(name, _BY_NAME, "smad gap next lists them"),
        )
    return _BY_NAME[name]


def catalogue_lines() -> list[str]:
    """All runs with their durations and what they do, under two headings."""
    lines = []
    for heading, timelines in (
        ("everyday runs, to fit on and to judge on", ROUTINE),
        ("to tell causes apart", CATALOGUE),
    ):
        lines.append(f"{heading}:")
        lines += [f"  {t.name:<16} {t.duration_s:>4.0f} s  {t.title}" for t in timelines]
    return lines
