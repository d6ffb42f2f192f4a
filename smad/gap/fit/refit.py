"""The refit of the nominal model: what the uncertain parameters alone can remove."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from smad.gap.fit.joint import polished
from smad.gap.fit.lsq import FitResult, Problem, fitted
from smad.gap.model.space import Space
from smad.gap.plant import Array, EffectValues, Parameter

REFIT_ITERATIONS = 8


def refit(
    problem: Problem,
    parameters: Sequence[Parameter],
    centre: Mapping[str, float] | None = None,
    fixed: EffectValues | None = None,
    *,
    squares: bool = False,
    tie: Array | None = None,
) -> FitResult:
    """Fit of the model parameters within their bounds, from the prior's centre.

    `fixed` are effects that belong to the model, `squares` asks for plain least squares, `tie`
    holds the parameters near the centre (see `Space`).

    The fit is finished with the coarse step calibrated near where it ends.
    """
    space = Space(tuple(parameters), (), centre, fixed or {}, tie)
    begin = space.start()
    problem = problem.calibrated(space.point(begin))
    fit = fitted(
        problem,
        space,
        begin,
        iterations=REFIT_ITERATIONS,
        refresh_theta=True,
        squares=squares,
        rough=True,
    ).recalibrated()
    if not squares:
        return polished(fit)
    return fitted(fit.problem, space, fit.p, theta_A=fit.A, iterations=3, squares=True)
