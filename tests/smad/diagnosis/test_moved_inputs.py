"""Inputs that are recorded a row early or late, which look as if the simulator lacked a delay."""

from __future__ import annotations

import numpy as np
import pytest

from smad.diagnosis import Verdict
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CAUSES, COLUMN_DOUBTED
from tests.smad.diagnosis.cases import GAIN, OTHER, ask, bank


def moved(run: GapRun, rows: int) -> GapRun:
    """The run with inputs that stand so many rows later than they were."""
    columns = {name: np.roll(column, rows) for name, column in run.inputs.items()}
    return run.with_columns(inputs=columns)


def doubts(verdict: Verdict) -> list[str]:
    return [f.text for f in verdict.findings if f.kind == COLUMN_DOUBTED]


@pytest.mark.parametrize(
    ("rows", "words"), [pytest.param(-1, "early", marks=pytest.mark.campaign), (1, "late")]
)
def test_inputs_that_stand_in_the_wrong_row_are_doubted_rather_than_the_simulator(
    rows: int, words: str
) -> None:
    verdict = ask([moved(run, rows) for run in bank(OTHER)])
    assert verdict.outcome == CAUSES
    texts = doubts(verdict)
    assert len(texts) == len(verdict.runs)
    begins = f"all inputs are one row {words}? With other values of the parameters they leave 0."
    assert texts[0].startswith(begins)
    assert verdict.headline.startswith("a column may be misread; as it was read, the simulator")


def test_beside_an_effect_that_is_there_inputs_in_the_wrong_row_are_doubted_too() -> None:
    verdict = ask([moved(run, -1) for run in bank(OTHER, GAIN)])
    assert "driver_gain" in {c.name for c in verdict.causes}
    assert doubts(verdict)[0].startswith("all inputs are one row early? With other values of ")


def test_an_effect_alone_leaves_the_inputs_where_they_are() -> None:
    verdict = ask(bank(OTHER, GAIN))
    assert verdict.outcome == CAUSES
    assert not doubts(verdict)
