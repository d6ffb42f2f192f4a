"""A run replayed with its own truth leaves nothing: judgements rest on that."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.played import predictions
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.rivals.evidence import Evidence, recorded_evidence
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from tests.smad.diagnosis.cases import strong

PLANT = SmaPlant()
EFFECTS = {e.name: e for e in PLANT.effects}
KINDS = ("pulses", "levels", "dry and wet")
"""Open loop, closed loop, and with water in the tube and without."""
RATES_HZ = (100.0, 250.0, 500.0)
PERIOD_S, DURATION_S = 0.2, 24.0


@cache
def floors() -> np.ndarray:
    """Noise of a row of an everyday run."""
    runs = [recorded(kind, PLANT, nominal_point(PLANT), 2, duration_s=40.0) for kind in KINDS]
    return estimate_floors(runs, PLANT, PERIOD_S)


@cache
def closed_loop() -> Evidence:
    """A run of levels on the healthy bench."""
    point = nominal_point(PLANT)
    run = recorded("levels", PLANT, point, 5, noise=False, duration_s=DURATION_S)
    return recorded_evidence(PLANT, [run], floors(), PERIOD_S, point)


def most_left(name: str, kind: str, rate_hz: float, **given: float) -> float:
    """The channel in which a run without noise and its exact replay differ most, in floors."""
    values = strong(EFFECTS[name]) | given
    if kind != "pulses" and "stribeck" in values:
        # A slip reaches the level that ends the heating: whether a replay slips just before the
        # heating ends hangs on less than a sample. Up to 7 floors of displacement.
        values["stribeck"] = 0.0
    point = ModelPoint(nominal_point(PLANT).theta, {name: values})
    run = recorded(kind, PLANT, point, 5, noise=False, duration_s=DURATION_S, rate_hz=rate_hz)
    evidence = recorded_evidence(PLANT, [run], floors(), PERIOD_S, nominal_point(PLANT))
    residual = evidence.residual(predictions(PLANT, point, evidence.played, exact=True))
    # Water and room begin where the first second has them; a slope within it is left open.
    return float(np.sqrt(evidence.variances(evidence.less_drifts(residual, evidence.valid)).max()))


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_a_run_replayed_with_its_own_truth_leaves_less_than_a_floor(name: str) -> None:
    turn = sorted(EFFECTS).index(name)
    for k, kind in enumerate(KINDS):
        assert most_left(name, kind, RATES_HZ[(k + turn) % len(RATES_HZ)]) < 1.1, kind


@pytest.mark.parametrize("share", [0.0, 2.0])
@pytest.mark.parametrize(
    "name", sorted(n for n, e in EFFECTS.items() if any(q.name == "y_share" for q in e.parameters))
)
def test_so_does_a_run_with_an_effect_on_one_side(name: str, share: float) -> None:
    assert most_left(name, "pulses", 250.0, y_share=share) < 1.1


@pytest.mark.campaign
@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_at_every_rate_and_in_every_kind_of_run(name: str, kind: str, rate_hz: float) -> None:
    assert most_left(name, kind, rate_hz) < 1.1


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_a_replay_does_not_hang_on_the_last_digit_of_a_parameter(name: str) -> None:
    theta, evidence = nominal_point(PLANT).theta, closed_loop()
    q = next(q for q in PLANT.parameters if q.name == "ambient_temperature")
    warmer = theta | {q.name: theta.get(q.name, q.nominal) + 1e-6 * q.prior_sd}
    points = [ModelPoint(t, {name: strong(EFFECTS[name])}) for t in (theta, warmer)]
    replays = [predictions(PLANT, p, evidence.played, exact=True) for p in points]
    assert np.sqrt(evidence.variances(evidence.change(*replays)).max()) < 0.01
