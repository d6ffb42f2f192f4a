"""A line on standard error that says what is going on."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator

import click

from smad.progress import Share

FIRST_PROGRESS_S = 2.0
_LINE_EVERY_S = 5.0
_BAR_STEPS = 1000


def note(text: str, *, nl: bool = True) -> None:
    """Print a line on standard error, whether or not anybody reads it any more.

    A reader that has gone (`2>&1 | head`) or a full disk ends nothing that is being done.
    """
    try:
        click.echo(text, nl=nl, err=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


class Progress:
    """One line that says what is going on, from two seconds on.

    On a terminal it is overwritten in place; elsewhere a new line comes every five seconds, if it
    says something new.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._began_s = clock_s()
        self._last_s = self._began_s
        self._early = self._last = ""
        self._terminal = sys.stderr.isatty()
        self._shown = False

    def say(self, text: str) -> None:
        """Show what is going on now."""
        self._early = ""
        now_s = self._clock_s()
        if now_s - self._began_s < FIRST_PROGRESS_S:
            self._early = text
            return
        if self._terminal:
            note(f"\r\x1b[K{text}", nl=False)
            self._shown = True
        elif text != self._last and (not self._last or now_s - self._last_s >= _LINE_EVERY_S):
            note(text)
            self._last = text
            self._last_s = now_s

    def say_again(self) -> None:
        """Show what was said too early to be shown, and still goes on."""
        if self._early:
            self.say(self._early)

    def note(self, text: str) -> None:
        """Print a line that stays."""
        self.done()
        note(text)

    def done(self) -> None:
        """Take the line away."""
        if self._terminal and self._shown:
            note("\r\x1b[K", nl=False)


@contextlib.contextmanager
def progress() -> Iterator[Progress]:
    """A progress line for as long as the block lasts."""
    line = Progress()
    late = threading.Timer(FIRST_PROGRESS_S, line.say_again)
    late.daemon = True
    late.start()
    try:
        yield line
    finally:
        late.cancel()
        late.join()
        line.done()


@contextlib.contextmanager
def bar(label: str) -> Iterator[Share]:
    """A bar on a terminal that is told the share that is done."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    with click.progressbar(length=_BAR_STEPS, label=label, file=sys.stderr) as widget:
        yield lambda share: widget.update(max(0, round(share * _BAR_STEPS) - widget.pos))
