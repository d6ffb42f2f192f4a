"""A simulated bench in one line: a daemon of its own with a client, gone when the block ends."""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from smad.client import Client
from smad.errors import DaemonError
from smad.processes.daemon import running_daemon
from smad.processes.simulator import PACED

FASTEST = 100.0
_ANSWER_S = 60.0
"""Longer than a busy computer may hold the daemon up."""


@contextlib.contextmanager
def simulated(*, speed: float = 4.0, options: Sequence[str] = ()) -> Iterator[Client]:
    """A client of a simulated bench that nobody else sees, for as long as the block lasts.

    The board waits for each setpoint, so that a busy machine makes a run slower and never wrong.
    `speed` is how many times faster than the clock it may go. `options` are further ones of
    `smad start --sim`, as `("--effect", "rtd_lag")`. Run logs go to `runs/` here, as always. Raises
    DaemonError where it does not come up.
    """
    if not 0.0 < speed <= FASTEST:
        raise DaemonError(
            "a simulated bench cannot run at this speed",
            value=speed,
            limit=f"above 0, at most {FASTEST:g}",
            action="give another speed",
        )
    arguments = ["--sim", "--speed", f"{speed:g}", *_with_us(), *PACED, *options]
    with tempfile.TemporaryDirectory(prefix="smad-") as name:
        folder = Path(name)
        # Nobody else is there to take control from, and a notebook may think for long.
        with (
            running_daemon(arguments, folder),
            Client(folder=folder, timeout_s=_ANSWER_S, lease_s=None) as bench,
        ):
            yield bench


@contextlib.contextmanager
def simulated_axes(count: int) -> Iterator[Client]:
    """A client of a simulated bench of so many axes, in real time; it ends with this process."""
    arguments = ["--sim", "--axes", str(count), *_with_us()]
    with (
        tempfile.TemporaryDirectory() as folder,
        running_daemon(arguments, Path(folder)),
        Client(folder=folder) as bench,
    ):
        yield bench


def _with_us() -> tuple[str, str]:
    """Options of a daemon that ends with this process, also when it is killed."""
    return "--parent", str(os.getpid())
