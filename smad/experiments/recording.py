"""What one run brought home: the columns of a run log and the marks that the plan set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from smad.arrays import Array
from smad.experiments.errors import ExperimentError


@dataclass(frozen=True)
class Recording:
    """Columns as in the run log (`smad.runlog.schema`), all of shape (n,), and marks in `t_s`."""

    columns: Mapping[str, Array]
    marks: Mapping[str, float]

    def __getitem__(self, name: str) -> Array:
        """The column of that name. Raises ExperimentError when the run has none."""
        try:
            return np.asarray(self.columns[name], float)
        except KeyError:
            raise ExperimentError(
                f"the run has no column {name}",
                limit=", ".join(self.columns),
                action="record it again, or import the log with that column",
            ) from None

    @property
    def t_s(self) -> Array:
        """Board time, s."""
        return self["t_s"]

    def between(self, first: str | None, last: str | None) -> Recording:
        """The samples after mark `first` up to mark `last`; None means the run's end.

        Raises ExperimentError when a mark is missing or nothing lies between them.
        """
        t = self.t_s
        begin_s = -np.inf if first is None else self._mark(first)
        end_s = np.inf if last is None else self._mark(last)
        inside = (t > begin_s) & (t <= end_s)
        if not inside.any():
            raise ExperimentError(
                f"the run has no samples between its marks {first!r} and {last!r}",
                action="repeat the run",
            )
        return Recording(
            {name: np.asarray(column)[inside] for name, column in self.columns.items()},
            {name: mark_s for name, mark_s in self.marks.items() if begin_s <= mark_s <= end_s},
        )

    def _mark(self, name: str) -> float:
        try:
            return self.marks[name]
        except KeyError:
            raise ExperimentError(
                f"the run has no mark {name!r}",
                limit=", ".join(self.marks) or "it has no marks at all",
                action="run the experiment with `smad run`, which sets them",
            ) from None
