"""The random commands of the soak: one way to draw for each row of the table of commands."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from msgspec import Struct

from smad import api
from smad.control.commands import (
    Chirp,
    DriveCurrent,
    Follow,
    FollowInputs,
    Hold,
    HoldTemperature,
    Idle,
    MoveStage,
    Ramp,
    RandomLevels,
    Samples,
    Sine,
    Spring,
    Staircase,
    Step,
    Trajectory,
    Tune,
)

Draw = Callable[[random.Random], Struct]
_LONGEST_S = 8.0
_REACH_MM = 10.0


@dataclass(frozen=True)
class Drawn:
    """How often a command comes, relative to the others, and how its parameters are drawn."""

    weight: float
    draw: Draw


def _seconds(rng: random.Random) -> float:
    return round(rng.uniform(0.3, _LONGEST_S), 3)


def _place(rng: random.Random) -> float:
    return round(rng.uniform(-_REACH_MM, _REACH_MM), 3)


def _spring(rng: random.Random) -> Spring:
    return rng.choice(("x", "y"))


def _trajectory(rng: random.Random) -> Trajectory:
    size_mm = round(rng.uniform(0.2, 5.0), 3)
    kinds: tuple[Callable[[], Trajectory], ...] = (
        lambda: Step(displacement_mm=_place(rng), duration_s=_seconds(rng)),
        lambda: Hold(duration_s=_seconds(rng)),
        lambda: Ramp(displacement_mm=_place(rng), rate_mm_per_s=round(rng.uniform(0.5, 10.0), 3)),
        lambda: Sine(
            amplitude_mm=size_mm, period_s=round(rng.uniform(2.0, 8.0), 3), cycles=rng.randint(1, 2)
        ),
        lambda: Chirp(amplitude_mm=size_mm / 2, start_Hz=0.1, end_Hz=0.4, duration_s=_seconds(rng)),
        lambda: Staircase(step_mm=size_mm / 4, steps=rng.randint(1, 4), dwell_s=0.5),
        lambda: RandomLevels(
            amplitude_mm=size_mm, levels=rng.randint(1, 6), dwell_s=0.5, seed=rng.randrange(2**32)
        ),
        lambda: Samples(t_s=(0.0, 1.0, 2.5), displacement_mm=(0.0, size_mm, 0.0)),
    )
    return rng.choice(kinds)()


def _follow(rng: random.Random) -> Follow:
    pieces = tuple(_trajectory(rng) for _ in range(rng.randint(1, 3)))
    return Follow(trajectories=pieces, queue=rng.random() < 0.3)


def _heat(rng: random.Random) -> HoldTemperature:
    return HoldTemperature(
        spring=_spring(rng),
        temperature_degC=round(rng.uniform(30.0, 78.0), 2),
        rate_K_per_s=rng.choice((None, round(rng.uniform(0.5, 10.0), 2))),
        duration_s=_seconds(rng),
    )


def _current(rng: random.Random) -> DriveCurrent:
    amperes = round(rng.uniform(0.0, 4.0), 3)
    heats_x = rng.random() < 0.5
    duty = round(rng.uniform(0.3, 1.0), 2) if rng.random() < 0.5 else 0.0
    return DriveCurrent(
        i_x_A=amperes if heats_x else 0.0,
        i_y_A=0.0 if heats_x else amperes,
        pump_x_duty=duty,
        pump_y_duty=duty,
        duration_s=_seconds(rng),
    )


def _inputs(rng: random.Random) -> FollowInputs:
    rows = rng.randint(1, 200)
    return FollowInputs(
        t_s=tuple(0.01 * k for k in range(rows)),
        end_s=0.01 * rows,
        i_x_A=(round(rng.uniform(0.0, 2.0), 3),) * rows,
        i_y_A=(0.0,) * rows,
        pump_x_duty=(0.0,) * rows,
        pump_y_duty=(round(rng.random(), 3),) * rows,
    )


def _tune(rng: random.Random) -> Tune:
    return Tune(
        kp_A_per_mm=round(rng.uniform(5.0, 20.0), 3),
        cooling=rng.choice(("switch", "proportional")),
        feedforward=rng.random() < 0.5,
    )


def _parameter(rng: random.Random) -> api.SetParam:
    # Tightened by a little: a limit that nothing here comes near.
    return api.SetParam(name="on_time_limit_s", value=float(rng.randint(20_000, 21_600)))


DRAWN: dict[str, Drawn] = {
    "status": Drawn(1.0, lambda rng: api.GetStatus()),
    "motion": Drawn(1.0, lambda rng: api.GetMotion()),
    "config": Drawn(0.3, lambda rng: api.GetConfig()),
    "timing.reset": Drawn(0.2, lambda rng: api.ResetTiming()),
    "arm": Drawn(3.0, lambda rng: api.Arm()),
    "disarm": Drawn(0.4, lambda rng: api.Disarm()),
    "estop": Drawn(0.0, lambda rng: api.EStop()),
    "clear": Drawn(1.0, lambda rng: api.Clear()),
    "move": Drawn(8.0, _follow),
    "together": Drawn(0.5, lambda rng: api.Together(moves={"": (_trajectory(rng),)})),
    "heat": Drawn(3.0, _heat),
    "current": Drawn(3.0, _current),
    "inputs": Drawn(0.5, _inputs),
    "stage": Drawn(
        0.2, lambda rng: MoveStage(stage_mm=round(rng.uniform(0.0, 5.0), 2), rate_mm_per_s=5.0)
    ),
    "idle": Drawn(1.0, lambda rng: Idle()),
    "tune": Drawn(1.0, _tune),
    "params.list": Drawn(0.3, lambda rng: api.ListParams()),
    "params.get": Drawn(0.3, lambda rng: api.GetParam(name="current_limit_mA")),
    "params.set": Drawn(0.5, _parameter),
    "params.save": Drawn(0.2, lambda rng: api.SaveParams()),
    "record.start": Drawn(0.1, lambda rng: api.StartRecording(name="again")),
    "record.stop": Drawn(0.0, lambda rng: api.StopRecording()),
    "record.note": Drawn(2.0, lambda rng: api.AddNote(text=f"soak note {rng.randrange(2**32)}")),
    "record.last": Drawn(0.2, lambda rng: api.RecordLast(seconds=rng.uniform(1.0, 60.0))),
    "control.take": Drawn(0.3, lambda rng: api.TakeControl(name="soak", lease_s=60.0)),
    "control.release": Drawn(0.5, lambda rng: api.ReleaseControl()),
}
"""By method. ESTOP and the end of the run log come at their own times, not by chance."""


SAFE_ONLY = ("params.set", "params.save")


def draw_command(rng: random.Random, among: Sequence[str] = tuple(DRAWN)) -> Struct:
    """One command, drawn by the weights."""
    (name,) = rng.choices(among, [DRAWN[name].weight for name in among])
    return DRAWN[name].draw(rng)
