"""A simulator in several processes, for one that takes long.

They are forked from this one, so that a function of a notebook, or one made inside another, needs
no module of its own.
"""

import multiprocessing
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from smad.processes.parent import begin_worker, interrupts_held
from smad.simulators.errors import LostProcessError, SimulatorError


class Processes:
    """`count` processes that call the same function; safe to ask from several threads.

    Raises SimulatorError where this system cannot fork processes.
    """

    def __init__(self, function: Callable[..., Any], count: int) -> None:
        if "fork" not in multiprocessing.get_all_start_methods():
            raise SimulatorError("this system cannot fork processes", action="leave processes out")
        self.count = count
        self._pool = ProcessPoolExecutor(
            count,
            multiprocessing.get_context("fork"),
            initializer=_begin,
            initargs=(function, os.getpid()),
        )

    def called(self, *arguments: Any) -> Any:
        """What the function returns. Raises RuntimeError for what it raised, LostProcessError."""
        try:
            with warnings.catch_warnings(), interrupts_held():
                # Forking beside threads is what Python 3.12 warns of; ours hold no lock that a
                # function could want.
                warnings.simplefilter("ignore", DeprecationWarning)
                future = self._pool.submit(_call, *arguments)
            returned, why = future.result()
        except BrokenProcessPool as error:
            raise LostProcessError(
                "a process of the simulator was killed, or ended by itself",
                action="if memory was short, take fewer (processes = 1: none but this one)",
            ) from error
        if why:
            raise RuntimeError(why)
        return returned

    def close(self) -> None:
        """End the processes."""
        self._pool.shutdown(cancel_futures=True)


_functions: list[Callable[..., Any]] = []
"""In a process of the pool: what it calls."""


def _begin(function: Callable[..., Any], parent: int) -> None:
    begin_worker(parent)
    _functions[:] = [function]


def _call(*arguments: Any) -> tuple[Any, str]:
    """What is returned, or why nothing is: exceptions of others need not survive the way back."""
    try:
        return _functions[0](*arguments), ""
    except Exception as error:  # whatever somebody else's function does at some point
        return None, f"{type(error).__name__}: {error}"
