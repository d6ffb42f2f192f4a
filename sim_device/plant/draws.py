"""Plants drawn from what a diagnosis left uncertain, or from ranges given by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sim_device.plant.effects.registry import effect, resolve
from sim_device.plant.errors import ModelError, PlantError
from sim_device.plant.fields import FIELDS
from sim_device.plant.models import Model, quantities
from sim_device.plant.setup import Setup

_TRIES = 100
_FIELDS = {field.name: field for field in FIELDS}
OPTIONS = {"fixture": "antagonistic", "cooling": "water"}


def draw(model: Model, rng: np.random.Generator) -> Model:
    """A model drawn from the normal distribution around `model` that its covariance describes.

    A value beyond what is physical, or beyond the range of its effect, is set to the edge. A set
    that no pair can be built of is drawn again. Raises ModelError for a model without a covariance,
    and when a hundred draws give no plant.
    """
    covariance = model.covariance
    if covariance is None:
        raise ModelError(
            "the model file has no [covariance], so there is nothing to draw from; give a file"
            " that smad gap diagnose --apply wrote, or ranges by hand"
        )
    values = quantities(model)
    for _ in range(_TRIES):
        steps = covariance.steps(rng)
        drawn = moved(model, {name: values[name] + step for name, step in steps.items()})
        if drawn is not None:
            return drawn
    raise ModelError(f"{_TRIES} draws from the covariance gave no plant that can be built")


def draw_between(
    model: Model, ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator
) -> Model:
    """A model with each named value drawn evenly from its range (SI).

    An effect that the model is without may be named; its other values are then as in the registry.
    Raises ModelError for an unknown name or a range without width, and as `draw`.
    """
    known = quantities(model)
    for name, (low, high) in ranges.items():
        if name not in known and not _is_effect(name):
            raise ModelError(f"the model has no value {name!r}")
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise ModelError(f"range of {name}: {low} to {high}; give the lower end first")
    for _ in range(_TRIES):
        values = {name: float(rng.uniform(*ends)) for name, ends in ranges.items()}
        drawn = moved(model, values)
        if drawn is not None:
            return drawn
    raise ModelError(f"{_TRIES} draws from the ranges gave no plant that can be built")


def moved(model: Model, values: Mapping[str, float]) -> Model | None:
    """The model with other values, each within its range; None where no plant can be built so."""
    parameters: dict[str, float] = {}
    mounting = dict(model.mounting)
    effects = {name: dict(strengths) for name, strengths in model.effects.items()}
    for name, value in values.items():
        table, _, key = name.partition(".")
        if table == "parameters":
            field = _FIELDS[key]
            parameters[key] = min(max(value, field.low), field.high)
        elif table == "effects":
            which, _, parameter = key.partition(".")
            entry = effect(which).parameter(parameter)
            if entry is not None:
                effects.setdefault(which, {})[parameter] = min(max(value, entry.low), entry.high)
        elif table == "mounting":
            mounting[key] = value
    laws = tuple(
        law.with_coefficients(
            [values.get(n, t.coefficient) for n, t in zip(law.names, law.terms, strict=True)]
        )
        for law in model.laws
    )
    try:
        changed = replace(
            model,
            parameters=model.parameters.replace(**parameters),
            effects=resolve(effects),
            overrides=model.overrides | parameters,
            mounting=mounting,
            laws=laws,
        )
        setup_of(changed).state()
    except PlantError:
        return None
    return changed


def setup_of(model: Model) -> Setup:
    """What the kernel takes of a model: a pair in water."""
    return Setup.make(**model.physics, **OPTIONS)


def _is_effect(name: str) -> bool:
    table, _, key = name.partition(".")
    which, _, parameter = key.partition(".")
    try:
        return table == "effects" and effect(which).parameter(parameter) is not None
    except PlantError:
        return False
