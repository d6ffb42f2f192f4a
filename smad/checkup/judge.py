"""From a paired residual to hypotheses: entries that are screened, refined, and grow into sets.

Every hypothesis is a fit in white space. Entries are screened by their stored signatures, the best
are refined by replay, and sets grow from the best by forward steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from smad.checkup.constants import Constants
from smad.checkup.evidence import PER_COORDINATE, Products, products
from smad.checkup.fits import Screened, screen
from smad.checkup.refine import Refined, refine
from smad.diagnosis.search.locate import Entry
from smad.gap.paired.difference import Paired
from smad.gap.plant import Array, Effect, Mask

_REFINED = 6
_REFINED_FURTHER = 2
_REFINED_AT_PLACE = 3
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
    screened = _screened(paired, S @ S.T, S @ z, exclude)
    progress("refining the best")
    singles = _refined_singles(paired, screened, z)
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
    out = []
    atoms = paired.reference.atoms
    for effect in paired.plant.effects:
        if effect.name in exclude:
            continue
        rows = [
            (i, a.strength, a.level, a.variant, a.values)
            for i, a in enumerate(atoms)
            if a.entry == effect.name
        ]
        found = screen(effect, rows, G, b) if rows else None
        if found is not None:
            out.append(found)
    return sorted(out, key=lambda s: -s.gain)


def best_entry(paired: Paired, effects: Sequence[Effect], z: Array) -> Entry | None:
    """The one of these effects that takes most of the white rows `z`, refined by replay."""
    S = paired.signatures
    screened = _screened(paired, S @ S.T, S @ z, [e.name for e in paired.plant.effects
                                                  if e not in effects])  # fmt: skip
    found = [
        refine([s.effect], {s.effect.name: s.values}, z, paired.white_change)
        for s in screened[:_REFINED_AT_PLACE]
    ]
    best = max((f for f in found if f is not None), key=score, default=None)
    if best is None or best.gain <= 0.0:
        return None
    return Entry(best.names[0], best.values, best.gain)


def score(fit: Refined) -> float:
    """What a fit takes, less what its free parameters take of noise."""
    return fit.gain - PER_COORDINATE * len(fit.coordinates)


def _refined_singles(paired: Paired, screened: Sequence[Screened], z: Array) -> list[Refined]:
    out = []
    for s in screened[:_REFINED]:
        found = refine([s.effect], {s.effect.name: s.values}, z, paired.white_change)
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
               paired.white_change, rounds=2)
        for s in _screened(paired, T @ T.T, T @ beside, (*now.names, *exclude))[:_REFINED_FURTHER]
    ]  # fmt: skip
    better = [f for f in found if f is not None and score(f) > score(now)]
    return max(better, key=score, default=None)
