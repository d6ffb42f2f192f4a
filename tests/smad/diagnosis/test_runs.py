"""A run that somebody makes of columns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from smad.diagnosis.errors import GapError
from smad.diagnosis.runs import GapRun


def test_a_run_of_lists_is_one_of_arrays() -> None:
    of_lists: Any = ([0.0, 0.1, 0.2], {"u": [0, 1, 1]}, {"y": (0.0, float("nan"), 2.0)})
    run = GapRun("lists", *of_lists)
    assert run.duration_s == pytest.approx(0.2)
    assert [column.dtype for column in (run.t_s, run.inputs["u"], run.outputs["y"])] == [float] * 3
    np.testing.assert_array_equal(run.outputs["y"], [0.0, np.nan, 2.0])


def test_columns_that_are_arrays_stay_the_same_objects() -> None:
    t_s, inputs = np.arange(3.0), {"u": np.arange(3)}
    run = GapRun("arrays", t_s, inputs, {})
    assert run.t_s is t_s
    assert run.inputs is inputs


@pytest.mark.parametrize("column", [["a", "b", "c"], 3.0, [[1.0], [2.0], [3.0]], None])
def test_a_column_of_no_numbers_is_refused_by_its_name(column: Any) -> None:
    with pytest.raises(GapError, match="run odd: column y is not a sequence of numbers; got "):
        GapRun("odd", np.arange(3.0), {}, {"y": column})
