"""`python -m smad.cli.queue_child PARENT BENCH WORD…`: a command of smad as an item of the queue.

Its exit status says what ended it (`smad.queue.machine`): an error alone would not tell a stop,
which pauses the queue, from a refusal, which does not. It ends with its parent, the runner: asked
to by the kernel, and killed if it does not.
"""

import errno
import sys
import traceback
from collections.abc import Sequence

import click

from smad.api import Reason
from smad.cli import root
from smad.client import Client
from smad.client.errors import NoAnswer, NoDaemon, Refused, Stopped
from smad.errors import ComputerError, SmadError
from smad.experiments.errors import StoppedError, TrippedError
from smad.processes.parent import end_group_with
from smad.queue.machine import LOST, SHORT, STOPPED, TRIPPED

_INTERRUPTED, _INTERNAL = 130, 70
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


def main(arguments: Sequence[str]) -> int:
    """Run the command; return its exit status."""
    parent, bench, *words = arguments
    end_group_with(int(parent))
    try:
        root.main(args=words, prog_name="smad", standalone_mode=False)
    except SmadError as error:
        click.echo(f"smad: {error}", err=True)
        return status_of(error)
    except click.ClickException as error:
        click.echo(f"smad: {error.format_message()}", err=True)
        return error.exit_code
    except click.Abort:
        return _INTERRUPTED
    except (MemoryError, OSError) as error:
        traceback.print_exc()
        return SHORT if is_used_up(error) else _INTERNAL
    except Exception:
        traceback.print_exc()
        return _INTERNAL
    return STOPPED if _stopped_since(bench) else 0


def is_used_up(error: MemoryError | OSError) -> bool:
    """Return whether the error says that this computer has no room, memory or files left."""
    return isinstance(error, MemoryError) or error.errno in _USED_UP


def _stopped_since(bench: str) -> bool:
    """Whether somebody stopped the bench while the command did not look, such as in an analysis."""
    from smad.cli.output import made_clients

    known = {client.as_of(None) for client in made_clients} - {None}
    if not known:
        return False
    try:
        with Client(bench) as client:
            stopped = client.motion().generation not in known
    except SmadError as error:
        click.echo(f"smad: {error}", err=True)
        return True
    if stopped:
        click.echo("smad: the bench was stopped while this ran", err=True)
    return stopped


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
