"""A small policy and a search for it: a linear feedback, and the cross-entropy method.

No framework: enough for an example, and for the table of `bench.policies`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from smad.arrays import Array, Singles
from smad.envs.errors import EnvError
from smad.envs.signals import NAMES

_U, _X, _Y, _INLET, _NOW, _AHEAD = (
    NAMES.index(name)
    for name in (
        "displacement_mm",
        "rtd_x_degC",
        "rtd_y_degC",
        "rtd_inlet_degC",
        "reference_mm",
        "reference_ahead_mm",
    )
)
_WARM_K = 20.0
WEIGHTS = ("error", "ahead", "position", "warmth", "water at rest", "water by demand", "by warmth")
"""What each weight of the policy is for."""
START = np.array([0.5, 0.5, 0.1, 0.0, 0.0, 0.5, 0.0])
SPREAD = np.array([0.5, 0.5, 0.2, 0.3, 0.3, 0.5, 0.3])


class Vector(Protocol):
    """What is used of a vector environment: `SpringPairVectorEnv`, or another plant's."""

    num_envs: int
    steps: int

    def reset(self, *, seed: Sequence[int]) -> tuple[Any, dict[str, Any]]: ...
    def step(self, actions: npt.ArrayLike, /) -> tuple[Any, Any, Any, Any, dict[str, Any]]: ...


def act(weights: Array, seen: npt.NDArray[np.floating[Any]]) -> Singles:
    """Actions of the kind "demand" for observations.

    weights (…, 7), see WEIGHTS; seen (…, 12). The two springs are treated alike: what warms X
    cools Y. Returns shape (…, 3).
    """
    w = np.moveaxis(np.asarray(weights), -1, 0)
    seen = np.asarray(seen, dtype=np.float64)
    error = seen[..., _NOW] - seen[..., _U]
    rise = seen[..., _AHEAD] - seen[..., _NOW]
    warm_x, warm_y = ((seen[..., reading] - seen[..., _INLET]) / _WARM_K for reading in (_X, _Y))
    demand = w[0] * error + w[1] * rise + w[2] * seen[..., _NOW] + w[3] * (warm_y - warm_x)
    duty_x = w[4] - w[5] * demand + w[6] * warm_x
    duty_y = w[4] + w[5] * demand + w[6] * warm_y
    out = np.empty((*demand.shape, 3), dtype=np.float32)
    out[..., 0] = np.clip(demand, -1.0, 1.0)
    out[..., 1] = np.clip(duty_x, 0.0, 1.0)
    out[..., 2] = np.clip(duty_y, 0.0, 1.0)
    return out


def returns(env: Vector, weights: Array, seeds: npt.ArrayLike) -> Array:
    """Mean reward of a step over whole episodes, mm; shape (n,), weights (n, 7), seeds (n,).

    An episode that the board ends counts to its end, by what the environment takes for the rest.
    """
    seen, _ = env.reset(seed=[int(seed) for seed in np.asarray(seeds)])
    total, going = np.zeros(env.num_envs), np.ones(env.num_envs, dtype=np.bool_)
    steps = env.steps
    for _ in range(steps):
        seen, rewards, terminated, truncated, _ = env.step(act(weights, seen))
        total += np.where(going, rewards, 0.0)
        going &= ~(terminated | truncated)
    return total / steps


@dataclass(frozen=True, kw_only=True)
class Search:
    """A cross-entropy search: `population` candidates a generation, each in `episodes` episodes,
    of which the best `elite` make the next."""

    population: int = 32
    episodes: int = 4
    generations: int = 15
    elite: int = 6
    least_spread: float = 0.02

    @property
    def num_envs(self) -> int:
        """Environments that the search needs."""
        return self.population * self.episodes

    def run(
        self, env: Vector, seed: int, progress: Callable[[int, float], None] | None = None
    ) -> Array:
        """The weights it ends with. All candidates of a generation meet the same plants and
        references. Raises EnvError for an environment of another size."""
        if env.num_envs != self.num_envs:
            raise EnvError(
                "the search needs another vector",
                value=env.num_envs,
                limit=f"num_envs={self.num_envs}",
            )
        rng = np.random.default_rng(seed)
        mean, spread = START.copy(), SPREAD.copy()
        for generation in range(self.generations):
            candidates = mean + spread * rng.standard_normal((self.population, mean.size))
            candidates[0] = mean
            seeds = rng.integers(2**31, size=self.episodes)
            got = returns(
                env, np.repeat(candidates, self.episodes, axis=0), np.tile(seeds, self.population)
            )
            score = got.reshape(self.population, self.episodes).mean(axis=1)
            best = candidates[np.argsort(-score)[: self.elite]]
            mean, spread = best.mean(axis=0), np.maximum(best.std(axis=0), self.least_spread)
            if progress is not None:
                progress(generation, float(score.max()))
        return mean


def tracking_error_mm(env: Vector, weights: Array, seed: int) -> Array:
    """Mean distance of the displacement from the reference in each episode, mm; shape (n,)."""
    seeds = seed + np.arange(env.num_envs)
    return -returns(env, np.broadcast_to(weights, (env.num_envs, len(weights))), seeds)
