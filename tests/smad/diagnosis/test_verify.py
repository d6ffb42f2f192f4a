"""The gap of new runs before and after a model."""

import pytest

from smad.diagnosis.errors import RunRefused
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.verify import verified
from tests.smad.diagnosis.cases import GAIN, OTHER, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant


def test_the_right_model_brings_every_signal_to_its_floor_and_a_wrong_one_does_not() -> None:
    runs = bank(OTHER, GAIN)[:2]
    right = verified(HeaterPlant(), runs, ModelPoint(OTHER, GAIN))
    assert [r.signal for r in right[:-1]] == [c.name for c in HeaterPlant().channels]
    assert all(r.final < 1.3 * r.floor for r in right)
    assert right[-1].unit == "floors"
    assert right[-1].raw > 10.0
    wrong = verified(HeaterPlant(), runs, ModelPoint({"rod_um_K": 3.7}))
    rod = next(r for r in wrong if r.signal == "rod_um")
    assert rod.final > rod.raw


def test_runs_that_cannot_be_used_are_refused_with_the_reason() -> None:
    with pytest.raises(RunRefused, match="at least"):
        verified(HeaterPlant(), [bank(OTHER)[0].part(0, 30)], ModelPoint({}))
