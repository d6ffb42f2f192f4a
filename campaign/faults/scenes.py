"""What the bench is doing when something breaks."""

from __future__ import annotations

from dataclasses import dataclass

from smad.control.commands import (
    DriveCurrent,
    Follow,
    HoldTemperature,
    ModeCommand,
    Sine,
)

FLUSH_HEAT_S = 12.0
FLUSH_PERIOD_S = 40.0


@dataclass(frozen=True)
class Scene:
    """A run of commands: (seconds after arming, command). `onset_s` is when faults begin."""

    name: str
    text: str
    script: tuple[tuple[float, ModeCommand], ...]
    cooling: str = "water"
    onset_s: tuple[float, float] = (1.0, 8.0)


def _flushing() -> tuple[tuple[float, ModeCommand], ...]:
    heat, flush = DriveCurrent(i_x_A=4.0), DriveCurrent(pump_x_duty=1.0)
    return tuple(
        pair
        for n in range(3)
        for pair in (
            (n * FLUSH_PERIOD_S, heat),
            (n * FLUSH_PERIOD_S + FLUSH_HEAT_S, flush),
        )
    )


SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        Scene("heating", "4 A in spring X, still water", ((0.0, DriveCurrent(i_x_A=4.0)),)),
        Scene(
            "water",
            "4 A in spring X, its pump full on",
            ((0.0, DriveCurrent(i_x_A=4.0, pump_x_duty=1.0)),),
            onset_s=(2.0, 12.0),
        ),
        Scene("air", "2 A in spring X, bare wires", ((0.0, DriveCurrent(i_x_A=2.0)),), "air"),
        Scene(
            "holding",
            "spring X held at 60 °C",
            ((0.0, HoldTemperature(spring="x", temperature_degC=60.0)),),
            onset_s=(2.0, 15.0),
        ),
        Scene(
            "sine",
            "10 mm sinusoid, 10 s, pumps by the switch",
            ((0.0, Follow(trajectories=(Sine(amplitude_mm=10.0, period_s=10.0, cycles=30),))),),
            onset_s=(2.0, 15.0),
        ),
        Scene("flushing", "12 s of 4 A, then its pump full on for 28 s, again", _flushing()),
    )
}
