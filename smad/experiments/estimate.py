"""Estimates with intervals from resampling, and the parameter file that they make."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim_device.plant.parameters import Entry, ParameterSet
from smad.arrays import Array, Index
from smad.experiments.errors import ExperimentError

REPEATS = 200
BLOCKS = 20
"""A run is cut into so many blocks that are drawn as a whole, so that slow errors stay together."""


@dataclass(frozen=True)
class Tolerance:
    """How near a recovered value has to be: a share of the true one, or a difference (SI)."""

    share: float = 0.0
    difference: float = 0.0


@dataclass(frozen=True)
class Estimate:
    """A parameter as found: value and 95 % interval in SI, under the name of the parameter file."""

    name: str
    value: float
    low: float
    high: float
    source: str
    tolerance: Tolerance

    def holds(self, truth: float) -> bool:
        """Whether the value is within its tolerance of the truth."""
        near = max(self.tolerance.share * abs(truth), self.tolerance.difference)
        return abs(self.value - truth) <= near


def estimates_from(
    parameters: Mapping[str, Tolerance], intervals: tuple[Array, Array, Array], source: str
) -> list[Estimate]:
    """An estimate of each parameter from value, low and high, each of shape (k,)."""
    return [
        Estimate(name, float(value), float(low), float(high), source, tolerance)
        for (name, tolerance), value, low, high in zip(parameters.items(), *intervals, strict=True)
    ]


def bootstrap(
    fit: Callable[[Index], Sequence[float]],
    samples: int,
    seed: int,
    *,
    groups: Sequence[Index] | None = None,
    repeats: int = REPEATS,
) -> tuple[Array, Array, Array]:
    """Value and 95 % interval of each quantity that `fit` returns for a choice of samples.

    `fit` gets sample numbers, shape (m,), and returns k numbers. The interval is that of the moving
    block bootstrap: blocks of neighbouring samples are drawn with replacement and fitted anew. With
    `groups` (such as two prestresses) each group is resampled within itself. Resamples that cannot
    be fitted (LinAlgError, ValueError) are drawn again, at most as many as there are repeats.
    Raises ExperimentError where none can be.

    Returns three arrays of shape (k,): value, low, high. Reference: Künsch, Ann. Statist. 17, 1989.
    """
    rng = np.random.default_rng(seed)
    parts = [np.arange(samples)] if groups is None else list(groups)
    value = np.asarray(fit(np.concatenate(parts)), float)
    resampled: list[Array] = []
    for _ in range(2 * repeats):
        if len(resampled) == repeats:
            break
        chosen = np.concatenate([_blocks(part, rng) for part in parts])
        try:
            resampled.append(np.asarray(fit(chosen), float))
        except (np.linalg.LinAlgError, ValueError):
            continue
    if not resampled:
        raise ExperimentError(
            "the value was found, but not its interval: no resample of the samples can be fitted",
            value=f"{samples} samples, {2 * repeats} resamples",
            action="record a longer run, in which more transforms",
        )
    low, high = np.percentile(np.array(resampled), [2.5, 97.5], axis=0)
    return value, np.minimum(low, value), np.maximum(high, value)


def _blocks(part: Index, rng: np.random.Generator) -> Index:
    length = max(1, part.size // BLOCKS)
    starts = rng.integers(0, part.size - length + 1, size=-(-part.size // length))
    return np.concatenate([part[start : start + length] for start in starts])[: part.size]


def with_estimates(
    parameters: ParameterSet, estimates: Sequence[Estimate], title: str
) -> ParameterSet:
    """The set with the estimated values, marked `derived` with their source.

    Raises ParameterError when the values together have no physical meaning.
    """
    checked = parameters.replace(**{estimate.name: estimate.value for estimate in estimates})
    by_name: Mapping[str, Estimate] = {estimate.name: estimate for estimate in estimates}

    def entry(old: Entry) -> Entry:
        estimate = by_name.get(old.name)
        if estimate is None:
            return old
        return dataclasses.replace(
            old,
            status="derived",
            source=f"{estimate.source}; 95 % interval "
            f"{old.shown(estimate.low)} to {old.shown(estimate.high)}",
        )

    return ParameterSet(title, tuple(entry(old) for old in checked.entries))
