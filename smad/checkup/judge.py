"""What is new with the same inputs: now − then.

Asked in the order of the other questions: whether anything stands out of the repeat floor, whether
other values of the parameters explain it, then places, laws and names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from smad.checkup.paired.difference import SHARE, Paired, paired
from smad.checkup.paired.reference import Reference
from smad.checkup.told import verdict_of
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.numerics.white import Shrink
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint, PlantModel, SavesModel, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.contrast import with_priors
from smad.diagnosis.search.locate import Alternative, Located, locate
from smad.diagnosis.search.names import Naming, likely_entries
from smad.diagnosis.verdict import PARAMETERS, PLACES, QUIET, UNPLACED, Verdict


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a check-up found before it is told.

    `gain` is what the best law of a place takes of runs left out, `parameters` what other values of
    the parameters take, in squares of rows; `ratio` the mean square of a row. `beside_parameters`
    is what rows keep with parameters open within their priors, and what that freedom costs: twice
    the log of the volume that it adds to theirs of one day to the next.
    """

    located: Located
    gain: float
    parameters: float
    ratio: float
    beside_parameters: float

    def outcome(self, c: Constants) -> str:
        """Quiet, parameters, places, or changed without a place, by the rule of `Constants`."""
        moved = self.parameters >= c.quiet_parameters
        if self.gain < c.quiet_gain and not moved and self.ratio < c.quiet_ratio:
            return QUIET
        # A further place fits more, whatever has changed: it must earn what noise gives to one.
        steps = range(1, len(self.located.where.steps) + 1)
        left = min((self.located.left(n) + (n - 1) * c.quiet_gain for n in steps), default=0.0)
        trusted = left + c.slopes_trusted * self.parameters
        stands_out = self.gain >= c.quiet_gain and bool(self.located.told)
        if moved and (not stands_out or self.beside_parameters <= trusted):
            return PARAMETERS
        return PLACES if self.located.told else UNPLACED


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A verdict with what it rests on: the pairs, and the places with their laws."""

    pairs: Paired
    verdict: Verdict
    found: Found

    @property
    def located(self) -> Located:
        """Places and laws; told only where the outcome is places."""
        return self.found.located

    @property
    def model(self) -> ModelPoint:
        """The reference model with what was found: named effects, and laws without a name."""
        point, own = self.pairs.point, self.located
        if self.verdict.outcome != PLACES:
            return point
        return ModelPoint(point.theta, {**point.effects, **own.effects}, own.own)

    @property
    def has_model(self) -> bool:
        """Whether anything was found that a model can carry."""
        return self.model != self.pairs.point

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Places between which these runs do not decide, with their laws."""
        return self.located.alternatives if self.verdict.outcome == PLACES else ()

    @property
    def variance(self) -> float:
        """Variance of a white row beside the places told; 1 at least."""
        return max(self.located.left() / max(self.located.rows.count, 1), 1.0)

    @property
    def uncertainty(self) -> Uncertainty | None:
        """The covariance of the laws of `model`; None where it has none."""
        return self.located.uncertainty if self.verdict.outcome == PLACES else None


class SavablePlant(PlantModel, SavesModel, Protocol):
    """A plant that can write a model file."""


def save_found(plant: SavesModel, found: Judged, path: Path) -> None:
    """Writes the model that a check-up found, with the covariance of its laws."""
    plant.save_model(found.model, path, found.verdict.headline, found.uncertainty)


@repeatable
def judged(
    plant: PlantModel,
    reference: Reference,
    runs: Sequence[tuple[GapRun, str]],
    *,
    constants: Constants | None = None,
    exclude: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Judged:
    """The verdict over runs of now, each with the name of the good run that it repeats.

    Effects of `exclude` are not asked. Raises PairingError for inputs that differ too much.
    """
    constants = constants or shipped()
    pairs = paired(with_places(plant), reference, runs)
    found = examined(pairs, constants, exclude, progress)
    return Judged(pairs=pairs, verdict=verdict_of(
        pairs, found.located, found.outcome(constants), constants.quiet_gain
    ), found=found)  # fmt: skip


def examined(
    pairs: Paired,
    constants: Constants,
    exclude: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Found:
    """Everything that the rule needs of a check-up."""
    plant, reference = pairs.plant, pairs.reference
    progress("where it lies")
    naming = Naming(
        tuple(e for e in plant.effects if e.name not in exclude),
        lambda effects, z: likely_entries(pairs, reference.atoms, pairs.signatures, effects, z),
    )
    located = locate(pairs, plant, reference.responses, naming, constants=constants)
    kept = pairs.fold >= 0
    own = FoldRows(pairs.untied, pairs.slopes.astype(np.float32), pairs.fold)
    taken = with_priors(own.products(np.arange(len(pairs.slopes))), np.unique(pairs.fold[kept]))
    opened = Shrink(pairs.slopes)(pairs.untied[None])[0][kept]
    squares = np.linalg.eigvalsh(pairs.slopes @ pairs.slopes.T).clip(0.0)
    freedom = float(np.sum(np.log1p(squares) - np.log1p(SHARE**2 * squares)))
    best = located.where.ranked[0].share if located.where.ranked else 0.0
    return Found(
        located=located, gain=best * located.where.size, parameters=taken,
        ratio=float(pairs.z @ pairs.z) / max(pairs.white.count, 1),
        beside_parameters=float(opened @ opened) + freedom,
    )  # fmt: skip
