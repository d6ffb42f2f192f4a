"""The one rule on score tables whose every number is made up."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from tests.withheld.engine.rule import Constants, decide, is_steady
from tests.withheld.engine.table import Kind, Row, ScoreTable

RULE = Constants(0.2, 0.4, 0.2, temper=2.0, form=0.2, moved=1000.0, steep=2.0, odds=3.0)
RUNS, BLOCKS, OUTPUTS, SIZE, DOF = 4, 10, 3, 50, 10.0
CELLS = RUNS * BLOCKS * OUTPUTS


def row(
    kind: Kind,
    names: str = "",
    misfit: float = 1.0,
    parent: int = 0,
    *,
    changes: float = 0.0,
    moved: float = 0.0,
) -> Row:
    """A hypothesis that leaves `misfit` floors in every cell; `names` apart by spaces."""
    q = np.full(CELLS, SIZE * misfit**2)
    return Row(kind, tuple(names.split()), q, np.full(CELLS, changes**2), parent, moved)


def table(*rows: Row) -> ScoreTable:
    """Hypotheses of one bench; the first is the model as it was."""
    run, block, output = (a.ravel() for a in np.indices((RUNS, BLOCKS, OUTPUTS)))
    keys = tuple(f"output {k}" for k in output.tolist())
    return ScoreTable(rows, np.full(CELLS, float(SIZE)), run, block, keys, DOF)


QUIET = row(Kind.NOTHING, parent=-1)
WRONG = row(Kind.NOTHING, misfit=3.0, parent=-1)


def test_a_model_that_nothing_betters_has_no_gap() -> None:
    said = decide(table(QUIET, row(Kind.PARAMETERS), row(Kind.KNOWN, "x"), row(Kind.UNKNOWN)), RULE)
    assert said.kind is Kind.NOTHING
    assert said.names == ()
    assert said.probability > 0.4


def test_the_entry_that_takes_the_gap_is_named() -> None:
    rivals = [row(Kind.PARAMETERS, misfit=2.5), row(Kind.UNKNOWN, misfit=2.0)]
    said = decide(table(WRONG, *rivals, row(Kind.KNOWN, "x"), row(Kind.KNOWN, "y", 2.5)), RULE)
    assert (said.kind, said.names, said.group, said.rest) == (Kind.KNOWN, ("x",), (), False)
    assert said.probability > 0.8


@pytest.mark.parametrize("kind", [Kind.PARAMETERS, Kind.UNKNOWN])
def test_what_takes_the_gap_alone_is_the_answer(kind: Kind) -> None:
    said = decide(table(WRONG, row(kind), row(Kind.KNOWN, "x", 2.6)), RULE)
    assert said.kind is kind
    assert said.names == ()


def test_two_entries_that_do_as_well_are_a_group() -> None:
    two = [row(Kind.KNOWN, "x"), row(Kind.KNOWN, "y", 1.02)]
    said = decide(table(WRONG, row(Kind.UNKNOWN, misfit=2.9), *two), RULE)
    assert (said.names, said.group) == (("x",), ("y",))


def test_an_entry_that_is_in_every_set_is_named_though_none_of_the_sets_is_likely() -> None:
    sets = [row(Kind.KNOWN, f"x {other}", 0.99, parent=1) for other in "abcd"]
    said = decide(table(WRONG, row(Kind.KNOWN, "x"), *sets), RULE)
    assert (said.names, said.group) == (("x",), ())


def further(misfit: float, changes: float) -> ScoreTable:
    first = row(Kind.KNOWN, "x", 1.5, changes=changes)
    return table(WRONG, first, row(Kind.KNOWN, "x y", misfit, parent=1))


def test_a_further_entry_must_gain_where_the_first_is_not_uncertain() -> None:
    assert decide(further(0.3, changes=0.0), RULE).names == ("x", "y")
    assert decide(further(0.3, changes=40.0), RULE).names == ("x",)


def test_a_further_entry_that_gains_a_little_of_much_is_not_named() -> None:
    assert decide(further(1.45, changes=0.0), RULE).names == ("x",)


def test_what_a_flexible_model_takes_beyond_a_name_is_a_rest_and_not_another_name() -> None:
    first = row(Kind.KNOWN, "x", 1.5)
    assert decide(table(WRONG, row(Kind.UNKNOWN, misfit=1.5), first), RULE).rest is False
    leaning = msgspec.structs.replace(RULE, unknown=0.001)
    said = decide(table(WRONG, row(Kind.UNKNOWN, misfit=0.3), first), leaning)
    assert (said.kind, said.names, said.rest) == (Kind.KNOWN, ("x",), True)


def test_parameters_that_have_moved_far_have_changed() -> None:
    def asked(moved: float) -> Kind:
        still = row(Kind.NOTHING, parent=-1, moved=moved)
        return decide(
            table(still, row(Kind.PARAMETERS), row(Kind.KNOWN, "x", moved=moved)), RULE
        ).kind

    assert asked(100.0) is Kind.NOTHING
    assert asked(20_000.0) is Kind.PARAMETERS


def test_the_entry_beside_which_the_parameters_stay_is_named() -> None:
    still = row(Kind.NOTHING, misfit=2.0, parent=-1, moved=9000.0)
    rows = [row(Kind.KNOWN, "x", moved=300.0), row(Kind.KNOWN, "y", moved=9000.0)]
    said = decide(table(still, row(Kind.PARAMETERS, misfit=2.0), *rows), RULE)
    assert (said.names, said.group) == (("x",), ())


def test_an_entry_that_gains_in_one_run_and_loses_in_the_others_is_not_named() -> None:
    one = row(Kind.KNOWN, "x", 1.3)
    one.q[: CELLS // RUNS] = SIZE * 0.1
    quiet = table(QUIET, one)
    assert decide(quiet, RULE).kind is Kind.NOTHING


def test_an_entry_as_it_was_in_known_good_runs_is_nothing_new() -> None:
    before = row(Kind.NOTHING, "x", parent=-1)
    said = decide(table(WRONG, row(Kind.KNOWN, "x"), before), RULE)
    assert said.kind is Kind.NOTHING


def test_cells_without_a_sample_count_for_nothing() -> None:
    full = table(WRONG, row(Kind.KNOWN, "x"))
    size = full.size.copy()
    size[::3] = 0.0
    part = ScoreTable(full.rows, size, full.run, full.block, full.output, full.dof)
    assert np.all(part.scores(0.0)[:, ::3] == 0.0)
    assert decide(part, RULE).names == ("x",)


def test_the_same_table_gets_the_same_answer() -> None:
    one = table(WRONG, row(Kind.KNOWN, "x"), row(Kind.KNOWN, "y", 1.1))
    assert decide(one, RULE) == decide(one, RULE)


def test_cells_of_twice_the_length_hold_the_same_residuals() -> None:
    one = table(WRONG, row(Kind.KNOWN, "x", 1.2, changes=2.0))
    two = one.doubled()
    assert two.cells == one.cells // 2
    assert np.all(two.size == 2 * SIZE)
    assert sorted(set(two.output)) == sorted(set(one.output))
    for before, after in zip(one.rows, two.rows, strict=True):
        assert after.q.sum() == pytest.approx(before.q.sum())
        assert after.unsure.max() == pytest.approx(before.unsure.max())


def test_a_verdict_that_hangs_on_the_length_of_cells_is_told_from_one_that_does_not() -> None:
    assert is_steady(table(WRONG, row(Kind.KNOWN, "x")), RULE)
    every_other = row(Kind.KNOWN, "x", 3.0)
    every_other.q[:] = np.where(np.indices((RUNS, BLOCKS, OUTPUTS))[1].ravel() % 2, 0.001, 1.0)
    every_other.q[:] *= SIZE * 60.0
    assert not is_steady(table(WRONG, every_other), RULE)
