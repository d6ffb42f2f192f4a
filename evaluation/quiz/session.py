"""`investigate` on mystery benches over the wire: board, daemon and commands as a user has them.

The board waits for its host and hurries between the runs, so that an hour of bench time takes
minutes; nothing else differs from a session by hand.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import msgspec

from evaluation.errors import QuizError
from evaluation.quiz.ends import end_of
from smad.checkup.errors import BaselineError
from smad.checkup.investigation import Report, read_report
from smad.checkup.programme import shipped
from smad.checkup.store import read_about
from smad.client.endpoints import FOLDER_VARIABLE
from smad.client.signals import ended_by_signals
from smad.errors import DaemonError
from smad.processes.daemon import running_daemon

BENCH = "quiz"
TRIES = 3
START_DEADLINE_S = 900.0
"""The first start compiles the plant."""
COMMAND_DEADLINE_S = 3600.0
_END_DEADLINE_S = 30.0
_POLL_S = 0.05


@dataclass(frozen=True)
class Order:
    """What is done on each bench: the good repeats on `days` days, or all on one; bench time.

    `unchanged`: nothing is wrong with it when it is investigated, on a day of its own.
    """

    minutes: float = 20.0
    quick: bool = False
    days: int = 2
    repeats: int = 2
    unchanged: bool = False


class Wire(Protocol):
    """A mystery bench with its daemon, and the commands of the product."""

    def bench(self, *, good: bool, day: int) -> AbstractContextManager[object]:
        """Board and daemon, before the trouble or with it, for as long as the block lasts."""

    def smad(self, *arguments: str) -> None:
        """A command, carried out to its end. Raises QuizError."""

    def answer(self) -> dict[str, Any]:
        """What the trouble was."""


def investigated(wire: Wire, order: Order, folder: Path) -> dict[str, Any]:
    """Commission, look for the trouble, open the answer; what was done already is not repeated."""
    baseline = folder / "baseline"
    days = order.days
    for day in range(days):
        repeats = order.repeats * (day + 1) // days
        have = _repeats(baseline)
        if have >= repeats:
            continue
        with wire.bench(good=True, day=day):
            wire.smad(
                *("gap", "commission", "--bench", BENCH, "--baseline", str(baseline)),
                *("--repeats", str(repeats - have)),
                *(["--again"] if have else []),
                *(["--quick"] if order.quick else []),
            )
    report = _report(baseline)
    if report is None or not report.why_over:
        with wire.bench(good=order.unchanged, day=days):
            wire.smad(
                *("gap", "investigate", "--bench", BENCH, "--baseline", str(baseline)),
                *("--minutes", f"{order.minutes:g}"),
            )
        report = _report(baseline)
    if report is None:
        raise QuizError(f"{baseline} holds no investigation")
    answer = wire.answer()
    if order.unchanged:
        answer = {**answer, "effects": []}
    return end_of(answer, report, sum(r.took_s for r in report.records), shipped())


def _repeats(baseline: Path) -> int:
    try:
        return read_about(baseline).repeats
    except BaselineError:
        return 0


def _report(baseline: Path) -> Report | None:
    path = baseline / "investigation-1" / "investigation.json"
    return read_report(path) if path.exists() else None


def asked(
    out: Path, order: Order, reveal: Callable[[Path], dict[str, Any]]
) -> Callable[[int], dict[str, Any]]:
    """What investigates the bench of a number; its runs lie in `out` until it is through.

    The processor time of all its processes is given as `processor_s`, of one that was interrupted
    only that since then.
    """

    def investigate_seed(seed: int) -> dict[str, Any]:
        folder = out / f"runs-{seed}"
        folder.mkdir(parents=True, exist_ok=True)
        began = _processor_s()
        with ended_by_signals(), tempfile.TemporaryDirectory(prefix="smad-") as sockets:
            wire = LiveWire(seed, folder, Path(sockets), reveal)
            case = investigated(wire, order, folder)
        shutil.rmtree(folder)
        return {**case, "quick": order.quick, "processor_s": round(_processor_s() - began, 1)}

    return investigate_seed


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True)
class LiveWire:
    """Processes: the quiz's board on a pseudo-terminal, `smad start` on it, and other commands."""

    seed: int
    folder: Path
    sockets: Path
    reveal: Callable[[Path], dict[str, Any]]

    @contextmanager
    def bench(self, *, good: bool, day: int) -> Iterator[None]:
        """Board and daemon, for as long as the block lasts."""
        link = self.sockets / "board"
        config = self.sockets / "quiz.toml"
        config.write_text(
            f"[recorder]\nfolder = {msgspec.json.encode(str(self.folder / 'logs')).decode()}\n"
            "automatic = false\n"
        )
        daemon = ("--port", str(link), "--config", str(config), "--no-realtime")
        try:
            with self._board(link, good, day), running_daemon(daemon, self.sockets, bench=BENCH):
                yield
        except DaemonError as error:
            raise QuizError(str(error)) from error

    @contextmanager
    def _board(self, link: Path, good: bool, day: int) -> Iterator[None]:
        command = [
            *(sys.executable, "-m", "evaluation", "mystery", str(self.seed)),
            *("--paced-by-host", "--with-parent", "--day", str(day)),
            *("--link", str(link), "--note", str(self._note)),
            *(["--good"] if good else []),
        ]
        with self._output.open("ab") as log:
            child = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
            )
        try:
            deadline_s = time.monotonic() + START_DEADLINE_S
            while not link.exists():
                if child.poll() is not None or time.monotonic() > deadline_s:
                    raise QuizError(f"the board did not start: {self._last_line()}")
                time.sleep(_POLL_S)
            yield
        finally:
            _end(child)

    def smad(self, *arguments: str) -> None:
        """A command; one that fails is given again, and goes on with what it has."""
        for _ in range(TRIES):
            if self._carried_out(arguments) == 0:
                return
        raise QuizError(
            f"`smad {' '.join(arguments[:2])}` failed {TRIES} times: {self._last_line()}"
        )

    def _carried_out(self, arguments: tuple[str, ...]) -> int:
        with self._output.open("ab") as log:
            child = subprocess.Popen(
                [sys.executable, "-m", "smad", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env={**os.environ, FOLDER_VARIABLE: str(self.sockets)},
            )
        try:
            return child.wait(COMMAND_DEADLINE_S)
        except subprocess.TimeoutExpired:
            raise QuizError(
                f"`smad {' '.join(arguments[:2])}` did not end in {COMMAND_DEADLINE_S:g} s"
            ) from None
        finally:
            _end(child)

    def answer(self) -> dict[str, Any]:
        """What the trouble was."""
        return self.reveal(self._note)

    @property
    def _note(self) -> Path:
        return self.folder / "mystery.json"

    @property
    def _output(self) -> Path:
        return self.folder / "said.txt"

    def _last_line(self) -> str:
        lines = self._output.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "it said nothing"


def _end(child: subprocess.Popen[bytes]) -> None:
    """End a process, if it has not ended."""
    if child.poll() is None:
        child.terminate()
    try:
        child.wait(_END_DEADLINE_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
