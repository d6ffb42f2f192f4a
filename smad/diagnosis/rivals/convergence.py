"""Carry a fit on to convergence: with fresh slopes, by exact replays, from several starts."""

from dataclasses import replace

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.rivals.evidence import Evidence
from smad.diagnosis.rivals.fit import NAT, Fit, Reference, fit, reference_at, reference_of

_POLISHES, _POLISH_ROUNDS = 12, 4
_ON_THE_WAY = 3.0
"""Finite-difference steps that slopes of the parameters outlast until a fit seems to have ended.
With one in their place four check-ups took 8 % longer; at the end of fits three left F too large.
"""


def reusable_slopes(source: Reference | Fit, steps: float = 1.0) -> Array:
    """Slopes of the parameters that still hold, (p, n), or (0, n).

    They hold while every coordinate is within so many finite-difference `steps` of where they were
    measured, and the parts are the same.
    """
    x, then = source.x, source.linearized_at
    far = len(then) != len(x) or (np.abs(x - then) > steps * source.model.steps(then)).any()
    return source.slopes[: 0 if far else source.model.parameters]


def polished(evidence: Evidence, fitted: Fit, *, offset: float = 1.0, exact: bool = True) -> Fit:
    """Repeat the fit with fresh slopes of its parts until F falls by less than a nat.

    Slopes of the parameters are computed again where `reusable_slopes` has none: on the way within
    `_ON_THE_WAY` steps, and at the end of an `exact` fit within one.
    """
    steps = _ON_THE_WAY
    for _ in range(_POLISHES):
        again = replace(fitted, slopes=reusable_slopes(fitted, steps))
        base = again if exact else reference_of(evidence, again)
        refitted = base and fit(
            evidence,
            fitted.model,
            fitted.x,
            base,
            rounds=_POLISH_ROUNDS,
            offset=offset,
            exact=exact,
        )
        if not refitted:
            return fitted
        gained, fitted = fitted.objective - refitted.objective, refitted
        if abs(gained) < NAT:
            if not exact or steps == 1.0 or len(reusable_slopes(again)):
                break
            steps = 1.0
    return fitted


def fit_to_end(evidence: Evidence, reference: Reference, *, near: bool = False) -> Fit | None:
    """Fit the model of a reference to convergence; None where the model fails.

    The first fit is nearly least squares (an offset as large as the loudest channel), the second
    has the geometric mean of that offset and 1, the last minimises F. A start `near` the minimum
    needs the last alone.
    """
    start = replace(reference, slopes=reusable_slopes(reference))
    loudest = max(float(evidence.variances(evidence.residual(reference.exact)).max()), 1.0)
    offsets = (1.0,) if near else (loudest, loudest**0.5, 1.0)
    fitted = fit(evidence, reference.model, reference.x, start, offset=offsets[0])
    for offset in dict.fromkeys(offsets):
        if fitted:
            fitted = polished(
                evidence,
                replace(fitted, objective=np.inf),
                offset=offset,
                # Far from the minimum an approximate descent direction suffices.
                exact=offset < loudest or offset == 1.0,
            )
    return fitted


def fit_from_several(evidence: Evidence, reference: Reference) -> Fit | None:
    """The best of three converged fits; None where the model fails.

    F has many local minima where springs reverse: 583 and 215 on the same good runs. The fits start
    at the reference, by least squares and with F, and half way from there to the first minimum.
    """
    first = fit_to_end(evidence, reference)
    if first is None:
        return None
    half = reference_at(evidence, reference.model, 0.5 * (reference.x + first.x))
    fits = (first, fit_to_end(evidence, reference, near=True), half and fit_to_end(evidence, half))
    return min((fitted for fitted in fits if fitted), key=lambda fitted: fitted.objective)
