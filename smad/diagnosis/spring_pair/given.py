"""What a run gives to every replay of it, and what a model point gives to every run.

A fit replays a run thousands of times, and a point on every run: what depends on one of the two
only is worked out once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from sim_device.plant import ParameterSet
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.laws import Law
from sim_device.plant.replay import Inputs
from sim_device.plant.setup import Setup
from smad.diagnosis.plant import Array, EffectValues, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import signals
from smad.diagnosis.spring_pair.recent import Recent

_ZERO_C = 273.15
_SURROUNDINGS_S = 2.0
_MOVES_CURRENT = frozenset(e.name for e in EFFECTS if "current" in e.signals)
_ENVIRONMENT = {
    "water_temperature": "rtd_inlet_degC",
    "ambient_temperature": "rtd_ambient_degC",
}
_OPTIONS = {"fixture": "antagonistic", "cooling": "water"}
_DRIVERS = 8


class PointReader(Protocol):
    """What the values of a model point mean on the spring pair."""

    @property
    def parameter_set(self) -> ParameterSet:
        """The nominal parameters."""

    @property
    def variant(self) -> str:
        """ "extended" or "printed"."""

    def set_of(self, theta: Mapping[str, float]) -> ParameterSet:
        """The parameter set with these values."""

    def acting(self, point: ModelPoint) -> dict[str, dict[str, float]]:
        """The effects of a point."""

    def within(self, effects: EffectValues) -> dict[str, dict[str, float]]:
        """Effect values moved into their ranges."""


class GivenPoint:
    """A model point as the kernel takes it. Raises PlantError where the plant refuses it."""

    def __init__(self, plant: PointReader, point: ModelPoint) -> None:
        self.variant, self.nominal = plant.variant, plant.parameter_set
        self.parameters = plant.set_of(point.theta)
        self.effects = plant.acting(point)
        self.laws: tuple[Law, ...] = point.laws
        self.zero_mm = point.theta.get("displacement_zero", 0.0)
        # Heat and voltage go with the resistance of each spring.
        self.root = {"x": 1.0, "y": (1.0 + point.theta.get("side_resistance", 0.0)) ** 0.5}
        self.moving = {k: v for k, v in self.effects.items() if k in _MOVES_CURRENT}

    @cached_property
    def setup(self) -> Setup:
        """Of the whole plant."""
        return self._setup(self.effects, self.laws)

    @cached_property
    def driver(self) -> Setup:
        """Of what moves the currents alone."""
        return self._setup(self.moving)

    def _setup(self, effects: EffectValues, laws: Sequence[Law] = ()) -> Setup:
        return Setup.make(
            self.parameters, variant=self.variant, effects=effects, laws=laws, **_OPTIONS
        )


@dataclass(frozen=True)
class FedCurrent:
    """The current that is fed to a run's replay, and how steady each spring's is in a sample.

    A voltage goes with the mean of a current, its heat with the mean square: `steadiness` is the
    ratio of the former to the root of the latter, by channel of voltage, where a run is thinned.
    """

    current_A: Array
    steadiness: Mapping[str, Array]


class GivenRun:
    """What is recorded of a run, as replays take it."""

    def __init__(self, run: GapRun) -> None:
        self.run = run
        self._inputs: dict[float, Inputs] = {}
        # Currents as they are fed, by the driver's currents that they were made of.
        self.currents: Recent[Mapping[str, Array], FedCurrent] = Recent(_DRIVERS)

    def inputs(self, point: GivenPoint) -> Inputs:
        """Inputs of a replay. Water and room start where the run measured them at its start.

        The two temperatures of the parameter set then act as corrections of those measurements.
        """
        root_y = point.root["y"]
        known = self._inputs.get(root_y)
        if known is None:
            known = self._recorded(root_y)
            self._inputs = {root_y: known}
        around = []
        for name, channel in _ENVIRONMENT.items():
            base = point.parameters[name]
            if channel in self._began:
                base += self._began[channel] + _ZERO_C - point.nominal[name]
            around.append(np.full(len(self.run.t_s), base))
        return known.surrounded(*around)

    def _recorded(self, root_y: float) -> Inputs:
        """The recorded inputs, the current of Y `root_y` times what was recorded."""
        run = self.run

        def both(stem: str) -> Array:
            return np.column_stack([np.asarray(run.inputs[stem.format(s)], float) for s in "xy"])

        return Inputs(
            run.t_s,
            i_A=both("i_applied_{}_A") * np.array([1.0, root_y]),
            pump_duty=np.clip(both("duty_{}"), 0.0, 1.0),
            drain=both("drain_{}") if "drain_x" in run.inputs and "drain_y" in run.inputs else None,
        )

    @cached_property
    def _began(self) -> dict[str, float]:
        """What inlet and room showed in the first second, where they were measured."""
        start = max(1, round(1.0 / max(self.run.dt_s, 1e-6)))
        shown = self.run.outputs
        return {c: float(np.median(shown[c][:start])) for c in _ENVIRONMENT.values() if c in shown}

    def surroundings(self, inputs: Inputs) -> Array | None:
        """Inlet and room as they were measured, if they were: what they did is not the wires'."""
        fed = []
        channels = _ENVIRONMENT.values()
        for channel, given in zip(channels, (inputs.inlet_K, inputs.ambient_K), strict=True):
            if channel not in self._began or given is None:
                return None
            fed.append(given + self._moved[channel] - self._began[channel])
        return np.clip(np.column_stack(fed), 230.0, 420.0)

    @cached_property
    def _moved(self) -> dict[str, Array]:
        run = self.run
        return {c: signals.smooth(run.outputs[c], run.dt_s, _SURROUNDINGS_S) for c in self._began}
