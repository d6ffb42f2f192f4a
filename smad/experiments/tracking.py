"""Tracking a sinusoid: the run, its score, and the controls that are compared."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from smad.control.commands import Follow, Sine, Tune
from smad.control.metrics import peak, r2_by_period, tracking_r2
from smad.control.plan import Cooling, Do, Mark, Plan, UntilDone
from smad.experiments.base import PAPER_CONTROL, Experiment, Options
from smad.experiments.driver import Mounting
from smad.experiments.recording import Recording


@dataclass(frozen=True)
class Control:
    """One way to control: its name on plots, what is tuned, and in which medium."""

    name: str
    tune: Tune
    cooling: Cooling = "water"


def _paper_with(**changes: bool) -> Tune:
    assert isinstance(PAPER_CONTROL.command, Tune)
    return msgspec.structs.replace(PAPER_CONTROL.command, **changes)


CONTROLS: Mapping[str, Control] = {
    "water": Control("PI, water", _paper_with()),
    "air": Control("PI, air", _paper_with(), "air"),
    "drain": Control("PI, drained", _paper_with(drain_before_heating=True)),
    "feedforward": Control("feed-forward", _paper_with(feedforward=True)),
    "both": Control(
        "feed-forward, drained", _paper_with(feedforward=True, drain_before_heating=True)
    ),
}
"""The paper's two, and what goes beyond it."""


class SineOptions(Options, frozen=True, kw_only=True):
    """Settings that all experiments with sinusoids share."""

    air: Annotated[bool, Meta(description="also in air; needs springs without cooling module")] = (
        True
    )
    beyond: Annotated[bool, Meta(description="also with feed-forward and draining")] = True


S = TypeVar("S", bound=SineOptions)


class SineExperiment(Experiment[S]):
    """Follows sinusoids with each of `CONTROLS` that the settings do not leave out."""

    needs = frozenset({"displacement_mm", "rtd_x_degC", "rtd_y_degC"})

    def controls(self) -> tuple[str, ...]:
        """Names of the controls that are compared."""
        return (
            "water",
            *(("air",) if self.options.air else ()),
            *(("feedforward", "drain", "both") if self.options.beyond else ()),
        )

    def requirements(self) -> frozenset[str]:
        return self.needs | ({"drain"} if self.options.beyond else set())

    def mountings(self) -> frozenset[Mounting]:
        return frozenset(Mounting(cooling=CONTROLS[name].cooling) for name in self.controls())


def sine_plan(
    name: str, control: Control, amplitude_mm: float, period_s: float, cycles: int
) -> Plan:
    """A sinusoid from rest under one of the controls."""
    sine = Sine(amplitude_mm=amplitude_mm, period_s=period_s, cycles=cycles)
    return Plan(
        name,
        (
            Do(control.tune),
            Mark("sine"),
            Do(Follow(trajectories=(sine,))),
            UntilDone(cycles * period_s + 10.0),
            Mark("end"),
        ),
        cooling=control.cooling,
    )


@dataclass(frozen=True)
class Score:
    """How well a sinusoid was followed. `r2` leaves the first cycle out, which starts from rest."""

    r2: float
    r2_all: float
    by_period: tuple[float, ...]
    peak_degC: float
    peak_A: float


def score_of(recording: Recording, period_s: float) -> Score:
    """The score of a run of `sine_plan`."""
    part = recording.between("sine", "end")
    t, reference, actual = part.t_s, part["reference_mm"], part["displacement_mm"]
    later = t > t[0] + period_s
    return Score(
        tracking_r2(reference[later], actual[later]),
        tracking_r2(reference, actual),
        tuple(r2_by_period(t, reference, actual, period_s)),
        peak(np.maximum(part["rtd_x_degC"], part["rtd_y_degC"])),
        peak(np.maximum(part["i_applied_x_A"], part["i_applied_y_A"])),
    )
