"""The spring pair's views of a run: passes of the kernel, each fed what was measured beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from sim_device.plant import ParameterSet
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.errors import SolverError
from sim_device.plant.replay import Inputs, Replay
from sim_device.plant.setup import Setup
from smad.gap import sma_signals
from smad.gap.plant import Array, ModelPoint
from smad.gap.runs import GapRun

if TYPE_CHECKING:
    from smad.gap.sma import SmaPlant

_ZERO_C = 273.15
_STEP_S = 5e-3
_FAST_STEP_S = 1e-2
_MOST_KEPT = 120
_RETRIES = ((0.0, 1.0), (3e-3, 1.0), (-3e-3, 1.0), (1e-2, 0.5), (0.0, 0.2))
_MOVES_CURRENT = frozenset(e.name for e in EFFECTS if "current" in e.signals)
_DRIVER = ("i_x_A", "i_y_A", "true_i_x_A", "true_i_y_A")
_INNOVATION_S = 0.3
_SURROUNDINGS_S = 2.0
_ENVIRONMENT = {"inlet_K": "water_temperature", "ambient_K": "ambient_temperature"}


class Passes:
    """The passes of the kernel that the views need, each made once for one model point."""

    def __init__(self, plant: SmaPlant, point: ModelPoint, run: GapRun, fast: bool) -> None:
        self.run, self.variant = run, plant.variant
        self.whole = run if run.whole is None else run.whole
        self.steadiness: dict[str, Array] = {}
        # A jittered sample must not cost a second step.
        self.dt_s = max(_FAST_STEP_S, 1.5 * run.dt_s) if fast else _STEP_S
        self.kept = plant.kept
        self.parameters = plant.set_of(point.theta)
        self.effects = plant.acting(point)
        self.zero_mm = point.theta.get("displacement_zero", 0.0)
        # Heat and voltage go with the resistance of each spring.
        self.root = {"x": 1.0, "y": (1.0 + point.theta.get("side_resistance", 0.0)) ** 0.5}
        self.set = plant.parameter_set
        self.inputs = _inputs_of(run, self.parameters, self.set, self.root)
        self.setup: Setup | None = None

    def views(self, names: Sequence[str]) -> dict[str, Array]:
        out: dict[str, Array] = {}
        if "open" in names:
            out |= {f"open:{k}": v for k, v in self._measured(self._pass({})).items()}
        if not set(names) - {"open"}:
            return out
        commanded = self._driver()
        if "actuator" in names:
            means = {s: self._over_samples(commanded[f"i_{s}_A"]) for s in "xy"}
            out |= {f"actuator:i_meas_{s}_A": means[s] / self.root[s] for s in "xy"}
        if not {"thermal", "electrical", "mechanics", "phase"} & set(names):
            return out
        feeds = self._surroundings()
        if all(f"i_meas_{s}_A" in self.run.outputs for s in "xy"):
            feeds["i_A"] = self._fed_current(commanded)
        heated = self._pass(feeds)
        if "thermal" in names:
            shown = self._measured(heated)
            out |= {f"thermal:{k}": v for k, v in shown.items() if k.startswith("rtd")}
        if not {"electrical", "mechanics", "phase"} & set(names):
            return out
        feeds["temperature_K"] = self._fed_temperature(heated)
        warmed = self._pass(feeds)
        shown = self._measured(warmed)
        out |= {f"electrical:{k}": shown[k] for k in ("v_x_V", "v_y_V")}
        out |= {f"mechanics:{k}": shown[k] for k in ("displacement_mm", "force_N")}
        if "phase" in names and "displacement_mm" in self.run.outputs:
            feeds["displacement_m"] = self._fed_displacement(warmed)
            held = self._pass(feeds)
            # What stands between the springs (friction, drag) pulls them apart by as much as the
            # free model says, and a sensor that sits on one side reads as much of that.
            apart = 0.5 * (warmed["spring_force_x_N"] - warmed["spring_force_y_N"])
            assert self.setup is not None, "a pass has been made"
            off = held["spring_force_x_N"] - held["spring_force_y_N"] - 2.0 * apart
            sensor = held["force_N"] - held["true_force_N"] - self.setup.reads_x * off
            out["phase:X"] = held["spring_force_x_N"] - apart + sensor
            out["phase:Y"] = held["spring_force_y_N"] + apart + sensor
        return out

    def _measured(self, result: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs of the plant under the names and units of the run log.

        A spring of another resistance is run with a current that makes its heat, and shows the
        current and the voltage that belong to that.
        """
        out = {f"i_meas_{s}_A": result[f"i_{s}_A"] / self.root[s] for s in "xy"}
        out |= {f"v_{s}_V": result[f"v_{s}_V"] * self.root[s] for s in "xy"}
        out |= {k: result[k] for k in result if k.startswith("rtd_")}
        out["force_N"] = result["force_N"]
        return out | {"displacement_mm": 1e3 * result["displacement_m"] + self.zero_mm}

    def _pass(self, feeds: Mapping[str, Array]) -> dict[str, Array]:
        """One kernel call. A fed temperature that rests on a kink of the kinetics can leave the
        kernel without a solution; a few millikelvin, or another step, take it off the kink."""
        for nudge_K, share in _RETRIES:
            nudged = dict(feeds)
            if "temperature_K" in feeds:
                nudged["temperature_K"] = feeds["temperature_K"] + nudge_K
            replay = Replay(self.inputs, variant=self.variant, feeds=nudged, outputs=_KEPT)
            if self.setup is None:
                self.setup = replay.setup(self.parameters, self.effects)
            try:
                return self._as_sampled(replay.run_setup(self.setup, dt_s=share * self.dt_s))
            except SolverError as error:
                failed = error
        raise failed

    def _as_sampled(self, result: dict[str, Array]) -> dict[str, Array]:
        """What is compared with a thinned run's samples, as means over them.

        Currents are in force over a sample already, and voltages go with their means; true values
        are fed on, and stay those of its end.
        """
        if self.whole is self.run:
            return result
        means = {k: sma_signals.means_over_pieces(self.run, result[k]) for k in _AVERAGED}
        return result | means | {k: result[k] * share for k, share in self.steadiness.items()}

    def _between(self, shown: Array, predicted: Array, tau_s: float) -> Array:
        """What a measurement adds to the prediction, smoothed, at the ends of the samples."""
        off = sma_signals.smooth(shown - predicted, self.run.dt_s, tau_s)
        return sma_signals.at_ends_of_pieces(self.run, off)

    def _driver(self) -> dict[str, Array]:
        """Currents, true and measured. Few points move them, so that they are kept by run.

        A driver answers within milliseconds: of a thinned run they are those of the whole run.
        """
        moving = {k: v for k, v in self.effects.items() if k in _MOVES_CURRENT}
        whole = self.whole
        key = (
            id(whole), self.variant, self.parameters["current_max"], self.root["y"],
            tuple((k, *v.items()) for k, v in moving.items()),
        )  # fmt: skip
        known = self.kept.get(key)
        if known is None or known[0] is not whole:
            inputs = _inputs_of(whole, self.parameters, self.set, self.root)
            # A driver knows neither heat nor force: with both given there is little to solve.
            n = len(whole.t_s)
            rest = {
                "temperature_K": np.full((n, 2), self.parameters["water_temperature"]),
                "force_N": np.full(n, self.parameters["initial_force"]),
            }
            replay = Replay(inputs, variant=self.variant, feeds=rest, outputs=_DRIVER)
            known = (whole, replay.run(self.parameters, moving, dt_s=1.5 * whole.dt_s))
            while len(self.kept) >= _MOST_KEPT:
                self.kept.pop(next(iter(self.kept), key), None)
            self.kept[key] = known
        return known[1]

    def _over_samples(self, values: Array) -> Array:
        """Means over the samples of a thinned run, of values at the pace of the whole one."""
        if self.whole is self.run:
            return values
        starts = np.r_[0, np.cumsum(self.run.pieces[:-1])].astype(np.intp)
        return np.asarray(np.add.reduceat(values, starts) / self.run.pieces)

    def _fed_current(self, commanded: Mapping[str, Array]) -> Array:
        """The driver's true current under this model, plus what the measurement adds to it.

        Over the samples of a thinned run, that which heats as much; the voltage is then smaller
        than it would be with as steady a current (`_as_sampled`).
        """
        fed = []
        for s in "xy":
            measured = np.asarray(self.whole.outputs[f"i_meas_{s}_A"], dtype=np.float64)
            off = self.root[s] * measured - commanded[f"i_{s}_A"]
            current = np.maximum(commanded[f"true_i_{s}_A"] + off, 0.0)
            heating = np.sqrt(self._over_samples(np.square(current)))
            if self.whole is not self.run:
                steady = np.maximum(heating, 1e-12)
                self.steadiness[f"v_{s}_V"] = self._over_samples(current) / steady
            fed.append(heating)
        return np.column_stack(fed)

    def _surroundings(self) -> dict[str, Array]:
        """Inlet and room as they were measured, if they were: what they did is not the wires'."""
        fed = []
        for name, given in (("inlet", self.inputs.inlet_K), ("ambient", self.inputs.ambient_K)):
            channel = self.run.outputs.get(f"rtd_{name}_degC")
            if channel is None or given is None:
                return {}
            start = _start(self.run)
            moved = sma_signals.smooth(channel, self.run.dt_s, _SURROUNDINGS_S)
            fed.append(given + moved - float(np.median(channel[:start])))
        return {"surroundings_K": np.clip(np.column_stack(fed), 230.0, 420.0)}

    def _fed_temperature(self, heated: Mapping[str, Array]) -> Array:
        fed = []
        for s in "xy":
            off = self._between(
                self.run.outputs[f"rtd_{s}_degC"], heated[f"rtd_{s}_degC"], _INNOVATION_S
            )
            fed.append(heated[f"T_{s}_K"] + off)
        return np.clip(np.column_stack(fed), 230.0, 420.0)

    def _fed_displacement(self, warmed: Mapping[str, Array]) -> Array:
        shown = 1e-3 * (self.run.outputs["displacement_mm"] - self.zero_mm)
        off = self._between(shown, warmed["displacement_m"], 0.1)
        return np.clip(warmed["true_displacement_m"] + off, -0.024, 0.024)


_KEPT = (
    "i_x_A", "i_y_A", "v_x_V", "v_y_V", "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC",
    "rtd_ambient_degC", "displacement_m", "force_N", "true_displacement_m", "true_force_N",
    "true_i_x_A", "true_i_y_A", "T_x_K", "T_y_K", "spring_force_x_N", "spring_force_y_N",
)  # fmt: skip
_AVERAGED = (
    "rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N", "true_force_N",
    "spring_force_x_N", "spring_force_y_N",
)  # fmt: skip


def _start(run: GapRun) -> int:
    """Samples of the first second."""
    return max(1, round(1.0 / max(run.dt_s, 1e-6)))


def _inputs_of(
    run: GapRun, parameters: ParameterSet, nominal: ParameterSet, root: Mapping[str, float]
) -> Inputs:
    """Inputs of a replay. Water and room start where the run measured them at its start.

    The two temperatures of the parameter set then act as corrections of those measurements.
    """
    n = len(run.t_s)
    start = _start(run)
    environment = {}
    for argument, name in _ENVIRONMENT.items():
        channel = "rtd_inlet_degC" if argument == "inlet_K" else "rtd_ambient_degC"
        base = parameters[name]
        if channel in run.outputs:
            base += float(np.median(run.outputs[channel][:start])) + _ZERO_C - nominal[name]
        environment[argument] = np.full(n, base)

    def both(stem: str) -> Array:
        return np.column_stack([np.asarray(run.inputs[stem.format(s)], float) for s in "xy"])

    return Inputs(
        run.t_s,
        i_A=both("i_applied_{}_A") * np.array([root["x"], root["y"]]),
        pump_duty=np.clip(both("duty_{}"), 0.0, 1.0),
        drain=both("drain_{}") if "drain_x" in run.inputs and "drain_y" in run.inputs else None,
        **environment,
    )
