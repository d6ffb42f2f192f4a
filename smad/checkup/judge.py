"""What is new with the same inputs: now − then.

Asked in the order of the other questions: whether anything stands out of the repeat floor, whether
other values of the parameters explain it, then places, laws and names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from smad.checkup.paired.difference import Paired, paired
from smad.checkup.paired.reference import Reference
from smad.checkup.told import verdict_of
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.numerics.forward import held_out
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.plant import ModelPoint, PlantModel, SavesModel, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.locate import Alternative, Located, locate
from smad.diagnosis.search.names import Naming, likely_entries
from smad.diagnosis.search.where import MOST_PLACES
from smad.diagnosis.verdict import PARAMETERS, PLACES, QUIET, UNPLACED, Verdict

QUIET_RATIO = 1.1
"""Mean square of a white row from which on something has changed, whatever it is. Floors are so
wide that it stays below 1 where nothing has."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """What decides whether anything has changed, and whether parameters are the answer.

    `gain` is what the best law of a place takes of runs left out, `explained` what the first place
    takes, be it a law or an effect, `parameters` what other values of the parameters take, in
    squares of rows; `count` are the rows and `ratio` is the mean square of one.
    """

    gain: float
    explained: float
    parameters: float
    count: int
    ratio: float

    def noticed(self, c: Constants) -> bool:
        """Whether a check-up stands out of the repeat floor."""
        moved = self.parameters >= c.quiet_parameters
        return self.gain >= c.quiet_gain or moved or self.ratio >= QUIET_RATIO

    def of_parameters(self, c: Constants) -> bool:
        """Whether other values of the parameters are the answer to a change that was noticed.

        The model's slopes have not the bench's form, so a change of parameters leaves something
        that a law takes, more of a larger change: on development benches it grows with the square
        root. The rows, whose number stands for their noise, make that a number without unit.
        """
        if self.parameters < c.quiet_parameters:
            return False
        form = c.parameters_form * np.sqrt(self.parameters * self.count)
        return bool(self.gain < c.quiet_gain or self.explained < form)


@dataclass(frozen=True, kw_only=True)
class Found(Sizes):
    """What a check-up found before it is told."""

    located: Located

    def outcome(self, c: Constants) -> str:
        """Quiet, parameters, places, or changed without a place, by the rule of `Constants`."""
        if not self.noticed(c):
            return QUIET
        if self.of_parameters(c):
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
        """The reference model with what was found: named effects, and laws without a name, or
        other values of the parameters."""
        if self.verdict.outcome == PARAMETERS:
            return self.pairs.moved[0]
        return self.located.model if self.verdict.outcome == PLACES else self.pairs.point

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
        return max(self.located.left / max(self.located.rows.count, 1), 1.0)

    @property
    def uncertainty(self) -> Uncertainty | None:
        """The covariance of what `model` has; None where nothing was found."""
        if self.verdict.outcome == PARAMETERS:
            return self.pairs.moved[1]
        return self.located.uncertainty if self.verdict.outcome == PLACES else None


class SavablePlant(PlantModel, SavesModel, Protocol):
    """A plant that can write a model file."""


def save_found(plant: SavesModel, found: Judged, path: Path) -> None:
    """Writes the model that a check-up found, with its covariance."""
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
    most: int = MOST_PLACES,
) -> Found:
    """Everything that the rule needs of a check-up, `most` places at most."""
    progress("where it lies")
    naming = Naming(
        tuple(e for e in pairs.plant.effects if e.name not in exclude),
        partial(likely_entries, pairs, pairs.reference.atoms, pairs.signatures),
    )
    located = locate(pairs, pairs.responses, naming, constants=constants, most=most)
    kept = pairs.fold >= 0
    moved = FoldRows(pairs.untied, pairs.slopes.astype(np.float32), pairs.fold)
    taken = held_out(moved.products(), np.unique(pairs.fold[kept]), prior=1.0)
    ranked, steps = located.where.ranked, located.where.steps
    best = ranked[0].share if ranked else 0.0
    first = steps[0].share if steps else 0.0
    return Found(
        located=located,
        gain=best * located.where.size,
        explained=max(best, first) * located.where.size,
        parameters=taken,
        count=located.rows.count,
        ratio=float(pairs.z @ pairs.z) / max(pairs.white.count, 1),
    )
