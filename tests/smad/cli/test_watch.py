"""`smad status --watch`: what is on the screen, and what its keys do. A clock of our own."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

import msgspec
import pytest
from click.testing import CliRunner

from smad import api
from smad.cli.status import status
from smad.client import NoAnswer
from smad.runlog.schema import Row
from smad.view.terminal.screen import KEYS, History, screen, sparkline
from smad.view.terminal.status_lines import Line, lines
from smad.view.terminal.watch import Terminal as CursesTerminal
from smad.view.terminal.watch import watch
from tests.smad.cli.test_commands import MOTION, STATUS

FAULT = api.Fault(number=6, name="OVER_TEMPERATURE", channel="SPRING_X")
FAULTED = msgspec.structs.replace(
    STATUS, motion=msgspec.structs.replace(MOTION, armed=False, mode="FAULT", fault=FAULT)
)


def shown(now: api.Status | None = STATUS, columns: int = 80, rows: int = 24, **more: str) -> str:
    history = History()
    for n in range(300):
        history.add(Row(t_s=n, displacement_mm=float(n), rtd_x_degC=30.0, duty_x=0.5))
    lines = screen(now, history, columns=columns, rows=rows, **more)
    assert len(lines) == rows
    assert max(len(line.text) for line in lines) <= columns
    return "\n".join(line.text for line in lines)


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (60, 20), (200, 60)])
def test_it_fits_and_state_and_fault_stand_first(columns: int, rows: int) -> None:
    drawn = shown(FAULTED, columns, rows, said="x" * 500).splitlines()
    assert "board FAULT" in drawn[0]
    assert drawn[1].startswith("fault       OVER_TEMPERATURE at SPRING_X")
    assert "hotter than the limit" in drawn[2]
    assert drawn[-1] == KEYS


def test_it_says_what_the_status_says() -> None:
    told = {line.text for line in lines(FAULTED)}
    labels = {"bench", "fault", "motion", "link", "age"}
    drawn = [line for line in shown(FAULTED, 160, 40).splitlines() if line.split(" ")[0] in labels]
    assert {line.split(" ")[0] for line in drawn} == labels
    assert set(drawn) <= told


@pytest.mark.parametrize("size", [(59, 24), (80, 3), (5, 1), (1, 0)])
def test_a_terminal_that_is_too_small_is_told_so(size: tuple[int, int]) -> None:
    columns, rows = size
    lines = screen(STATUS, History(), columns=columns, rows=rows)
    assert len(lines) <= rows
    assert all(len(line.text) <= columns for line in lines)


def test_what_came_of_a_stop_is_said_in_a_terminal_that_is_too_small_as_well() -> None:
    drawn = screen(STATUS, History(), columns=50, rows=3, said="NOT CONFIRMED: no answer")
    assert "NOT CONFIRMED: no answer" in [line.text for line in drawn]


def test_readings_have_units_and_their_range() -> None:
    text = shown()
    assert "299.00 mm" in text
    assert "50 %" in text
    assert "Tendon force" not in text, "nothing of it was measured"
    assert "ARMED" in text


def test_a_bar_a_value_from_the_least_to_the_most() -> None:
    assert sparkline([0.0, 1.0, None, 7.0]) == "▁▂ █"
    assert sparkline([2.0, 2.0]) == "▁▁"
    assert sparkline([None]) == " "


class WatchedClient:
    """Answers with statuses in turn; an error is raised."""

    def __init__(self, *answers: api.Status | Exception) -> None:
        self.answers = list(answers)
        self.stops = 0

    def status(self) -> api.Status:
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, Exception):
            raise answer
        return answer

    def disarm(self) -> api.Motion:
        self.stops += 1
        if self.stops > 1:
            raise NoAnswer("the daemon did not answer")
        return msgspec.structs.replace(MOTION, armed=False, mode="SAFE")


class Terminal:
    """Keys that come at given times, and what was drawn by then."""

    def __init__(self, *keys: tuple[float, str]) -> None:
        self.keys = list(keys)
        self.now_s = 0.0
        self.drawn: list[str] = []

    def size(self) -> tuple[int, int]:
        return 80, 24

    def draw(self, lines: Sequence[Line]) -> None:
        self.drawn.append("\n".join(line.text for line in lines))

    def key(self, timeout_s: float) -> str:
        at_s, key = self.keys[0]
        if at_s > self.now_s + timeout_s:
            self.now_s += timeout_s
            return ""
        self.now_s = max(at_s, self.now_s)
        del self.keys[0]
        return key


def test_quitting_stops_nothing() -> None:
    bench, terminal = WatchedClient(STATUS), Terminal((0.7, "x"), (5.0, "q"))
    watch(bench, terminal, lambda: terminal.now_s)
    assert bench.stops == 0
    assert terminal.now_s == 5.0
    assert len(terminal.drawn) == 11, "twice a second, and at once after a key"


@pytest.mark.parametrize("key", [" ", "\x1b"], ids=["space", "escape, as on the live page"])
def test_the_stop_key_disarms_at_once_and_says_what_came_of_it(key: str) -> None:
    bench, terminal = WatchedClient(STATUS), Terminal((0.2, key), (0.3, "s"), (0.4, "q"))
    watch(bench, terminal, lambda: terminal.now_s)
    assert "stopped: the board is in SAFE" in terminal.drawn[1]
    assert "NOT CONFIRMED: the daemon did not answer" in terminal.drawn[2]


def test_what_came_of_a_stop_is_not_shown_as_if_it_were_of_now() -> None:
    bench, terminal = WatchedClient(STATUS), Terminal((0.2, " "), (60.3, "q"))
    watch(bench, terminal, lambda: terminal.now_s)
    assert "0 s ago: stopped: the board is in SAFE" in terminal.drawn[1]
    assert "60 s ago: stopped: the board is in SAFE" in terminal.drawn[-1]


class Window:
    """What a terminal sends at once, byte by byte."""

    def __init__(self, sent: str) -> None:
        self.sent = list(sent)

    def timeout(self, ms: int) -> None:
        """Nobody waits."""

    def get_wch(self) -> str:
        return self.sent.pop(0)


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        ("\x1b", ["\x1b"]),
        ("\x1b\x1b", ["\x1b"]),
        ("\x1b ", ["\x1b"]),
        ("\x1b[1;5A", [""]),
        ("q", ["q"]),
    ],
    ids=["escape", "escape twice", "escape and space", "ctrl and an arrow", "a letter"],
)
def test_escape_is_the_key_and_not_the_beginning_of_another(sent: str, keys: list[str]) -> None:
    terminal = screen_terminal(Window(sent))
    assert [terminal.key(0.0), terminal.key(0.0)] == [*keys, ""]


def screen_terminal(window: Window) -> CursesTerminal:
    terminal = CursesTerminal.__new__(CursesTerminal)
    terminal.__dict__.update(_window=window, _error=IndexError)
    return terminal


def test_a_daemon_that_is_silent_is_not_shown_as_live() -> None:
    bench = WatchedClient(STATUS, NoAnswer("the daemon did not answer"), STATUS)
    terminal = Terminal((1.2, "q"))
    watch(bench, terminal, lambda: terminal.now_s)
    silent = [text.startswith("NOT LIVE: the daemon did not answer") for text in terminal.drawn]
    assert silent == [False, True, False]
    assert "board ARMED" in terminal.drawn[1], "the last state stays, marked as old"


def test_without_a_terminal_it_says_what_to_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("smad.cli.status.client", lambda bench: contextlib.nullcontext())
    assert "--watch --json" in CliRunner().invoke(status, ["--watch"]).output
