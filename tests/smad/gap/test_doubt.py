"""What a second cause must stand beside: a first one whose law is only roughly the bench's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from smad.gap import Settings
from smad.gap.compare.select import Selection
from smad.gap.compare.tracks import follow_tracks
from smad.gap.diagnose import ready
from smad.gap.fit.doubt import Doubt
from smad.gap.fit.stages import Prepared

from smad.diagnosis.plant import ModelPoint
from tests.smad.gap.cases import OTHER, SHOWN, bank
from tests.smad.gap.heater_plant import EFFECTS, HeaterPlant, recorded

LAG = {"sensor_lag": SHOWN["sensor_lag"]}
SETTINGS = Settings(max_effects=2)


@cache
def prepared() -> Prepared:
    """A bench whose thermometers have grown slow since its good runs."""
    good = bank(OTHER, seed=20)
    held = [recorded("sines", 31, OTHER, LAG, duration_s=50.0)]
    return ready(bank(OTHER, LAG), plant=HeaterPlant(), good=good, hold_out=held, settings=SETTINGS)


def selected(*names: str) -> Selection:
    library = [e for e in EFFECTS if e.name in names]
    return follow_tracks(prepared(), library, unscreened=names).asked


@cache
def alone() -> Selection:
    return selected("sensor_lag")


def test_a_model_without_a_cause_is_not_doubted() -> None:
    base = alone().base
    assert base.doubt.problem is base.judged.problem
    assert np.array_equal(base.doubt.scores(base.judged), base.judged.scores())


def test_rows_that_a_cause_does_not_change_are_as_certain_as_they_were() -> None:
    best = alone().best
    assert best.names == ("sensor_lag",)
    before, after = best.judged.problem.whitening.s, best.doubt.problem.whitening.s
    for segment in best.judged.problem.dataset.segments:
        grown = after[segment.rows] > before[segment.rows]
        assert grown.any() == (segment.sub_model != "power")


def test_what_a_cause_changes_is_uncertain_by_a_share_of_itself() -> None:
    best = alone().best
    problem, settings = best.judged.problem, best.judged.problem.dataset.settings
    ev, point = problem.dataset, best.fit.point
    with_it, without = ev.predict([point, ModelPoint(point.theta, {})])
    change = np.square(np.where(ev.valid, with_it - without, 0.0))
    added = np.square(best.doubt.problem.whitening.s) - np.square(problem.whitening.s)
    share = ev.cell_sum(added * ev.valid) / ev.cell_sum(change).clip(1e-12)
    changed = ev.cell_sum(change) > 1e-6
    assert changed.any()
    assert share[changed] == pytest.approx(settings.form_share**2, rel=1e-6)


def test_nothing_is_doubted_where_laws_are_known_to_be_those_of_the_bench() -> None:
    best = alone().best
    sure = replace(best.judged.problem.dataset.settings, form_share=0.0)
    dataset = best.judged.problem.dataset
    kept, dataset.settings = dataset.settings, sure
    try:
        doubt = Doubt.about(best.fit, replace(best.judged, hold=None))
    finally:
        dataset.settings = kept
    assert np.array_equal(doubt.problem.whitening.s, best.judged.problem.whitening.s)


def test_a_second_cause_that_brings_nothing_is_as_likely_absent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("smad.gap.compare.select.acceptable", lambda c, s, *, tied: True)
    monkeypatch.setattr("smad.gap.compare.select.asked_gain", lambda c, s, *, tied: -np.inf)
    both = selected("sensor_lag", "driver_gain")
    assert set(both.best.names) == {"sensor_lag", "driver_gain"}
    assert both.probability["sensor_lag"][""] < 0.01
    assert both.probability["driver_gain"][""] > 0.3
