"""Is anything left in a residual? Ljung–Box, and cross-correlation with inputs and states.

Diagnostics for the report, never the verdict: where the true law differs in form from the
candidate's, residuals stay coloured after a correct attribution.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from smad.gap.plant import Array

LAGS = 20
_ORDER = 8


def autocorrelation(x: Array, lags: int) -> Array:
    """Autocorrelation at lags 1 … `lags`, with the mean taken out; shape (lags,)."""
    y = x - x.mean()
    power = float(y @ y)
    if power == 0:
        return np.zeros(lags)
    return np.array([float(y[k:] @ y[:-k]) / power for k in range(1, lags + 1)])


def ljung_box(x: Array, lags: int = LAGS) -> tuple[float, float]:
    """Q = n(n+2) Σ ρ_k²/(n−k) and its p-value against χ² with `lags` degrees of freedom.

    A series with fewer lags is tested on those it has.

    Ljung & Box, Biometrika 65 (1978) 297.
    """
    n = len(x)
    lags = min(lags, n - 1)
    if lags < 1:
        return 0.0, 1.0
    rho = autocorrelation(x, lags)
    q = float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    return q, float(chi2.sf(q, lags))


def ar_coefficients(x: Array, order: int) -> Array:
    """Yule–Walker coefficients a of x_t ≈ Σ a_k x_{t−k}; shape (order,)."""
    y = x - x.mean()
    power = float(y @ y)
    if power == 0:
        return np.zeros(order)
    r = np.r_[1.0, autocorrelation(x, order)]
    r[0] += 1e-9
    return np.asarray(solve_toeplitz(r[:-1], r[1:]))


def cross_correlation(driver: Array, residual: Array) -> tuple[float, float]:
    """Largest |correlation| of the residual with a driver 0 … `LAGS` rows earlier, and its p-value.

    Both are filtered by the autoregression that makes the driver white (prewhitening), so that a
    coloured driver does not feign a correlation. The p-value is Bonferroni's over the lags.
    """
    d, r = driver - driver.mean(), residual - residual.mean()
    if np.std(d) < 1e-12 or np.std(r) < 1e-12:
        return 0.0, 1.0
    filt = np.r_[1.0, -ar_coefficients(d, _ORDER)]
    d, r = lfilter(filt, [1.0], d)[_ORDER:], lfilter(filt, [1.0], r)[_ORDER:]
    n = len(d)
    lags = min(LAGS, n - 1)
    if lags < 0:
        return 0.0, 1.0
    scale = float(np.sqrt((d @ d) * (r @ r)))
    if scale == 0:
        return 0.0, 1.0
    values = [float(d[: n - k] @ r[k:]) / scale for k in range(lags + 1)]
    best = max(values, key=abs)
    p = float(chi2.sf(n * best**2, 1)) * (lags + 1)
    return best, min(1.0, p)
