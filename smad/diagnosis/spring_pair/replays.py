"""Replays of a recorded run by a model point of the spring pair.

A fit replays a run thousands of times, and a point on every run. What depends on the run or the
point alone is computed once (`GivenRun`, `GivenPoint`) and cached.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from sim_device.plant import ParameterSet
from sim_device.plant.effects.registry import effect
from sim_device.plant.errors import SolverError
from sim_device.plant.replay import Inputs, Replay, trajectory
from sim_device.plant.setup import Setup
from sim_device.plant.start import Start
from sim_device.plant.units import ZERO_C
from smad.diagnosis.data.starts import corrected_starts
from smad.diagnosis.places.place import Forcing
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import TRAITS, means_over_pieces
from smad.diagnosis.spring_pair.steps import LONGEST_STEP_S, STEP_S, Steps

_OPTIONS = {"fixture": "antagonistic", "cooling": "water"}
_FAST_STEP_S = 1e-2
_KEPT = 64
"""Of so many effects and laws the starts of a run are kept; a fit moves the parameters beside them.
"""
_CORRECTIONS = 2
"""Each leaves the share of the error by which a sensor's gain is off: of a tenth, a hundredth."""
_RETRIES = (1.0, 0.1, 0.03)
"""Shares of the step to try: at a kink of the kinetics the kernel may find no solution."""
_READINGS = ("rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N")
_SENSORS = {
    "rtd_x_degC": ("reading_rtd", "x", 1.0),
    "rtd_y_degC": ("reading_rtd", "y", 1.0),
    "displacement_mm": ("reading_displacement", "both", 1e-3),
    "force_N": ("reading_force", "both", 1.0),
}
"""Place, side and SI unit of the sensor behind a channel, where it may lag, slip or creep."""
_OUTPUTS = ("i_x_A", "i_y_A", "v_x_V", "v_y_V", "rtd_inlet_degC", "rtd_ambient_degC", *_READINGS)


def _acts_on_sensors(*places: str) -> bool:
    """Whether one of these places is a sensor: nothing else changes what a start reads."""
    return any(place in places for place, _, _ in _SENSORS.values())


class PointReader(Protocol):
    """How the spring pair reads a model point (see `SmaPlant`)."""

    @property
    def parameter_set(self) -> ParameterSet: ...
    @property
    def variant(self) -> str: ...
    def set_of(self, theta: Mapping[str, float]) -> ParameterSet: ...
    def acting(self, point: ModelPoint) -> dict[str, dict[str, float]]: ...


class GivenPoint:
    """A model point as the kernel takes it. Raises PlantError where the plant refuses it."""

    def __init__(self, plant: PointReader, point: ModelPoint) -> None:
        self.variant, self.nominal = plant.variant, plant.parameter_set
        self.parameters, effects = plant.set_of(point.theta), plant.acting(point)
        self.setup = Setup.make(
            self.parameters, variant=self.variant, effects=effects, laws=point.laws, **_OPTIONS
        )
        self.zero_mm = point.theta.get("displacement_zero", 0.0)
        sensors = {name: v for name, v in effects.items() if _acts_on_sensors(*effect(name).places)}
        laws = [law for law in point.laws if _acts_on_sensors(law.place)]
        self.on_sensors = repr((sorted(sensors.items()), laws)) if sensors or laws else ""
        self.unmoved = partial(GivenPoint, plant, replace(point, theta={}))
        # Heat and voltage go with the resistance of each spring.
        self.root = {"x": 1.0, "y": (1.0 + point.theta.get("side_resistance", 0.0)) ** 0.5}


class GivenRun:
    """A recorded run, and its replays."""

    def __init__(self, run: GapRun, began: Mapping[str, float] | None = None) -> None:
        self.run = run
        environment = TRAITS.environment.values()
        self._began = run.at_start(environment) if began is None else began
        self._starts: dict[str, dict[str, float]] = {}

    def inputs(self, point: GivenPoint, steps: Steps | None = None) -> Inputs:
        """Inputs of a replay, a row for each sample, or for each of the `steps`.

        The pair starts where the run says, water and room where the run measured them at its start.
        The two temperatures of the parameter set then act as corrections of those measurements.
        """
        inputs = self.recorded if steps is None else steps.inputs
        inlet_K, ambient_K = (self._around(point, *pair) for pair in TRAITS.environment.items())
        starts = self.starts(point)
        more_N = starts.get("force_N", 0.0)
        x_K, y_K = (inlet_K + starts.get(name, 0.0) for name in ("rtd_x_degC", "rtd_y_degC"))
        start = Start(
            displacement_m=1e-3 * starts.get("displacement_mm", 0.0),
            tension_N=point.parameters["initial_force"] + more_N if more_N else None,
            wires_K=(x_K, y_K),
        )
        return inputs.surrounded(inlet_K, ambient_K, point.root["y"], start)

    def starts(self, point: GivenPoint) -> dict[str, float]:
        """Where the pair starts by channel, of the force how much more than as mounted.

        If the run says what it read there, that is less what effects and laws of a point add at
        the sensors, with the nominal parameters, and the encoder's zero. A forcing there adds
        nothing to a start.
        """
        if not self.run.starts_read:
            return dict(self.run.starts)
        starts = dict(self._without_zero(point) if point.on_sensors else self.run.starts)
        if "displacement_mm" in starts:
            starts["displacement_mm"] -= point.zero_mm
        return starts

    def _without_zero(self, point: GivenPoint) -> dict[str, float]:
        """What the run reads at its start, less what a point adds at the sensors; kept."""
        starts = self._starts.get(point.on_sensors)
        if starts is None:
            starts = self.less_sensors(point.unmoved())
            if len(self._starts) >= _KEPT:
                self._starts.clear()
            self._starts[point.on_sensors] = starts
        return starts

    def less_sensors(self, unmoved: GivenPoint) -> dict[str, float]:
        """What the run reads at its start, less what a point's effects and laws add there."""
        reads = self.run.starts
        first = replace(self.run.part(0, 2), whole=None, starts_read=False)
        starts = dict(reads)
        for _ in range(_CORRECTIONS):
            replayed = GivenRun(replace(first, starts=starts), self._began)
            outputs = replayed.forced(unmoved, {}, fast=True)
            shown = {name: float(column[0]) for name, column in outputs.items()}
            starts = corrected_starts(TRAITS, reads, starts, shown)
        return starts

    def offsets(self, t_s: Array) -> dict[tuple[str, str], Array]:
        """The forcing of the sensors by the run's offsets, at times (m,)."""
        given = self.run.as_recorded.offsets
        return {
            (place, side): unit * np.interp(t_s, *given[channel])
            for channel, (place, side, unit) in _SENSORS.items()
            if channel in given
        }

    def steps(self, forcing: Forcing) -> Steps:
        """The kernel's steps for the run under a forcing."""
        return Steps.of(self.recorded, list(forcing.values())) if forcing else self._unforced

    @cached_property
    def _unforced(self) -> Steps:
        return Steps.of(self.recorded)

    def _around(self, point: GivenPoint, name: str, channel: str) -> float:
        """Temperature of water or room in K, from a parameter and its RTD's channel."""
        value = point.parameters[name]
        if channel not in self._began:
            return value
        return value + (self._began[channel] + ZERO_C - point.nominal[name])

    @cached_property
    def recorded(self) -> Inputs:
        """Inputs with water and room as in the parameter set."""
        run = self.run

        def both(stem: str) -> Array:
            return np.column_stack([np.asarray(run.inputs[stem.format(s)], float) for s in "xy"])

        return Inputs(
            run.t_s,
            i_A=both("i_applied_{}_A"),
            pump_duty=np.clip(both("duty_{}"), 0.0, 1.0),
            drain=both("drain_{}") if "drain_x" in run.inputs and "drain_y" in run.inputs else None,
        )

    def forced(self, point: GivenPoint, forcing: Forcing, *, fast: bool) -> dict[str, Array]:
        """Channels under a forcing, (n,) each, under the names and in the units of the run log.

        A spring of another resistance is simulated with a current that gives the same heat; current
        and voltage are converted back.
        """
        result = self._solved(point, forcing, fast=fast)
        out = {f"i_meas_{s}_A": result[f"i_{s}_A"] / point.root[s] for s in "xy"}
        out |= {f"v_{s}_V": result[f"v_{s}_V"] * point.root[s] for s in "xy"}
        out |= {k: result[k] for k in result if k.startswith("rtd_")}
        out["force_N"] = result["force_N"]
        return out | {"displacement_mm": 1e3 * result["displacement_m"] + point.zero_mm}

    def trajectory(self, point: GivenPoint, *, fast: bool) -> dict[str, Array]:
        """All states that a law may depend on, (n,) each."""
        inputs = self.inputs(point)
        replay = Replay(inputs, variant=point.variant, forcing=self.offsets(inputs.t_s))
        return trajectory(replay, point.setup, dt_s=self._quick_s if fast else STEP_S)

    @property
    def _quick_s(self) -> float:
        """One step a sample, jittered ones too."""
        return max(_FAST_STEP_S, 1.5 * self.run.dt_s)

    def _solved(self, point: GivenPoint, forcing: Forcing, *, fast: bool) -> dict[str, Array]:
        """Outputs of the plant, those of a thinned run as means over its samples.

        Currents are in force over a sample already, and voltages go with their means.
        """
        steps, dt_s = None if fast else self.steps(forcing), self._quick_s
        if steps is not None:
            dt_s = LONGEST_STEP_S
            forcing = {key: np.asarray(series)[steps.sample] for key, series in forcing.items()}
        inputs = self.inputs(point, steps)
        offsets = self.offsets(inputs.t_s)
        forcing = {**forcing, **{key: x + forcing.get(key, 0.0) for key, x in offsets.items()}}
        replay = Replay(inputs, variant=point.variant, forcing=forcing, outputs=_OUTPUTS)
        for share in _RETRIES:
            try:
                result = replay.run_setup(point.setup, dt_s=share * dt_s)
            except SolverError as error:
                failed = error
            else:
                result = result if steps is None else steps.at_samples(result)
                if self.run.whole is None:
                    return result
                return result | {k: means_over_pieces(self.run, result[k]) for k in _READINGS}
        raise failed
