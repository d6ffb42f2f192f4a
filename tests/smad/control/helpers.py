"""Samples and runs for the tests of the control: no plant, only what the controller sees."""

from collections.abc import Callable, Iterable

import msgspec

from smad.control.controller import Controller
from smad.control.sample import Sample
from smad.control.setpoint import Output

PERIOD_US = 10_000


def sample(k: int = 0, **changes: object) -> Sample:
    """Sample number `k` at 100 Hz of an armed, cold pair at rest."""
    at_rest = Sample(
        t_us=k * PERIOD_US,
        tick=k & 0xFFFF,
        armed=True,
        displacement_m=0.0,
        force_N=1.24,
        rtd_degC=(25.0, 25.0, 26.85, 26.85),
    )
    return msgspec.structs.replace(at_rest, **changes)


def drive(
    controller: Controller,
    samples: Iterable[int],
    displacement_m: Callable[[int], float] = lambda k: 0.0,
    **changes: object,
) -> list[Output]:
    """Step through the numbered samples, displaced as told."""
    return [
        controller.step(sample(k, displacement_m=displacement_m(k), **changes)) for k in samples
    ]
