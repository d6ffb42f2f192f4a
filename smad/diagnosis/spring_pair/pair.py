"""The antagonistic spring pair as a plant of the diagnosis: an adapter of `sim_device.plant`."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache, partial
from math import inf
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from firmware_protocol.nearest import instead
from sim_device.plant import ParameterSet, load_parameters, own_states, unit_of_state
from sim_device.plant.covariance import Covariance
from sim_device.plant.effects.record import Effect as RegistryEffect
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.errors import InputError, PlantError
from sim_device.plant.parameters import BUILT_IN, spring_factors
from sim_device.plant.places import PLACES, STATES, check_place_needs
from sim_device.plant.start import reach_m
from smad.diagnosis.errors import PlantMismatch
from smad.diagnosis.places.place import Forcing, Place
from smad.diagnosis.plant import (
    Array,
    Effect,
    EffectParameter,
    Experiment,
    ModelPoint,
    Parameter,
    Traits,
    Uncertainty,
    clipped,
)
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import catalogue, signals
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.spring_pair.replays import GivenPoint, GivenRun

_POINTS = 64
_RUNS = 64
_SPARE = 1.1
"""Springs may stand so much further than those of the parameter set."""
_WIDE = 0.4
_WIDE_K = 6.0

# Geometry and noise are not refitted: only their products with these can be seen.
REFITTED = (
    "modulus_martensite", "modulus_austenite", "stress_start", "stress_finish", "max_deflection",
    "austenite_start", "austenite_finish", "martensite_start", "martensite_finish",
    "slope_austenite", "slope_martensite", "initial_deflection", "initial_force",
    "heat_capacity_heating", "heat_capacity_cooling", "latent_heating", "latent_cooling",
    "resistivity", "warming_share", "tube_loss", "tube_diameter", "flow_max", "film_scale",
    "water_temperature", "ambient_temperature",
)  # fmt: skip
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
# parameter, but no entry of a parameter set.
_MOUNTING = tuple(
    Parameter(name=name, unit=unit, nominal=0.0, low=-reach, high=reach, prior_sd=sd, words=words)
    for name, unit, reach, sd, words in (
        ("side_flow", "1", 0.5, 0.1, "share by which one spring gets more water"),
        ("side_resistance", "1", 0.2, 0.03, "share by which one spring has more resistance"),
        ("displacement_zero", "mm", 2.0, 0.15, "zero of the encoder"),
    )
)
_FLOW_EFFECT = "uneven_flow"
_FLOW_SHARE = (_FLOW_EFFECT, ".", "share")
# What of these a model file keeps as mounting, and its name there; the flow is kept as an effect.
_KEPT_APART = {"side_resistance": "side_resistance", "displacement_zero": "displacement_zero_mm"}
_Record = TypeVar("_Record", Place, EffectParameter, Effect)
_RANGES = {(e.name, q.name): (q.low, q.high) for e in EFFECTS for q in e.parameters}


@dataclass(frozen=True)
class SmaPlant:
    """Satisfies `PlantModel`. Parameter values are SI, as in a parameter set.

    `variant` is "extended" or "printed". Effects that cannot act in the variant are not candidates.
    `only` restricts the library to these names.
    """

    parameter_set: ParameterSet = field(default_factory=lambda: load_parameters("A"))
    variant: str = "extended"
    only: tuple[str, ...] | None = None

    name = "spring pair"
    inputs = signals.INPUTS
    channels = signals.CHANNELS
    regimes = staticmethod(signals.regimes)

    @cached_property
    def traits(self) -> Traits:
        """Usual variation; its runs start where springs that are all martensite can stand."""
        p = self.parameter_set
        reach_mm = _SPARE * 1e3 * reach_m(p)
        c1, _ = spring_factors(p)
        austenite_K = p["austenite_start"] + c1 * p["initial_force"] / p["slope_austenite"]
        warmer_K = austenite_K - p["water_temperature"]
        farthest = {"displacement_mm": reach_mm, "rtd_x_degC": warmer_K, "rtd_y_degC": warmer_K}
        starts = {
            name: replace(reading, low=-farthest.get(name, inf), high=farthest.get(name, inf))
            for name, reading in signals.TRAITS.starts.items()
        }
        return replace(signals.TRAITS, starts=starts)

    @cached_property
    def _given_point(self) -> Callable[[ModelPoint], GivenPoint]:
        """A model point as it is replayed; as many are kept as are replayed together."""
        return lru_cache(_POINTS)(partial(GivenPoint, self))

    @cached_property
    def _given_run(self) -> Callable[[GapRun], GivenRun]:
        """A run as it is replayed; all of a diagnosis are kept."""
        return lru_cache(_RUNS)(GivenRun)

    def __getstate__(self) -> dict[str, Any]:
        """A copy sent elsewhere begins without what is kept."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def version(self) -> str:
        return f"{self.variant}, parameters {self.parameter_set.digest()[:12]}"

    @cached_property
    def built_in(self) -> str:
        """The built-in set that its parameters are; empty for those of a file."""
        digest = self.parameter_set.digest()
        return next((n for n in BUILT_IN if load_parameters(n).digest() == digest), "")

    @cached_property
    def parameters(self) -> Sequence[Parameter]:
        return (*map(self._parameter, REFITTED), *_MOUNTING)

    def _parameter(self, name: str) -> Parameter:
        entry = self.parameter_set.entry(name)
        if name in _TEMPERATURES:
            reach, sd = _WIDE_K, max(_PRIOR_K, (entry.high - entry.low) / 6.0)
        else:
            reach = _WIDE * abs(entry.value)
            sd = max(_PRIOR_SHARE * abs(entry.value), (entry.high - entry.low) / 8.0)
        low, high = min(entry.low, entry.value - reach), max(entry.high, entry.value + reach)
        if (factor := _LUMPED.get(name)) is not None:
            low, high = min(low, entry.value / factor), max(high, entry.value * factor)
            sd = max(sd, 0.15 * abs(entry.value))
        if name == "warming_share":
            high = min(high, 1.0)
        return Parameter(
            name=name,
            unit=entry.unit,
            nominal=entry.value,
            low=low,
            high=high,
            prior_sd=sd,
            words=entry.meaning,
        )

    @cached_property
    def effects(self) -> Sequence[Effect]:
        return tuple(
            _effect(e)
            for e in EFFECTS
            if self.variant in dict(e.needs).get("variant", (self.variant,))
            and (self.only is None or e.name in self.only)
        )

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """See `PlantModel`. A point that the plant refuses or cannot solve gives NaN."""
        try:
            return self.forced(point, run, {}, fast=fast)
        except PlantError:
            return {c.name: np.full(len(run.t_s), np.nan) for c in self.channels}

    @cached_property
    def places(self) -> Sequence[Place]:
        options = {"variant": self.variant, "fixture": "antagonistic", "cooling": "water"}
        offered = []
        for entry in PLACES:
            with contextlib.suppress(InputError):
                check_place_needs(entry.name, options)
                offered.append(_like(Place, entry))
        return tuple(offered)

    def trajectory(
        self, point: ModelPoint, run: GapRun, *, fast: bool = False
    ) -> Mapping[str, Array]:
        """States of the run replayed in open loop, SI, by the names of the plant's trajectory.

        Raises PlantError where the plant refuses the point or cannot solve it, as `forced` does.
        """
        return self._given_run(run).trajectory(self._given_point(point), fast=fast)

    def seen(self, place: str, side: str, states: Mapping[str, Array]) -> dict[str, Array]:
        """States as a place sees them on a side, by the names of `sim_device.plant.places`."""
        return own_states(place, side, states)

    def state_words(self, place: str, state: str) -> tuple[str, str]:
        """A state in words and its unit."""
        label = next(s.label for s in STATES if s.name == state)
        return label, unit_of_state(place, state)

    def forced(
        self, point: ModelPoint, run: GapRun, forcing: Forcing, *, fast: bool = False
    ) -> dict[str, Array]:
        """Channels of the run in open loop under a forcing, see `smad.diagnosis.places.place`."""
        return self._given_run(run).forced(self._given_point(point), forcing, fast=fast)

    def catalogue(self) -> Sequence[Experiment]:
        return tuple(
            Experiment(t.name, t.title, t.duration_s, f"smad gap next --run '{t.name}'")
            for t in catalogue.CATALOGUE
        )

    def perform(self, experiment: str, point: ModelPoint, seed: int) -> GapRun:
        return recorded(experiment, self, point, seed, noise=False)

    def set_of(self, theta: Mapping[str, float]) -> ParameterSet:
        """The parameter set with these values. Raises ParameterError when it is not physical."""
        names = {p.name for p in self.parameters}
        unknown = sorted(set(theta) - names)
        if unknown:
            raise PlantMismatch(
                "a parameter is not one that this plant refits",
                value=unknown[0],
                action=instead(
                    unknown[0], sorted(names), "use a model file made with the same plant"
                ),
            )
        mounting = {p.name for p in _MOUNTING}
        values = {k: float(v) for k, v in theta.items() if k not in mounting}
        return self.parameter_set.replace(**self._mountable(values))

    def _mountable(self, values: dict[str, float]) -> dict[str, float]:
        """The values with the preload clipped to one that the pair can be mounted with.

        Eq. (10) must give a martensite fraction from 0 to 1. Without clipping a fit at that limit
        could move in no direction.
        """
        names = ("modulus_martensite", "max_deflection", "initial_deflection", "initial_force")
        modulus, reach, slack, force = (values.get(n, self.parameter_set[n]) for n in names)
        c1, c2 = spring_factors(self.parameter_set)
        stiffness = c2 * modulus / c1
        taut, loose = stiffness * slack, stiffness * (slack - reach)
        edge = 1e-9 * taut
        return values | {"initial_force": clipped(force, loose + edge, taut - edge)}

    def save_model(
        self, point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
    ) -> None:
        """Write the model file that the simulated device and the replay load.

        It carries every parameter that differs from the plant's built-in set, or from set A, so
        that it stands alone, and the covariance of what it has.
        """
        from sim_device.plant.models import save_model

        name = self.built_in or "A"
        base, changed = load_parameters(name), self.set_of(point.theta)
        save_model(
            path,
            base=name,
            variant=self.variant,
            overrides={n: changed[n] for n in changed.names if changed[n] != base[n]},
            effects=self.acting(point),
            mounting={
                key: point.theta[name]
                for name, key in _KEPT_APART.items()
                if point.theta.get(name, 0.0) != 0.0
            },
            laws=point.laws,
            covariance=None if uncertainty is None else self._covariance(point, uncertainty),
            note=note,
        )

    def _covariance(self, point: ModelPoint, uncertainty: Uncertainty) -> Covariance:
        """The covariance in a model file's names: there the flow of a side is an effect's share."""
        acting = self.acting(point)
        rows: dict[str, Array] = {}
        for name, unit in zip(uncertainty.names, np.eye(len(uncertainty.names)), strict=True):
            which, _, parameter = _FLOW_SHARE if name == "side_flow" else name.partition(".")
            if which == "laws":
                rows[name] = unit
            elif not parameter:
                table = "mounting" if which in _KEPT_APART else "parameters"
                rows[f"{table}.{_KEPT_APART.get(which, which)}"] = unit
            elif which in acting:
                key = f"effects.{which}.{parameter}"
                rows[key] = rows.get(key, np.zeros(unit.size)) + unit
        moves = np.array(list(rows.values()))
        matrix = moves @ uncertainty.covariance @ moves.T
        return Covariance(tuple(rows), 0.5 * (matrix + matrix.T))

    def load_model(self, path: Path) -> ModelPoint:
        """The point of this plant that a model file holds.

        Raises ModelError when it cannot be read and PlantMismatch when it is of another variant,
        another built-in set, or of other parameters that are not refitted.
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
        if model.base in BUILT_IN and model.base != (self.built_in or "A"):
            raise PlantMismatch(
                f"{path.name} is a model of another parameter set",
                value=model.base,
                limit=self.built_in or "A, or the file that it was made with",
                action=f"give --params {model.base}",
            )
        base_set = self.parameter_set
        for name in (n for n in base_set.names if n not in REFITTED):
            if not np.isclose(model.parameters[name], base_set[name], rtol=1e-9, atol=0.0):
                raise PlantMismatch(
                    f"{path.name} was made with another parameter file: {name} differs",
                    value=f"{model.parameters[name]:g}",
                    limit=f"{base_set[name]:g}",
                    action="give with --params the file that the model was made with",
                )
        theta = {n: model.parameters[n] for n in REFITTED}
        theta |= {n: model.mounting[key] for n, key in _KEPT_APART.items() if key in model.mounting}
        return ModelPoint(theta, model.effects, model.laws)

    def acting(self, point: ModelPoint) -> dict[str, dict[str, float]]:
        """Effects of a point, with its uneven flow as an effect."""
        effects = self.within(point.effects)
        flow = point.theta.get("side_flow", 0.0)
        if flow != 0.0:
            share = effects.get(_FLOW_EFFECT, {}).get("share", 0.0) + flow
            effects |= self.within({_FLOW_EFFECT: {"share": share}})
        return effects

    def within(self, effects: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
        """Effect values moved into their ranges, where rounding put them outside."""
        return {
            name: {q: clipped(float(v), *_RANGES[name, q]) for q, v in values.items()}
            for name, values in effects.items()
        }


def _effect(entry: RegistryEffect) -> Effect:
    parameters = tuple(
        _like(EffectParameter, q, strength=q.is_strength) for q in entry.parameters if not q.switch
    )
    more = {"sub_model": entry.subsystem, "separates": entry.separated_by}
    return _like(Effect, entry, parameters=parameters, **more)


def _like(kind: type[_Record], entry: object, **given: Any) -> _Record:
    """A record of the diagnosis: what is `given`, and the other fields from one of the plant."""
    names = (f.name for f in fields(kind) if f.name not in given)
    return kind(**{name: getattr(entry, name) for name in names}, **given)
