"""The shape of a registry entry: an effect, its parameters, and what is known about each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

Subsystem = Literal[
    "actuator", "electrical", "sensors", "timing", "thermal", "water", "phase", "mechanics"
]
Signal = Literal["current", "voltage", "temperature", "inlet", "ambient", "displacement", "force"]


@dataclass(frozen=True)
class Prior:
    """Belief about a parameter's size when its effect is present.

    normal: mean 0, standard deviation `scale`. half-normal: the same on one side. log-normal:
    median `scale`, standard deviation `spread` of the logarithm.
    """

    kind: Literal["normal", "half-normal", "log-normal"]
    scale: float
    spread: float = 0.7


@dataclass(frozen=True, kw_only=True)
class EffectParameter:
    """One parameter of an effect, SI.

    A strength switches the effect: at `zero` it is absent. A shape (`zero` is None) says how the
    effect acts and means nothing while every strength is zero. `low` and `high` are the range that
    is accepted; `typical` is a value that a bench may well show. `term` is the field of `Effects`
    in the kernel that it fills; without one it only says how others get there.
    """

    name: str
    term: str | None
    unit: str
    low: float
    high: float
    typical: float
    prior: Prior
    meaning: str
    zero: float | None = 0.0
    switch: bool = False

    @property
    def is_strength(self) -> bool:
        return self.zero is not None

    def on_a_side(self, value: float, share: float) -> float:
        """What a side with that share of the effect gets: of a strength so much, in its range."""
        return min(max(share * value, self.low), self.high) if self.is_strength else value


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One candidate effect.

    places: where in the model it acts, entries of `sim_device.plant.places`, the main one first.
    signals: measured channels that it moves. confused_with: other entries that look alike in
    routine runs. separated_by: the experiment that tells them apart. needs: what the plant must be
    for the effect to act (variant, cooling, fixture), as option to allowed values. law: a good
    bench follows it too, more or less. An effect with the parameter `Y_SHARE` acts on hardware that
    each side has of its own, not equally strongly on both.
    """

    name: str
    title: str
    subsystem: Subsystem
    places: tuple[str, ...]
    equation: str
    parameters: tuple[EffectParameter, ...]
    signals: tuple[Signal, ...]
    confused_with: tuple[str, ...]
    separated_by: str
    reference: str
    needs: tuple[tuple[str, tuple[str, ...]], ...] = ()
    law: bool = False

    def typical(self) -> dict[str, float]:
        """Every parameter at its typical value."""
        return {parameter.name: parameter.typical for parameter in self.parameters}

    def parameter(self, name: str) -> EffectParameter | None:
        """The parameter of that name, if the effect has it."""
        return next((q for q in self.parameters if q.name == name), None)


def half(scale: float) -> Prior:
    """Prior of a strength that can only be positive."""
    return Prior("half-normal", scale)


def either(scale: float) -> Prior:
    """Prior of a strength of either sign."""
    return Prior("normal", scale)


def about(median: float, spread: float = 0.7) -> Prior:
    """Prior of a shape parameter: positive, known to a factor."""
    return Prior("log-normal", median, spread)


Range = tuple[float, float, float]
"""The least value that is accepted, a typical one, and the most."""


def strength(
    name: str,
    unit: str,
    values: Range,
    prior: Prior,
    meaning: str,
    *,
    term: str,
    switch: bool = False,
) -> EffectParameter:
    """Row of a parameter that switches its effect."""
    low, typical, high = values
    return EffectParameter(
        name=name,
        term=term,
        unit=unit,
        low=low,
        high=high,
        typical=typical,
        prior=prior,
        meaning=meaning,
        switch=switch,
    )


def shape(
    name: str, unit: str, values: Range, prior: Prior, meaning: str, *, term: str | None = None
) -> EffectParameter:
    """Row of a parameter that says how its effect acts."""
    return replace(strength(name, unit, values, prior, meaning, term=""), term=term, zero=None)


Y_SHARE = shape(
    "y_share",
    "1",
    (0, 1, 2),
    about(1, 0.3),
    "factor of the strengths on side Y; that on side X is 2 minus it",
)
