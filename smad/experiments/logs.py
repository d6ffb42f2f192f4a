"""Plans that were carried out before: the recordings come from run logs, not from a bench."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from smad.control.plan import Plan
from smad.experiments.driver import PARTS, Mounting, log_name
from smad.experiments.errors import ExperimentError
from smad.experiments.recording import Recording
from smad.experiments.virtual import MARK
from smad.runlog.reader import Run, board_time_s, read_run, recorded


def recording_of(run: Run) -> Recording:
    """The recording in a run log: its columns, and its notes that begin with `mark `."""
    marks = {
        event.text.removeprefix(MARK): at_s
        for event in run.events
        if event.kind == "note" and event.text.startswith(MARK)
        if (at_s := board_time_s(run, event)) is not None
    }
    columns = {name: np.asarray(column, float) for name, column in run.columns.items()}
    return Recording(columns, marks)


class LogDriver:
    """Answers each plan with the run log of that name. Raises RunLogError for an unreadable one."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._runs = {run.header.name or run.path.stem: run for run in map(read_run, paths)}

    def parts(self) -> frozenset[str]:
        """Every channel that all the logs hold; actuators are taken for granted."""
        actuators = {"stage", "drain"}
        return frozenset(
            part
            for part in PARTS
            if part in actuators
            or all(recorded(run.columns[part]).any() for run in self._runs.values())
        )

    def mounting(self) -> Mounting | None:
        return None

    def run(self, plan: Plan) -> Recording:
        run = self._runs.get(log_name(plan))
        if run is None:
            raise ExperimentError(
                f"none of the logs is of run {log_name(plan)}",
                limit=", ".join(sorted(self._runs)) or "no logs were given",
                action="add it with --from, or run the experiment",
            )
        return recording_of(run)
