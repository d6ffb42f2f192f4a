"""From a paired residual to hypotheses with probabilities.

Every hypothesis is a fit in white space. Entries are screened by their stored signatures, the best
are refined by replay, sets grow by forward steps. What is left over after the best, as a share of
the excess, is what nothing of the library explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.gap.paired.constants import Constants
from smad.gap.paired.difference import SHARE, Paired
from smad.gap.paired.fits import Screened, screen
from smad.gap.paired.refine import Refined, refine
from smad.gap.plant import Array, EffectValues, Mask

_REFINED = 6
_REFINED_FURTHER = 3
MOST_CAUSES = 3
_PER_PARAMETER = 6.0


@dataclass(frozen=True)
class Findings:
    """What a check-up found, in white space.

    `ratio` is the mean square of all rows, `by_channel` and `by_run` of parts, 1 on a bench without
    a change. `excess` is the sum of squares beyond what quiet channels reach; `left` is what the
    accepted set leaves of it, over that and what the set takes. `singles` are the refined entries,
    best first; `steps` the sets that were accepted, growing; `parameters` what freely moved
    parameters take, each within its prior.
    """

    count: int
    ratio: float
    by_channel: Array
    by_run: Array
    excess: float
    parameters: float
    parameter_odds: float
    screened: tuple[Screened, ...]
    singles: tuple[Refined, ...]
    steps: tuple[Refined, ...]
    left: float

    @property
    def best_gain(self) -> float:
        return self.singles[0].gain if self.singles else 0.0


def examine(
    paired: Paired,
    constants: Constants,
    exclude: Sequence[str] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Findings:
    """Everything that the rule needs. Entries named in `exclude` are not asked."""
    z, white = paired.z, paired.white
    count, good = white.count, white.valid
    channel, run = white.channel_of_row(), white.run_of_row()
    by_channel = _ratios(z, good, channel, len(paired.plant.channels))
    by_run = _ratios(z, good, run, len(paired.pairs))
    ratio = float(z @ z) / max(count, 1)
    S = paired.signatures
    screened = _screened(paired, S @ S.T, S @ z, exclude)
    progress("refining the best")
    singles = _refined_singles(paired, screened, z)
    gain, odds = _parameters(paired)
    found = Findings(
        count, ratio, by_channel, by_run, 0.0, gain, odds, tuple(screened), tuple(singles), (), 0.0
    )
    return stepped(paired, found, constants)


def stepped(paired: Paired, found: Findings, constants: Constants) -> Findings:
    """The findings with the sets that these constants accept, and what those leave."""
    z, good, channel = paired.z, paired.white.valid, paired.white.channel_of_row()
    steps = _forward(paired, constants, found.singles, z)
    excess = _excess(z, good, channel, constants)
    rest = _excess(z - steps[-1].change, good, channel, constants) if steps else excess
    taken = steps[-1].gain if steps else 0.0
    left = float(np.clip(rest / max(rest + taken, 1e-9), 0.0, 1.0))
    return replace(found, excess=excess, steps=tuple(steps), left=left)


def _excess(z: Array, good: Mask, channel: Array, constants: Constants) -> float:
    """Sum of squares beyond what a channel reaches without a change."""
    total = np.bincount(channel[good], z[good] ** 2)
    count = np.bincount(channel[good])
    return float(np.maximum(total - constants.quiet_excess * count, 0.0).sum())


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


def score(fit: Refined) -> float:
    """What a fit takes, less what its free parameters take of noise."""
    return fit.gain - _PER_PARAMETER * len(fit.coordinates)


def _refined_singles(paired: Paired, screened: Sequence[Screened], z: Array) -> list[Refined]:
    out = []
    for s in screened[:_REFINED]:
        found = refine([s.effect], {s.effect.name: s.values}, z, paired.white_change)
        if found is not None:
            out.append(found)
    return sorted(out, key=lambda r: -score(r))


def _parameters(paired: Paired) -> tuple[float, float]:
    """What parameters take within their priors beyond the tied ones, and log odds against those."""
    J, z = paired.slopes, paired.untied
    A, g = J @ J.T, J @ z
    one = np.eye(len(A))

    def evidence(share: float) -> tuple[float, float]:
        B = A + one / share**2
        gain = float(g @ np.linalg.solve(B, g))
        return gain, 0.5 * np.linalg.slogdet(one + share**2 * A)[1]

    tied, tied_cost = evidence(SHARE)
    free, free_cost = evidence(1.0)
    return free - tied, float(free_cost - tied_cost)


def _forward(
    paired: Paired,
    constants: Constants,
    singles: Sequence[Refined],
    z: Array,
) -> list[Refined]:
    """Sets that grow from the best single one while a further entry beats the form's allowance."""
    if not singles:
        return []
    steps = [singles[0]]
    while len(steps) < MOST_CAUSES:
        found = _further(paired, constants, steps[-1], z)
        if found is None:
            break
        steps.append(found)
    return steps


def _further(paired: Paired, constants: Constants, now: Refined, z: Array) -> Refined | None:
    """The best set of one entry more, if that entry beats the form's allowance.

    What the set so far changes is known to a share only. Rows count the less the more it changes
    them, so that a further entry has to be seen where the set does not already act.
    """
    weight = 1.0 / np.sqrt(1.0 + (constants.further_form * now.change) ** 2)
    left, S = weight * (z - now.change), weight * paired.signatures
    if float(left @ left) < constants.quiet_gain:
        return None
    free = weight * now.slopes
    free = free[np.einsum("ij,ij->i", free, free) > 1e-9]
    Q = np.linalg.qr(free.T)[0].T if len(free) else np.zeros((0, len(z)))
    beside, T = left - Q.T @ (Q @ left), S - (S @ Q.T) @ Q
    again = _screened(paired, T @ T.T, T @ beside, now.names)

    def weighted(effects: EffectValues) -> Array | None:
        change = paired.white_change(effects)
        return None if change is None else weight * change

    best: Refined | None = None
    for s in again[:_REFINED_FURTHER]:
        if s.gain < 0.5 * constants.quiet_gain:
            break
        start = {**now.values, s.effect.name: s.values}
        found = refine([*now.effects, s.effect], start, weight * z, weighted, rounds=3)
        if found is not None and (best is None or score(found) > score(best)):
            best = found
    if best is None:
        return None
    rest = weight * z - best.change
    more = _PER_PARAMETER * (len(best.coordinates) - len(now.coordinates))
    if float(left @ left) - float(rest @ rest) - more < constants.quiet_gain:
        return None
    change = paired.white_change(best.values)
    if change is None:
        return None
    gain = float(z @ z - (z - change) @ (z - change))
    slopes = best.slopes / weight
    return replace(best, change=change, gain=gain, slopes=slopes)
