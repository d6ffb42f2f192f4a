"""When a wait for a motion is over, or will never be. Pure: time is an argument."""

from __future__ import annotations

from smad.api import Motion
from smad.client.errors import NoAnswer, Stopped


class Wait:
    """Judges each poll of a motion."""

    def __init__(self, now_s: float, timeout_s: float | None) -> None:
        self._began_s = now_s
        self._timeout_s = timeout_s

    def over(self, motion: Motion, now_s: float) -> bool:
        """Return whether the motion is done.

        Raises Stopped when the board is not armed any more, NoAnswer when the time is over.
        """
        fault = motion.fault
        if not motion.armed or fault is not None:
            raise Stopped(
                "the motion ended early: "
                + (
                    f"the {fault.by} stopped with {fault.name}"
                    if fault
                    else "the bench is not armed"
                ),
                value=f"board in {motion.mode}",
                action="smad faults explain says what to do"
                if fault
                else "see smad status for what happened; arm and start again",
            )
        if motion.done:
            return True
        if self._timeout_s is not None and now_s - self._began_s > self._timeout_s:
            raise NoAnswer(
                "the motion is not done yet",
                limit=f"{self._timeout_s:g} s",
                action="wait longer, or end it with idle() or disarm()",
            )
        return False
