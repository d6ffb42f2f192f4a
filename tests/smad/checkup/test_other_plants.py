"""A check-up of a plant that is no spring pair and offers no places: the tiny heater."""

import pytest

from smad.checkup.judge import commissioned, judge_runs
from smad.diagnosis import Verdict
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.plant import EffectValues
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import CAUSES, CHECK_UP, QUIET
from tests.smad.diagnosis.cases import GAIN, OTHER
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded

PROGRAMME = (("random", 1), ("sines", 2), ("random", 3), ("sines", 4))


def played(day: int, effects: EffectValues | None = None) -> list[GapRun]:
    """The programme on a bench whose parameters are not the model's, with the noise of a day."""
    return [
        recorded(family, seed, OTHER, effects, duration_s=40.0, day=day)
        for family, seed in PROGRAMME
    ]


@pytest.fixture(scope="module")
def reference() -> GoodRuns:
    days = [played(day) for day in (1, 2, 3)]
    return commissioned(HeaterPlant(), list(zip(*days, strict=True)))


def checked(reference: GoodRuns, day: int, effects: EffectValues | None = None) -> Verdict:
    runs = [(run, run.name) for run in played(day, effects)]
    return judge_runs(HeaterPlant(), reference, runs).verdict


def test_a_heater_as_it_was_is_quiet(reference: GoodRuns) -> None:
    found = checked(reference, 4)
    assert (found.question, found.outcome, found.causes) == (CHECK_UP, QUIET, [])
    assert any(text.startswith("dial_delay, delay_s: less than") for text in found.unseen)


def test_a_new_gain_of_a_heater_is_named_with_its_value(reference: GoodRuns) -> None:
    found = checked(reference, 5, GAIN)
    assert found.outcome == CAUSES
    (cause,) = found.causes
    assert cause.name == "driver_gain"
    assert cause.values[0].value == pytest.approx(0.05, abs=0.003)
    assert found.whole is not None
    assert found.whole.final < 0.5 * found.whole.parameters
