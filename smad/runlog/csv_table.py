"""A CSV file as columns of numbers; whatever is wrong is told with its line."""

from __future__ import annotations

import contextlib
import csv
import gzip
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TextIO, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from smad.errors import LogImportError
from smad.runlog.bounds import (
    DAMAGED,
    MOST_HEAD_CHARACTERS,
    require_bounded,
    require_bounded_text,
)

if TYPE_CHECKING:
    import pyarrow

_DELIMITERS: tuple[str, ...] = (",", ";", "\t")
_NOTHING = ["", "nan", "NaN", "NAN", "NA", "null", "NULL", "None"]
_COMMENT = "#"


class CsvFormat(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the numbers are written. `delimiter` empty: found in the line of names."""

    delimiter: Literal["", ",", ";", "\t"] = ""
    decimal: Literal[".", ","] = "."


@dataclass(frozen=True)
class CsvTable:
    """The line of names of a CSV file, and how to read the rest.

    Lines before it that begin with # are passed over.
    """

    path: Path
    names: list[str]
    names_line: int
    delimiter: str
    decimal: str
    most_rows: int
    """How many rows there are at most."""

    def columns(self, wanted: Iterable[str]) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """The columns named, each of shape (rows,), NaN where a cell is empty.

        Raises LogImportError for a row of another length, text in numbers, or no rows.
        """
        columns = {name: np.empty(self.most_rows) for name in wanted}
        rows = 0
        for batch in self._batches(list(columns)):
            end = rows + batch.num_rows
            if end > self.most_rows:
                raise LogImportError(
                    f"{self.path} became longer while it was read", action="try again"
                )
            for name, values in columns.items():
                values[rows:end] = self._numbers(name, batch[name], rows)
            rows = end
        if not rows:
            raise LogImportError(f"{self.path} holds no rows", action="there is nothing to import")
        for name in tuple(columns):
            yield name, columns.pop(name)[:rows]

    def place_of(self, row: int) -> str:
        """The line of the file on which that row (from 0) ends."""
        return f"line {self._line_of(row)}"

    def _line_of(self, row: int) -> int:
        # Columns that nobody wants are not looked at before, so anything may stand in them.
        with _opened(self.path, errors="replace") as file:
            reader = csv.reader(_after(file, self.names_line), delimiter=self.delimiter)
            filled = (reader.line_num for cells in reader if cells)
            with contextlib.suppress(csv.Error):
                for number, line in enumerate(filled):
                    if number == row:
                        return self.names_line + line
            return self.names_line + reader.line_num

    def _batches(self, wanted: list[str]) -> Iterator[pyarrow.RecordBatch]:
        """The columns as text, a megabyte of the file at a time."""
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        try:
            yield from arrow_csv.open_csv(
                str(self.path),
                arrow_csv.ReadOptions(
                    use_threads=False, skip_rows=self.names_line, column_names=self.names
                ),
                arrow_csv.ParseOptions(delimiter=self.delimiter, newlines_in_values=False),
                arrow_csv.ConvertOptions(
                    include_columns=wanted,
                    column_types=dict.fromkeys(self.names, pa.string()),
                    null_values=_NOTHING,
                    strings_can_be_null=True,
                ),
            )
        except OSError as error:
            raise LogImportError(
                f"cannot read {self.path}: {error}", action="restore the file"
            ) from error
        except pa.ArrowInvalid as error:
            if "Empty CSV" in str(error):
                return
            raise LogImportError(
                f"{self.path} is no table: {self._first_bad_row() or error}",
                action="correct the line",
            ) from None

    def _first_bad_row(self) -> str:
        try:
            with _opened(self.path) as file:
                reader = csv.reader(_after(file, self.names_line), delimiter=self.delimiter)
                for cells in reader:
                    if cells and len(cells) != len(self.names):
                        line = self.names_line + reader.line_num
                        return f"line {line} has {len(cells)} cells, not {len(self.names)}"
        except (csv.Error, UnicodeDecodeError, *DAMAGED) as error:
            return str(error)
        return ""

    def _numbers(self, name: str, texts: pyarrow.Array, before: int) -> NDArray[np.float64]:
        """The numbers of a piece of a column that `before` rows stand before."""
        import pyarrow as pa
        from pyarrow import compute

        plain = compute.utf8_trim_whitespace(texts)
        if self.decimal == ",":
            plain = compute.replace_substring(plain, ",", ".")
        plain = compute.replace_substring_regex(plain, r"^\+", "")
        try:
            values: NDArray[np.float64] = compute.cast(plain, pa.float64()).to_numpy(
                zero_copy_only=False
            )
        except pa.ArrowInvalid:
            row, text = _first_text(plain)
            self._refuse(name, before + row, text)
        infinite = np.flatnonzero(np.isinf(values))
        if len(infinite):
            self._refuse(name, before + int(infinite[0]), "an infinite number")
        return values

    def _refuse(self, name: str, row: int, value: str) -> None:
        raise LogImportError(
            f"{self.path}, {self.place_of(row)}: column {name!r} is not a number",
            value=value,
            action="correct it, or leave the cell empty"
            if self.decimal == "," or "," not in value
            else 'correct it, or say `decimal = ","` under [csv] in a mapping file',
        )


def open_csv(path: Path, form: CsvFormat) -> CsvTable:
    """Read the line of names.

    Raises LogImportError for a file that cannot be read, is empty, or is no table of names.
    """
    try:
        with _opened(path) as file:
            number, line = _names_line(path, file)
    except DAMAGED as error:
        said = getattr(error, "strerror", None) or error
        raise LogImportError(f"cannot read {path}: {said}", action="check the file") from error
    except UnicodeDecodeError as error:
        raise LogImportError(
            f"{path} is not UTF-8 text (byte {error.start})", action="save it as UTF-8 CSV"
        ) from None
    if not line.strip():
        raise LogImportError(f"{path} is empty", action="there is nothing to import")
    likely = max(_DELIMITERS, key=line.count)
    delimiter = form.delimiter or likely
    require_bounded(path, columns=line.count(delimiter) + 1)
    try:
        names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise LogImportError(
            f"{path}, line {number}: {error}", action="write the names of the columns there"
        ) from None
    twin = next((name for name, count in Counter(names).items() if count > 1), None)
    if twin is not None:
        raise LogImportError(
            f"{path}, line {number}: two columns are named {twin!r}", action="rename one"
        )
    rows = require_bounded_text(path, len(names))
    return CsvTable(path, names, number, delimiter, form.decimal, rows)


def _opened(path: Path, errors: str = "strict") -> TextIO:
    """The text of a file, unpacked if its name says that it is packed."""
    how = gzip.open if path.suffix == ".gz" else open
    return cast(TextIO, how(path, "rt", encoding="utf-8-sig", errors=errors, newline=""))


def _names_line(path: Path, file: TextIO) -> tuple[int, str]:
    """The number of the first line that is no comment, and the line itself."""
    number, left = 0, MOST_HEAD_CHARACTERS
    while line := file.readline(left + 1):
        number += 1
        left -= len(line)
        if left < 0:
            raise LogImportError(
                f"{path}: its line of names does not end",
                value=f"more than {MOST_HEAD_CHARACTERS} characters",
                limit=f"{MOST_HEAD_CHARACTERS} characters",
                action="leave out columns and comments that are not needed",
            )
        if line.strip() and not line.startswith(_COMMENT):
            return number, line
    return 1, ""


def _after(lines: Iterator[str], count: int) -> Iterator[str]:
    for _ in range(count):
        next(lines, None)
    return lines


def _first_text(values: pyarrow.Array) -> tuple[int, str]:
    import pyarrow as pa

    for row, value in enumerate(values):
        if value.is_valid:
            try:
                value.cast(pa.float64())
            except pa.ArrowInvalid:
                return row, value.as_py()
    raise AssertionError("a column that could not be cast holds only numbers")
