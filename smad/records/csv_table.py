"""A CSV file as columns of numbers; whatever is wrong is told with its line."""

from __future__ import annotations

import codecs
import contextlib
import csv
import gzip
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal, NoReturn, TextIO, cast

import msgspec
import numpy as np

from smad.arrays import Array
from smad.counted import counted
from smad.errors import LogImportError
from smad.records.csv_head import Head, read_head
from smad.records.stamps import is_stamp, likely_forms, read_stamp
from smad.runlog.bounds import DAMAGED, require_bounded_text

if TYPE_CHECKING:
    import _csv

    import pyarrow

_UTF8 = "utf-8-sig"
"""UTF-8 with or without a byte order mark."""
_NO_NUMBER = (
    "nan", "+nan", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind", "1.#inf", "-1.#inf",
    "na", "n/a", "#n/a", "<na>", "null", "none", "#num!", "#div/0!", "#value!",
)  # fmt: skip
_NOTHING = ["", "NaN", "-NaN", *(c(w) for w in _NO_NUMBER for c in (str, str.upper, str.title))]
"""What programs write where they have no number."""

_UNDER_CSV = (
    "under [csv] in a mapping file (--mapping of smad log import, --map of smad gap diagnose) or "
    "csv=… of smad.simulators.diagnose"
)
_NARROW_SPACES = "[\u00a0\u2009\u202f]"
"""Spaces that spreadsheets group digits with, so that no line ends there."""


class CsvFormat(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the numbers are written. `delimiter` empty: found in the head; `thousands`: no sign.

    `encoding` is one of Python's; empty: UTF-8, UTF-16 with its mark, else cp1252, which is said.
    `time_format`: of stamps, as strptime has it; empty: ISO 8601.
    """

    delimiter: Literal["", ",", ";", "\t", " "] = ""
    decimal: Literal[".", ","] = "."
    thousands: Literal["", ".", ",", " ", "'"] = ""
    encoding: str = ""
    time_format: str = ""


@dataclass(frozen=True)
class CsvTable:
    """The head of a CSV file, and how to read the rest. `most_rows`: how many there are at most.

    `encoding` is that of its text, `guessed` whether nobody said so.
    """

    path: Path
    head: Head
    form: CsvFormat
    most_rows: int
    encoding: str
    guessed: bool

    @property
    def names(self) -> list[str]:
        """The names of the columns."""
        return self.head.names

    @property
    def stamps(self) -> dict[str, str]:
        """Columns that hold stamps: empty where they are read, else what to say of them."""
        first = dict(zip(self.names, self.head.first, strict=False))
        read = {n: "" for n, text in first.items() if is_stamp(text, self.form.time_format)}
        forms = {n: likely_forms(text) for n, text in first.items() if n not in read}
        return read | {n: _as_stamps(f, first[n]) for n, f in forms.items() if f}

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the head was not read, and which encoding was taken, in words."""
        taken = f"it is no UTF-8: its names are read as {self.encoding}"
        return (*self.head.passed_over, *([taken] if self.guessed else []))

    def columns(self, wanted: Iterable[str]) -> Iterator[tuple[str, Array]]:
        """The columns named, each of shape (rows,), NaN where a cell is empty.

        Raises LogImportError for a row of another length, text in numbers, or no rows.
        """
        columns = {name: np.empty(self.most_rows) for name in wanted}
        stamps = {n for n, advice in self.stamps.items() if not advice}
        rows = 0
        for batch in self._batches(list(columns)):
            end = rows + batch.num_rows
            if end > self.most_rows:
                raise LogImportError(
                    f"{self.path} became longer while it was read", action="try again"
                )
            for name, values in columns.items():
                numbers = self._stamps if name in stamps else self._numbers
                values[rows:end] = numbers(name, batch[name], rows)
            rows = end
        if not rows:
            raise LogImportError(f"{self.path} holds no rows", action="there is nothing to import")
        for name in tuple(columns):
            yield name, columns.pop(name)[:rows]

    def place_of(self, row: int) -> str:
        """The line of the file on which that row (from 0) ends."""
        # Columns that nobody wants are not looked at before, so anything may stand in them.
        with _opened(self.path, self.encoding, errors="replace") as file:
            reader = self._rows_of(file)
            with contextlib.suppress(csv.Error):
                next(islice(filter(None, reader), row, None), None)
            return f"line {self.head.lines + reader.line_num}"

    def _rows_of(self, file: TextIO) -> _csv.Reader:
        return csv.reader(islice(file, self.head.lines, None), delimiter=self.head.delimiter)

    def _batches(self, wanted: list[str]) -> Iterator[pyarrow.RecordBatch]:
        """The columns as text, a megabyte of the file at a time."""
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

        packing = "gzip" if self.path.suffix.lower() == ".gz" else None
        try:
            yield from arrow_csv.open_csv(
                pa.input_stream(str(self.path), compression=packing),
                arrow_csv.ReadOptions(
                    use_threads=False,
                    skip_rows=self.head.lines,
                    column_names=self.names,
                    encoding="utf8" if self.encoding == _UTF8 else self.encoding,
                ),
                arrow_csv.ParseOptions(delimiter=self.head.delimiter, newlines_in_values=False),
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
                f"{self.path} is not a table: {self._first_bad_row() or error}",
                action="correct the line",
            ) from None

    def _first_bad_row(self) -> str:
        try:
            with _opened(self.path, self.encoding) as file:
                reader = self._rows_of(file)
                for cells in reader:
                    if cells and len(cells) != len(self.names):
                        line = self.head.lines + reader.line_num
                        return (
                            f"line {line} has {counted(len(cells), 'cell')}, not {len(self.names)}"
                        )
        except (csv.Error, UnicodeDecodeError, *DAMAGED) as error:
            return str(error)
        return ""

    def _numbers(self, name: str, texts: pyarrow.Array, before: int) -> Array:
        """The numbers of a piece of a column that `before` rows stand before."""
        import pyarrow as pa
        from pyarrow import compute

        plain = compute.utf8_trim_whitespace(texts)
        decimal, thousands = self.form.decimal, self.form.thousands
        if thousands == " ":
            plain = compute.replace_substring_regex(plain, _NARROW_SPACES, thousands)
        if thousands:
            sign, point = re.escape(thousands), re.escape(decimal)
            grouped = rf"^[+-]?\d{{1,3}}({sign}\d{{3}})+({point}\d*)?$"
            self._require(name, plain, before, thousands, grouped)
            plain = compute.replace_substring(plain, thousands, "")
        if decimal == ",":
            if thousands != ".":
                self._require(name, plain, before, ".", "^$")
            plain = compute.replace_substring(plain, ",", ".")
        plain = compute.replace_substring_regex(plain, r"^\+", "")
        try:
            return np.asarray(compute.cast(plain, pa.float64()).to_numpy(zero_copy_only=False))
        except pa.ArrowInvalid:
            row = _first_text(plain)
            self._refuse(name, before + row, texts[row].as_py())

    def _stamps(self, name: str, texts: pyarrow.Array, before: int) -> Array:
        """Seconds since the stamp of the first row."""
        first = self.head.first[self.names.index(name)]
        start, out = read_stamp(first, self.form.time_format), np.full(len(texts), np.nan)
        for row, text in enumerate(texts.to_pylist()):
            if text is not None:
                try:
                    stamp = read_stamp(text.strip(), self.form.time_format)
                except ValueError:
                    self._refuse(name, before + row, text)
                out[row] = (stamp - start).total_seconds()
        return out

    def _require(
        self, name: str, texts: pyarrow.Array, before: int, sign: str, pattern: str
    ) -> None:
        """Refuse a cell that has a sign and is not written by the pattern."""
        from pyarrow import compute

        signed = compute.match_substring(texts, sign).fill_null(False)
        fits = compute.match_substring_regex(texts, pattern).fill_null(False)
        bad = np.flatnonzero(compute.and_not(signed, fits).to_numpy(zero_copy_only=False))
        if len(bad):
            self._refuse(name, before + int(bad[0]), texts[int(bad[0])].as_py())

    def _refuse(self, name: str, row: int, value: str) -> NoReturn:
        action = "correct it, or leave the cell empty"
        if forms := likely_forms(value.strip()):
            action = _as_stamps(forms)
        elif self.form.decimal == "," and "." in value:
            action = 'say `thousands = "."` under [csv] if points group thousands, or correct it'
        elif self.form.decimal == "." and "," in value:
            action = f'correct it, or say `decimal = ","` (or `thousands = ","`) {_UNDER_CSV}'
        raise LogImportError(
            f"{self.path}, {self.place_of(row)}: column {name!r} is not a number",
            value=value,
            limit=f"decimals after {self.form.decimal!r}"
            + (f", thousands grouped by {self.form.thousands!r}" if self.form.thousands else ""),
            action=action,
        )


def _as_stamps(forms: Sequence[str], text: str = "") -> str:
    """What to do about stamps that may be in some forms."""
    say = " or ".join(f'`time_format = "{form}"`' for form in forms)
    return (f"for stamps as {text} " if text else "") + f"say {say} {_UNDER_CSV}"


def open_csv(path: Path, form: CsvFormat) -> CsvTable:
    """Read the head of a file.

    Raises LogImportError for a file that cannot be read, is empty, or is no table of names.
    """
    if form.thousands == form.decimal:
        raise LogImportError(
            "under [csv], thousands and decimals have one sign",
            value=form.decimal,
            action="correct one of them",
        )
    for encoding, guessed in _encodings(path, form):
        try:
            with _opened(path, encoding) as file:
                head = read_head(path, file, form.delimiter)
        except DAMAGED as error:
            why = getattr(error, "strerror", None) or error
            raise LogImportError(f"cannot read {path}: {why}", action="check the file") from error
        except UnicodeError as error:
            wrong = str(error)
            continue
        most = require_bounded_text(path, len(head.names))
        return CsvTable(path, head, form, most, encoding, guessed)
    raise LogImportError(
        f"{path} is not text: {wrong}",
        action='save it as UTF-8 CSV, or say `encoding = "…"` under [csv] in a mapping file',
    )


def _encodings(path: Path, form: CsvFormat) -> list[tuple[str, bool]]:
    """Encodings to try in turn, and whether each is a guess.

    Digits and the degree sign are the same in cp1252 and its kin, so that a wrong guess spoils
    names of columns only. Raises LogImportError for one that is not known.
    """
    if form.encoding:
        try:
            codecs.lookup(form.encoding)
        except LookupError:
            raise LogImportError(
                "under [csv], the encoding is not known",
                value=form.encoding,
                limit="those of Python: utf-8, utf-16, cp1252, latin-1, shift_jis …",
                action="correct it",
            ) from None
        plain = codecs.lookup(form.encoding).name == "utf-8"
        return [(_UTF8 if plain else form.encoding, False)]
    with contextlib.suppress(*DAMAGED), _bytes_of(path) as file:
        if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            return [("utf-16", False)]
    return [(_UTF8, False), ("cp1252", True)]


def _bytes_of(path: Path) -> BinaryIO:
    """The bytes of a file, unpacked if its name says that it is packed."""
    return cast(BinaryIO, (gzip.open if path.suffix.lower() == ".gz" else open)(path, "rb"))


def _opened(path: Path, encoding: str, errors: str = "strict") -> TextIO:
    return io.TextIOWrapper(_bytes_of(path), encoding=encoding, errors=errors, newline="")


def _first_text(values: pyarrow.Array) -> int:
    """The place of the first value that is no number."""
    import pyarrow as pa

    for row, value in enumerate(values):
        if value.is_valid:
            try:
                value.cast(pa.float64())
            except pa.ArrowInvalid:
                return row
    raise AssertionError("a column that could not be cast holds only numbers")
