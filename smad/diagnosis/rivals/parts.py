"""A model of the bench as coordinates: parameters, and the parts that a hypothesis adds to them.

A part is an effect of the library or a law at a place. Every part has `size` coordinates p of
order 1, so that one fit serves all of them, and acts at `places`. It has `bounds()`, lower and
upper; a normal `prior()`, mean and precision; finite-difference `steps(p)`; `absent(p)`, the
coordinates nearest p at which it changes nothing, or infinity; and `added(point, p)`, the point of
the model with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np

from sim_device.plant import joined
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Candidate, Responses
from smad.diagnosis.plant import Array, Effect, Index, ModelPoint, moved_parameters

_LAW_PRECISION = 1e-3
_STEP, _LEAST_STEP = 0.15, 0.02
_PARAMETER_STEP = 0.1


@dataclass(frozen=True)
class EffectPart:
    """An effect of the library; a coordinate is one of its parameters over its scale.

    `needs_exact`: averaged inputs hide its effect, so it is fitted by exact replays.
    """

    effect: Effect
    needs_exact: bool = False

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def size(self) -> int:
        return len(self.effect.parameters)

    @property
    def places(self) -> tuple[str, ...]:
        return self.effect.places

    @property
    def has_strength(self) -> bool:
        """Whether one of its parameters is a strength; else it is on or off."""
        return any(q.strength for q in self.effect.parameters)

    def bounds(self) -> tuple[Array, Array]:
        low = [q.low / q.scale for q in self.effect.parameters]
        high = [q.high / q.scale for q in self.effect.parameters]
        return np.array(low), np.array(high)

    def prior(self) -> tuple[Array, Array]:
        """Half the range wide, around strength 0 and the typical shape: it bounds directions that
        the runs do not determine."""
        parameters = self.effect.parameters
        mean = [0.0 if q.strength else float(np.sign(q.typical)) for q in parameters]
        precision = [(2 * q.scale / (q.high - q.low)) ** 2 for q in parameters]
        return np.array(mean), np.array(precision)

    def steps(self, p: Array) -> Array:
        # Wide, since a hysteretic replay is rough on a small scale; at most half the value, since
        # a lag of milliseconds in a library that goes to seconds needs small steps.
        away = np.abs(p)
        return np.where(away < 1e-9, _STEP, np.clip(0.5 * away, _LEAST_STEP, _STEP))

    def coordinates(self, values: Mapping[str, float]) -> Array:
        return np.array([values[q.name] / q.scale for q in self.effect.parameters])

    def weaker(self, p: Array, share: float) -> Array:
        """Coordinates of a share of the strength that the effect has at `p`, of the same shape."""
        strengths = [q.strength for q in self.effect.parameters]
        return np.where(strengths, share * p, p)

    def absent(self, p: Array) -> Array:
        return self.weaker(p, 0.0) if self.has_strength else np.full(self.size, np.inf)

    def values(self, p: Array) -> dict[str, float]:
        """The effect's values at coordinates `p`."""
        pairs = zip(self.effect.parameters, p, strict=True)
        return {q.name: float(x) * q.scale for q, x in pairs}

    def added(self, point: ModelPoint, p: Array) -> ModelPoint:
        effects = {**point.effects, self.effect.name: self.values(p)}
        return replace(point, effects=effects)


@dataclass(frozen=True, eq=False)
class LawPart:
    """A law of a few terms at a place; a coordinate is a coefficient at the place's scale."""

    candidate: Candidate
    columns: Index
    responses: Responses
    needs_exact: ClassVar[bool] = False
    has_strength: ClassVar[bool] = True

    @property
    def name(self) -> str:
        return f"law:{self.candidate.place}"

    @property
    def size(self) -> int:
        return len(self.columns)

    @property
    def places(self) -> tuple[str, ...]:
        return (self.candidate.place,)

    def bounds(self) -> tuple[Array, Array]:
        wide = np.full(self.size, np.inf)
        return -wide, wide

    def prior(self) -> tuple[Array, Array]:
        return np.zeros(self.size), np.full(self.size, _LAW_PRECISION)

    def steps(self, p: Array) -> Array:
        return np.asarray(np.maximum(_PARAMETER_STEP, _PARAMETER_STEP * np.abs(p)))

    def absent(self, p: Array) -> Array:
        return np.zeros(self.size)

    def added(self, point: ModelPoint, p: Array) -> ModelPoint:
        laws = self.responses.law_of(self.columns, p)
        return replace(point, laws=joined((*point.laws, *laws)))


Part = EffectPart | LawPart


@dataclass(frozen=True, kw_only=True)
class Model:
    """Coordinates x (k,): parameters in prior standard deviations from `start`, then the parts'.

    `parameter_precision` (p, p) is that of the parameters' normal prior around the start.
    A fit multiplies it by `prior_weight`: the score counts so many rows of a fit as one.
    """

    plant: PlacesPlant
    start: ModelPoint
    parameter_precision: Array
    parts: tuple[Part, ...] = ()
    prior_weight: float = 1.0

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return len(self.plant.parameters)

    @property
    def needs_exact(self) -> bool:
        """Whether one of its parts needs exact replays."""
        return any(part.needs_exact for part in self.parts)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where the coordinates of each part stand."""
        stops = np.cumsum([self.parameters, *(part.size for part in self.parts)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(stops))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of each coordinate."""
        theta = self.start.theta
        low = [(q.low - theta.get(q.name, q.nominal)) / q.prior_sd for q in self.plant.parameters]
        high = [(q.high - theta.get(q.name, q.nominal)) / q.prior_sd for q in self.plant.parameters]
        of_parts = [part.bounds() for part in self.parts]
        return np.concatenate([low, *(a for a, _ in of_parts)]), np.concatenate(
            [high, *(b for _, b in of_parts)]
        )

    @cached_property
    def prior(self) -> tuple[Array, Array]:
        """Mean (k,) and precision (k, k) of the normal prior of all coordinates."""
        of_parts = [part.prior() for part in self.parts]
        mean = np.concatenate([np.zeros(self.parameters), *(m for m, _ in of_parts)])
        precision = np.zeros((len(mean), len(mean)))
        n = self.parameters
        precision[:n, :n] = self.prior_weight * self.parameter_precision
        diagonal = np.arange(n, len(mean))
        precision[diagonal, diagonal] = np.concatenate([np.zeros(0), *(p for _, p in of_parts)])
        return mean, precision

    def steps(self, x: Array) -> Array:
        """Finite-difference steps of all coordinates."""
        of_parts = [part.steps(x[s]) for part, s in zip(self.parts, self.slices, strict=True)]
        return np.concatenate([np.full(self.parameters, _PARAMETER_STEP), *of_parts])

    def absent(self, x: Array, present: Sequence[Part]) -> Array:
        """Coordinates of the parts after those `present`, where each would change nothing."""
        new = list(zip(self.parts, self.slices, strict=True))[len(present) :]
        return np.concatenate([np.zeros(0), *(part.absent(x[s]) for part, s in new)])

    def point(self, x: Array) -> ModelPoint:
        """The simulator at coordinates `x`."""
        theta = moved_parameters(self.plant, self.start, x[: self.parameters])
        point = replace(self.start, theta=theta)
        for part, s in zip(self.parts, self.slices, strict=True):
            point = part.added(point, x[s])
        return point

    def with_parts(self, parts: Sequence[Part]) -> Model:
        return replace(self, parts=tuple(parts))

    def log_prior(self, x: Array) -> float:
        """Log density of the parameters' prior at coordinates `x`, less that at its mean."""
        off = x[: self.parameters]
        return float(-0.5 * off @ self.parameter_precision @ off)
