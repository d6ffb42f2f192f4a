"""The antagonistic spring pair as a plant of the diagnosis: an adapter of `sim_device.plant`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sim_device.plant import ParameterSet, load_parameters
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.errors import PlantError, SolverError
from sim_device.plant.parameters import spring_factors
from sim_device.plant.replay import Inputs, Replay
from sim_device.plant.setup import Setup
from smad.gap import catalogue, sma_signals
from smad.gap.errors import PlantMismatch
from smad.gap.plant import (
    Array,
    Channel,
    Effect,
    EffectParameter,
    Experiment,
    Mask,
    ModelPoint,
    Parameter,
    Signal,
    View,
)
from smad.gap.runs import GapRun

_ZERO_C = 273.15
_STEP_S = 5e-3
_FAST_STEP_S = 1e-2
_MOST_KEPT = 120
_RETRIES = ((0.0, 1.0), (3e-3, 1.0), (-3e-3, 1.0), (1e-2, 0.5), (0.0, 0.2))
_MOVES_CURRENT = frozenset(e.name for e in EFFECTS if "current" in e.signals)
_DRIVER = ("i_x_A", "i_y_A", "true_i_x_A", "true_i_y_A")
_INNOVATION_S = 0.3
_SURROUNDINGS_S = 2.0
_WIDE = 0.4
_WIDE_K = 6.0

# Refitted parameter -> the sub-model it belongs to. Geometry and noise are not refitted: only their
# products with these can be seen.
REFITTED = {
    "modulus_martensite": "mechanics",
    "modulus_austenite": "mechanics",
    "stress_start": "phase",
    "stress_finish": "phase",
    "max_deflection": "phase",
    "austenite_start": "phase",
    "austenite_finish": "phase",
    "martensite_start": "phase",
    "martensite_finish": "phase",
    "slope_austenite": "phase",
    "slope_martensite": "phase",
    "initial_deflection": "mechanics",
    "initial_force": "mechanics",
    "heat_capacity_heating": "thermal",
    "heat_capacity_cooling": "thermal",
    "latent_heating": "thermal",
    "latent_cooling": "thermal",
    "resistivity": "electrical",
    "warming_share": "thermal",
    "tube_loss": "thermal",
    "tube_diameter": "thermal",
    "flow_max": "thermal",
    "film_scale": "thermal",
    "water_temperature": "thermal",
    "ambient_temperature": "thermal",
}
_TEMPERATURES = {
    "austenite_start", "austenite_finish", "martensite_start", "martensite_finish",
    "water_temperature", "ambient_temperature",
}  # fmt: skip
# Closures of a lumped model rather than material: well-mixed water against a front that moves, one
# film coefficient, one capacity and one latent heat for a whole wire. Known to a factor.
_LUMPED = {
    "flow_max": 2.5, "film_scale": 3.0, "warming_share": 4.0, "latent_cooling": 4.0,
    "latent_heating": 2.5, "heat_capacity_cooling": 2.5, "heat_capacity_heating": 1.6,
    "tube_loss": 4.0, "stress_finish": 2.5, "slope_martensite": 2.0,
}  # fmt: skip
_PRIOR_SHARE = 0.08
_PRIOR_K = 1.5
# What differs from bench to bench between the two springs, and the encoder's zero: refitted like a
# parameter, but no entry of a parameter set. Nominal value, bounds, standard deviation, sub-model.
_MOUNTING = (
    Parameter("side_flow", "1", 0.0, -0.5, 0.5, 0.1, "thermal"),
    Parameter("side_resistance", "1", 0.0, -0.2, 0.2, 0.03, "electrical"),
    Parameter("displacement_zero", "mm", 0.0, -2.0, 2.0, 0.15, "mechanics"),
)
_FLOW_EFFECT = "uneven_flow"
_ENVIRONMENT = {"inlet_K": "water_temperature", "ambient_K": "ambient_temperature"}


@dataclass(frozen=True)
class SmaPlant:
    """Satisfies `PlantModel`. Parameter values are SI, as in a parameter set.

    `variant` is "extended" or "printed". Effects that cannot act in the variant are not candidates.
    `only` restricts the library to these names, for tests.
    """

    parameter_set: ParameterSet = field(default_factory=lambda: load_parameters("A"))
    variant: str = "extended"
    only: tuple[str, ...] | None = None
    kept: dict[Any, tuple[GapRun, dict[str, Array]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def name(self) -> str:
        return "spring pair"

    @property
    def version(self) -> str:
        return f"{self.variant}, parameters {self.parameter_set.digest()[:12]}"

    @property
    def inputs(self) -> Sequence[Signal]:
        return sma_signals.INPUTS

    @property
    def channels(self) -> Sequence[Channel]:
        return sma_signals.CHANNELS

    @property
    def views(self) -> Sequence[View]:
        return sma_signals.VIEWS

    @cached_property
    def parameters(self) -> Sequence[Parameter]:
        own = tuple(self._parameter(name, part) for name, part in REFITTED.items())
        return own + _MOUNTING

    def _parameter(self, name: str, part: str) -> Parameter:
        entry = self.parameter_set.entry(name)
        if name in _TEMPERATURES:
            reach, sd = _WIDE_K, max(_PRIOR_K, (entry.high - entry.low) / 6.0)
        else:
            reach = _WIDE * abs(entry.value)
            sd = max(_PRIOR_SHARE * abs(entry.value), (entry.high - entry.low) / 8.0)
        low, high = min(entry.low, entry.value - reach), max(entry.high, entry.value + reach)
        if name in _LUMPED:
            low, high = (
                min(low, entry.value / _LUMPED[name]),
                max(high, entry.value * _LUMPED[name]),
            )
            sd = max(sd, 0.15 * abs(entry.value))
        if name == "warming_share":
            high = min(high, 1.0)
        return Parameter(name, entry.unit, entry.value, low, high, sd, part)

    @cached_property
    def effects(self) -> Sequence[Effect]:
        chosen = []
        for e in EFFECTS:
            needs = dict(e.needs)
            if self.variant not in needs.get("variant", (self.variant,)):
                continue
            if self.only is not None and e.name not in self.only:
                continue
            chosen.append(
                Effect(
                    e.name,
                    e.title,
                    e.subsystem,
                    tuple(
                        EffectParameter(q.name, q.unit, q.typical, q.low, q.high, q.is_strength)
                        for q in e.parameters
                        if not q.switch
                    ),
                    e.signals,
                    e.equation,
                    e.confused_with,
                    e.separated_by,
                    e.reference,
                    e.law,
                )
            )
        return tuple(chosen)

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        """See `PlantModel`. A point that the plant refuses or cannot solve gives NaN."""
        try:
            return _Passes(self, point, run, fast).views(views)
        except PlantError:
            keys = [o.key for v in self.views if v.name in views for o in v.outputs]
            return {key: np.full(len(run.t_s), np.nan) for key in keys}

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        return sma_signals.regimes(run, side)

    def features(self, run: GapRun, side: str) -> dict[str, Array]:
        return sma_signals.features(run, side)

    def catalogue(self) -> Sequence[Experiment]:
        return tuple(
            Experiment(t.name, t.title, t.duration_s, f"smad gap next --run '{t.name}'")
            for t in catalogue.CATALOGUE
        )

    def perform(self, experiment: str, point: ModelPoint, seed: int) -> GapRun:
        from smad.gap.recorded import recorded

        return recorded(experiment, self, point, seed, noise=False)

    def set_of(self, theta: Mapping[str, float]) -> ParameterSet:
        """The parameter set with these values. Raises ParameterError when it is not physical."""
        known = {p.name for p in self.parameters}
        unknown = sorted(set(theta) - known)
        if unknown:
            raise PlantMismatch(
                "a parameter is not one that this plant refits",
                value=unknown[0],
                limit=", ".join(sorted(known)),
                action="use a model file made with the same plant",
            )
        mounting = {p.name for p in _MOUNTING}
        values = {k: float(v) for k, v in theta.items() if k not in mounting}
        return self.parameter_set.replace(**self._mountable(values))

    def _mountable(self, values: dict[str, float]) -> dict[str, float]:
        """The values with the preload moved, if need be, to one that the pair can be mounted with.

        Eq. (10) must give a martensite fraction from 0 to 1. A fit that leans on that edge would
        otherwise be stopped there in every direction.
        """
        names = (
            "modulus_martensite", "max_deflection", "initial_deflection", "initial_force",
        )  # fmt: skip
        modulus, reach, slack, force = (values.get(n, self.parameter_set[n]) for n in names)
        c1, c2 = spring_factors(self.parameter_set)
        stiffness = c2 * modulus / c1
        taut, loose = stiffness * slack, stiffness * (slack - reach)
        edge = 1e-9 * taut
        return values | {"initial_force": float(np.clip(force, loose + edge, taut - edge))}

    def save_model(self, point: ModelPoint, path: Path, note: str) -> None:
        """Writes the model file that the simulated device and the replay load.

        It carries every parameter that differs from the built-in set A, so that it stands alone.
        """
        from sim_device.plant.models import save_model

        base, own = load_parameters("A"), self.set_of(point.theta)
        save_model(
            path,
            base="A",
            variant=self.variant,
            overrides={n: own[n] for n in own.names if own[n] != base[n]},
            effects=self.acting(point),
            note=note,
        )

    def load_model(self, path: Path) -> ModelPoint:
        """The point of this plant that a model file holds.

        Raises ModelError when it cannot be read and PlantMismatch when it is of another variant.
        """
        from sim_device.plant.models import read_model

        model = read_model(path)
        if model.variant != self.variant:
            raise PlantMismatch(
                f"{path.name} is a model of another variant",
                value=model.variant,
                limit=self.variant,
                action="give the same variant as the model was made with",
            )
        theta = {n: model.parameters[n] for n in REFITTED}
        return ModelPoint(theta, model.effects)

    def acting(self, point: ModelPoint) -> dict[str, dict[str, float]]:
        """Effects of a point, with what its parameters say of the two sides."""
        effects = self.within(point.effects)
        flow = point.theta.get("side_flow", 0.0)
        if flow != 0.0:
            share = effects.get(_FLOW_EFFECT, {}).get("share", 0.0) + flow
            effects |= self.within({_FLOW_EFFECT: {"share": share}})
        return effects

    def within(self, effects: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
        """Effect values moved into their ranges, where rounding put them outside."""
        ranges = {(e.name, q.name): (q.low, q.high) for e in EFFECTS for q in e.parameters}
        return {
            name: {q: float(np.clip(v, *ranges[name, q])) for q, v in values.items()}
            for name, values in effects.items()
        }


class _Passes:
    """The passes of the kernel that the views need, each made once for one model point."""

    def __init__(self, plant: SmaPlant, point: ModelPoint, run: GapRun, fast: bool) -> None:
        self.run, self.variant = run, plant.variant
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
            out |= {f"actuator:i_meas_{s}_A": commanded[f"i_{s}_A"] / self.root[s] for s in "xy"}
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
            sensor = held["force_N"] - held["true_force_N"]
            # What stands between the springs (friction, drag) pulls them apart by as much as the
            # free model says.
            apart = 0.5 * (warmed["spring_force_x_N"] - warmed["spring_force_y_N"])
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
                return replay.run_setup(self.setup, dt_s=share * self.dt_s)
            except SolverError as error:
                failed = error
        raise failed

    def _driver(self) -> dict[str, Array]:
        """Currents, true and measured. Few points move them, so that they are kept by run.

        A driver answers within milliseconds: a thinned run's are means of those of the whole run.
        """
        moving = {k: v for k, v in self.effects.items() if k in _MOVES_CURRENT}
        whole = self.run if self.run.whole is None else self.run.whole
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
        if whole is self.run:
            return known[1]
        stops = np.searchsorted(whole.t_s, self.run.t_s, side="right")
        starts = np.r_[0, stops[:-1]]
        return {k: np.add.reduceat(v, starts) / (stops - starts) for k, v in known[1].items()}

    def _fed_current(self, commanded: Mapping[str, Array]) -> Array:
        """The driver's true current under this model, plus what the measurement adds to it."""
        fed = [
            commanded[f"true_i_{s}_A"]
            + self.root[s] * self.run.outputs[f"i_meas_{s}_A"]
            - commanded[f"i_{s}_A"]
            for s in "xy"
        ]
        return np.asarray(np.maximum(np.column_stack(fed), 0.0))

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
            off = self.run.outputs[f"rtd_{s}_degC"] - heated[f"rtd_{s}_degC"]
            fed.append(heated[f"T_{s}_K"] + sma_signals.smooth(off, self.run.dt_s, _INNOVATION_S))
        return np.clip(np.column_stack(fed), 230.0, 420.0)

    def _fed_displacement(self, warmed: Mapping[str, Array]) -> Array:
        shown = 1e-3 * (self.run.outputs["displacement_mm"] - self.zero_mm)
        off = shown - warmed["displacement_m"]
        fed = warmed["true_displacement_m"] + sma_signals.smooth(off, self.run.dt_s, 0.1)
        return np.clip(fed, -0.024, 0.024)


_KEPT = (
    "i_x_A", "i_y_A", "v_x_V", "v_y_V", "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC",
    "rtd_ambient_degC", "displacement_m", "force_N", "true_displacement_m", "true_force_N",
    "true_i_x_A", "true_i_y_A", "T_x_K", "T_y_K", "spring_force_x_N", "spring_force_y_N",
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
