"""Many plants advanced by one sample in one call."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry
from sim_device.plant.kernel.curves import Row
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.step import advance

Array = npt.NDArray[np.float64]


@entry
def advance_many(
    states: OneRecord,
    works: OneRecord,
    models: OneRecord,
    rings: Array,
    ring_rows: int,
    table: Array,
    laws: Array,
    memory: Array,
    most_laws: int,
    counts: Row,
    dt: float,
    steps: int,
    first: int,
    last: int,
    statuses: Row,
) -> None:
    """Advance plants `first` to `last` (not included), each as `advance` does.

    Arrays of one record a plant, and tables of one plant after the other: of rings `ring_rows`
    each, of laws (17 columns) and memory (4 columns) `most_laws` each, of which a plant uses the
    first `counts` (n,). `statuses` (n,) gets what `advance` returns. Parts of the arrays may be
    advanced by several threads at once.
    """
    for i in range(first, last):
        j = i + 1
        begin = i * most_laws
        end = begin + int(counts[i])
        statuses[i] = advance(
            states[i:j],
            works[i:j],
            models[i:j],
            rings[i * ring_rows : j * ring_rows],
            table,
            laws[begin:end],
            memory[begin:end],
            dt,
            steps,
        )
