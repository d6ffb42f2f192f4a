"""The head of a CSV file: what stands before the numbers, and which of it names the columns.

Spreadsheets and loggers write a title, comments, `sep=;`, or a row of units around the names. The
names are the last line that has as many cells as the first row of numbers, none of them a number
(then a row of units may follow); where that row is the first line of all, they may stand in the
last comment (as numpy's savetxt writes them).
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from smad.errors import LogImportError
from smad.runlog.bounds import MOST_HEAD_CHARACTERS, require_bounded
from smad.units import is_unit

DELIMITERS: tuple[str, ...] = (",", ";", "\t", " ")
_COMMENT = re.compile(r"\s*(#|%|//)+\s?")
_SEPARATOR = re.compile(r"\s*\"?sep=(?P<delimiter>.)\"?\s*$", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?[\d.,']*\d[\d.,']*(e[+-]?\d+)?$", re.IGNORECASE)
_DATE = r"\d{1,4}[-./](?:\d{1,2}|[A-Za-z]{3})[-./]\d{1,4}"
_TIME = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?(?: ?[AP]M)?"
STAMP = re.compile(
    rf"(?:{_DATE}(?:[T ]+{_TIME})?|{_TIME})(?:Z|[+-]\d{{2}}:?\d{{2}})?", re.IGNORECASE
)
"""A date, a time of day or both, as programs write them."""
_TOKENS = re.compile(r"[;,\t ]+")
_MOST_LINES = 1000


@dataclass(frozen=True)
class Head:
    """Names of the columns, and how many lines the numbers come after.

    `passed_over` says in words which lines were not read; `first` are the cells of the first row.
    """

    names: list[str]
    lines: int
    delimiter: str
    passed_over: tuple[str, ...] = ()
    first: Sequence[str] = ()


@dataclass(frozen=True)
class _Line:
    number: int
    text: str

    def cells(self, delimiter: str) -> list[str]:
        text = self.text.strip("\r\n")
        text = text.strip() if delimiter == " " else text
        return [
            c.strip()
            for c in next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
        ]

    @property
    def holds_numbers(self) -> bool:
        """Whether it begins with a number and most of it is numbers."""
        text = STAMP.sub("0", self.text.strip())
        words = [w.strip('"') for w in _TOKENS.split(text) if w.strip('"')]
        numbers = [bool(_NUMBER.match(w)) for w in words]
        return bool(numbers) and numbers[0] and sum(numbers) > len(numbers) / 2


def read_head(path: Path, file: TextIO, delimiter: str = "") -> Head:
    """The head of an opened file; `delimiter` empty: by what the file says or looks like.

    Raises LogImportError for a file without a line, and for one without names.
    """
    guessed, comments, lines = _lines_before_numbers(path, file)
    delimiter = delimiter or guessed
    if not lines:
        raise LogImportError(f"{path} is empty", action="there is nothing to import")
    first = next((k for k, line in enumerate(lines) if line.holds_numbers), None)
    if first == 0:
        return _named_by_comment(path, comments, lines[0], delimiter)
    numbers = lines[0] if first is None else lines[first]
    before = lines[:1] if first is None else lines[:first]
    delimiter = delimiter or _likely(path, before[-1], numbers)
    cells = _cells(path, numbers, delimiter)
    rows = [_fitting(_cells(path, line, delimiter), cells) for line in before]
    wide = [k for k, row in enumerate(rows) if len(row) == len(cells)]
    named = [k for k in wide if not any(map(_NUMBER.match, rows[k]))]
    if not named and all(len(row) == 1 for row in rows) and len(cells) > 1:
        raise _unnamed(path, numbers)
    row = last = named[-1] if named else 0
    if row - 1 in named and _are_units(rows[row]):
        row -= 1
    elif row + 1 in wide and _are_units(rows[row + 1]):
        last += 1
    names = rows[row]
    if row != last:
        units = [u.strip("[]()") for u in rows[last]]
        names = [
            f"{n} [{u}]" if u and not n.endswith("]") else n
            for n, u in zip(names, units, strict=True)
        ]
    _require_distinct(path, names, before[row].number)
    passed = tuple(
        f"line {x.number} is not a line of names: {x.text.strip()[:60]}" for x in before[:row]
    )
    first_cells = [] if first is None else cells
    return Head(names, before[last].number, delimiter, passed, first_cells)


def _fitting(row: list[str], cells: Sequence[str]) -> list[str]:
    """A row above the numbers, in as many cells: a delimiter too many ends either, or a comment."""
    if len(row) + 1 == len(cells) and not cells[-1]:
        return [*row, ""]
    return row[:-1] if len(row) == len(cells) + 1 and row[-1] in ("", "Comment") else row


def _lines_before_numbers(path: Path, file: TextIO) -> tuple[str, list[_Line], list[_Line]]:
    """The delimiter that the file tells, its comments, and its lines up to the first numbers."""
    delimiter, comments, lines = "", list[_Line](), list[_Line]()
    number, characters_left = 0, MOST_HEAD_CHARACTERS
    while number < _MOST_LINES and (text := file.readline(characters_left + 1)):
        number += 1
        characters_left -= len(text)
        if characters_left < 0 and not lines:
            raise LogImportError(
                f"{path}: its line of names does not end",
                value=f"more than {MOST_HEAD_CHARACTERS} characters",
                limit=f"{MOST_HEAD_CHARACTERS} characters",
                action="leave out columns and comments that are not needed",
            )
        if characters_left < 0:
            break
        line = _Line(number, text)
        if number == 1 and (separator := _SEPARATOR.match(text)):
            delimiter = separator["delimiter"]
        elif _COMMENT.match(text):
            comments.append(_Line(number, _COMMENT.sub("", text, count=1)))
        elif text.strip():
            lines.append(line)
            if line.holds_numbers:
                break
    return delimiter, comments, lines


def _named_by_comment(
    path: Path, comments: Sequence[_Line], numbers: _Line, delimiter: str
) -> Head:
    delimiter = delimiter or _likely(path, numbers, numbers)
    if comments:
        cells = _cells(path, numbers, delimiter)
        names = _fitting(_cells(path, comments[-1], delimiter), cells)
        if len(names) == len(cells) and not comments[-1].holds_numbers:
            _require_distinct(path, names, comments[-1].number)
            return Head(names, numbers.number - 1, delimiter, (), cells)
    raise _unnamed(path, numbers)


def _unnamed(path: Path, numbers: _Line) -> LogImportError:
    return LogImportError(
        f"{path}, line {numbers.number}: numbers stand where the names of the columns should be",
        value=numbers.text.strip(),
        action="write a line of names above them",
    )


def _likely(path: Path, names: _Line, numbers: _Line) -> str:
    """The delimiter by which a line of names has as many cells as one of numbers."""
    alike = [
        d for d in DELIMITERS if 1 < len(_cells(path, names, d)) == len(_cells(path, numbers, d))
    ]
    candidates = alike or [d for d in DELIMITERS if d != " "]
    return max(candidates, key=lambda d: (d != " ", names.text.count(d)))


def _cells(path: Path, line: _Line, delimiter: str) -> list[str]:
    require_bounded(path, columns=line.text.count(delimiter) + 1 if delimiter != " " else 0)
    try:
        return line.cells(delimiter)
    except csv.Error as error:
        raise LogImportError(
            f"{path}, line {line.number}: {error}", action="write the names of the columns there"
        ) from None


def _are_units(cells: Sequence[str]) -> bool:
    """Whether half of the cells that hold something, or more, are units."""
    words = [w for c in cells if (w := c.strip("[]()"))]
    return bool(words) and 2 * sum(map(is_unit, words)) >= len(words)


def _require_distinct(path: Path, names: Sequence[str], number: int) -> None:
    twin = next((name for name, count in Counter(names).items() if count > 1), None)
    if twin is not None:
        raise LogImportError(
            f"{path}, line {number}: two columns are named {twin!r}",
            action="rename one"
            + ("; are these units? write as many names above them" if _are_units(names) else ""),
        )
