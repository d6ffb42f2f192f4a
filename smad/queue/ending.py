"""What ended an item: the exit status that its process tells the runner."""

import errno
from collections.abc import Sequence

from smad.api import Reason
from smad.client import Client
from smad.client.errors import NoAnswer, NoDaemon, Refused, Stopped
from smad.errors import ComputerError, SmadError
from smad.experiments.errors import StoppedError, TrippedError
from smad.queue.machine import LOST, SHORT, STOPPED, TRIPPED

_REASONS = {
    Reason.STOPPED: STOPPED,
    Reason.NOT_ARMED: STOPPED,
    # A lease ends when this process gets no turn for so long; the daemon then disarms.
    Reason.NOT_IN_CONTROL: STOPPED,
    Reason.FAULTED: TRIPPED,
    Reason.NOT_CONNECTED: LOST,
    Reason.NO_REPLY: LOST,
    Reason.RECORDER: SHORT,
}
_STATUSES: tuple[tuple[type[SmadError], int], ...] = (
    (StoppedError, STOPPED),
    (Stopped, STOPPED),
    (TrippedError, TRIPPED),
    (NoDaemon, LOST),
    (NoAnswer, LOST),
    (ComputerError, SHORT),
)
_USED_UP = (errno.ENOSPC, errno.EDQUOT, errno.ENOMEM, errno.EMFILE, errno.ENFILE, errno.EIO)


def status_of(error: SmadError) -> int:
    """Return the exit status that says why a command ended."""
    if isinstance(error, Refused) and error.reason in _REASONS:
        return _REASONS[error.reason]
    for kind, status in _STATUSES:
        if isinstance(error, kind):
            return status
    return error.exit_status


def is_used_up(error: Exception) -> bool:
    """Return whether the error says that this computer has no room, memory or files left."""
    used_up = isinstance(error, OSError) and error.errno in _USED_UP
    return used_up or isinstance(error, MemoryError)


def unseen_stop(clients: Sequence[Client], bench: str) -> str:
    """Return how the bench was stopped while a command did not look, such as in an analysis.

    Empty where it was not, as far as the command's `clients` know of stops.
    """
    generations = {client.known for client in clients} - {None}
    try:
        if generations:
            with Client(bench) as client:
                if client.motion().generation not in generations:
                    return "the bench was stopped while this ran"
    except SmadError as error:
        return str(error)
    return ""
