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


_Tried = tuple[float, Settled, list[Array]]
"""What a model leaves of runs that it had no part of, the model, and its predictions."""


def listed(settler: Settler, rows: FoldRows, steps: Sequence[Step]) -> Listed | None:
    """The steps that each take what is worth telling in the simulator; None if it cannot replay.

    What counts are the runs that laws are selected on, each by a model that had no part of it:
    runs that are held out altogether have no say in the list.
    """
    runs = [k for k, own in enumerate(settler.gap.counts) if own]
    now = settler.first()
    predicted = None if now is None else settler.held_out(now)
    if now is None or predicted is None:
        return None
    kept: list[Step] = []
    settled, found = [now], [tuple(predicted)]
    squares = [settler.square(predicted, runs)]
    for step in steps:
        own = fits(rows, [*kept, step])
        best: _Tried | None = None
        for alone in (True, False):
            more = settler.extended(settled[-1], own.columns, own.fit.mean, alone=alone)
            best = _better(settler, runs, more, best)
        # A large law moves the other coordinates far: one step may end beside what it is after.
        last = None if best is None else best[1]
        for _ in range(_ROUNDS):
            if last is None or best is None or best[0] < squares[-1]:
                break
            last = settler.refreshed(last)
            best = _better(settler, runs, last, best)
        if best is None or squares[-1] - best[0] < WORTH_TELLING * squares[0]:
            continue
        kept.append(step)
        squares.append(best[0])
        settled.append(best[1])
        found.append(tuple(best[2]))
    for _ in range(_ROUNDS if kept else 0):
        last = settler.refreshed(settled[-1])
        predicted = settler.held_out(last)
        if predicted is None or (left := settler.square(predicted, runs)) >= squares[-1]:
            break
        settled[-1], found[-1], squares[-1] = last, tuple(predicted), left
    if kept:
        n = len(settler.plant.parameters)
        still = settler.unmoved(settled[-1].columns, settled[-1].x[n:])
        predicted = None if still is None else settler.held_out(still)
        if still is not None and predicted is not None:
            left = settler.square(predicted, runs)
            # With the laws in it the model may need no other values of its parameters.
            if left <= squares[-1]:
                settled[-1], found[-1], squares[-1] = still, tuple(predicted), left
    return Listed(
        settler=settler, steps=tuple(kept), settled=tuple(settled), predicted=tuple(found),
        squares=tuple(squares),
    )  # fmt: skip


def _better(
    settler: Settler, runs: Sequence[int], more: Settled | None, best: _Tried | None
) -> _Tried | None:
    """The one of two models that leaves less of runs that it had no part of."""
    predicted = None if more is None else settler.held_out(more)
    if more is None or predicted is None:
        return best
    left = settler.square(predicted, runs)
    return (left, more, predicted) if best is None or left < best[0] else best
