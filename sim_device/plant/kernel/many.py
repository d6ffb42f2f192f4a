"""Many plants advanced by one sample in one call."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.step import advance

Array = npt.NDArray[np.float64]


@entry
def advance_many(
    states: OneRecord,
    works: OneRecord,
    models: OneRecord,
    rings: Array,
    table: Array,
    laws: Array,
    counts: npt.NDArray[np.int64],
    memory: Array,
    dt: float,
    steps: int,
    first: int,
    last: int,
    statuses: npt.NDArray[np.int64],
) -> None:
    """Advance plants `first` to `last` (not included), each as `advance` does.

    Arrays of one record a plant; rings (n, rows, columns); laws (n, m, 17) and memory (n, m, 4), of
    which each plant uses the first `counts` (n,); `statuses` (n,) gets what `advance` returns.
    Parts of the arrays may be advanced by several threads at once.
    """
    for i in range(first, last):
        j = i + 1
        n_laws = counts[i]
        statuses[i] = advance(
            states[i:j],
            works[i:j],
            models[i:j],
            rings[i],
            table,
            laws[i, :n_laws],
            memory[i, :n_laws],
            dt,
            steps,
        )
