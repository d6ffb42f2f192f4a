"""Names: which effect of the library acts as the law of a place does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from smad.diagnosis.data.played import Atom, signatures
from smad.diagnosis.gap import Gap, kept_in, white_change
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.plant import Effect
from smad.diagnosis.search.refine import Refined, refine
from smad.diagnosis.search.screen import screen

PER_COORDINATE = 6.0
"""What a free coordinate takes of noise off the sum of squares, and must take beyond to count."""
LIST_GAIN = 2.0 * PER_COORDINATE
"""What a place of a list must take off the sum of squares to be tried in the simulator."""
_REFINED = 5

Refine = Callable[[Sequence[Effect], Array], list[Refined]]
"""Those of some effects that take most of white rows, the best first."""


def score(fit: Refined) -> float:
    """What a fit takes, less what its free parameters take of noise."""
    return fit.gain - PER_COORDINATE * len(fit.coordinates)


@dataclass(frozen=True)
class Naming:
    """The effects that may be named, and how they are refined."""

    effects: tuple[Effect, ...]
    refine: Refine

    def without(self, name: str) -> Naming:
        """The others."""
        return replace(self, effects=tuple(e for e in self.effects if e.name != name))


def likely_entries(
    gap: Gap,
    atoms: Sequence[Atom],
    S: Array,
    effects: Sequence[Effect],
    z: Array,
    *,
    only: Sequence[bool] | None = None,
) -> list[Refined]:
    """Those of these effects that take most of the white rows `z`, refined by replay, best first.

    `S` (atoms, rows) are white signatures; with `only` effects act in the runs marked alone. Empty
    where none takes anything.
    """
    G, b = S @ S.T, S @ z
    screened = [s for s in (screen(e, atoms, G, b) for e in effects) if s is not None]
    likely = sorted(screened, key=lambda s: -s.gain)[:_REFINED]
    white = partial(white_change, gap, only=only)
    found = [refine(s.effect, s.values, z, white) for s in likely]
    return sorted((f for f in found if f is not None and score(f) > 0.0), key=lambda f: -score(f))


def naming_at(gap: Gap, effects: tuple[Effect, ...], only: Sequence[bool] | None = None) -> Naming:
    """Naming by signatures that are made at a gap; with `only` effects act in these runs alone."""
    atoms, found = signatures(gap.plant, gap.point, gap.played, effects=effects)
    S = np.zeros((len(atoms), len(gap.z)))
    for i in range(len(atoms)):
        raw = [f[i : i + 1].astype(np.float64) for f in found]
        S[i] = gap.rows(kept_in(only, raw))[0]
    return Naming(effects, partial(likely_entries, gap, atoms, S, only=only))
