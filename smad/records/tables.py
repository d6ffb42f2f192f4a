"""Tables made elsewhere: CSV, gzipped CSV and Parquet, column by column."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from smad.arrays import Array
from smad.counted import listed
from smad.errors import LogImportError, RunLogError, SmadError
from smad.records.bag_table import is_bag, open_bag
from smad.records.csv_table import CsvFormat, open_csv
from smad.runlog.bounds import require_bounded
from smad.runlog.paths import SUFFIX
from smad.runlog.reader import read_run, recorded

if TYPE_CHECKING:
    import pyarrow

_MOST_NAMED = 12


def left_out(names: Sequence[str], why: str = "") -> tuple[str, ...]:
    """A note that columns of these names were not used; none where there are none."""
    if not names:
        return ()
    named = [name or "one without a name" for name in names]
    return (f"columns left out{why}: {listed(named, _MOST_NAMED)}",)


_ROUNDED = 0.2
"""Of the steps of a time, that are 0 where it was written with too few digits."""
_MOST_DIGITS_BYTES = 64
_MOST_TEXT_BYTES = 1_000_000
"""Of a column of Parquet that holds numbers as texts: for each row, and besides."""


class ForeignTable(Protocol):
    """A table before its numbers are read."""

    @property
    def path(self) -> Path: ...

    @property
    def names(self) -> list[str]: ...

    @property
    def most_rows(self) -> int: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    @property
    def stamps(self) -> Mapping[str, str]:
        """Columns of dates and times, read in s since the first; or what to say of one."""

    def columns(self, wanted: Iterable[str]) -> Iterator[tuple[str, Array]]:
        """The columns named, each of shape (rows,), NaN where nothing stands.

        One by one, so that whoever converts them need not hold all of them twice.
        """

    def place_of(self, row: int) -> str:
        """Where that row (from 0) is to be found."""


@dataclass(frozen=True)
class ParquetTable:
    """A Parquet file of which the names of the columns are known."""

    path: Path
    names: list[str]
    most_rows: int
    stamps: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def columns(self, wanted: Iterable[str]) -> Iterator[tuple[str, Array]]:
        """The columns named. Raises LogImportError for text in one, and without rows."""
        import pyarrow as pa
        from pyarrow import parquet

        wanted = list(wanted)
        if not self.most_rows:
            raise LogImportError(f"{self.path} holds no rows", action="there is nothing to import")
        try:
            with parquet.ParquetFile(self.path) as file:
                kinds = {name: file.schema_arrow.field(name).type for name in wanted}
                sizes = _sizes(file.metadata)
            for name, kind in kinds.items():
                # A list may hold any number of values in a row, and none of them is read.
                self._require_plain(name, kind)
            # A text that repeats stays one text, however long it is.
            texts = [n for n, kind in kinds.items() if not pa.types.is_primitive(kind)]
            for name in texts:
                self._require_short(name, sizes[name])
            with parquet.ParquetFile(self.path, read_dictionary=texts) as file:
                for name in wanted:
                    yield name, self._numbers(name, file.read([name])[0])
        except (OSError, pa.ArrowException) as error:
            raise _unreadable(self.path, error) from error

    def _require_plain(self, name: str, kind: pyarrow.DataType) -> None:
        import pyarrow as pa

        if pa.types.is_nested(kind):
            raise LogImportError(
                f"{self.path}: column {name!r} is not a number",
                value=str(kind),
                action="write it as numbers, one in a row",
            )

    def _require_short(self, name: str, size: int) -> None:
        most = _MOST_TEXT_BYTES + _MOST_DIGITS_BYTES * self.most_rows
        if size > most:
            raise LogImportError(
                f"{self.path}: column {name!r} holds text too long for numbers",
                value=f"{size} bytes, unpacked",
                limit=f"{most} bytes",
                action="write it as numbers",
            )

    def place_of(self, row: int) -> str:
        return f"row {row + 1}"

    def _numbers(self, name: str, column: pyarrow.ChunkedArray) -> Array:
        import pyarrow as pa

        try:
            if pa.types.is_timestamp(column.type):
                since = np.asarray(column.cast(pa.timestamp("ns")).to_numpy())
                return np.asarray((since - since[0]) / np.timedelta64(1, "s"), dtype=np.float64)
            if pa.types.is_dictionary(column.type):
                parts = [c.dictionary.cast(pa.float64()).take(c.indices) for c in column.chunks]
                column = pa.chunked_array(parts, pa.float64())
            return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
        except pa.ArrowException as error:
            raise LogImportError(
                f"{self.path}: column {name!r} is not a number",
                value=str(error).splitlines()[0],
                action="write it as numbers, and missing samples as nothing or NaN",
            ) from None


def _open_parquet(path: Path, _: CsvFormat) -> ParquetTable:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(path) as file:
            about = file.metadata
            require_bounded(
                path,
                columns=about.num_columns,
                rows=about.num_rows,
                size=sum(about.row_group(i).total_byte_size for i in range(about.num_row_groups)),
            )
            names = file.schema_arrow.names
            kinds = zip(names, file.schema_arrow.types, strict=True)
            stamps = {n: "" for n, kind in kinds if pa.types.is_timestamp(kind)}
    except (OSError, pa.ArrowException) as error:
        raise _unreadable(path, error) from error
    twin = next((name for name, count in Counter(names).items() if count > 1), None)
    if twin is not None:
        raise LogImportError(f"{path}: two columns are named {twin!r}", action="rename one")
    return ParquetTable(path, names, about.num_rows, stamps)


_OPEN: Mapping[str, Callable[[Path, CsvFormat], ForeignTable]] = {
    ".parquet": _open_parquet,
    **dict.fromkeys((".csv", ".csv.gz", ".tsv", ".lvm"), open_csv),
}
KINDS = tuple(_OPEN)
"""How the name of a table ends, in small or capital letters."""


def is_table(path: Path) -> bool:
    """Whether the name of a file is that of a table."""
    return path.name.lower().endswith(KINDS)


def open_table(path: Path, form: CsvFormat | None = None) -> ForeignTable:
    """The table at `path`. Raises LogImportError when it cannot be read, or is of another kind."""
    if is_bag(path):
        return open_bag(path)
    kind = next((kind for kind in KINDS if path.name.lower().endswith(kind)), None)
    if kind is None:
        raise LogImportError(
            f"{path} is not a table",
            value=path.suffix or "no suffix",
            limit=", ".join(KINDS),
            action="convert it, or name it .csv if it is text",
        )
    return _OPEN[kind](path, form or CsvFormat())


@dataclass(frozen=True)
class Columns:
    """Columns of a table or a run log, (n,) each, NaN where nothing was recorded.

    `names` are all that it has, `unread` says why a column is no numbers, `stamps` are those of
    dates and times, in s since the first.
    """

    names: list[str]
    numbers: dict[str, Array]
    unread: dict[str, str]
    notes: tuple[str, ...]
    stamps: tuple[str, ...] = ()


def read_columns(path: Path, form: CsvFormat | None = None) -> Columns:
    """The columns of any file of one run.

    Raises LogImportError and RunLogError for a file that cannot be read.
    """
    if not is_table(path):
        try:
            run = read_run(path)
        except RunLogError:
            if not path.name.lower().endswith(SUFFIX):
                open_table(path)  # which says what kinds of files are read
            raise
        numbers = {
            n: np.where(recorded(c), c, np.nan) for n, c in run.columns.items() if recorded(c).any()
        }
        return Columns(list(numbers), numbers, {}, tuple(run.notes))
    require_bounded(path)
    table = open_table(path, form)
    remaining = table.names
    numbers, unread = dict[str, Array](), dict[str, str]()
    while remaining:
        try:
            numbers |= dict(table.columns(remaining))
            break
        except LogImportError:
            # One of them is no numbers: each by itself.
            name, remaining = remaining[0], remaining[1:]
            try:
                numbers |= dict(table.columns([name]))
            except LogImportError as error:
                unread[name] = str(error)
    stamps = tuple(n for n, advice in table.stamps.items() if not advice)
    numbers = {n: np.where(np.isinf(c), np.nan, c) for n, c in numbers.items()}
    return Columns(table.names, numbers, unread, table.notes, stamps)


def is_rounded(t_s: Array) -> bool:
    """Whether times, shape (n,), stand still so often that they lack digits."""
    return bool(np.mean(np.diff(t_s) == 0.0) > _ROUNDED)


def require_rising(t_s: Array, where: str, error: type[SmadError]) -> None:
    """Raise the error for times, shape (n,), that are not known, or do not increase."""
    back = np.flatnonzero(~(np.diff(t_s) > 0))
    if back.size or not np.isfinite(t_s).all():
        row = int(back[0]) + 1 if back.size else 0
        again = row > 1 and t_s[row] <= t_s[0]
        raise error(
            f"{where} {'begins again' if again else 'does not increase'} at row {row + 1}",
            value=float(t_s[row]),
            action="split it there: each run is a table of its own"
            if again
            else "write it with more digits"
            if is_rounded(t_s)
            else "sort the rows, remove repeated ones, or leave the run out",
        )


def _sizes(about: pyarrow.parquet.FileMetaData) -> dict[str, int]:
    """Bytes of each column, unpacked, as the file tells."""
    sizes: Counter[str] = Counter()
    for group in map(about.row_group, range(about.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            sizes[column.path_in_schema] += column.total_uncompressed_size
    return sizes


def _unreadable(path: Path, error: Exception) -> LogImportError:
    return LogImportError(
        f"cannot read {path}: {str(error).splitlines()[0]}", action="restore the file"
    )
