"""Strength of an effect: the magnitude that leaves 1, 3 or 10 floors after the oracle's refit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evaluation.bank import oracle
from evaluation.bank.recorder import Run, record
from evaluation.plant.effects import BY_NAME, Active
from evaluation.plant.parameters import Bench

Array = NDArray[np.float64]

TRIALS = 6
CLOSE_ENOUGH = 0.2


@dataclass(frozen=True)
class Plan:
    """Which runs a case has: (family, seed, role) each, and how long they are."""

    runs: tuple[tuple[str, int, str], ...]
    seconds: float


@dataclass(frozen=True)
class Rig:
    """One bench with the runs of one case and what an oracle makes of them without effects."""

    bench: Bench
    plan: Plan
    slopes: oracle.Slopes
    floor_squares: Array

    def recorded(self, active: tuple[Active, ...], bench: Bench | None = None) -> list[Run]:
        """All runs of the plan, with `active` effects (on another `bench` if given)."""
        where = bench or self.bench
        return [
            record(where, active, family, seed, seconds=self.plan.seconds, number=i)
            for i, (family, seed, _) in enumerate(self.plan.runs)
        ]

    def split(self, runs: Sequence[Run]) -> tuple[list[Run], list[Run]]:
        """The runs to fit on and those held out."""
        roles = [role for _, _, role in self.plan.runs]
        fit = [run for run, role in zip(runs, roles, strict=True) if role == "fit"]
        return fit, [run for run, role in zip(runs, roles, strict=True) if role == "hold_out"]

    def after_refit(
        self, runs: Sequence[Run], start: Array | None = None, slopes: oracle.Slopes | None = None
    ) -> tuple[oracle.Gap, oracle.Refit]:
        """What remains of the runs' gap when the plant without effects is refitted to them."""
        fit, held_out = self.split(runs)
        result = oracle.refit(self.bench, fit, held_out, slopes or self.slopes, start=start)
        return oracle.excess(result.held_out, self.floor_squares), result


def rig(bench: Bench, plan: Plan) -> Rig:
    """Record the plan without effects; its refitted held-out residual is the floor."""
    nothing = oracle.Slopes(np.zeros((0, 0)), np.zeros(0))
    blank = Rig(bench, plan, nothing, np.ones(len(oracle.SIGNALS)))
    runs = blank.recorded(())
    fit, held_out = blank.split(runs)
    slopes = oracle.slopes_at(bench, fit)
    floor = oracle.refit(bench, fit, held_out, slopes).held_out
    return Rig(bench, plan, slopes, floor)


@dataclass(frozen=True)
class Strength:
    """An effect at a wanted gap, and the gap (in floors) that it really leaves."""

    active: Active
    gap: oracle.Gap

    def reaches(self, target: float) -> bool:
        """Whether the gap is near enough to the wanted one to count as that strength."""
        return 0.7 * target <= self.gap.worst <= 1.45 * target


def find(rig_: Rig, effect: Active, target: float) -> Strength:
    """Scale `effect` until its gap is `target` floors, within its limit and `TRIALS` trials.

    The search starts at the effect's own magnitude.
    A secant on log gap against log magnitude, kept inside the bracket that the trials leave.
    """
    spec = BY_NAME[effect.name]
    sign = -1.0 if effect.magnitude < 0 else 1.0
    size = min(abs(effect.magnitude), spec.limit)
    low, high = spec.usual * 1e-4, spec.limit
    tried: list[tuple[float, float]] = []
    best: Strength | None = None
    start: Array | None = None
    slopes: oracle.Slopes | None = None
    for _ in range(TRIALS):
        active = replace(effect, magnitude=sign * size)
        gap, found = rig_.after_refit(rig_.recorded((active,)), start, slopes)
        slopes = found.slopes
        here = Strength(active, gap)
        off = abs(np.log(max(gap.worst, 1e-3) / target))
        if best is None or off < abs(np.log(max(best.gap.worst, 1e-3) / target)):
            best = here
        if off < CLOSE_ENOUGH or (size >= spec.limit and gap.worst < target):
            break
        if gap.worst < target:
            low = max(low, size)
        else:
            high = min(high, size)
        tried.append((np.log(size), np.log(max(gap.worst, 0.05))))
        before, size = (
            size,
            _next_size(tried, np.log(target), low, high, untried=high == spec.limit),
        )
        start = found.steps * min(size / before, 1.5)
    assert best is not None
    return best


def _next_size(
    tried: list[tuple[float, float]], target: float, low: float, high: float, *, untried: bool
) -> float:
    """Secant step on logarithms, kept inside (low, high); `untried` allows `high` itself."""
    x, y = tried[-1]
    slope = 1.0
    if len(tried) > 1:
        x0, y0 = tried[-2]
        if abs(x - x0) > 1e-6:
            slope = float(np.clip((y - y0) / (x - x0), 0.4, 3.0))
    size = float(np.exp(x + np.clip((target - y) / slope, -2.5, 2.5)))
    if size >= high and untried:
        return high
    return size if low < size < high else float(np.sqrt(low * high))


def exact_law(rig_: Rig, runs: Sequence[Run], active: tuple[Active, ...]) -> oracle.Gap:
    """Oracle O1: what remains when the true law is inserted and fitted with the constants."""
    fit, held_out = rig_.split(runs)
    slopes = oracle.slopes_at(rig_.bench, fit, active)
    result = oracle.refit(rig_.bench, fit, held_out, slopes, active=active, start_scale=0.9)
    return oracle.excess(result.held_out, rig_.floor_squares)


def raw_gap(rig_: Rig, runs: Sequence[Run]) -> oracle.Gap:
    """The held-out gap before any refit, in floors."""
    _, held_out = rig_.split(runs)
    return oracle.excess(oracle.unfitted(rig_.bench, held_out), rig_.floor_squares)
