"""What is asked of a function before it is trusted with a diagnosis."""

import contextlib
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches

import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun, bridged
from smad.records.column_names import quantity_in
from smad.simulators.calling import called
from smad.simulators.columns import Table
from smad.simulators.declare import Simulator, value_name
from smad.simulators.errors import SimulatorError
from smad.simulators.starts import Starts

_ALIKE = 0.75
"""How alike two names are spelt, 0 to 1, that are likely meant to be one."""
_CHECKED_S = 1.0
"""For calls that look for values without a use."""


class WatchedColumns(Mapping[str, Array]):
    """The columns of a run, noting which of them the function reads.

    One that is asked for in another unit is converted.
    """

    def __init__(self, table: Table) -> None:
        self._table = table
        self.read: dict[str, None] = {}

    def __getitem__(self, name: str) -> Array:
        column = self._table.column(name)
        self.read[name] = None
        return column

    def __iter__(self) -> Iterator[str]:
        return iter(self._table.columns)

    def __len__(self) -> int:
        return len(self._table.columns)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and bool(self._table.source_of(name))


class FirstReadings(Mapping[str, float]):
    """NAME and NAME_rate of every column of a table at its first row, made when they are read;
    `read` are the columns that were."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self.read: dict[str, None] = {}

    def __getitem__(self, name: str) -> float:
        of = name if self._table.source_of(name) else name.removesuffix("_rate")
        run = GapRun(self._table.name, self._table.t_s, {}, {of: self._table.column(of)})
        self.read[of] = None
        return Starts(run, (of,)).start_of(0)[0][name]

    def __iter__(self) -> Iterator[str]:
        return iter([*self._table.columns, *(f"{n}_rate" for n in self._table.columns)])

    def __len__(self) -> int:
        return 2 * len(self._table.columns)


@dataclass(frozen=True, kw_only=True)
class Roles:
    """What a function makes of columns: `inputs` that it reads, `outputs` that it returns, `begun`
    ones whose start it uses, `unmeasured` ones that no column is; `idle` values change nothing; a
    call takes `seconds`."""

    inputs: list[str]
    begun: list[str]
    outputs: list[str]
    unmeasured: list[str]
    idle: list[str]
    seconds: float


class _Trial:
    """A function and the columns of a run; `values` are those that it begins with."""

    def __init__(self, declared: Simulator, table: Table) -> None:
        self.declared, self.table = declared, table
        # What lacks is bridged, as in an admitted run.
        columns = {n: bridged(c) for n, c in table.columns.items() if np.isfinite(c).any()}
        self.starting = FirstReadings(replace(table, columns=columns))
        columns |= {n: np.zeros(len(table.t_s)) for n in declared.forces}
        self.watched = WatchedColumns(replace(table, columns=columns))
        self.values = declared.values({}, {})

    def outputs(self, values: Mapping[str, float]) -> dict[str, Array]:
        """One call of the function."""
        return called(self.declared, self.table.t_s, self.watched, values, self.starting)


def roles(declared: Simulator, table: Table) -> Roles:
    """What the function makes of the columns of a run.

    Raises SimulatorError for a function that cannot be asked: it fails, writes to what it is given,
    returns another length, is not the same twice.
    """
    trial = _Trial(declared, table)
    watched = trial.watched
    first = _first(trial)
    sources = {n: table.source_of(n) for n in first}
    outputs = [n for n, s in sources.items() if s == n or (s and s not in sources)]
    unread = [why for n in first if (why := table.why_unread(n))]
    if not outputs and unread:
        raise SimulatorError(unread[0])
    if not outputs:
        raise SimulatorError(
            f"{declared.name} returns nothing that was measured",
            value=", ".join(first) or "nothing",
            limit=", ".join(table.columns),
            action="return outputs by the names of their columns",
        )
    _require_no_slip(trial, sources)
    peeked = [n for n in watched.read if n in outputs]
    if peeked:
        raise SimulatorError(
            f"{declared.name} reads {peeked[0]}, which it returns",
            action=f"begin from start[{peeked[0]!r}], and leave the rest of it alone",
        )
    for name in outputs:
        # What stops later is said of each run.
        if not np.isfinite(first[name]).any():
            raise SimulatorError(
                f"{declared.name} gives no numbers for {name} with the values it begins with",
                value=table.name,
                action="begin with values at which it runs",
            )
    _require_used(declared, {*watched.read, *first, *trial.values})
    first = {n: first[n] for n in outputs}
    seconds = _require_same(trial, first)
    return Roles(
        inputs=[n for n in watched.read if n not in outputs],
        outputs=outputs,
        begun=[n for n in outputs if n in trial.starting.read],
        unmeasured=[n for n, s in sources.items() if not s],
        idle=_idle(trial, first, seconds),
        seconds=seconds,
    )


def _require_used(declared: Simulator, used: set[str]) -> None:
    """Raise SimulatorError for what is declared of a signal that the function has not."""
    used |= {*declared.observed, *declared.forces}
    for option in ("exact", "ranges", "noise", "units"):
        for name in (n for n in getattr(declared, option) if n not in used):
            raise SimulatorError(
                f"{option} names {name}, which {declared.name} neither reads nor returns",
                limit=", ".join(sorted(used)),
                action="correct the name, or leave it out",
            )


def _require_no_slip(trial: _Trial, sources: Mapping[str, str]) -> None:
    """Raise SimulatorError for an output that is likely a column under another name."""
    declared, table = trial.declared, trial.table
    used = {*sources.values(), *map(table.source_of, trial.watched.read), *declared.observed}
    free = [n for n in table.columns if n not in used]
    quantities = {quantity_in(n)[0]: n for n in free}
    for name in (n for n, source in sources.items() if not source):
        for like in get_close_matches(quantity_in(name)[0], quantities, 1, _ALIKE):
            raise SimulatorError(
                f"{declared.name} returns {name}, but no column has that name, and does not read "
                f"column {quantities[like]}",
                limit=", ".join(table.columns),
                action="give both one name and unit if they are one quantity; else leave out one",
            )


def _first(trial: _Trial) -> dict[str, Array]:
    declared, table = trial.declared, trial.table
    try:
        return trial.outputs(trial.values)
    except KeyError as error:
        name = str(error.args[0])
        empty = f"{table.name}: column {name!r} holds no number" if table.source_of(name) else ""
        if why := table.why_unread(name) or empty:
            raise SimulatorError(why) from error
        raise SimulatorError(
            f"{declared.name} asks for {name!r}, which is neither a column nor a value",
            limit=", ".join([*table.columns, *trial.values]),
            action="correct the name, or declare it",
        ) from error
    except Exception as error:  # whatever somebody else's function does
        text = f"{type(error).__name__}: {error}"
        if "read-only" in text or "does not support item assignment" in text:
            raise SimulatorError(
                f"{declared.name} changes what it is given",
                value=text,
                action="work on a copy: np.array(inputs[…])",
            ) from error
        raise SimulatorError(
            f"{declared.name} fails on {table.name} with the values it begins with",
            value=text,
            action="take (t, inputs, values, start); return outputs by name, one value for each "
            "time",
        ) from error


def _require_same(trial: _Trial, first: Mapping[str, Array]) -> float:
    """The same again, also after other values, or it is no function; the s that a call takes."""
    declared = trial.declared
    moved = {p.name: p.nominal + 0.1 * p.prior_sd for p in declared.parameters[:1]}
    with contextlib.suppress(Exception):  # it may fail elsewhere: such a model is dropped
        trial.outputs(trial.values | moved)
    # The calls before may have compiled it.
    began = time.perf_counter()
    again = trial.outputs(trial.values)
    seconds = time.perf_counter() - began
    for name in first:
        if not np.array_equal(first[name], again[name], equal_nan=True):
            off = float(np.nanmax(np.abs(first[name] - again[name])))
            raise SimulatorError(
                f"{declared.name} gives another {name} for the same run and values",
                value=f"up to {off:.3g} apart",
                action="keep no state from one call to the next, and give what is random a seed",
            )
    return seconds


def _idle(trial: _Trial, first: Mapping[str, Array], seconds: float) -> list[str]:
    """Parameters and effects that change no output, as one whose name the function misspells.

    Empty for a function that takes long.
    """
    of = trial.declared
    moved = {p.name: p.nominal + 0.1 * p.prior_sd for p in of.parameters} | {
        value_name(e, q): q.typical for e in of.effects for q in e.parameters if q.strength
    }
    if len(moved) * seconds > _CHECKED_S:
        return []
    idle = []
    for name, value in moved.items():
        with contextlib.suppress(Exception):  # where it fails, it does not do nothing
            outputs = trial.outputs(trial.values | {name: value})
            if all(np.array_equal(y, outputs[n], equal_nan=True) for n, y in first.items()):
                idle.append(name)
    return idle
