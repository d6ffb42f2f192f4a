"""A selection asks nothing twice of the same fit, and answers as if it did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from smad.gap.compare import select
from smad.gap.compare.select import Hypothesis, Selection, Selector
from smad.gap.fit.joint import JointFit, Start, joint_fits
from smad.gap.fit.lsq import FitResult
from smad.gap.fit.stages import prepare

from smad.diagnosis.plant import Effect
from tests.smad.gap.cases import OTHER, SETTINGS, SHOWN, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant


class Forgetful(Selector):
    """Fits and judges anew, as often as it is asked."""

    def _refitted(self, current: Hypothesis, effects: tuple[Effect, ...]) -> JointFit:
        self._refits.clear()
        return super()._refitted(current, effects)

    def _without(self, base: Hypothesis, current: Hypothesis, name: str) -> Hypothesis:
        self._less.clear()
        return super()._without(base, current, name)

    def _enters(self, c: Hypothesis) -> bool:
        self._news.clear()
        return super()._enters(c)


def test_two_causes_are_found_alike_by_one_that_forgets(monkeypatch: pytest.MonkeyPatch) -> None:
    both = {name: SHOWN[name] for name in ("coupling", "backlash")}
    prepared = prepare(
        bank(OTHER, both)[:3], HeaterPlant(), SETTINGS, good=bank(OTHER, seed=40)[:3]
    )
    assert prepared.tied is not None
    refit = prepared.tied
    asked: Counter[object] = Counter()
    # Kept, so that no identity is given twice.
    fits: list[FitResult] = []

    def is_new(candidate: Hypothesis) -> bool:
        fits.append(candidate.fit)
        asked["new", id(candidate.fit)] += 1
        return True

    def refits(
        base: FitResult, starts: Sequence[Start], *, finish: int = 2
    ) -> dict[tuple[str, ...], JointFit]:
        fits.append(base)
        named = tuple(tuple(e.name for e in start.effects) for start in starts)
        asked["refit", id(base), finish, named] += 1
        return joint_fits(base, starts, finish=finish)

    monkeypatch.setattr(select, "joint_fits", refits)

    def answer(kind: type[Selector]) -> Selection:
        return kind(refit, None, EFFECTS, is_new=is_new).run()

    remembered = answer(Selector)
    assert set(remembered.best.names) == set(both)
    assert max(asked.values()) == 1
    asked.clear()
    forgotten = answer(Forgetful)
    assert max(asked.values()) > 1
    assert remembered.best.names == forgotten.best.names
    assert remembered.probability == forgotten.probability
    assert np.array_equal(remembered.best.fit.p, forgotten.best.fit.p)
    assert np.array_equal(remembered.best.judged.scores(), forgotten.best.judged.scores())
