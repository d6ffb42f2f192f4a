"""A baseline from runs, and a check-up against it: what the command line and banks both call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from smad.checkup.constants import Constants, shipped_constants
from smad.checkup.files import (
    Found,
    Matched,
    match,
    require_one_bench,
    require_other_recordings,
)
from smad.checkup.judge import Findings, entry_of, examine
from smad.checkup.paired.difference import Paired, paired
from smad.checkup.paired.reference import Reference, reference_from
from smad.checkup.verdict import CAUSE, GROUP, Verdict, decide, is_quiet
from smad.diagnosis.constants import shipped
from smad.diagnosis.errors import PairingError
from smad.diagnosis.model_file import SavesModel, write_model
from smad.diagnosis.numerics.threads import repeatable
from smad.diagnosis.places.place import Forceable
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import ModelPoint, PlantModel, Uncertainty
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.locate import Alternative, Located, locate


def _silent(text: str) -> None:
    pass


@repeatable
def commissioned(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    start: ModelPoint | None = None,
    progress: Callable[[str], None] = _silent,
) -> Reference:
    """The reference of good runs, the repeats of each run of a programme in a group."""
    reference = reference_from(plant, groups, start, progress)
    if not isinstance(plant, Forceable):
        return reference
    played = [r.played for r in reference.runs]
    found = responses(plant, reference.point, played, progress=progress)
    return replace(reference, responses=found.runs)


def checked(
    plant: PlantModel,
    reference: Reference,
    runs: Sequence[tuple[GapRun, str]],
    constants: Constants | None = None,
    progress: Callable[[str], None] = _silent,
) -> Verdict:
    """The verdict over runs of now, each with the name of the good run that it repeats."""
    return judged(plant, reference, runs, constants, progress).verdict


@dataclass(frozen=True)
class Judged:
    """A verdict with what it rests on: the pairs, and the places with their laws.

    `located` is None on a quiet bench, and of a plant whose equations cannot be forced.
    """

    pairs: Paired
    verdict: Verdict
    located: Located | None

    @property
    def model(self) -> ModelPoint:
        """The reference model with what was found: named effects, and laws without a name."""
        point = self.pairs.reference.point
        v = self.verdict
        effects = v.likely[0].values if v.outcome in (CAUSE, GROUP) else {}
        named = {p.place for p in v.places if p.name}
        laws = self.located.laws if self.located is not None and v.places else ()
        own = tuple(law for law in laws if law.place not in named)
        return ModelPoint(point.theta, {**point.effects, **effects}, own)

    @property
    def has_model(self) -> bool:
        """Whether anything was found that a model can carry."""
        point = self.pairs.reference.point
        return bool(self.model.laws) or self.model.effects != point.effects

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Places between which these runs do not decide, with their laws."""
        return () if self.located is None else self.located.alternatives

    @property
    def variance(self) -> float:
        """Variance of a white row beside the places told; 1 at least."""
        if self.located is None or not self.located.where.steps:
            return 1.0
        left = 1.0 - self.located.where.steps[-1].share
        return max(left * self.located.square / max(self.located.count, 1), 1.0)

    @property
    def uncertainty(self) -> Uncertainty | None:
        """The covariance of the laws of `model`; None where it has none."""
        if self.located is None or self.located.uncertainty is None:
            return None
        names = {n for law in self.model.laws for n in law.names}
        known = self.located.uncertainty
        at = [k for k, n in enumerate(known.names) if n in names]
        if not at:
            return None
        return Uncertainty(tuple(known.names[k] for k in at), known.covariance[np.ix_(at, at)])


class SavablePlant(PlantModel, SavesModel, Protocol):
    """A plant that can write a model file."""


def save_found(plant: SavesModel, found: Judged, path: Path) -> None:
    """Writes the model that a check-up found, with the covariance of its laws."""
    write_model(plant, found.model, found.uncertainty, path, found.verdict.headline)


@repeatable
def judged(
    plant: PlantModel,
    reference: Reference,
    runs: Sequence[tuple[GapRun, str]],
    constants: Constants | None = None,
    progress: Callable[[str], None] = _silent,
) -> Judged:
    """The same with what it rests on, which a page and a model file need."""
    constants = constants or shipped_constants()
    pairs = paired(plant, reference, runs)
    findings, located = asked(pairs, constants, progress=progress)
    return Judged(pairs, decide(pairs, findings, constants, located), located)


def asked(
    pairs: Paired,
    constants: Constants,
    exclude: Sequence[str] = (),
    progress: Callable[[str], None] = _silent,
) -> tuple[Findings, Located | None]:
    """What a verdict rests on: entries of the library, and places with their laws.

    Entries named in `exclude` are not asked. Nothing is located on a bench that is quiet, of a
    plant whose equations cannot be forced, and where no run has the inputs of a good one.
    """
    findings = examine(pairs, constants, exclude, progress)
    known, plant = pairs.reference.responses, pairs.plant
    if not known or not isinstance(plant, Forceable) or is_quiet(findings, constants):
        return findings, None
    if all(p.carried for p in pairs.pairs):
        return findings, None
    progress("where it lies")
    played = [r.played for r in pairs.reference.runs]
    found = responses(plant, pairs.reference.point, played, known=known)
    entry = partial(entry_of, pairs)
    return findings, locate(pairs, plant, found, entry, constants=shipped(), exclude=exclude)


def checked_files(
    plant: PlantModel,
    good: Sequence[Found],
    now: Sequence[Found],
    progress: Callable[[str], None] = _silent,
) -> tuple[Judged, Matched]:
    """The verdict over files of a good day and of now, and what was paired with what.

    Raises PairingError when nothing is paired, when a run of now is one of the good ones, when a
    good one is given twice, and when runs of two benches are mixed.
    """
    require_one_bench([*good, *now])
    require_other_recordings(good, now)
    matched = match(plant, good, now)
    if not matched.now:
        raise PairingError(
            "no run of now has the inputs of a good one",
            value=f"{len(good)} good, {len(now)} now",
            action="play the same programme on both days; smad docs guide/check-up says how",
        )
    reference = commissioned(plant, matched.groups, progress=progress)
    return judged(plant, reference, matched.now, progress=progress), matched
