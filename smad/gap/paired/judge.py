"""From a paired residual to hypotheses with probabilities.

Every hypothesis is a fit in white space. Entries are screened by their stored signatures, the best
are refined by replay, sets grow by forward steps. Beside them a flexible correction is fitted: all
refined entries at strengths of their own and parameters free within their priors, and whatever
stands out of a channel after that. What it takes beyond a set, as a share, that set does not
explain.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from smad.gap.paired.constants import Constants
from smad.gap.paired.difference import SHARE, Paired
from smad.gap.paired.fits import Screened, screen
from smad.gap.paired.refine import Refined, refine
from smad.gap.plant import Array, EffectValues, Mask

_REFINED = 6
_REFINED_FURTHER = 2
MOST_CAUSES = 3
_PER_PARAMETER = 6.0
_WORTH_TRYING = 50.0
_RIDGE = 1e-6


@dataclass(frozen=True)
class Findings:
    """What a check-up found, in white space.

    `ratio` is the mean square of all rows, `by_channel` and `by_run` of parts, 1 on a bench without
    a change. `singles` are the refined entries, best first; `steps` the sets that grow from the
    first of them, `beyond` what each further entry of these takes where the form of those before is
    allowed for. `flexible` is what the flexible correction takes that goes with each of the steps,
    `parameters` what freely moved parameters take, each within its prior.
    """

    count: int
    ratio: float
    by_channel: Array
    by_run: Array
    parameters: float
    parameter_odds: float
    screened: tuple[Screened, ...]
    singles: tuple[Refined, ...]
    steps: tuple[Refined, ...]
    beyond: tuple[float, ...]
    flexible: tuple[float, ...]

    @property
    def best_gain(self) -> float:
        return self.singles[0].gain if self.singles else 0.0

    def set_by(self, constants: Constants) -> int:
        """Which of `steps` these constants accept: how many further entries are worth a name."""
        worth = (b >= constants.further_gain for b in self.beyond)
        return sum(1 for _ in takewhile(bool, worth))

    def left_by(self, step: int) -> float:
        """What a step leaves of what a flexible correction takes, as a share."""
        if not self.steps:
            return 1.0
        return float(
            np.clip(1.0 - self.steps[step].gain / max(self.flexible[step], 1e-9), 0.0, 1.0)
        )


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
        count, ratio, by_channel, by_run, gain, odds, tuple(screened), tuple(singles), (), (), ()
    )
    return stepped(paired, found, constants)


def stepped(paired: Paired, found: Findings, constants: Constants) -> Findings:
    """The findings with the sets that grow under these constants, and what goes beyond those."""
    steps, beyond = _forward(paired, constants, found.singles)
    flexible = tuple(_flexible(paired, constants, (*found.singles, s)) for s in steps)
    return replace(found, steps=tuple(steps), beyond=tuple(beyond), flexible=flexible)


def _flexible(paired: Paired, constants: Constants, fits: Sequence[Refined]) -> float:
    """What a flexible correction takes.

    First these fits at strengths of their own, with parameters free within their priors, less what
    so many directions take of noise. Then what channels show beyond a quiet one's where the form of
    that is allowed for.
    """
    z = paired.z
    changes = np.array([f.change for f in fits])
    X = np.concatenate([changes, paired.tie(paired.slopes)])
    A, b = X @ X.T, X @ z
    size = np.einsum("ij,ij->i", changes, changes)
    ridge = np.concatenate([_RIDGE * np.maximum(size, 1.0), np.ones(len(X) - len(changes))])
    inverse = np.linalg.inv(A + np.diag(ridge))
    moved = (inverse @ b) @ X
    gain = float(z @ z - (z - moved) @ (z - moved) - np.einsum("ij,ji->", A, inverse))
    left = _form_weight(paired, moved, constants.further_form) * (z - moved)
    good, channel = paired.white.valid, paired.white.channel_of_row()
    total = np.bincount(channel[good], left[good] ** 2)
    quiet = constants.channel_ratio * np.bincount(channel[good])
    return gain + float(np.maximum(total - quiet, 0.0).sum())


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
    paired: Paired, constants: Constants, singles: Sequence[Refined]
) -> tuple[list[Refined], list[float]]:
    """Sets that grow from the best single one, and what each further entry takes.

    Beside an entry that is not worth a name itself none is sought.
    """
    steps, beyond = list(singles[:1]), []
    while steps and score(steps[0]) > constants.quiet_gain and len(steps) < MOST_CAUSES:
        found = _further(paired, constants, steps[-1])
        if found is None:
            break
        steps.append(found[0])
        beyond.append(found[1])
    return steps, beyond


def _form_weight(paired: Paired, change: Array, form: float) -> Array:
    """How much each row counts beside a set that changes it by `change`, known to a share `form`.

    What a law of another form gets wrong stands where and near where the law acts: the allowance
    has the row's own change in it, and the mean square over the signal in that run.
    """
    run, channel = paired.white.run_of_row(), paired.white.channel_of_row()
    part = run * len(paired.plant.channels) + channel
    good = paired.white.valid
    total = np.bincount(part[good], change[good] ** 2, minlength=int(part.max()) + 1)
    mean = total / np.maximum(np.bincount(part[good], minlength=len(total)), 1)
    return np.asarray(1.0 / np.sqrt(1.0 + form**2 * (change**2 + mean[part])))


def _further(paired: Paired, constants: Constants, now: Refined) -> tuple[Refined, float] | None:
    """The best set of one entry more, and what that entry takes beside the form's allowance.

    What the set so far changes is known to a share only. Rows count the less the more it changes
    them, so that a further entry has to be seen where the set does not already act.
    """
    z = paired.z
    weight = _form_weight(paired, now.change, constants.further_form)
    left, S = weight * (z - now.change), weight * paired.signatures
    if float(left @ left) < _WORTH_TRYING:
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
        if s.gain < 0.5 * _WORTH_TRYING:
            break
        start = {**now.values, s.effect.name: s.values}
        found = refine([*now.effects, s.effect], start, weight * z, weighted, rounds=2)
        if found is not None and (best is None or score(found) > score(best)):
            best = found
    if best is None:
        return None
    rest = weight * z - best.change
    more = _PER_PARAMETER * (len(best.coordinates) - len(now.coordinates))
    taken = float(left @ left) - float(rest @ rest) - more
    change = paired.white_change(best.values)
    if taken < _WORTH_TRYING or change is None:
        return None
    gain = float(z @ z - (z - change) @ (z - change))
    slopes = best.slopes / weight
    return replace(best, change=change, gain=gain, slopes=slopes), taken
