"""What the reader process does. It needs the extras `log` and `report`; the server has neither."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from smad.config import LimitsConfig
from smad.counted import counted
from smad.view import forms, preview
from smad.view.replies import Preview, Read

_logs: dict[tuple[str, str], Any] = {}
MOST_LOGS = 6
"""That many axes of one log, or logs of one axis."""
ON_A_BENCH = (
    "fig9-cycle",
    "fig10-thermal",
    "fig11-tracking",
    "fig13-segment",
    "resistance",
    "fig12-frequency",
)
"""Experiments on the antagonistic pair, the shortest first: another mounting has to be told."""
AT_HAND: Mapping[str, Any] = {"air": False}
"""What a form begins with where the experiment's own default needs another mounting."""


def past(
    path: str, axis: str, span_s: tuple[float, float], channels: Sequence[str], xy: Sequence[str]
) -> Read:
    """Read channels of a run log, and of its further parts, between two Unix times.

    The log is followed from one request to the next. The only axis has no name.
    """
    from smad.view.reader.logs import Log

    place = (path, axis)
    if place not in _logs:
        while len(_logs) >= MOST_LOGS:
            del _logs[next(iter(_logs))]
        _logs[place] = Log(Path(path), axis)
    read: Read = _logs[place].read(*span_s, channels, xy)
    return read


def runs(folder: Path, most: int) -> list[Any]:
    """List the newest runs, the newest first."""
    from smad.runlog.overview import list_runs

    return list_runs(folder, newest=most)[::-1] if folder.is_dir() else []


def results(path: Path, axis: str) -> list[tuple[str, str]]:
    """Say what a run came to, of one axis where it has several: names and values in words."""
    import numpy as np

    from smad.control.metrics import tracking_r2
    from smad.runlog.reader import read_run

    run = read_run(path, axis=axis)
    columns = run.columns
    table = [("duration", f"{run.duration_s:.1f} s, {counted(len(run), 'sample')}")]

    def add_range(what: str, names: tuple[str, ...], form: str) -> None:
        values = np.concatenate([columns[name] for name in names])
        values = values[np.isfinite(values)]
        if values.size:
            table.append((what, form.format(values.min(), values.max())))

    add_range("displacement", ("displacement_mm",), "{0:.2f} to {1:.2f} mm")
    away = columns["displacement_mm"] - columns["reference_mm"]
    away = away[np.isfinite(away)]
    r2 = tracking_r2(columns["reference_mm"], columns["displacement_mm"])
    if away.size and math.isfinite(r2):
        table.append(("tracking", f"R² {r2:.4f}, RMS error {math.sqrt(np.mean(away**2)):.3f} mm"))
    add_range("force", ("force_N",), "{0:.2f} to {1:.2f} N")
    add_range("temperature", ("rtd_x_degC", "rtd_y_degC"), "{0:.1f} to {1:.1f} °C")
    add_range("current", ("i_meas_x_A", "i_meas_y_A"), "up to {1:.2f} A")
    texts = [event.text for event in run.events if event.kind in ("fault", "note", "warning")]
    table += [("said", text) for text in texts[-5:]]
    table += [("note", note) for note in run.notes]
    return table


def experiments() -> list[forms.Form]:
    """Make a form of the settings of each experiment."""
    from smad.experiments.registry import make_experiment

    out = []
    for name in ON_A_BENCH:
        experiment = make_experiment(name)
        form = forms.form_of(type(experiment.options), skip=True)
        fields = tuple(
            msgspec.structs.replace(field, initial=AT_HAND.get(field.name, field.initial))
            for field in form.fields
        )
        out.append(forms.Form(tag=name, title=experiment.title, about="", fields=fields))
    return out


class _Planned(Exception):
    """Ends an experiment at its first run, whose plan is all that is wanted."""


class _Plans:
    """A driver that carries nothing out."""

    def __init__(self) -> None:
        self.plans: list[Any] = []

    def parts(self) -> frozenset[str]:
        from smad.experiments.driver import PARTS

        return frozenset(PARTS)

    def mounting(self) -> None:
        return None

    def run(self, plan: Any) -> Any:
        self.plans.append(plan)
        raise _Planned


def plans(
    name: str, settings: Mapping[str, Any], limits: LimitsConfig, handover_rate_mm_per_s: float
) -> list[Preview]:
    """Draw the first run of each trial of an experiment; later ones may hang on its outcome."""
    from smad.experiments.registry import make_experiment

    experiment, driver = make_experiment(name, settings), _Plans()
    for trial in experiment.trials():
        try:
            experiment.conduct(trial, driver)
        except _Planned:
            continue
    return [preview.planned(plan, limits, handover_rate_mm_per_s) for plan in driver.plans]
