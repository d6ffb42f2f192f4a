"""A list of places whose laws are proven in the simulator, on runs that had no part in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from smad.diagnosis.numerics.folds import Array, FoldRows
from smad.diagnosis.search.settle import Settled, Settler
from smad.diagnosis.search.where import Step, fits


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


def listed(
    settler: Settler,
    rows: FoldRows,
    steps: Sequence[Step],
    judged: Sequence[int],
    least_share: float,
) -> Listed | None:
    """The steps that each take `least_share` more in the simulator; None if it cannot replay.

    `judged` are the runs that count: held out by whole runs, or by turns of a run's stretches.
    """
    now = settler.first()
    predicted = None if now is None else settler.held_out(now)
    if now is None or predicted is None:
        return None
    square = settler.square(predicted, judged)
    kept: list[Step] = []
    settled, found, squares = [now], [tuple(predicted)], [square]
    for step in steps:
        own = fits(rows, [*kept, step])
        more = settler.extended(settled[-1], own.columns, own.fit.mean)
        predicted = None if more is None else settler.held_out(more)
        if more is None or predicted is None:
            continue
        left = settler.square(predicted, judged)
        if squares[-1] - left < least_share * squares[0]:
            continue
        kept.append(step)
        settled.append(more)
        found.append(tuple(predicted))
        squares.append(left)
    if kept:
        last = settler.refreshed(settled[-1])
        predicted = settler.held_out(last)
        if predicted is not None and settler.square(predicted, judged) < squares[-1]:
            settled[-1], found[-1] = last, tuple(predicted)
            squares[-1] = settler.square(predicted, judged)
    return Listed(
        settler=settler, steps=tuple(kept), settled=tuple(settled), predicted=tuple(found),
        squares=tuple(squares),
    )  # fmt: skip
