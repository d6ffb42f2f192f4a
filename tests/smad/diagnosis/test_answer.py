"""From a search to the outcome of an answer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from smad.diagnosis.answer import _outcome
from smad.diagnosis.rivals.score import NOTHING
from smad.diagnosis.verdict import QUIET, UNEXPLAINED


@pytest.mark.parametrize(("left_by_days", "outcome"), [(0.9, QUIET), (1.7, UNEXPLAINED)])
def test_day_to_day_variation_is_no_unexplained_change(left_by_days: float, outcome: str) -> None:
    as_configured = SimpleNamespace(kind=NOTHING, floors=1.8)
    other_days = SimpleNamespace(kind=NOTHING, floors=left_by_days)
    search = SimpleNamespace(
        question=SimpleNamespace(gap=lambda rival: rival.floors, quiet_gap=1.35),
        final=as_configured,
        moved=False,
        steps=[SimpleNamespace(rivals=[other_days])],
    )
    assert _outcome(cast(Any, search), []) == outcome
