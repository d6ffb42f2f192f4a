"""A child that ends with who started it, however that ends. Linux."""

import contextlib
import ctypes
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator

_PR_SET_PDEATHSIG = 1
_ORPHAN_S = 10.0


def signal_at_parents_end(number: signal.Signals) -> None:
    """Let the kernel send us a signal when the thread that started us ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def end_with(parent: int) -> None:
    """Get SIGTERM when `parent` ends, also when it is killed; not when a thread of it does.

    Raises SystemExit when it has ended already.
    """
    if os.getppid() != parent:
        raise SystemExit(1)
    _once_ended(parent, lambda: os.kill(os.getpid(), signal.SIGTERM))


def end_group_with(parent: int) -> None:
    """Get SIGTERM when the thread of `parent` that started us ends, also when it is killed.

    Our process group is killed when it has not ended ten seconds later.
    """
    signal_at_parents_end(signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(128 + signal.SIGTERM)
    _once_ended(parent, _kill_group)


@contextlib.contextmanager
def interrupts_held() -> Iterator[None]:
    """SIGINT waits for the end of the block; `begin_worker` lets it through in what began here."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_worker(parent: int) -> None:
    """Begin a process of a pool of `parent`: it ends with it, and at ctrl-C at once and silently.

    As an exception, ctrl-C could lose what the pool waits for. Which thread of `parent` started
    the process does not matter.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    _once_ended(parent, lambda: os._exit(128 + signal.SIGTERM))


def _kill_group() -> None:
    time.sleep(_ORPHAN_S)
    os.killpg(0, signal.SIGKILL)


def _once_ended(parent: int, act: Callable[[], None]) -> None:
    """Act once `parent` has ended, from a thread: which of its threads started us does not
    matter."""

    def wait() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        act()

    threading.Thread(target=wait, daemon=True).start()
