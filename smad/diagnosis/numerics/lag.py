"""A first-order lag of a sampled signal: `scipy.signal.lfilter` to the bit.

Not scipy's own, because `scipy.signal` takes a second to import, in every command of `smad gap`.
"""

from itertools import accumulate

import numpy as np

from smad.diagnosis.plant import Array


def lagged(y: Array, keep: float) -> Array:
    """Samples (n,) or (n, columns) behind a lag that keeps `keep` of its value each sample.

    It begins settled at the first sample.
    """

    def follow(behind: float, new: float) -> float:
        return keep * behind + new

    columns = y.reshape(len(y), -1).T
    out = np.empty(columns.shape)
    for row, column in zip(out, columns, strict=True):
        if len(column):
            news = ((1.0 - keep) * column).tolist()
            row[:] = list(accumulate(news, follow, initial=float(column[0])))[1:]
    return out.T.reshape(y.shape)
