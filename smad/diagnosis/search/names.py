"""Names: which effect of the library acts as the law of a place does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from smad.diagnosis.data.played import Atom, signatures
from smad.diagnosis.gap import Gap, white_change
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

    def likely(self, z: Array) -> list[Refined]:
        """The effects that take most of white rows, the best first."""
        return self.refine(self.effects, z)


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


@dataclass
class Library:
    """Effects asked at a gap; signatures are made as they are first asked for."""

    gap: Gap
    only: tuple[bool, ...] | None = None
    _known: dict[str, tuple[list[Atom], Array]] = field(default_factory=dict)

    def __call__(self, effects: Sequence[Effect], z: Array) -> list[Refined]:
        """See `likely_entries`."""
        atoms: list[Atom] = []
        parts = [np.zeros((0, len(z)))]
        for effect in effects:
            own, rows = self._signatures(effect)
            atoms += own
            parts.append(rows)
        return likely_entries(self.gap, atoms, np.concatenate(parts), effects, z, only=self.only)

    def _signatures(self, effect: Effect) -> tuple[list[Atom], Array]:
        if effect.name not in self._known:
            gap = self.gap
            atoms, found = signatures(gap.plant, gap.point, gap.played, effects=[effect])
            raw = [f.astype(np.float64).reshape(len(atoms), *b.shape)
                   for f, b in zip(found, gap.base, strict=True)]  # fmt: skip
            if self.only is not None:
                raw = [r if own else np.zeros_like(r)
                       for r, own in zip(raw, self.only, strict=True)]  # fmt: skip
            self._known[effect.name] = atoms, gap.rows(raw)
        return self._known[effect.name]
