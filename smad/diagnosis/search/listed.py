"""A list of places whose laws are proven in the simulator, on runs that had no part in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from smad.diagnosis.numerics.folds import Array, FoldRows
from smad.diagnosis.search.settle import Settled, Settler
from smad.diagnosis.search.where import WORTH_TELLING, Step, fits

_ROUNDS = 4
"""Steps at most in which the whole list is settled."""


@dataclass(frozen=True, kw_only=True)
class Listed:
    """The steps that brought the simulator nearer, in the order in which they were found.

    `settled` and `predicted` begin with the parameters alone, one more entry for each step;
    predictions (bins, channels) a run are held out. `squares` are what they leave of the rows
    judged, and `shares` what each step took of what the parameters left.
    """

    settler: Settler
    steps: tuple[Step, ...]
    settled: tuple[Settled, ...]
    predicted: tuple[tuple[Array, ...], ...]
    squares: tuple[float, ...]

    @property
    def shares(self) -> tuple[float, ...]:
        """What each step took of what the parameters left."""
        first = max(self.squares[0], 1e-12)
        return tuple((a - b) / first for a, b in zip(self.squares, self.squares[1:], strict=False))


_Tried = tuple[float, Settled, tuple[Array, ...]]
"""What a model leaves of runs that it had no part of, the model, and its predictions."""


def listed(settler: Settler, rows: FoldRows, steps: Sequence[Step]) -> Listed | None:
    """The steps that each take what is worth telling in the simulator; None if it cannot replay.

    What counts are the runs that laws are selected on, each by a model that had no part of it:
    runs that are held out altogether have no say in the list. Beside a new law the parameters stay
    where they were, or move as well, whichever leaves less.
    """
    first = _tried(settler, settler.first())
    if first is None:
        return None
    kept: list[Step] = []
    found = [first]
    for step in steps:
        own = fits(rows, [*kept, step])
        tries = [
            _tried(settler, settler.extended(found[-1][1], own.columns, own.fit.mean, alone=alone))
            for alone in (True, False)
        ]
        best = min((t for t in tries if t is not None), key=lambda t: t[0], default=None)
        if best is not None and found[-1][0] - best[0] >= WORTH_TELLING * first[0]:
            kept.append(step)
            found.append(best)
    for _ in range(_ROUNDS if kept else 0):
        last = _tried(settler, settler.refreshed(found[-1][1]))
        if last is None or last[0] >= found[-1][0]:
            break
        found[-1] = last
    squares, settled, predicted = zip(*found, strict=True)
    return Listed(
        settler=settler, steps=tuple(kept), settled=settled, predicted=predicted, squares=squares
    )


def _tried(settler: Settler, model: Settled | None) -> _Tried | None:
    """A model with what it leaves of runs that it had no part of; None if it cannot replay them."""
    predicted = None if model is None else settler.held_out(model)
    if model is None or predicted is None:
        return None
    runs = [k for k, own in enumerate(settler.gap.counts) if own]
    return settler.square(predicted, runs), model, tuple(predicted)
