"""Which experiment would part rivals that runs leave confused."""

from __future__ import annotations

import pytest

from smad.diagnosis import Answer, diagnose
from smad.diagnosis.next_run import offers
from tests.smad.diagnosis.cases import GAIN, OTHER, bank
from tests.smad.diagnosis.heater_plant import HeaterPlant


class WithoutExperiments:
    """The tiny plant, as somebody may bring one who has no catalogue."""

    def __init__(self) -> None:
        whole = HeaterPlant()
        for member in (
            "name", "version", "inputs", "channels", "parameters", "effects", "simulate",
            "regimes",
        ):  # fmt: skip
            setattr(self, member, getattr(whole, member))


@pytest.fixture(scope="module")
def confused() -> Answer:
    """A gain on both sides without a library: either reading takes half of it."""
    return diagnose(bank(OTHER, GAIN)[:2], plant=HeaterPlant(), candidates=())


def test_rivals_that_runs_do_not_tell_apart_are_parted_by_experiments_the_best_first(
    confused: Answer,
) -> None:
    words, found = offers(confused)
    assert set(words) == {"a law at the reading of power_l_W", "a law at the reading of power_r_W"}
    assert {o.experiment.name for o in found} == {e.name for e in HeaterPlant().catalogue()}
    separations = [o.separation for o in found]
    assert separations == sorted(separations, reverse=True)
    # A law of either side shows in a run that drives them, and they differ by it.
    assert separations[0] > 1.0


def test_where_nothing_is_confused_nothing_is_offered() -> None:
    quiet = diagnose(bank()[:2], plant=HeaterPlant())
    assert offers(quiet) == ([], [])


def test_a_plant_without_experiments_is_diagnosed_and_none_is_offered() -> None:
    answer = diagnose(bank(OTHER, GAIN)[:2], plant=WithoutExperiments(), candidates=())
    words, found = offers(answer)
    assert len(words) == 2
    assert found == []
