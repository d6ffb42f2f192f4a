"""The board's memory of the last request, which is what makes a request act at most once."""

from __future__ import annotations

import enum


class Verdict(enum.Enum):
    """What to do with a request."""

    NEW = "carry it out"
    REPEATED = "answer as before"
    BUSY = "drop it; the one before is not answered yet"
    OLD = "drop it; a newer one was here already"


class RequestMemory:
    """Sequence number and answer of the last request of a session.

    Numbers count from 1 and wrap at 256. Only one request is in flight and a host gives up its
    session after a few that were not answered, so half the circle is far more than they can drift.
    """

    def __init__(self) -> None:
        self.seq = 0
        self.answer: bytes | None = b""

    def judge(self, seq: int) -> Verdict:
        """Return what to do with the request `seq`; a NEW one becomes the last."""
        step = (seq - self.seq) & 0xFF
        if step == 0:
            return Verdict.REPEATED if self.answer is not None else Verdict.BUSY
        if step > 127:
            return Verdict.OLD
        if self.answer is None:
            return Verdict.BUSY
        self.seq = seq
        self.answer = None
        return Verdict.NEW
