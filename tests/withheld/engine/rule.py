"""One rule: from a score table to what is the matter, with its probability.

Every hypothesis h has a prior share π, a held-out score S, the mean over the cells in nats, and
parameters that have moved by M from those of the known-good runs:

    log P(h) = log π(h) + (S(h) − S(0)) / (1/τ + κ G) − s log(1 + (M(h)/m)²),   G = max S − S(0)

Means, since where the model's form is wrong more runs do not make an answer surer. τ tempers small
differences; what differs by less than the share κ of all that can be gained is not told apart,
since no entry has just the form of the bench's law. A bench that is quiet, or to whose model the
right entry was added, has its parameters where they were, up to about m. Runs and blocks of time
are resampled and the posterior is averaged over that, so that one run does not decide against the
others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from smad.gap.fit.significance import resample_weights
from smad.gap.plant import Array
from tests.withheld.engine.table import Kind, Row, ScoreTable

_EVEN = 0.5


class Constants(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the rule takes from benches whose truth is known.

    `parameters`, `known` and `unknown` are prior odds against nothing; `known` is that of one
    entry, and again of each further one. `temper` is τ, `form` is κ, by which entries may be wrong:
    a further entry must also gain where so much of what the others change is uncertain. `moved` is
    m in nats, `steep` is s. Two answers within `odds` are not told apart.
    """

    parameters: float
    known: float
    unknown: float
    temper: float
    form: float
    moved: float
    steep: float
    odds: float


@dataclass(frozen=True)
class Ruling:
    """What is the matter.

    `names` are the entries, the most probable first, `group` what stands within the odds of the
    last of them, where that is in doubt, `rest` whether something beside the names is needed.
    `probability` is that of the kind, or that the last name or one of its group is there;
    `shares` are those of every set of names by kind.
    """

    kind: Kind
    names: tuple[str, ...]
    group: tuple[str, ...]
    rest: bool
    probability: float
    shares: dict[tuple[Kind, frozenset[str]], float]


@dataclass(frozen=True)
class Weighed:
    """Mean score of every row, nats a cell, in each resample of runs and blocks: (draws, rows)."""

    table: ScoreTable
    means: Array

    @classmethod
    def of(cls, table: ScoreTable, form: float, *, draws: int = 400, seed: int = 0) -> Weighed:
        """Scores with entries uncertain in `form`. Deterministic in its arguments."""
        rng = np.random.default_rng(seed)
        counted = table.size > 0
        weights = resample_weights(table.run[counted], table.block[counted], draws, rng)
        return cls(table, weights @ table.scores(form)[:, counted].T / max(table.cells, 1))

    def told(self, constants: Constants) -> Array:
        """By how much every row is better than the first, in units that are told apart."""
        gains = self.means - self.means[:, :1]
        most = gains.max(axis=1, keepdims=True)
        return np.asarray(gains / (1.0 / constants.temper + constants.form * most))

    def posterior(self, constants: Constants) -> Array:
        """Probability of every row; sums to 1. Shape (rows,)."""
        moved = np.array([row.moved for row in self.table.rows])
        logs = self.told(constants) + np.log(priors(self.table.rows, constants))
        logs -= constants.steep * np.log1p(np.square(moved / constants.moved))
        logs -= logs.max(axis=1, keepdims=True)
        shares = np.exp(logs)
        return np.asarray((shares / shares.sum(axis=1, keepdims=True)).mean(axis=0))


def priors(rows: Iterable[Row], constants: Constants) -> Array:
    """Prior odds of every row: those of its kind, divided among the rows of one kind and size."""
    given = list(rows)
    # An entry as it was in good runs is nothing new, whatever its name.
    alike = [(r.kind, 0 if r.kind is Kind.NOTHING else len(r.names)) for r in given]
    own = {
        Kind.NOTHING: 1.0,
        Kind.PARAMETERS: constants.parameters,
        Kind.UNKNOWN: constants.unknown,
    }
    return np.array(
        [
            own.get(kind, constants.known**names) / alike.count((kind, names))
            for kind, names in alike
        ]
    )


def decide(table: ScoreTable, constants: Constants) -> Ruling:
    """What the table says under these constants."""
    return ruled(Weighed.of(table, constants.form), constants)


def is_steady(table: ScoreTable, constants: Constants) -> bool:
    """Whether cells of twice the length give the same kind and the same names."""
    one, other = (decide(t, constants) for t in (table, table.doubled()))
    return (one.kind, frozenset(one.names)) == (other.kind, frozenset(other.names))


def ruled(weighed: Weighed, constants: Constants) -> Ruling:
    """What weighed scores say: every entry that is rather there than not, or the likeliest else."""
    shares = shares_of(weighed.table.rows, weighed.posterior(constants))
    present = presence(shares)
    names = tuple(e for e, p in present.items() if p > _EVEN) or tuple(present)[:1]
    group = _group(present, names, constants.odds)
    # Only sets of entries have names.
    p = sum(p for (_, told), p in shares.items() if told & {*names[-1:], *group})
    if p > _EVEN:
        rest = _leaves_a_rest(weighed, names, constants)
        return Ruling(Kind.KNOWN, names, group, rest, p, shares)
    quiet = {k: shares.get((k, frozenset()), 0.0) for k in Kind if k is not Kind.KNOWN}
    kind = max(quiet, key=lambda k: quiet[k])
    return Ruling(kind, (), (), False, quiet[kind], shares)


def presence(shares: Mapping[tuple[Kind, frozenset[str]], float]) -> dict[str, float]:
    """Probability that each entry is there, alone or beside others; the most probable first."""
    found: dict[str, float] = {}
    for (_, names), p in shares.items():
        for name in names:
            found[name] = found.get(name, 0.0) + p
    return dict(sorted(found.items(), key=lambda pair: (-pair[1], pair[0])))


def shares_of(rows: Iterable[Row], posterior: Array) -> dict[tuple[Kind, frozenset[str]], float]:
    """Posterior of every kind and set of names."""
    out: dict[tuple[Kind, frozenset[str]], float] = {}
    for row, p in zip(rows, posterior.tolist(), strict=True):
        key = (row.kind, frozenset(row.names) if row.kind is Kind.KNOWN else frozenset())
        out[key] = out.get(key, 0.0) + p
    return out


def _leaves_a_rest(weighed: Weighed, names: Sequence[str], constants: Constants) -> bool:
    """Whether a flexible model is better than names by more than entries may be wrong by."""
    told, rows = weighed.told(constants).mean(axis=0), weighed.table.rows
    flexible = [told[i] for i in weighed.table.where(Kind.UNKNOWN)]
    named = [told[i] for i in weighed.table.where(Kind.KNOWN) if set(rows[i].names) <= set(names)]
    if not flexible or not named:
        return bool(flexible)
    return bool(max(flexible) - max(named) > np.log(constants.odds))


def _group(present: Mapping[str, float], names: Sequence[str], odds: float) -> tuple[str, ...]:
    """What could stand in the place of the last name, if that is in doubt; most probable first."""
    if not names or present[names[-1]] > odds / (1.0 + odds):
        return ()
    last = present[names[-1]]
    return tuple(e for e, p in present.items() if e not in names and last < odds * p)
