"""A first-order lag of a sampled signal: `scipy.signal.lfilter` to the bit.

Not scipy's own, because `scipy.signal` takes a second to import, in every command of `smad gap`.
"""

from itertools import accumulate

import numpy as np

from smad.diagnosis.plant import Array


def lagged(y: Array, keep: float) -> Array:
    """Samples (n,) behind a lag that keeps `keep` of its value each sample.

    It begins settled at the first sample.
    """

    def follow(behind: float, new: float) -> float:
        return keep * behind + new

    news = ((1.0 - keep) * y).tolist()
    return np.array(list(accumulate(news, follow, initial=float(y[0])))[1:])
