"""`smad status --watch`: a screen that is drawn anew twice a second, and two keys."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from smad.errors import SmadError
from smad.view.terminal.screen import History, screen
from smad.view.terminal.status_lines import COLOURS, Line, Style

if TYPE_CHECKING:
    import curses

    from smad.client import Client

REFRESH_S = 0.5
PATIENCE_S = 1.0
"""How long an answer may take before the screen says that it is not live."""
ESCAPE = "\x1b"
ESCAPE_MS = 50
"""After so long alone it is the key, and not the first byte of another."""
STOP_KEYS = frozenset({*" sS", ESCAPE})
"""Escape stops on the live page, too."""
QUIT_KEYS = frozenset("qQ")


def watch(bench: Client, terminal: Terminal, clock_s: Callable[[], float]) -> None:
    """Show the bench until somebody quits."""
    history, now, away, note = History(), None, "", ""
    due_s = noted_s = clock_s()
    while True:
        if clock_s() >= due_s:
            try:
                now, away = bench.status(), ""
            except SmadError as error:
                away = str(error)
            history.add(None if now is None or away else now.sample)
            due_s = clock_s() + REFRESH_S
        columns, rows = terminal.size()
        said = note and f"{clock_s() - noted_s:.0f} s ago: {note}"
        terminal.draw(screen(now, history, columns=columns, rows=rows, away=away, said=said))
        key = terminal.key(max(0.0, due_s - clock_s()))
        if key in QUIT_KEYS:
            return
        if key in STOP_KEYS:
            note = _stopped(bench)
            due_s = noted_s = clock_s()


def _stopped(bench: Client) -> str:
    try:
        return f"stopped: the board is in {bench.disarm().mode}"
    except SmadError as error:
        return f"NOT CONFIRMED: {error}"


class Terminal:
    """The terminal that we run in, on its alternate buffer."""

    def __init__(self, window: curses.window) -> None:
        import curses

        self._window = window
        self._error = curses.error
        curses.set_escdelay(ESCAPE_MS)
        with contextlib.suppress(curses.error):
            curses.curs_set(0)
        self._attributes: dict[Style, int] = dict.fromkeys(COLOURS, curses.A_BOLD)
        self._attributes |= {"plain": 0, "title": curses.A_BOLD}
        if curses.has_colors():
            curses.use_default_colors()
            for number, (style, colour) in enumerate(COLOURS.items(), 1):
                curses.init_pair(number, getattr(curses, f"COLOR_{colour.upper()}"), -1)
                self._attributes[style] = curses.color_pair(number) | curses.A_BOLD

    def size(self) -> tuple[int, int]:
        """Return columns and rows; it may have been made larger or smaller."""
        rows, columns = self._window.getmaxyx()
        return columns, rows

    def draw(self, lines: Sequence[Line]) -> None:
        """Show these lines and nothing else."""
        self._window.erase()
        for row, line in enumerate(lines):
            # Writing into the last place of a window moves beyond it, which curses calls an error.
            with contextlib.suppress(self._error):
                self._window.addstr(row, 0, line.text, self._attributes[line.style])
        self._window.refresh()

    def key(self, timeout_s: float) -> str:
        """Return the next key, or nothing when none came in time, or the size changed."""
        key = self._next(round(timeout_s * 1000))
        # Any other key that follows, as the space bar of somebody in a hurry, takes no stop back.
        if key != ESCAPE or self._next(ESCAPE_MS) not in ("[", "O"):
            return key
        # An arrow or function key that curses does not know in this terminal.
        while self._next(0):
            pass
        return ""

    def _next(self, timeout_ms: int) -> str:
        self._window.timeout(timeout_ms)
        try:
            key = self._window.get_wch()
        except self._error:
            return ""
        return key if isinstance(key, str) else ""


def run(bench: Client) -> None:
    """Watch in this terminal, and leave it as it was; ctrl-C quits too."""
    import curses
    import locale

    locale.setlocale(locale.LC_ALL, "")
    with contextlib.suppress(KeyboardInterrupt):
        curses.wrapper(lambda window: watch(bench, Terminal(window), time.monotonic))
