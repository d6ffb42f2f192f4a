"""The board's memory of its faults: the first since boot and the latest ones, per axis."""

from __future__ import annotations

import msgspec

from firmware_protocol.messages import FaultReport

LATEST_KEPT = 15


class FaultReports:
    """Reports by axis and index. The first of an axis is never forgotten."""

    def __init__(self) -> None:
        self.first_fault = 0
        self._reports: dict[int, dict[int, FaultReport]] = {}
        self._counts: dict[int, int] = {}

    def add(self, report: FaultReport) -> FaultReport:
        """Keep a report; return it with its index filled in.

        The index stops at 255: later reports replace each other there.
        """
        count = self._counts.get(report.axis, 0)
        numbered = msgspec.structs.replace(report, index=min(count, 255))
        self._counts[report.axis] = count + 1
        kept = self._reports.setdefault(report.axis, {})
        kept[numbered.index] = numbered
        for index in sorted(kept)[1:-LATEST_KEPT]:
            del kept[index]
        self.first_fault = self.first_fault or int(report.fault)
        return numbered

    def get(self, axis: int, index: int) -> FaultReport | None:
        """Return a report, None if there is none (any more)."""
        return self._reports.get(axis, {}).get(index)

    def count(self, axis: int) -> int:
        """Return how many reports an axis has made since boot."""
        return self._counts.get(axis, 0)
