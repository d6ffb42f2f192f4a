"""The search: which fits compete."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import pytest

from smad.diagnosis.rivals.search import _Fits


@dataclass(frozen=True)
class Leaving:
    """A rival by the floors that it leaves."""

    floors: float


@dataclass(frozen=True)
class Steady:
    """A question to which parameters that stay are always likelier."""

    floors: float

    def parameters_kept_if_likelier(self, *_: object) -> Leaving:
        return Leaving(self.floors)

    def gap(self, rival: Leaving) -> float:
        return rival.floors


@pytest.mark.parametrize(("steady", "taken"), [(9.0, 9.0), (12.0, 12.0), (21.0, 10.0)])
def test_parameters_stay_only_where_the_part_then_explains_something(
    steady: float, taken: float
) -> None:
    fits = _Fits(cast(Any, Steady(steady)), cast(Any, None), without=15.0)
    made = fits._steadied(cast(Any, Leaving(10.0)), "law", "law:input", cast(Any, None))
    assert cast(Any, made).floors == taken
