"""A declared simulator and the runs it is asked about: what the records say of its signals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from smad.diagnosis.data.grid import MOST_ROWS, row_length_s
from smad.diagnosis.data.noise import third_difference_sd
from smad.diagnosis.plant import Channel, Signal, Traits
from smad.diagnosis.runs import GapRun
from smad.records.csv_table import CsvFormat
from smad.simulators.checks import Roles, roles
from smad.simulators.columns import (
    LAG_OF_CORRELATION,
    UNMEASURED,
    Table,
    quantum_of,
    require_time,
    run_of,
    span_of,
    tables_of,
    usual_correlation_s,
)
from smad.simulators.declare import Simulator
from smad.simulators.errors import SimulatorError
from smad.simulators.plant import SimulatedPlant, SimulatorPlaces

_SHORTEST = 4.0
"""Correlation times of what is measured that a run must be long, or as long as of any plant."""
_NEARLY = 0.99
"""Of the shortest row that their number allows: what is longer was made so by that number."""
_UNCHANGED = 1e-9


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A plant of the diagnosis with its runs, in the groups they were given in.

    `said` are the defaults that were taken, in words; `seconds` is what a replay takes.
    """

    plant: SimulatorPlaces
    groups: tuple[tuple[GapRun, ...], ...]
    said: tuple[str, ...]
    seconds: float


def bind(
    declared: Simulator,
    *groups: Any,
    trusted: Sequence[str] = (),
    time: str = "",
    form: CsvFormat | None = None,
) -> Bound:
    """Read the runs of each group, and make the plant that they are of.

    `trusted` are paths, or names, of runs that the model's opinion does not refuse; `time` and
    `form`: see `tables_of`.

    Raises SimulatorError for runs or a function that cannot be used.
    """
    if not isinstance(declared, Simulator):
        raise SimulatorError(
            "this is not a declared simulator",
            value=type(declared).__name__,
            action="give the runs first, then simulator(f, parameters=…)",
        )
    tables = [tables_of(group, time, form) for group in groups]
    every = [t for group in tables for t in group]
    if not every:
        raise SimulatorError("there are no runs", action="give at least one")
    for table in every:
        require_time(table)
    fullest = max(every, key=lambda t: len(t.columns))
    by_role = _with_channels_of(every, roles(declared, fullest))
    inputs, outputs = by_role.inputs, by_role.outputs
    # From here on every column has the unit that the function asked for.
    names = [*inputs, *outputs, *declared.observed]
    tables = [[t.with_columns(names) for t in group] for group in tables]
    every = [t for group in tables for t in group]
    for table in every:
        _require_start(declared, table, by_role.begun)
    exact = {*declared.exact, *_constant(inputs, every, declared)}
    read = [n for n in inputs if n not in declared.forces]
    names = [*read, *(n for n in declared.observed if n not in read)]
    runs = [
        tuple(
            run_of(t, names, outputs, tuple(declared.forces), trusted=bool(t.words & set(trusted)))
            for t in group
        )
        for group in tables
    ]
    defaults = _defaults_in_words(declared, every, read, by_role, exact, idle_in=fullest.name)
    correlation_s = _correlation_s(outputs, every)
    plant = SimulatedPlant(
        declared,
        _signals(declared, [n for n in read if n not in exact], every),
        [_channel(declared, n, [r for group in runs for r in group]) for n in outputs],
        lag_s=declared.lag_s or LAG_OF_CORRELATION * correlation_s,
        shortest_s=declared.shortest_s or min(Traits().shortest_s, _SHORTEST * correlation_s),
    )
    places = SimulatorPlaces(plant)
    defaults += _blurred(places, [r for group in runs for r in group], outputs)
    return Bound(plant=places, groups=tuple(runs), said=tuple(defaults), seconds=by_role.seconds)


def _with_channels_of(tables: Sequence[Table], of: Roles) -> Roles:
    """The roles in one run, with the channels that only others have."""
    names = {*of.outputs, *of.unmeasured}
    sources = {n: {t.source_of(n) for t in tables} - {""} - (names - {n}) for n in of.unmeasured}
    return replace(
        of,
        outputs=[*of.outputs, *(n for n, s in sources.items() if s)],
        unmeasured=[n for n, s in sources.items() if not s],
    )


def _require_start(declared: Simulator, table: Table, begun: Sequence[str]) -> None:
    """Raise SimulatorError for a run without a reading that the function begins from."""
    for name in begun:
        if name not in table.columns or not np.isfinite(table.columns[name]).any():
            raise SimulatorError(
                f"{table.name} has no reading of {name}, which {declared.name} begins from",
                limit=", ".join(table.columns),
                action="leave the run out, or begin without this reading",
            )


def _constant(inputs: Sequence[str], tables: Sequence[Table], declared: Simulator) -> list[str]:
    """Inputs that no run changes: a law or a drive error there would be a parameter."""
    out = []
    for name in (n for n in inputs if n not in declared.forces):
        low, high = _ends(name, tables)
        if high - low <= _UNCHANGED * max(abs(low), abs(high), 1e-300):
            out.append(name)
    return out


def _ends(name: str, tables: Sequence[Table]) -> tuple[float, float]:
    values = [t.columns[name] for t in tables if name in t.columns]
    return (float(min(np.nanmin(v) for v in values)), float(max(np.nanmax(v) for v in values)))


def _signals(declared: Simulator, inputs: Sequence[str], tables: Sequence[Table]) -> list[Signal]:
    signals = []
    for name in inputs:
        low, high = declared.ranges.get(name) or span_of(
            [t.columns[name] for t in tables if name in t.columns],
            [t.written[name] for t in tables if name in t.written],
        )
        signals.append(Signal(name, declared.unit(name), low, high))
    forces = [Signal(n, declared.unit(n), a, b) for n, (a, b) in declared.forces.items()]
    return [*signals, *forces]


def _channel(declared: Simulator, name: str, runs: Sequence[GapRun]) -> Channel:
    columns = [r.outputs[name] for r in runs if name in r.outputs]
    low, high = span_of(columns, [r.written[name] for r in runs if name in r.written])
    noise = declared.noise.get(name) or third_difference_sd(columns)
    # A reading at the end of what was seen is not at the end of what it can show.
    ends = declared.ranges.get(name, (2.0 * low - high, 2.0 * high - low))
    return Channel(
        name=name,
        unit=declared.unit(name),
        quantum=declared.quanta.get(name) or quantum_of(columns),
        low=ends[0],
        high=ends[1],
        noise=noise or UNMEASURED * (high - low),
    )


def _correlation_s(outputs: Sequence[str], tables: Sequence[Table]) -> float:
    return usual_correlation_s(
        (t.t_s, t.columns[n]) for t in tables for n in outputs if n in t.columns
    )


def _blurred(plant: SimulatorPlaces, runs: Sequence[GapRun], outputs: Sequence[str]) -> list[str]:
    """What to do where so much is given that rows become longer than a reading's changes."""
    row_s = row_length_s(runs, plant)
    whole_s = sum(float(np.ptp(r.t_s)) for r in runs)
    if row_s < _NEARLY * whole_s / MOST_ROWS:
        return []
    tables = [Table(r.name, r.t_s, r.outputs) for r in runs]
    times = {n: _correlation_s([n], tables) for n in outputs}
    fast = {n: s for n, s in times.items() if s < row_s}
    if not fast:
        return []
    return [
        f"{', '.join(fast)} changes within a row, which is {row_s:.2g} s long since all runs "
        f"together have at most {MOST_ROWS} rows: the floor takes signal for noise, and less is "
        f"noticed. Give fewer or shorter runs, {0.5 * MOST_ROWS * min(fast.values()):.2g} s in all"
    ]


def _defaults_in_words(
    declared: Simulator,
    tables: Sequence[Table],
    inputs: Sequence[str],
    by_role: Roles,
    exact: set[str],
    *,
    idle_in: str,
) -> list[str]:
    used = {*inputs, *by_role.outputs, *declared.observed}
    unread = sorted({n for t in tables for n in t.columns} - used)
    flat = sorted(exact & set(inputs) - set(declared.exact))
    rows: Mapping[str, Sequence[str]] = {
        "inputs": [n for n in inputs if n not in exact],
        "inputs taken as exact, no places": sorted(declared.exact),
        "inputs that no run changes, no places": flat,
        "columns that a law may go with": declared.observed,
        "columns that the simulator does not read": unread,
        "outputs without a column": by_role.unmeasured,
        "measured": by_role.outputs,
        f"values that change nothing in {idle_in}": by_role.idle,
    }
    words = "; ".join(f"{label}: {', '.join(names)}" for label, names in rows.items() if names)
    return [f"{words}. Ranges, quanta and noise are those of the records, unless given"]
