"""The score table: how well every hypothesis predicts every cell that it was not fitted to.

A cell is a block of one output of one run. A hypothesis is judged by the sum q of its squared white
residuals in each cell, from which a score follows whatever is held uncertain beside it, so that a
table can be judged again under other constants without another replay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from smad.gap.data.replay import Index
from smad.gap.plant import Array


class Kind(StrEnum):
    """What a hypothesis says of the runs.

    `NOTHING`: the model as it was. `PARAMETERS`: other values of them. `KNOWN`: entries of the
    library. `UNKNOWN`: something that only a flexible model follows.
    """

    NOTHING = "nothing"
    PARAMETERS = "parameters"
    KNOWN = "known"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Row:
    """One hypothesis.

    `names` are the entries in it, in the order in which they came. `parent` is the row that it has
    one entry more than, -1 where there is none. `q` is the sum of squared white residuals of each
    cell, held out; `unsure` the mean square of what its entries change there, white as well.
    `moved` is how far its parameters are from those of the known-good runs: half the squared
    distance in the precision with which those are known, nats; 0 where a hypothesis lets them move.
    """

    kind: Kind
    names: tuple[str, ...]
    q: Array
    unsure: Array
    parent: int = -1
    moved: float = 0.0


@dataclass(frozen=True)
class ScoreTable:
    """Hypotheses against cells. The first row is the model as it was.

    `size` counts the rows of each cell, `block` numbers its block of time within its run `run`, and
    `output` is what it is of. `dof` is the prior weight of a cell's scale being the floor's.
    """

    rows: tuple[Row, ...]
    size: Array
    run: Index
    block: Index
    output: tuple[str, ...]
    dof: float

    def likelihood(self, q: Array, unsure: Array | float = 0.0) -> Array:
        """Student-t log-likelihood of each cell up to a constant, its scale integrated out.

        `unsure` is a variance of white residuals beside that of the floor, which is 1.
        """
        scaled = q / (1.0 + unsure)
        return -0.5 * (self.dof + self.size) * np.log1p(scaled / self.dof) * (self.size > 0)

    def scores(self, form: float) -> Array:
        """Held-out log-score of every row in every cell; shape (rows, cells).

        What the entries of a row change is uncertain by the share `form` of itself. An entry beside
        others counts by what it gains where that is allowed for.
        """
        out: list[Array] = []
        for row in self.rows:
            if row.parent < 0 or not self.rows[row.parent].names:
                out.append(self.likelihood(row.q))
                continue
            before = self.rows[row.parent]
            allowed = form**2 * before.unsure
            gain = self.likelihood(row.q, allowed) - self.likelihood(before.q, allowed)
            out.append(out[row.parent] + gain)
        return np.array(out)

    @cached_property
    def cells(self) -> int:
        """How many cells count."""
        return int(np.sum(self.size > 0))

    def doubled(self) -> ScoreTable:
        """The same table with cells of twice the length."""
        outputs = {name: i for i, name in enumerate(dict.fromkeys(self.output))}
        number = [outputs[name] for name in self.output]
        place = np.column_stack([self.run, number, self.block // 2])
        first, cell = np.unique(place, axis=0, return_index=True, return_inverse=True)[1:]
        cell = cell.ravel()

        def summed(values: Array) -> Array:
            return np.asarray(np.bincount(cell, weights=values), dtype=np.float64)

        size = summed(self.size)

        def merged(row: Row) -> Row:
            changed = summed(row.unsure * self.size) / np.maximum(size, 1.0)
            return replace(row, q=summed(row.q), unsure=changed)

        return replace(
            self,
            rows=tuple(merged(row) for row in self.rows),
            size=size,
            run=self.run[first],
            block=self.block[first] // 2,
            output=tuple(self.output[i] for i in first.tolist()),
        )

    def where(self, kind: Kind) -> list[int]:
        """Rows of one kind."""
        return [i for i, row in enumerate(self.rows) if row.kind is kind]


def joined(parts: Sequence[Array]) -> Array:
    """Cells of the runs to fit, then those held out."""
    return np.concatenate([np.asarray(p, dtype=np.float64) for p in parts])
