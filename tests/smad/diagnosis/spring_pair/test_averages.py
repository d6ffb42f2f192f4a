"""Fits replay averaged inputs; an effect that these hide is fitted by replays as recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.rivals.evidence import Evidence, recorded_evidence
from smad.diagnosis.rivals.fit import Reference, averages_hide, fit, reference_at
from smad.diagnosis.rivals.parts import EffectPart
from smad.diagnosis.rivals.rival import free_model
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded

PLANT = SmaPlant()
EFFECTS = {e.name: e for e in PLANT.effects}
LAG = EffectPart(EFFECTS["driver_lag"])
LAG_S = 0.005
"""A step of 0.01 s of the control loop is over before a row of 0.2 s is."""


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    nominal = nominal_point(PLANT)
    lagging = ModelPoint(nominal.theta, {"driver_lag": {"tau_s": LAG_S, "y_share": 1.0}})
    run = recorded("levels", PLANT, lagging, 5, duration_s=24.0)
    floors = estimate_floors([run], PLANT, 0.2)
    return recorded_evidence(PLANT, [run], floors, 0.2, nominal)


@pytest.fixture(scope="module")
def reference(evidence: Evidence) -> Reference:
    model = free_model(PLANT, nominal_point(PLANT))
    made = reference_at(evidence, model, np.zeros(model.parameters))
    assert made is not None
    return made


def hidden(evidence: Evidence, reference: Reference, part: EffectPart, **values: float) -> bool:
    model = reference.model.with_parts([part])
    usual = {q.name: q.typical for q in part.effect.parameters}
    x = np.r_[reference.x, part.coordinates(usual | values)]
    return averages_hide(evidence, reference, model, x)


def test_averages_hide_a_lag_of_milliseconds_and_no_gain(
    evidence: Evidence, reference: Reference
) -> None:
    assert hidden(evidence, reference, LAG, tau_s=LAG_S)
    assert not hidden(evidence, reference, EffectPart(EFFECTS["driver_gain"]))
    assert not hidden(evidence, reference, EffectPart(EFFECTS["rtd_lag"]))


def test_a_lag_of_milliseconds_is_found_by_exact_replays_and_not_by_averages(
    evidence: Evidence, reference: Reference
) -> None:
    found = []
    for needs_exact in (False, True):
        part = replace(LAG, needs_exact=needs_exact)
        model = reference.model.with_parts([part])
        start = np.r_[reference.x, part.coordinates({"tau_s": 2.0 * LAG_S, "y_share": 1.0})]
        made = fit(evidence, model, start, reference)
        assert made is not None
        found.append(part.values(made.x[model.slices[0]])["tau_s"])
    by_averages, by_replays = found
    assert by_replays == pytest.approx(LAG_S, rel=0.05)
    assert abs(by_averages - LAG_S) > 0.2 * LAG_S
