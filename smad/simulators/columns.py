"""Runs for a simulator: columns of files, tables and frames; ranges, quanta and noise from them."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun
from smad.records.column_names import quantity_in, unit_in
from smad.records.csv_table import CsvFormat
from smad.records.readings import CODES
from smad.records.tables import left_out, read_columns, require_rising
from smad.records.units import Written, convert
from smad.simulators.errors import SimulatorError
from smad.units import convertible, units_for

TIMES = ("t_s", "time_s", "time", "t", "timestamp_s")
"""Names of a column that is the time in s; `Time [ms]` and other units are understood, too."""
LAG_OF_CORRELATION = 0.1
"""Of a reading's correlation time, what its sensor may well lag by."""
UNMEASURED = 1e-3
"""Of a range, the noise of a reading that no run has."""
LONG_STEP_S = 2.0
"""Samples further apart, on a time without a unit, are as likely ms of a logger at 1 to 500 Hz."""
_FEWEST = 8
"""Samples of a run, to look at all. A diagnosis needs more."""
_SAME, _DIGITS = 1e-6, 9
_WHOLE = 0.02
"""Steps between values this near to a whole number of the least one are of a rounded column."""


@dataclass(frozen=True)
class Table:
    """Columns of one record on its time axis; a `GapRun` is one whose columns have their roles.

    `path` is that of its file, where it has one; `notes` say what was not read of it, `unread` why
    a column was not, `written` how a converted one stands in its file.
    """

    name: str
    t_s: Array
    columns: Mapping[str, Array]
    run: GapRun | None = None
    path: str = ""
    notes: tuple[str, ...] = ()
    unread: Mapping[str, str] = field(default_factory=dict)
    written: Mapping[str, Written] = field(default_factory=dict)

    @property
    def words(self) -> set[str]:
        """What it may be called by: its name, and that of its file."""
        return {self.name, self.path, Path(self.path).name} - {""}

    def source_of(self, name: str) -> str:
        """The column that is read as `name`: itself, or the only one that is the same quantity in
        another unit. Empty where there is none."""
        if name in self.columns:
            return name
        quantity, unit = quantity_in(name)
        quantities = {n: quantity_in(n) for n in self.columns}
        alike = [n for n, (q, u) in quantities.items() if q == quantity and convertible(u, unit)]
        return alike[0] if unit and len(alike) == 1 else ""

    def why_unread(self, name: str) -> str:
        """Why a column that would be read as `name` could not be; empty where there is none."""
        quantity = quantity_in(name)[0]
        return next((t for n, t in self.unread.items() if quantity_in(n)[0] == quantity), "")

    def column(self, name: str) -> Array:
        """The column `name`, converted where it has another unit. Raises KeyError without one."""
        source = self.source_of(name)
        if not source:
            raise KeyError(name)
        values = self.columns[source]
        return values if source == name else convert(values, unit_in(source), unit_in(name))

    def with_columns(self, names: Iterable[str]) -> Table:
        """The table with these columns in the units that they end with, where it has them."""
        names = list(names)
        sources = {n: s for n in names if (s := self.source_of(n)) and s != n}
        spent = set(sources.values()) - set(names)
        columns = {n: c for n, c in self.columns.items() if n not in spent}
        columns |= {n: self.column(n) for n in sources}
        notes = [f"{n} is column {s!r}, converted" for n, s in sources.items()]
        written = {n: Written.of(unit_in(s), unit_in(n)) for n, s in sources.items()}
        return replace(
            self, columns=columns, notes=(*self.notes, *notes), written={**self.written, **written}
        )


def csv_format(keys: Mapping[str, str]) -> CsvFormat:
    """How a CSV file is written, by the keys of [csv] in a mapping file. Raises SimulatorError."""
    try:
        return msgspec.convert(dict(keys), CsvFormat)
    except msgspec.ValidationError as error:
        raise SimulatorError(
            f"csv does not say how a table is written: {error}",
            limit=", ".join(CsvFormat.__struct_fields__),
            action='give for example {"delimiter": ";", "decimal": ","}',
        ) from None


def tables_of(
    runs: Any, time: str = "", form: CsvFormat | None = None, time_unit: str | None = None
) -> list[Table]:
    """The records in files, patterns, mappings, frames or structured arrays of columns, and runs
    that are made.

    `time` is the column of the time, where it has none of the usual names: in the unit that its
    name ends with, else in s. A map has a `time_unit` or, where it is empty, only a time that may
    well be in s. `form` says how a CSV file is written.
    Raises SimulatorError for what is none of these, or has no time.
    """
    single = isinstance(runs, (str, Path, GapRun, Table)) or hasattr(runs, "keys") or _fields(runs)
    if single or not isinstance(runs, Iterable):
        runs = [runs]
    return [
        table
        for n, run in enumerate(runs, 1)
        for table in _tables(run, f"run {n}", time, form, time_unit)
    ]


def _tables(
    run: Any, name: str, time: str, form: CsvFormat | None, unit: str | None
) -> Iterable[Table]:
    if isinstance(run, Table):
        return [run]
    if isinstance(run, GapRun):
        return [Table(run.name, run.t_s, {**run.inputs, **run.outputs}, run)]
    if isinstance(run, (str, Path)):
        paths = sorted(glob.glob(str(run))) if not Path(run).exists() else [str(run)]
        if not paths:
            raise SimulatorError(f"no file is {str(run)!r}", action="correct the path or pattern")
        return [_of_file(Path(p), time, form, unit) for p in paths]
    if fields := _fields(run):
        # A structure of MATLAB is one element, whose fields are arrays.
        run = {n: run[n].item() if run.size == 1 else run[n] for n in fields}
    if hasattr(run, "keys"):
        columns = {str(k): _array(run[k]) for k in run} | _index_of(run)
        stamps = {n: _since_first(c) for n, c in columns.items() if c.dtype.kind in "mM"}
        time = time or ("" if _times(columns) else next(iter(stamps), ""))
        return [_timed(name, columns | stamps, name, time, {}, unit=unit, stamps=tuple(stamps))]
    raise SimulatorError(
        "a run is neither a file nor a table of columns",
        value=type(run).__name__,
        action="give paths, mappings of columns, data frames or GapRuns",
    )


def _fields(run: Any) -> tuple[str, ...]:
    """Names of the columns of a structured array; none of what is no such."""
    return getattr(getattr(run, "dtype", None), "names", None) or ()


def _index_of(run: Any) -> dict[str, Any]:
    """The index of a data frame as a column, where it has a name or consists of stamps."""
    index = getattr(run, "index", None)
    values = _array(index)
    name = getattr(index, "name", None) or ("time" if values.dtype.kind in "mM" else "")
    return {str(name): values} if name else {}


def _array(column: Any) -> Any:
    """A column of a frame; stamps of a time zone, which numpy has none of, in universal time."""
    zoned = getattr(getattr(column, "dtype", None), "tz", None) is not None
    return np.asarray(column, dtype="datetime64[ns]" if zoned else None)


def _since_first(stamps: Any) -> Array:
    """Stamps, or durations, in s since the first."""
    return np.asarray((stamps - stamps[:1]) / np.timedelta64(1, "s"), dtype=np.float64)


def _of_file(path: Path, time: str, form: CsvFormat | None, unit: str | None) -> Table:
    read = read_columns(path, form)
    notes = (*read.notes, *left_out(list(read.unread), ", since they are not numbers"))
    numbers = any(n not in read.stamps for n in _times(read.numbers))
    stamps = [*_times(read.stamps), *read.stamps]
    time = time or ("" if numbers or not stamps else stamps[0])
    timed = _timed(
        path.stem, read.numbers, str(path), time, read.unread, unit=unit, stamps=read.stamps
    )
    return replace(timed, path=str(path), notes=(*notes, *timed.notes))


def _timed(
    name: str,
    columns: Mapping[str, Any],
    where: str,
    called: str,
    unread: Mapping[str, str],
    *,
    unit: str | None,
    stamps: Sequence[str] = (),
) -> Table:
    """The columns that are numbers on their time, in s, as `stamps` are already.

    Raises SimulatorError without a time.
    """
    time = next(iter(_times(columns, called)), None)
    if time is None:
        dates = [n for n, why in unread.items() if "time_format" in why and not called]
        broken = next((unread[t] for t in [*_times(unread, called), *dates]), "")
        lacking = f"time column {called!r}" if called else "column of the time"
        raise SimulatorError(
            broken or f"{where} has no {lacking}",
            value=None if broken else ", ".join(columns),
            limit=None if broken else ", ".join((called,) if called else (*TIMES, "time_ms …")),
            action="" if broken else "name it so, or say which it is: time = …",
        )
    numbers: dict[str, Array] = {}
    texts: dict[str, str] = dict(unread)
    for n, c in columns.items():
        try:
            numbers[n] = np.atleast_1d(np.squeeze(np.asarray(c, dtype=np.float64)))
        except (TypeError, ValueError) as error:
            texts[n] = f"{where}: column {n!r} is not numbers: {error}"
    if time not in numbers:
        raise SimulatorError(texts[time], action="give it in s")
    notes = left_out([n for n in texts if n not in unread], ", since they are not numbers")
    column = numbers.pop(time)
    odd = {n: c.shape for n, c in numbers.items() if c.shape != column.shape}
    for n, shape in odd.items():
        del numbers[n]
        texts[n] = f"{where}: column {n!r} has the shape {shape}, its time {column.shape}"
    notes += left_out(list(odd), ", since they are not as long as their time")
    t_s = column if time in stamps else _in_s(column, time, where, unit, stated=bool(called))
    return Table(name, t_s, numbers, notes=notes, unread=texts)


def _times(names: Iterable[str], called: str = "") -> list[str]:
    """Those that are the time by name, the likeliest first; the one that is `called`, if it is."""
    names = list(names)
    if called:
        return [called] if called in names else []
    parts = {n: quantity_in(n) for n in names if n not in TIMES}
    with_unit = [
        n for n, (q, u) in parts.items() if q in ("t", "time", "timestamp") and u in units_for("s")
    ]
    return [*(n for n in TIMES if n in names), *with_unit]


def _in_s(times: Array, name: str, where: str, of_map: str | None, *, stated: bool) -> Array:
    """Times in s; `stated`: in s where neither the map nor the name has another unit.

    Raises SimulatorError where a unit is missing that s cannot be.
    """
    unit = of_map or unit_in(name)
    if unit in units_for("s"):
        return convert(times, unit, "s")
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if not (stated and of_map is None) and name != "t_s" and step > LONG_STEP_S:
        remedy = "name it time_ms, or time_s"
        if of_map is not None:
            remedy = f'say it in the map, time_unit = "ms" (or s, us, ns, min, h), or {remedy}'
        raise SimulatorError(
            f"{where}: column {name!r} has no unit, and its samples would be seconds apart",
            value=f"{step:.6g} s",
            limit=f"{LONG_STEP_S:g} s without a unit in the name",
            action=f"is it in ms? {remedy}",
        )
    return times


def run_of(
    table: Table,
    inputs: Sequence[str],
    outputs: Sequence[str],
    zeros: Sequence[str] = (),
    *,
    trusted: bool = False,
) -> GapRun:
    """A record as a run with these inputs and outputs; inputs of `zeros` are 0 throughout.

    NaN where nothing was recorded.

    Raises SimulatorError for an input that it lacks.
    """
    lacking = [n for n in inputs if n not in table.columns]
    if lacking and (why := table.why_unread(lacking[0])):
        raise SimulatorError(why)
    if lacking:
        raise SimulatorError(
            f"{table.name} has no column {lacking[0]}, which the simulator reads",
            limit=", ".join(table.columns),
            action="record it, or rename a column",
        )
    flat = {n: np.zeros(len(table.t_s)) for n in zeros}
    if table.run is not None:
        run = table.run.with_columns(inputs=flat)
        return replace(run, trusted=run.trusted or trusted)
    driven = {n: table.columns[n] for n in inputs}
    measured = {n: table.columns[n] for n in outputs if n in table.columns}
    return GapRun(
        table.name,
        table.t_s,
        {**driven, **flat},
        measured,
        notes=table.notes,
        trusted=trusted,
        written=table.written,
    )


def require_time(table: Table) -> None:
    """Raise SimulatorError for a time that does not increase, or too few samples."""
    require_rising(table.t_s, f"{table.name}: its time", SimulatorError)
    count = len(table.t_s)
    if count < _FEWEST:
        raise SimulatorError(
            f"{table.name} has only {count} sample{'s'[: count != 1]}",
            limit=f"{_FEWEST} or more",
            action="leave the run out",
        )


def span_of(columns: Sequence[Array], written: Iterable[Written] = ()) -> tuple[float, float]:
    """Lowest and highest finite value of a signal over some runs; (0, 1) of none.

    `written` is how they stand in their files.

    A sensor's code for "no reading" does not count where it is further from all other values than
    these are from each other.
    """
    finite = [c[np.isfinite(c)] for c in columns]
    joined = np.concatenate([np.zeros(0), *finite])
    if not joined.size:
        return 0.0, 1.0
    codes = np.concatenate([CODES, *(w.values(np.array(CODES)) for w in written)])
    readings = joined[~np.isin(np.round(joined, _DIGITS), np.round(codes, _DIGITS))]
    if readings.size:
        room = np.ptp(readings)
        joined = joined[(joined >= readings.min() - room) & (joined <= readings.max() + room)]
    low, high = float(joined.min()), float(joined.max())
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def quantum_of(columns: Sequence[Array]) -> float:
    """The step to which a signal was rounded; 0 where none shows."""
    joined = np.concatenate([np.zeros(0), *(c[np.isfinite(c)] for c in columns)])
    values = np.unique(joined)
    steps = np.diff(values)
    steps = steps[steps > _SAME * np.ptp(values)] if len(values) > 2 else steps[:0]
    if not steps.size:
        return 0.0
    least = float(steps.min())
    off = np.abs(steps / least - np.rint(steps / least))
    return least if bool(np.all(off < _WHOLE)) else 0.0


def correlation_time_s(t_s: Array, y: Array) -> float:
    """Time in which the autocorrelation of a signal falls to 1/e."""
    level = y - np.mean(y)
    n = len(level)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(level, size)) ** 2
    products = np.fft.irfft(power, size)[: max(n // 2, 1)]
    below = np.flatnonzero(products < products[0] / np.e)
    return float(below[0] if below.size else len(products)) * float(np.median(np.diff(t_s)))


def usual_correlation_s(readings: Iterable[tuple[Array, Array]]) -> float:
    """Median correlation time of readings, each its times and values, in s; missing ones are 0."""
    return float(np.median([correlation_time_s(t_s, np.nan_to_num(y)) for t_s, y in readings]))
