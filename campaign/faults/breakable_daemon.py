"""`python -m campaign.faults.breakable_daemon PART start …`: PART breaks on SIGUSR1.

The words after PART are those of `smad`, which is then run as `python -m smad` runs it: the daemon
is the real one in a process of its own. Until the signal comes it runs unchanged.
"""

from __future__ import annotations

import functools
import importlib
import runpy
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

DAEMON_PARTS: dict[str, str] = {
    "session": "firmware_protocol.host:HostSession.receive",
    "controller": "smad.control.controller:Controller.step",
    "publisher": "smad.daemon.telemetry.publisher:Publisher.publish",
    "recorder": "smad.daemon.telemetry.recorder:Recorder.row",
    "watch": "smad.daemon.link.watch:BoardWatch.on_state",
    "housekeeping": "smad.daemon.daemon:Daemon._each_second",
    "server": "smad.daemon.command.server:CommandServer._turn",
}
"""Parts whose death ends the daemon, by the method that raises."""

WRITER_PART = "writer"
WALL_CLOCK_PART = "wall_clock"
_WRITER = "smad.runlog.writer:RunWriter._drain"
_JUMP_S = -3600.0


class _Trigger:
    pulled = False


def main(arguments: Sequence[str]) -> None:
    """Prepare the part, then be `smad`, which exits with its own status."""
    part, words = arguments[0], arguments[1:]
    signal.signal(signal.SIGUSR1, _pull)
    if part == WALL_CLOCK_PART:
        _jumping_clock()
    else:
        _break((DAEMON_PARTS | {WRITER_PART: _WRITER})[part])
    sys.argv[1:] = words
    runpy.run_module("smad", run_name="__main__")


def _pull(number: int, frame: object) -> None:
    _Trigger.pulled = True


def _break(place: str) -> None:
    module_name, _, path = place.partition(":")
    class_name, _, method = path.partition(".")
    owner = getattr(importlib.import_module(module_name), class_name)
    setattr(owner, method, _once_broken(getattr(owner, method)))


def _once_broken(whole: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(whole)
    def broken(*arguments: Any, **options: Any) -> Any:
        if _Trigger.pulled:
            raise RuntimeError("injected")
        return whole(*arguments, **options)

    return broken


def _jumping_clock() -> None:
    true_time = time.time
    # Whoever imports it from now on, the daemon among them, gets the one that jumps.
    time.time = lambda: true_time() + (_JUMP_S if _Trigger.pulled else 0.0)


if __name__ == "__main__":
    main(sys.argv[1:])
