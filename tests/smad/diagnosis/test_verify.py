"""The gap of new runs before and after a model."""

from dataclasses import replace

import pytest

from smad.diagnosis.errors import RunRefused
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.report.words import findings_to
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


def test_what_is_refused_or_lost_beside_usable_runs_is_said_as_a_diagnosis_says_it() -> None:
    good, short = bank(OTHER, GAIN)[0], bank(OTHER)[1].part(0, 30)
    notes: list[str] = []
    rows = verified(
        HeaterPlant(), [good, short], ModelPoint(OTHER, GAIN), found=findings_to(notes.append)
    )
    assert rows == verified(HeaterPlant(), [good], ModelPoint(OTHER, GAIN))
    assert any(short.name in text and "at least" in text for text in notes)


def test_the_reason_of_a_refusal_is_not_cut_before_it_says_what_to_do() -> None:
    run = bank(OTHER)[0]
    lacking = replace(run, inputs={}, notes=())
    with pytest.raises(RunRefused, match="map the columns that have them; correct that"):
        verified(HeaterPlant(), [lacking], ModelPoint({}))
