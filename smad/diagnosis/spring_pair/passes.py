"""The spring pair's views of a run: passes of the kernel, each fed what was measured beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim_device.plant.errors import SolverError
from sim_device.plant.replay import DRIVEN, Replay, drivers, trajectory
from smad.diagnosis.places.place import Forcing
from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import signals
from smad.diagnosis.spring_pair.given import FedCurrent, GivenPoint, GivenRun
from smad.diagnosis.spring_pair.recent import Recent

# Two steps a sample at 100 Hz, jittered ones too. One is too few for a current that chatters.
_STEP_S = 6e-3
_FAST_STEP_S = 1e-2
_MOST_KEPT = 120
_RETRIES = ((0.0, 1.0), (3e-3, 1.0), (-3e-3, 1.0), (1e-2, 0.5), (0.0, 0.2))
_INNOVATION_S = 0.3


KeptDrivers = dict[Any, tuple[GapRun, dict[str, Array]]]
"""Driver currents of whole runs, beside the run whose identity is in the key."""


class Passes:
    """The passes of the kernel that the views need, each made once for one model point.

    What is kept of `runs` and `kept` saves a second calculation.
    """

    def __init__(
        self,
        given: GivenPoint,
        run: GapRun,
        fast: bool,
        runs: Recent[GapRun, GivenRun],
        kept: KeptDrivers,
    ) -> None:
        self.given, self.run, self.runs, self.kept = given, run, runs, kept
        self.whole = run if run.whole is None else run.whole
        self.steadiness: Mapping[str, Array] = {}
        # A jittered sample must not cost a second step.
        self.dt_s = max(_FAST_STEP_S, 1.5 * run.dt_s) if fast else _STEP_S
        self.root = given.root
        self.recorded = self._given_run(run)
        self.inputs = self.recorded.inputs(given)

    def _given_run(self, run: GapRun) -> GivenRun:
        return self.runs.of(run, lambda: GivenRun(run))

    def views(self, names: Sequence[str]) -> dict[str, Array]:
        out: dict[str, Array] = {}
        if "open" in names:
            out |= {f"open:{k}": v for k, v in self._measured(self._pass({}, _OPEN)).items()}
        if not set(names) - {"open"}:
            return out
        commanded = self._driver()
        if "actuator" in names:
            means = {s: self._over_samples(commanded[f"i_{s}_A"]) for s in "xy"}
            out |= {f"actuator:i_meas_{s}_A": means[s] / self.root[s] for s in "xy"}
        if not {"thermal", "electrical", "mechanics", "phase"} & set(names):
            return out
        around = self.recorded.surroundings(self.inputs)
        feeds = {} if around is None else {"surroundings_K": around}
        if all(f"i_meas_{s}_A" in self.run.outputs for s in "xy"):
            fed = self.recorded.currents.of(commanded, lambda: self._fed_current(commanded))
            feeds["i_A"], self.steadiness = fed.current_A, fed.steadiness
        heated = self._pass(feeds, _HEATED)
        if "thermal" in names:
            out |= {f"thermal:{k}": heated[k] for k in heated if k.startswith("rtd_")}
        if not {"electrical", "mechanics", "phase"} & set(names):
            return out
        feeds["temperature_K"] = self._fed_temperature(heated)
        warmed = self._pass(feeds, _WARMED)
        out |= {f"electrical:{k}": v for k, v in self._voltages(warmed).items()}
        out["mechanics:displacement_mm"] = self._shown_mm(warmed)
        out["mechanics:force_N"] = warmed["force_N"]
        if "phase" in names and "displacement_mm" in self.run.outputs:
            feeds["displacement_m"] = self._fed_displacement(warmed)
            held = self._pass(feeds, _HELD)
            # What stands between the springs (friction, drag) pulls them apart by as much as the
            # free model says, and a sensor that sits on one side reads as much of that.
            apart = 0.5 * (warmed["spring_force_x_N"] - warmed["spring_force_y_N"])
            off = held["spring_force_x_N"] - held["spring_force_y_N"] - 2.0 * apart
            sensor = held["force_N"] - held["true_force_N"] - self.given.setup.reads_x * off
            out["phase:X"] = held["spring_force_x_N"] - apart + sensor
            out["phase:Y"] = held["spring_force_y_N"] + apart + sensor
        return out

    def forced(self, forcing: Forcing) -> dict[str, Array]:
        """Channels in open loop under a forcing."""
        return self._measured(self._pass({}, _OPEN, forcing))

    def trajectory(self) -> dict[str, Array]:
        """All states that a law may depend on, in open loop."""
        replay = Replay(self.inputs, variant=self.given.variant)
        return trajectory(replay, self.given.setup, dt_s=self.dt_s)

    def _measured(self, result: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs of the plant under the names and units of the run log.

        A spring of another resistance is run with a current that makes its heat, and shows the
        current and the voltage that belong to that.
        """
        out = {f"i_meas_{s}_A": result[f"i_{s}_A"] / self.root[s] for s in "xy"}
        out |= self._voltages(result)
        out |= {k: result[k] for k in result if k.startswith("rtd_")}
        out["force_N"] = result["force_N"]
        return out | {"displacement_mm": self._shown_mm(result)}

    def _voltages(self, result: Mapping[str, Array]) -> dict[str, Array]:
        return {f"v_{s}_V": result[f"v_{s}_V"] * self.root[s] for s in "xy"}

    def _shown_mm(self, result: Mapping[str, Array]) -> Array:
        return 1e3 * result["displacement_m"] + self.given.zero_mm

    def _pass(
        self,
        feeds: Mapping[str, Array],
        outputs: tuple[str, ...],
        forcing: Forcing | None = None,
    ) -> dict[str, Array]:
        """One kernel call. A fed temperature that rests on a kink of the kinetics can leave the
        kernel without a solution; a few millikelvin, or another step, take it off the kink."""
        for nudge_K, share in _RETRIES:
            nudged = dict(feeds)
            if "temperature_K" in feeds:
                nudged["temperature_K"] = feeds["temperature_K"] + nudge_K
            replay = Replay(
                self.inputs,
                variant=self.given.variant,
                feeds=nudged,
                forcing=forcing or {},
                outputs=outputs,
            )
            try:
                result = replay.run_setup(self.given.setup, dt_s=share * self.dt_s)
                return self._as_sampled(result)
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
        averaged = [k for k in _AVERAGED if k in result]
        means = {k: signals.means_over_pieces(self.run, result[k]) for k in averaged}
        steady = {k: result[k] * share for k, share in self.steadiness.items() if k in result}
        return result | means | steady

    def _between(self, shown: Array, predicted: Array, tau_s: float) -> Array:
        """What a measurement adds to the prediction, smoothed, at the ends of the samples."""
        off = signals.smooth(shown - predicted, self.run.dt_s, tau_s)
        return signals.at_ends_of_pieces(self.run, off)

    def _driver(self) -> dict[str, Array]:
        """Currents, true and measured. Few points move them, so that they are kept by run.

        A driver answers within milliseconds: of a thinned run they are those of the whole run.
        """
        whole, kept = self.whole, self.kept
        if any(law.place in _OF_CURRENTS for law in self.given.laws):
            # These depend on the rest of the plant.
            inputs = self._given_run(whole).inputs(self.given)
            replay = Replay(inputs, variant=self.given.variant, outputs=DRIVEN)
            return replay.run_setup(self.given.setup, dt_s=self.dt_s)
        key = (
            id(whole), self.given.variant, self.given.parameters["current_max"], self.root["y"],
            tuple((k, *v.items()) for k, v in self.given.moving.items()),
        )  # fmt: skip
        known = kept.get(key)
        if known is None or known[0] is not whole:
            inputs = self._given_run(whole).inputs(self.given)
            known = (whole, drivers(inputs, self.given.driver, dt_s=1.5 * whole.dt_s))
            while len(kept) >= _MOST_KEPT:
                kept.pop(next(iter(kept), key), None)
            kept[key] = known
        return known[1]

    def _over_samples(self, values: Array) -> Array:
        """Means over the samples of a thinned run, of values at the pace of the whole one."""
        if self.whole is self.run:
            return values
        starts = np.r_[0, np.cumsum(self.run.pieces[:-1])].astype(np.intp)
        return np.asarray(np.add.reduceat(values, starts) / self.run.pieces)

    def _fed_current(self, commanded: Mapping[str, Array]) -> FedCurrent:
        """The driver's true current under this model, plus what the measurement adds to it.

        Over the samples of a thinned run, that which heats as much; the voltage is then smaller
        than it would be with as steady a current (`_as_sampled`).
        """
        fed, steadiness = [], {}
        for s in "xy":
            measured = np.asarray(self.whole.outputs[f"i_meas_{s}_A"], dtype=np.float64)
            off = self.root[s] * measured - commanded[f"i_{s}_A"]
            current = np.maximum(commanded[f"true_i_{s}_A"] + off, 0.0)
            heating = np.sqrt(self._over_samples(np.square(current)))
            if self.whole is not self.run:
                steady = np.maximum(heating, 1e-12)
                steadiness[f"v_{s}_V"] = self._over_samples(current) / steady
            fed.append(heating)
        return FedCurrent(np.column_stack(fed), steadiness)

    def _fed_temperature(self, heated: Mapping[str, Array]) -> Array:
        shown, names = self.run.outputs, {s: f"rtd_{s}_degC" for s in "xy"}
        off = {s: self._between(shown[n], heated[n], _INNOVATION_S) for s, n in names.items()}
        fed = [heated[f"T_{s}_K"] + off[s] for s in "xy"]
        return np.clip(np.column_stack(fed), 230.0, 420.0)

    def _fed_displacement(self, warmed: Mapping[str, Array]) -> Array:
        shown = 1e-3 * (self.run.outputs["displacement_mm"] - self.given.zero_mm)
        off = self._between(shown, warmed["displacement_m"], 0.1)
        return np.clip(warmed["true_displacement_m"] + off, -0.024, 0.024)


_RTDS = ("rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC", "rtd_ambient_degC")
_OF_CURRENTS = ("driven_current", "reading_current")
# What is read of each pass.
_OPEN = ("i_x_A", "i_y_A", "v_x_V", "v_y_V", *_RTDS, "displacement_m", "force_N")
_HEATED = (*_RTDS, "T_x_K", "T_y_K")
_WARMED = (
    "v_x_V", "v_y_V", "displacement_m", "force_N", "true_displacement_m",
    "spring_force_x_N", "spring_force_y_N",
)  # fmt: skip
_HELD = ("force_N", "true_force_N", "spring_force_x_N", "spring_force_y_N")
_AVERAGED = (
    "rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N", "true_force_N",
    "spring_force_x_N", "spring_force_y_N",
)  # fmt: skip
