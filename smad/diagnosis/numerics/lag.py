"""A first-order lag of a sampled signal: `scipy.signal.lfilter` to the bit.

Not scipy's own, because `scipy.signal` takes a second to import, in every command of `smad gap`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from smad.diagnosis.numerics.folds import Array


def lagged(y: Array, keep: float) -> Array:
    """Samples (n,) or (n, columns) behind a lag that keeps `keep` of its value each sample.

    It begins settled at the first sample.
    """
    columns = np.ascontiguousarray(y.reshape(len(y), -1).T, dtype=np.float64)
    return np.asarray(_lagged(columns, keep).T.reshape(y.shape))


@njit(cache=True, nogil=True)
def _lagged(columns: Array, keep: float) -> Array:
    out = np.empty_like(columns)
    for k in range(len(columns)):
        value = keep * columns[k, 0]
        for n in range(columns.shape[1]):
            out[k, n] = value + (1.0 - keep) * columns[k, n]
            value = keep * out[k, n]
    return out
