"""The function of a simulator in several processes, for one that takes long.

They are forked from this one, so that a function of a notebook, or one made inside another, needs
no module of its own.
"""

from __future__ import annotations

import multiprocessing
import warnings
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor

from smad.diagnosis.plant import Array
from smad.simulators.calling import called
from smad.simulators.declare import Simulator
from smad.simulators.errors import SimulatorError


class Processes:
    """`count` processes that call the function; safe to ask from several threads.

    Raises SimulatorError where this system forks no processes.
    """

    def __init__(self, declared: Simulator, count: int) -> None:
        if "fork" not in multiprocessing.get_all_start_methods():
            raise SimulatorError("this system forks no processes", action="leave processes out")
        self.count = count
        self._pool = ProcessPoolExecutor(
            count, multiprocessing.get_context("fork"), initializer=_begin, initargs=(declared,)
        )

    def called(
        self,
        t_s: Array,
        inputs: Mapping[str, Array],
        values: Mapping[str, float],
        start: Mapping[str, float],
    ) -> dict[str, Array]:
        """As `smad.simulators.calling.called`. Raises RuntimeError for what the function raised."""
        with warnings.catch_warnings():
            # Forking beside threads is what Python 3.12 warns of; ours hold no lock that a function
            # could want.
            warnings.simplefilter("ignore", DeprecationWarning)
            asked = self._pool.submit(_call, t_s, dict(inputs), dict(values), dict(start))
        outputs, why = asked.result()
        if why:
            raise RuntimeError(why)
        return outputs

    def close(self) -> None:
        """End the processes."""
        self._pool.shutdown(cancel_futures=True)


_simulators: list[Simulator] = []
"""In a process of the pool: what it calls."""


def _begin(declared: Simulator) -> None:
    _simulators[:] = [declared]


def _call(
    t_s: Array,
    inputs: Mapping[str, Array],
    values: Mapping[str, float],
    start: Mapping[str, float],
) -> tuple[dict[str, Array], str]:
    """Outputs, or why there are none: exceptions of others need not survive the way back."""
    try:
        return called(_simulators[0], t_s, inputs, values, start), ""
    except Exception as error:  # whatever somebody else's function does at some point
        return {}, f"{type(error).__name__}: {error}"
