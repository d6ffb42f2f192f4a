"""The quiz over the wire: a bench with a hidden effect, and what opens the answer afterwards.

The answer follows from the number alone; its hash is shown at the start and checked at the end.
"""

import hashlib
import json
import os
import select
import signal
import sys
import time
import tty
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TextIO

import numpy as np

from evaluation.bank import files
from evaluation.errors import QuizError
from evaluation.plant.effects import BY_NAME, SIGNED, Active, names
from evaluation.plant.parameters import Bench, another_bench

SHARE_UNKNOWN = 0.3
NOTE = Path("mystery.json")
DAY = 1_000_003
"""Between the seeds of a bench's days."""


class Board(Protocol):
    """What the quiz serves: bytes in, one sample at a time out."""

    @property
    def period_us(self) -> int:
        """Time between samples."""

    def receive(self, data: bytes) -> bytes:
        """Bytes from the host; what to answer at once."""

    def step(self) -> bytes:
        """One sample; what the board sends."""

    @property
    def unanswered(self) -> bool:
        """Whether the last sample went out armed, and its setpoint has not come."""

    @property
    def setpoints(self) -> int:
        """How many setpoints have come."""

    @property
    def at_rest(self) -> bool:
        """Whether nothing happens on the bench before somebody arms it."""


@dataclass(frozen=True)
class Riddle:
    """A bench and what is wrong with it."""

    seed: int
    bench: Bench
    active: tuple[Active, ...]

    def answer(self) -> dict[str, Any]:
        """What `reveal` tells."""
        return {
            "seed": self.seed,
            "effects": [
                {
                    "name": a.name,
                    "listed": BY_NAME[a.name].kind == "known",
                    "places": BY_NAME[a.name].places,
                    "subsystem": BY_NAME[a.name].subsystem,
                    "magnitude": a.magnitude,
                    "unit": BY_NAME[a.name].unit,
                    "form": BY_NAME[a.name].form,
                }
                for a in self.active
            ],
        }

    @property
    def sealed(self) -> str:
        """SHA-256 of the answer."""
        text = json.dumps(self.answer(), sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(text.encode()).hexdigest()


def riddle(seed: int) -> Riddle:
    """The bench and the effect that belong to a number: about ten floors strong."""
    rng = np.random.default_rng((seed, 5))
    bench = another_bench(rng)
    pool = names("spent") if rng.uniform() < SHARE_UNKNOWN else names("known")
    name = str(rng.choice(pool))
    spec = BY_NAME[name]
    size = min(spec.usual * float(rng.uniform(3.0, 4.5)), spec.limit)
    sign = -1.0 if name in SIGNED and rng.integers(2) else 1.0
    y_share, shape = float(rng.uniform(0.6, 1.0)), float(rng.uniform())
    if spec.side == "one":
        y_share = 0.0
    active = Active(name, sign * size, y_share, shape)
    return Riddle(seed, bench, (active,))


def begin(seed: int, note: Path = NOTE) -> Riddle:
    """Draw the riddle and leave a note with its hash for `reveal`."""
    drawn = riddle(seed)
    files.write_json(note, {"seed": seed, "sealed_sha256": drawn.sealed})
    return drawn


def reveal(note: Path = NOTE) -> dict[str, Any]:
    """The answer to the riddle of a note; QuizError when it is not the one that was sealed."""
    if not note.exists():
        raise QuizError(f"{note} does not exist: start a bench with `mystery SEED` first")
    seal = files.read_json(note)
    drawn = riddle(int(seal["seed"]))
    if drawn.sealed != seal["sealed_sha256"]:
        raise QuizError(
            f"the answer's hash is {drawn.sealed[:16]}…, sealed was {seal['sealed_sha256'][:16]}…: "
            "the code or the note has changed since the bench was started"
        )
    return drawn.answer()


@dataclass(frozen=True)
class Clock:
    """Where time comes from, and how to wait for bytes."""

    now_s: Callable[[], float]
    wait: Callable[[int, float], bool]


def _wait(descriptor: int, seconds: float) -> bool:
    ready, _, _ = select.select([descriptor], [], [], max(seconds, 0.0))
    return bool(ready)


WALL = Clock(time.monotonic, _wait)


@dataclass(frozen=True)
class Pace:
    """How fast board time goes.

    As fast as the wall's; with `by_host` an armed board takes its next sample when the setpoint
    that answers the last one has come, one that cools goes at `speed`, and one at rest as fast as
    the wall. A host that is silent for `patience_s` of wall time is not waited for until it says
    something: the board goes on by itself, so that it notices and stops.
    """

    by_host: bool = False
    speed: float = 20.0
    patience_s: float = 2.0


REAL_TIME = Pace()


def open_terminal() -> tuple[int, str, int]:
    """A raw pseudo-terminal: our end, the path for the host, and the descriptor kept open."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    return ours, os.ttyname(theirs), theirs


def serve(
    board: Board,
    descriptor: int,
    clock: Clock = WALL,
    going: Callable[[], bool] = lambda: True,
    pace: Pace = REAL_TIME,
) -> None:
    """Pace the board and pass its bytes, until `going` says no.

    A late step is made up for, but never more than a second of them. Bytes that the other side
    does not take are lost, as on a wire.
    """
    due = clock.now_s()
    given_up_at = -1
    while going():
        if pace.by_host and board.unanswered and board.setpoints != given_up_at:
            if not _answered(board, descriptor, clock, pace.patience_s):
                given_up_at = board.setpoints
            due = min(due, clock.now_s())
        while clock.wait(descriptor, due - clock.now_s()):
            _send(descriptor, board.receive(_receive(descriptor)))
            if clock.now_s() >= due:
                break
        if clock.now_s() < due:
            continue
        fast = pace.speed if pace.by_host and not board.at_rest else 1.0
        due = max(due + board.period_us / 1e6 / fast, clock.now_s() - 1.0)
        _send(descriptor, board.step())


def _answered(board: Board, descriptor: int, clock: Clock, patience_s: float) -> bool:
    """Wait until the host has answered the last sample; whether it did in time."""
    until = clock.now_s() + patience_s
    while board.unanswered:
        left_s = until - clock.now_s()
        if left_s <= 0.0:
            return False
        if clock.wait(descriptor, left_s):
            _send(descriptor, board.receive(_receive(descriptor)))
    return True


def _receive(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 4096)
    except (BlockingIOError, OSError):
        return b""


def _send(descriptor: int, data: bytes) -> None:
    while data:
        try:
            data = data[os.write(descriptor, data) :]
        except (BlockingIOError, OSError):
            return


@dataclass(frozen=True)
class Sitting:
    """What of a bench is served: before the trouble (`good`) or with it, on which of its days.

    `with_parent`: only for as long as the process that started it lives.
    """

    good: bool = False
    day: int = 0
    pace: Pace = REAL_TIME
    with_parent: bool = False

    def going(self) -> Callable[[], bool]:
        """Asked before each sample whether to go on."""
        parent = os.getppid()
        return (lambda: os.getppid() == parent) if self.with_parent else (lambda: True)


def run(
    seed: int, sitting: Sitting, *, link: Path | None, note: Path, tell: TextIO = sys.stdout
) -> None:
    """Serve the bench of a number on a pseudo-terminal until interrupted."""
    from evaluation.quiz.wire_board import WireBoard

    drawn = begin(seed, note)
    active = () if sitting.good else drawn.active
    board = WireBoard(drawn.bench, active, seed + sitting.good + DAY * sitting.day)
    ours, path, theirs = open_terminal()
    if link is not None:
        link.unlink(missing_ok=True)
        link.symlink_to(path)
    print(f"bench on {link or path}", file=tell)
    print(f"sealed answer SHA-256 {drawn.sealed}", file=tell, flush=True)
    # Ended as ctrl-C does it: a shell's background processes do not hear that.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        serve(board, ours, going=sitting.going(), pace=sitting.pace)
    except KeyboardInterrupt:
        print("stopped", file=tell)
    finally:
        os.close(ours)
        os.close(theirs)
        if link is not None:
            link.unlink(missing_ok=True)
