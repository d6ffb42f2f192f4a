"""Signals that end a program, made to end it as ctrl-C does."""

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP (a terminal that goes away) unwind the block, as ctrl-C does.

    Without it they would end the process on the spot, and leave the bench armed. What the program
    itself does about one of them, or a parent's wish to ignore it (nohup), is left alone. Outside
    of the main thread, where Python hands out no signals, nothing is changed.
    """

    def leave(number: int, frame: object) -> None:
        raise SystemExit(128 + number)

    ours = []
    if threading.current_thread() is threading.main_thread():
        both = (signal.SIGTERM, signal.SIGHUP)
        ours = [number for number in both if signal.getsignal(number) is signal.SIG_DFL]
    try:
        for number in ours:
            signal.signal(number, leave)
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)
