"""The bench as it was: effects that even known-good runs ask for.

A model that lacks a law shows the lack in good runs too. What the library can say of it is fitted
to the good runs and stays in the model, fixed; the question is then what has changed on top of it,
and what remains is K_δ. An effect of the baseline may change as well: it stays a candidate.

What is missing here turns up later as a change that never happened, so that effects enter by the
handful, not by the best one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from smad.gap.fit.descent import descent
from smad.gap.fit.hypothesis import cluster_gain
from smad.gap.fit.joint import FIT_ITERATIONS, polished
from smad.gap.fit.judge import Judged, judge
from smad.gap.fit.lsq import FitResult, Problem, drive, fitted
from smad.gap.fit.refit import REFIT_ITERATIONS, refit
from smad.gap.fit.screen import Screened, probe, reprobe, screen
from smad.gap.model.space import Space
from smad.gap.plant import Array, Effect, Parameter

_LAW_START = 0.3
_LAW_ROUNDS, _LAW_ROUNDS_LAST = 2, 4
"""Rounds of slopes for each kinetics, and for the better of them."""
_ROUNDS, _HANDFUL = 2, 3
"""Rounds in which known-good runs may ask for effects, and effects tried in each."""
_GAIN = 100.0
"""Nats from which an effect belongs to the good bench."""


def learn_baseline(
    fit: FitResult, effects: Sequence[Effect], progress: Callable[[str], None] = lambda text: None
) -> FitResult:
    """The fit of the good runs with the effects that they ask for, all then fixed.

    A few at a time, the best first, judged on good runs left out in turn; a handful that fails
    together is tried by its first alone. What `fit` has already stays free until the end.
    """
    current = fit
    judged: Judged | None = None
    probes = probe(current, sorted(effects, key=lambda e: e.name))
    for _ in range(_ROUNDS):
        probes = reprobe(probes, current)
        asked = [s for s in screen(probes) if s.gain > _GAIN]
        asked = asked[:_HANDFUL]
        if not asked:
            break
        judged = judged or judge([current], None)[0]
        entered = _entered(current, judged, asked)
        if entered is None and len(asked) > 1:
            entered = _entered(current, judged, asked[:1])
        if entered is None:
            break
        current, judged = entered
        progress("baseline: " + ", ".join(e.name for e in current.space.effects))
    return frozen(polished(current.recalibrated()))


def with_laws(
    problem: Problem, parameters: Sequence[Parameter], effects: Sequence[Effect]
) -> FitResult:
    """The least-squares fit of the parameters and of the laws of the library beside them.

    Laws begin at a part of what they typically are, since a slope at nothing says little, and
    parameters at their nominal values: fitted alone, they would stand for the laws. A law without
    a strength replaces another; the fit goes on with it or without, whichever comes further in a
    few rounds. Other starts come no further: on nine benches of the withheld plant none of two
    ended with a misfit that was smaller by more than a thousandth.
    """
    laws = laws_of(effects)
    if not laws:
        return refit(problem, parameters, squares=True)

    def begin(space: Space) -> Array:
        return space.start({e.name: e.at(_LAW_START) for e in space.effects})

    def go(problem: Problem, space: Space, start: Array, rounds: int) -> FitResult:
        return drive([descent(problem, space, start, rounds=rounds)])[0]

    spaces = [Space(tuple(parameters), chosen) for chosen in choices(laws)]
    ends = [go(problem, space, begin(space), _LAW_ROUNDS) for space in spaces]
    # A descent ends calibrated where it is, so that ends compare as if in full detail.
    best = min(ends, key=lambda end: problem.misfit(end.z))
    return go(best.problem, best.space, best.p, _LAW_ROUNDS_LAST)


def laws_of(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Those that are laws, in an order of their own."""
    return tuple(sorted((e for e in effects if e.law), key=lambda e: e.name))


def choices(laws: Sequence[Effect]) -> list[tuple[Effect, ...]]:
    """The laws with those that replace another, and, if there are such, without them."""
    added = tuple(e for e in laws if any(q.strength for q in e.parameters))
    return [tuple(laws), added] if 0 < len(added) < len(laws) else [tuple(laws)]


def _entered(
    current: FitResult, judged: Judged, chosen: Sequence[Screened]
) -> tuple[FitResult, Judged] | None:
    """The fit with these effects too, and it judged, if runs left out gain by it."""
    effects = (*current.space.effects, *(s.effect for s in chosen))
    values = {**current.point.effects, **{s.effect.name: s.start for s in chosen}}
    space, p = current.beside(effects, values)
    trial = fitted(
        current.problem.matching(current.point, current.predicted),
        space,
        p,
        theta_A=current.A[:, : space.n_theta],
        iterations=FIT_ITERATIONS,
        refresh_theta=True,
        rough=True,
    )
    after = judge([trial], None)[0]
    gain, se = cluster_gain(current.problem, None, after.scores() - judged.scores())
    return (trial, after) if gain > max(_GAIN, se) else None


def unbound(tied: FitResult) -> FitResult:
    """The refit in which parameters and laws of a bench may be others than in its good runs.

    From where they are tied to those, with its effects.
    """
    problem, own = tied.problem, tied.space.effects
    held = {e.name for e in own}
    fixed = [e for e in problem.dataset.plant.effects if e.name in tied.space.fixed]
    laws = [e for e in laws_of(fixed) if e.name not in held]
    space = replace(tied.space, tie=None, effects=(*laws, *own))
    start = space.start(tied.point.effects)
    start[: space.n_theta] = tied.p[: space.n_theta]
    end = fitted(
        problem,
        space,
        start,
        theta_A=tied.A[:, : space.n_theta],
        iterations=REFIT_ITERATIONS,
        refresh_theta=True,
        rough=True,
    ).recalibrated()
    return polished(end)


def as_fixed(fit: FitResult) -> FitResult:
    """The same fit, nothing moved, whose effects count as fixed."""
    space = replace(fit.space, effects=(), fixed=fit.point.effects)
    n = space.size
    return replace(fit, space=space, p=fit.p[:n], A=fit.A[:, :n], at_bound=fit.at_bound[:n])


def frozen(fit: FitResult) -> FitResult:
    """The fit with its effects fixed where they are, the parameters refitted in a few steps."""
    space = replace(fit.space, effects=(), fixed=fit.point.effects)
    p, A = fit.p[: space.size], fit.A[:, : space.size]
    return fitted(fit.problem, space, p, theta_A=A, iterations=0)
