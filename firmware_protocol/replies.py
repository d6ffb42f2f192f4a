"""The board's answers: at most one action for each request, at most ten complaints a second."""

from __future__ import annotations

import enum
from collections import deque

from firmware_protocol.enums import ErrorCode
from firmware_protocol.messages import Error
from firmware_protocol.wire import Field, fields_of

ERRORS_PER_SECOND = 10
_FIELDS: dict[str, Field] = {field.name: field for field in fields_of(Error)}


def error_of(
    number: int, seq: int, code: ErrorCode, field: int, *, value: int, limit: int
) -> Error:
    """Return the ERROR that refuses message `number`; what was found may be any whole number.

    The wire holds 32 bits with a sign, and a token, a time or a parameter's number may need more:
    value and limit are cut off at the ends of that span.
    """
    return Error(number, seq, code, field, _saturated("value", value), _saturated("limit", limit))


def _saturated(name: str, value: int) -> int:
    low, high = _FIELDS[name].span
    return min(max(value, low), high)


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

    def judge(self, seq: int, *, urgent: bool) -> Verdict:
        """Return what to do with the request `seq`; a NEW one becomes the last.

        An urgent one does not wait for the answer to the one before.
        """
        step = (seq - self.seq) & 0xFF
        if step == 0:
            return Verdict.REPEATED if self.answer is not None else Verdict.BUSY
        if step > 127:
            return Verdict.OLD
        if self.answer is None and not urgent:
            return Verdict.BUSY
        self.seq = seq
        self.answer = None
        return Verdict.NEW


class Budget:
    """So many a second, whatever arrives: a flood of bad frames must not fill the line back."""

    def __init__(self, per_second: int) -> None:
        self._spent: deque[int] = deque(maxlen=per_second)

    def spend(self, now_us: int) -> bool:
        """Return whether one more is allowed now."""
        full = len(self._spent) == self._spent.maxlen
        if full and 0 <= now_us - self._spent[0] < 1_000_000:
            return False
        self._spent.append(now_us)
        return True
