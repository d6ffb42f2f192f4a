"""Constants of the rule from tables whose truth is made up."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from tests.withheld import rule, tables
from tests.withheld.calibrating import toml_of
from tests.withheld.engine.rule import Weighed
from tests.withheld.engine.table import Kind, Row
from tests.withheld.engine.test_rule import QUIET, WRONG, row, table
from tests.withheld.rule import FIRST, Known, fitted, left_out, mark, reliability_lines

TOLD = {
    "before": {"outcome": "effect", "effects": ["y"], "p": 0.7, "group": []},
    "seconds": {"prepare": 70.0, "table": 30.0, "before": 25.0},
}


def case(number: int, kind: Kind, *rows: Row, names: str = "") -> Known:
    made = table(*rows)
    weighed = {form: Weighed.of(made, form, draws=20) for form in rule.FORMS}
    return Known(f"case-{number}", kind, frozenset(names.split()), 3.0, weighed, TOLD)


def bank() -> list[Known]:
    """Quiet benches on which an entry gains a little, and effects that gain much."""
    loud = [row(Kind.KNOWN, "x", 1.0), row(Kind.UNKNOWN, misfit=2.0)]
    quiet = [row(Kind.KNOWN, "x", 0.97), row(Kind.UNKNOWN, misfit=0.99)]
    odd = [row(Kind.KNOWN, "x", 2.6), row(Kind.UNKNOWN, misfit=1.2)]
    return [
        known
        for i in range(4)
        for known in (
            case(3 * i, Kind.KNOWN, WRONG, *loud, names="x"),
            case(3 * i + 1, Kind.NOTHING, QUIET, *quiet),
            case(3 * i + 2, Kind.UNKNOWN, WRONG, *odd),
        )
    ]


def test_the_constants_that_are_fitted_tell_the_truth_of_what_they_come_from() -> None:
    cases = bank()
    constants = fitted(cases)
    assert {c.rule(constants).kind is c.kind for c in cases} == {True}
    before = np.mean([c.given(FIRST) for c in cases])
    assert np.mean([c.given(constants) for c in cases]) > before


def test_each_case_is_judged_by_constants_from_others() -> None:
    cases = bank()
    held = left_out(cases, folds=3)
    assert sorted(c.case for c, _ in held) == sorted(c.case for c in cases)
    head, _, *lines = reliability_lines("held out", held)
    assert "calibration error" in head
    assert lines


@pytest.mark.parametrize(
    ("kind", "names", "said", "word"),
    [
        (Kind.KNOWN, "x", (Kind.KNOWN, "x", ""), "right"),
        (Kind.KNOWN, "x", (Kind.KNOWN, "x", "y"), "in the group"),
        (Kind.KNOWN, "x", (Kind.KNOWN, "y", "x"), "in the group"),
        (Kind.KNOWN, "x", (Kind.KNOWN, "y", ""), "wrong name"),
        (Kind.KNOWN, "x", (Kind.KNOWN, "x y", ""), "right and a wrong one"),
        (Kind.KNOWN, "x y", (Kind.KNOWN, "x", ""), "part"),
        (Kind.KNOWN, "x", (Kind.UNKNOWN, "", ""), "unknown"),
        (Kind.KNOWN, "x", (Kind.NOTHING, "", ""), "silent"),
        (Kind.UNKNOWN, "", (Kind.KNOWN, "x", ""), "false name"),
        (Kind.NOTHING, "", (Kind.UNKNOWN, "", ""), "false alarm"),
        (Kind.NOTHING, "", (Kind.NOTHING, "", ""), "right"),
    ],
)
def test_an_answer_is_marked_by_how_it_stands_to_the_truth(
    kind: Kind, names: str, said: tuple[Kind, str, str], word: str
) -> None:
    what, named, group = said
    assert mark(kind, frozenset(names.split()), what, named.split(), group.split()) == word


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    made = table(WRONG, row(Kind.KNOWN, "x y", 1.5, parent=0, changes=2.0))
    tables.write(tmp_path / "case-001.npz", made, TOLD)
    again, told = tables.read(tmp_path / "case-001.npz")
    assert told["before"] == TOLD["before"]
    assert np.array_equal(again.scores(0.2), made.scores(0.2))
    assert replace(again, rows=()).output == made.output


def test_the_file_of_constants_is_read_as_they_are() -> None:
    text = toml_of("# of three cases\n", FIRST)
    assert msgspec.toml.decode(text, type=rule.Constants) == FIRST
