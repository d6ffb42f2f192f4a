"""Whether an answer hangs on the length of the cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from smad.gap.compare import cells
from smad.gap.compare.cells import hangs_on_cells
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import follow_tracks
from smad.gap.diagnose import ready

from tests.smad.gap.cases import OTHER, SHOWN, bank
from tests.smad.gap.heater_plant import HeaterPlant


@pytest.fixture(scope="module")
def coupled() -> Selection:
    prepared = ready(bank(OTHER, {"coupling": SHOWN["coupling"]}), plant=HeaterPlant())
    return follow_tracks(prepared, prepared.plant.effects).selection


def test_cells_of_another_length_hold_the_same_rows(coupled: Selection) -> None:
    whole = coupled.base.fit.problem.dataset
    half = whole.with_cells_of(0.5 * whole.settings.block_s)
    assert half.cell_size.sum() == whole.cell_size.sum()
    assert 1.8 < len(half.cell_size) / len(whole.cell_size) < 2.2
    rows = np.arange(whole.n, dtype=float)
    assert half.cell_sum(rows).sum() == whole.cell_sum(rows).sum()
    assert len(whole.cell_size) == len(coupled.base.judged.scores())


def test_a_clear_cause_does_not_hang_on_the_cells(coupled: Selection) -> None:
    assert coupled.best.names == ("coupling",)
    assert hangs_on_cells(coupled, tied=False) == ""


def test_a_cause_that_other_cells_would_not_let_in_is_told(
    coupled: Selection, monkeypatch: pytest.MonkeyPatch
) -> None:
    most = coupled.best.cells

    def acceptable(candidate: Any, settings: Any, *, tied: bool) -> bool:
        return bool(candidate.cells <= most)

    monkeypatch.setattr(cells, "acceptable", acceptable)
    block_s = coupled.base.fit.problem.dataset.settings.block_s
    assert hangs_on_cells(coupled, tied=False) == (
        f"in cells of {0.5 * block_s:g} s coupling would not enter: the answer hangs on the length "
        f"of the cells, {block_s:g} s"
    )


def test_a_cause_that_only_other_cells_would_let_in_is_told(
    coupled: Selection, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = Selection.without_effects(coupled.base, coupled)
    tried = Selection(asked.base, asked.best, (), {}, {}, asked.screened, coupled.tried)
    most = coupled.best.cells

    def acceptable(candidate: Any, settings: Any, *, tied: bool) -> bool:
        return bool(candidate.cells < most)

    monkeypatch.setattr(cells, "acceptable", acceptable)
    said = hangs_on_cells(tried, tied=False)
    assert said.startswith("in cells of ")
    assert f"{coupled.tried[0].names[-1]} would enter" in said
