"""Fault reports: the board's memory of them, and the host's of those it has told already."""

from __future__ import annotations

from collections import deque

import msgspec

from firmware_protocol.messages import FaultReport

COPIES = 3
LATEST_KEPT = 15
SEEN_KEPT = 64


class FaultReports:
    """Reports by axis and index. The first of an axis is never forgotten."""

    def __init__(self) -> None:
        self.first_fault = 0
        self._reports: dict[int, dict[int, FaultReport]] = {}
        self._counts: dict[int, int] = {}
        self._copies_left: list[tuple[FaultReport, int]] = []

    def add(self, report: FaultReport) -> FaultReport:
        """Keep a report; return it with its index filled in, to be sent at once.

        The index stops at 255: later reports replace each other there.
        """
        count = self._counts.get(report.axis, 0)
        numbered = msgspec.structs.replace(report, index=min(count, 255))
        self._counts[report.axis] = count + 1
        of_axis = self._reports.setdefault(report.axis, {})
        of_axis[numbered.index] = numbered
        for index in sorted(of_axis)[1:-LATEST_KEPT]:
            del of_axis[index]
        self.first_fault = self.first_fault or int(report.fault)
        self._copies_left.append((numbered, COPIES - 1))
        return numbered

    def repeats(self) -> list[FaultReport]:
        """Return the reports of which a copy goes out with the sample now being sent."""
        due = self._copies_left
        self._copies_left = [(report, left - 1) for report, left in due if left > 1]
        return [report for report, _ in due]

    def get(self, axis: int, index: int) -> FaultReport | None:
        """Return a report, None if there is none (any more)."""
        return self._reports.get(axis, {}).get(index)

    def count(self, axis: int) -> int:
        """Return how many reports an axis has made since boot."""
        return self._counts.get(axis, 0)


class ReportsSeen:
    """The host's memory: the copies of a report are one report."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int]] = deque(maxlen=SEEN_KEPT)

    def note(self, report: FaultReport) -> bool:
        """Return whether the report is new."""
        key = (report.axis, report.index, report.t_us)
        if key in self._seen:
            return False
        self._seen.append(key)
        return True
