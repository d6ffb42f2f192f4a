"""The reader of the page's server: `python -m smad.view.reader`, one request a line, on its input.

It ends with its input, so it never outlives the server. What it can do needs the extras of `log`
and `report`; where one is missing the answer names it.
"""

import math
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from smad.counted import counted
from smad.extras import missing
from smad.processes import oom
from smad.view import forms, preview, requests

NICER = 10
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


def past(ask: requests.Past) -> requests.Read:
    """Read a log that is followed from one request to the next."""
    from smad.view.reader.logs import Log

    place = (ask.path, ask.axis)
    if place not in _logs:
        while len(_logs) >= MOST_LOGS:
            del _logs[next(iter(_logs))]
        _logs[place] = Log(Path(ask.path), ask.axis)
    read: requests.Read = _logs[place].read(ask.from_s, ask.to_s, ask.channels, ask.xy)
    return read


def runs(ask: requests.Runs) -> list[Any]:
    """List the newest runs, the newest first."""
    from smad.runlog.overview import list_runs

    if not Path(ask.folder).is_dir():
        return []
    return list_runs(ask.folder, newest=ask.most)[::-1]


def results(ask: requests.Results) -> list[tuple[str, str]]:
    """Say what a run came to: names and values in words."""
    import numpy as np

    from smad.control.metrics import tracking_r2
    from smad.runlog.reader import read_run

    run = read_run(ask.path, axis=ask.axis)
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


def experiments(ask: requests.Experiments) -> list[forms.Form]:
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


def plan(ask: requests.Plan) -> list[requests.Preview]:
    """Draw the first run of each trial of an experiment; later ones may hang on its outcome."""
    from smad.experiments.registry import make_experiment

    experiment, driver = make_experiment(ask.experiment, ask.settings), _Plans()
    for trial in experiment.trials():
        try:
            experiment.conduct(trial, driver)
        except _Planned:
            continue
    return [preview.planned(plan, ask.limits, ask.handover_rate_mm_per_s) for plan in driver.plans]


HANDLERS: Mapping[type[requests.ReaderRequest], Callable[[Any], Any]] = {
    requests.Past: past,
    requests.Runs: runs,
    requests.Results: results,
    requests.Experiments: experiments,
    requests.Plan: plan,
}


def answer(line: bytes) -> bytes:
    """Carry out a request; return the reply, or why there is none, as a line of JSON."""
    try:
        ask = msgspec.json.decode(line, type=requests.Request)
        done = {"done": HANDLERS[type(ask)](ask)}
    except Exception as error:
        # A damaged file is reported to the page; the next request is carried out.
        done = {"failed": str((isinstance(error, ModuleNotFoundError) and missing(error)) or error)}
    return msgspec.json.encode(done) + b"\n"


def main() -> None:
    """Carry out requests until the input ends."""
    oom.prefer_as_oom_victim()
    os.nice(NICER)
    for line in sys.stdin.buffer:
        sys.stdout.buffer.write(answer(line))
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
