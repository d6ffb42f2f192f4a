"""The coordinates of a fit: model parameters and effect parameters, scaled and bounded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from smad.diagnosis.plant import Array, Effect, EffectValues, ModelPoint, Parameter

_THETA_STEP, _STEP, _LEAST_STEP = 0.2, 0.15, 0.02


@dataclass(frozen=True)
class Space:
    """Scaled coordinates p of model parameters `theta` followed by those of `effects`.

    A model parameter is scaled as (value − centre)/prior_sd, an effect parameter as
    value/scale. `centre` replaces nominal values as the middle of the prior. `fixed` are
    effects that belong to the model as it is; a free effect of the same name starts from there.
    `tie` (parameters, parameters) is the precision with which the model parameters are known to be
    at the centre, from known-good runs; without it each has its own prior.
    """

    theta: tuple[Parameter, ...]
    effects: tuple[Effect, ...] = ()
    centre: Mapping[str, float] | None = None
    fixed: EffectValues = field(default_factory=dict)
    tie: Array | None = None

    @property
    def size(self) -> int:
        return len(self.theta) + sum(len(e.parameters) for e in self.effects)

    @property
    def n_theta(self) -> int:
        return len(self.theta)

    def _centre(self, p: Parameter) -> float:
        return p.nominal if self.centre is None else self.centre.get(p.name, p.nominal)

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of each coordinate."""
        lo = [(p.low - self._centre(p)) / p.prior_sd for p in self.theta]
        hi = [(p.high - self._centre(p)) / p.prior_sd for p in self.theta]
        for e in self.effects:
            lo += [q.low / q.scale for q in e.parameters]
            hi += [q.high / q.scale for q in e.parameters]
        return np.array(lo), np.array(hi)

    def prior(self) -> tuple[Array, Array]:
        """Mean and precision matrix of the normal prior; shapes (k,) and (k, k).

        An effect's prior only keeps a flat direction from wandering: half its range wide, around
        where the effect is now.
        """
        mean = [0.0] * self.n_theta
        precision: list[float] = []
        for e in self.effects:
            for q in e.parameters:
                known = self.fixed.get(e.name)
                if known is not None:
                    mean.append(known[q.name] / q.scale)
                else:
                    mean.append(0.0 if q.strength else float(np.sign(q.typical)))
                precision.append((2 * q.scale / (q.high - q.low)) ** 2)
        own = self.n_theta
        whole = np.diag(np.r_[np.ones(own), precision] + 1e-9)
        if self.tie is not None:
            whole[:own, :own] = self.tie
        return np.array(mean), whole

    def steps(self, p: Array) -> Array:
        """Finite-difference steps at `p`; shape (k,).

        Wide, since a hysteretic replay is rough on a small scale; but no wider than half of where
        an effect stands, since a lag of milliseconds in a library that goes to seconds is sharp.
        """
        own = self.n_theta
        away = np.abs(p[own:])
        near = np.clip(0.5 * away, _LEAST_STEP, _STEP)
        wide = np.where(away < 1e-9, _STEP, near)
        return np.concatenate([np.full(own, _THETA_STEP), wide])

    def start(self, effects: Mapping[str, Mapping[str, float]] | None = None) -> Array:
        """Prior centre for the model parameters, and the effects' values given (or absent)."""
        p = np.zeros(self.size)
        i = self.n_theta
        for e in self.effects:
            given = (effects or {}).get(e.name) or self.fixed.get(e.name) or e.at(0.0)
            for q in e.parameters:
                p[i] = given[q.name] / q.scale
                i += 1
        return p

    def point(self, p: Array) -> ModelPoint:
        """The model point at scaled coordinates `p`."""
        theta = {
            q.name: self._centre(q) + q.prior_sd * float(v)
            for q, v in zip(self.theta, p, strict=False)
        }
        effects = {name: dict(values) for name, values in self.fixed.items()}
        i = self.n_theta
        for e in self.effects:
            effects[e.name] = {}
            for q in e.parameters:
                effects[e.name][q.name] = float(p[i]) * q.scale
                i += 1
        return ModelPoint(theta, effects)

    def value(self, index: int, coordinate: float) -> float:
        """A coordinate in the parameter's own unit."""
        if index < self.n_theta:
            q = self.theta[index]
            return self._centre(q) + q.prior_sd * coordinate
        flat = [q for e in self.effects for q in e.parameters]
        return coordinate * flat[index - self.n_theta].scale
