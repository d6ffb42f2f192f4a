"""One rule: from a score table to what is the matter, with its probability.

Every hypothesis h has a prior share π and a held-out score S, the mean over the cells in nats:

    log P(h) = log π(h) + (S(h) − S(0)) / (1/τ + κ G) + const,    G = max S − S(0)

Means, since where the model's form is wrong more runs do not make an answer surer. τ tempers small
differences; what differs by less than the share κ of all that can be gained is not told apart,
since no entry has just the form of the bench's law. Runs and blocks of time are resampled and the
posterior is averaged over that, so that one run does not decide against the others.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np

from smad.gap.fit.significance import resample_weights
from smad.gap.plant import Array
from tests.withheld.engine.table import Kind, Row, ScoreTable


class Constants(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the rule takes from benches whose truth is known.

    `nothing`, `parameters`, `known` and `unknown` are prior shares; `known` is that of one entry,
    and again of each further one, and `unknown` that of a rest beside entries, too. `temper` is
    τ, `form` is κ, by which entries may be wrong: a further entry must also gain where so much of
    what the others change is uncertain. Two names are not told apart below `odds`. Whatever is not
    better than less of it in all but `significance` of the resamples is not said.
    """

    nothing: float
    parameters: float
    known: float
    unknown: float
    temper: float
    form: float
    odds: float
    significance: float


@dataclass(frozen=True)
class Ruling:
    """What is the matter.

    `names` are the entries, in the order in which they came, `group` what stands within the odds of
    the last of them that is in doubt ("parameters" for other values of those), `rest` whether
    something beside the names is needed. `probability` is that of the kind, or of the names and
    their group together; `shares` are those of every set of names by kind.
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

    def posterior(self, constants: Constants) -> Array:
        """Probability of every row; sums to 1. Shape (rows,)."""
        gains = self.means - self.means[:, :1]
        most = gains.max(axis=1, keepdims=True)
        told = gains / (1.0 / constants.temper + constants.form * most)
        logs = np.log(priors(self.table.rows, constants)) + told
        logs -= logs.max(axis=1, keepdims=True)
        shares = np.exp(logs)
        return np.asarray((shares / shares.sum(axis=1, keepdims=True)).mean(axis=0))

    def sure(self, row: int, beside: int, constants: Constants) -> bool:
        """Whether a row is better than another in all but `significance` of the resamples."""
        worse = self.means[:, row] <= self.means[:, beside]
        return bool(np.mean(worse) <= constants.significance)


def priors(rows: Iterable[Row], constants: Constants) -> Array:
    """Prior share of every row: that of its kind, divided among the rows of one kind and size."""
    given = list(rows)
    alike = [(r.kind, len(r.names)) for r in given]
    own = []
    for row in given:
        base: float = getattr(constants, row.kind.value)
        # An entry as it was in good runs is nothing new, whatever its name.
        names = 0 if row.kind is Kind.NOTHING else len(row.names)
        further = names - 1 if row.kind is Kind.KNOWN else names
        own.append(base * constants.known**further)
    return np.array([p / alike.count(a) for p, a in zip(own, alike, strict=True)])


def decide(table: ScoreTable, constants: Constants) -> Ruling:
    """What the table says under these constants."""
    return ruled(Weighed.of(table, constants.form), constants)


def is_steady(table: ScoreTable, constants: Constants) -> bool:
    """Whether cells of twice the length give the same kind and the same names."""
    one, other = (decide(t, constants) for t in (table, table.doubled()))
    return (one.kind, frozenset(one.names)) == (other.kind, frozenset(other.names))


def ruled(weighed: Weighed, constants: Constants) -> Ruling:
    """What weighed scores say."""
    table, posterior = weighed.table, weighed.posterior(constants)
    shares = shares_of(table, posterior)
    by_kind = {k: sum(p for (kind, _), p in shares.items() if kind is k) for k in Kind}
    kind = max(Kind, key=lambda k: by_kind[k])
    if kind is not Kind.NOTHING and not _clear(weighed, kind, constants):
        kind = Kind.NOTHING
    if kind is not Kind.KNOWN:
        return Ruling(kind, (), (), False, by_kind[kind], shares)
    best = _best(weighed, posterior, constants)
    names, own = table.rows[best].names, shares[Kind.KNOWN, frozenset(table.rows[best].names)]
    group = _group(shares, frozenset(names), own, constants.odds)
    rest = any(
        r.kind is Kind.UNKNOWN and r.names == names and posterior[i] > posterior[best]
        for i, r in enumerate(table.rows)
    )
    together = own + sum(p for p, _ in group)
    return Ruling(kind, names, tuple(n for _, n in group), rest, min(1.0, together), shares)


def shares_of(table: ScoreTable, posterior: Array) -> dict[tuple[Kind, frozenset[str]], float]:
    """Posterior of every kind and set of names; names with a rest beside them count as names."""
    out: dict[tuple[Kind, frozenset[str]], float] = {}
    for row, p in zip(table.rows, posterior.tolist(), strict=True):
        with_rest = row.kind is Kind.UNKNOWN and row.names
        kind = Kind.KNOWN if with_rest else row.kind
        key = (kind, frozenset() if kind is Kind.NOTHING else frozenset(row.names))
        out[key] = out.get(key, 0.0) + p
    return out


def _clear(weighed: Weighed, kind: Kind, constants: Constants) -> bool:
    """Whether some row of a kind is better than the model as it was beyond chance."""
    return any(weighed.sure(i, 0, constants) for i in weighed.table.where(kind))


def _best(weighed: Weighed, posterior: Array, constants: Constants) -> int:
    """The most probable row of entries, less the entries whose gain is not beyond chance."""
    rows = weighed.table.rows
    shares = shares_of(weighed.table, posterior)
    known = weighed.table.where(Kind.KNOWN)
    best = max(known, key=lambda i: (shares[Kind.KNOWN, frozenset(rows[i].names)], -i))
    while len(rows[best].names) > 1 and not weighed.sure(best, rows[best].parent, constants):
        best = rows[best].parent
    return best


def _group(
    shares: dict[tuple[Kind, frozenset[str]], float], names: frozenset[str], own: float, odds: float
) -> list[tuple[float, str]]:
    """What could stand in the place of one of the names, most probable first."""
    found = []
    for (kind, others), p in shares.items():
        near = own < odds * p
        if kind is Kind.PARAMETERS and near:
            found.append((p, Kind.PARAMETERS.value))
        elif kind is Kind.KNOWN and near and len(others - names) == 1 == len(names - others):
            found.append((p, next(iter(others - names))))
    return sorted(found, key=lambda pair: (-pair[0], pair[1]))
