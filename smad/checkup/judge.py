"""From a paired residual to hypotheses: entries that are screened, refined, and grow into sets.

Every hypothesis is a fit in white space. Entries are screened by their stored signatures, the best
are refined by replay, and sets grow from the best by forward steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from smad.checkup.constants import Constants
from smad.checkup.evidence import Products, products
from smad.checkup.paired.difference import Paired
from smad.diagnosis.gap import white_change
from smad.diagnosis.plant import Array, Effect, Mask
from smad.diagnosis.search.names import Entry, best_entry, score, screened
from smad.diagnosis.search.refine import Refined, refine
from smad.diagnosis.search.screen import Screened

_REFINED = 6
_REFINED_FURTHER = 2
MOST_CAUSES = 3
_LEAST_SLOPE = 1e-9


@dataclass(frozen=True)
class Findings:
    """What a check-up found, in white space.

    `ratio` is the mean square of all rows, `by_channel` and `by_run` of parts, 1 on a bench without
    a change. `singles` are the refined entries, best first; `sets` grow from the first of them, one
    entry more at a time. `products` holds what the evidence for all of these follows from.
    """

    count: int
    ratio: float
    by_channel: Array
    by_run: Array
    singles: tuple[Refined, ...]
    sets: tuple[Refined, ...]
    products: Products

    @property
    def fits(self) -> tuple[Refined, ...]:
        """Singles and sets, as `products` has them."""
        return (*self.singles, *self.sets)


def examine(
    paired: Paired,
    constants: Constants,
    exclude: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Findings:
    """Everything that the rule needs. Entries named in `exclude` are not asked."""
    z, white = paired.z, paired.white
    good = white.valid
    S = paired.signatures
    found = _screened(paired, S @ S.T, S @ z, exclude)
    progress("refining the best")
    singles = _refined_singles(paired, found, z)
    sets = _grown(paired, constants, singles, exclude)
    return Findings(
        white.count,
        float(z @ z) / max(white.count, 1),
        _ratios(z, good, white.channel_of_row(), len(paired.plant.channels)),
        _ratios(z, good, white.run_of_row(), len(paired.pairs)),
        tuple(singles),
        tuple(sets),
        products(paired, singles, sets, constants),
    )


def _ratios(z: Array, good: Mask, group: Array, size: int) -> Array:
    total = np.bincount(group[good], z[good] ** 2, minlength=size)
    return np.asarray(total / np.maximum(np.bincount(group[good], minlength=size), 1))


def _screened(paired: Paired, G: Array, b: Array, exclude: Sequence[str]) -> list[Screened]:
    effects = [e for e in paired.plant.effects if e.name not in exclude]
    return screened(effects, paired.reference.atoms, G, b)


def entry_of(paired: Paired, effects: Sequence[Effect], z: Array) -> Entry | None:
    """The one of these effects that takes most of the white rows `z`, refined by replay."""
    return best_entry(paired, paired.reference.atoms, paired.signatures, effects, z)


def _refined_singles(paired: Paired, entries: Sequence[Screened], z: Array) -> list[Refined]:
    out = []
    for s in entries[:_REFINED]:
        found = refine([s.effect], {s.effect.name: s.values}, z, partial(white_change, paired))
        if found is not None:
            out.append(found)
    return sorted(out, key=lambda r: -score(r))


def _grown(
    paired: Paired, constants: Constants, singles: Sequence[Refined], exclude: Sequence[str]
) -> list[Refined]:
    """Sets that grow from the best single entry.

    Beside an entry that is not worth a name itself none is sought.
    """
    if not singles or score(singles[0]) <= constants.quiet_gain:
        return []
    sets: list[Refined] = []
    now: Refined | None = singles[0]
    while now is not None and len(now.names) < MOST_CAUSES:
        now = _further(paired, now, exclude)
        if now is not None:
            sets.append(now)
    return sets


def _further(paired: Paired, now: Refined, exclude: Sequence[str]) -> Refined | None:
    """The best set of one entry more, found beside what this one leaves once it is free."""
    z = paired.z
    free = now.slopes[np.einsum("ij,ij->i", now.slopes, now.slopes) > _LEAST_SLOPE]
    Q = np.linalg.qr(free.T)[0].T if len(free) else np.zeros((0, len(z)))
    left, S = z - now.change, paired.signatures
    beside, T = left - Q.T @ (Q @ left), S - (S @ Q.T) @ Q
    found = [
        refine([*now.effects, s.effect], {**now.values, s.effect.name: s.values}, z,
               partial(white_change, paired), rounds=2)
        for s in _screened(paired, T @ T.T, T @ beside, (*now.names, *exclude))[:_REFINED_FURTHER]
    ]  # fmt: skip
    better = [f for f in found if f is not None and score(f) > score(now)]
    return max(better, key=score, default=None)
