"""The verdict depends on the runs, the plant and the settings, and on nothing else."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from smad.gap.records import Diagnosis

from tests.smad.gap.cases import OTHER, SHOWN, ask, bank, renamed
from tests.smad.gap.heater_plant import HeaterPlant

EFFECT = {"sticky_fan": SHOWN["sticky_fan"]}


@pytest.fixture(scope="module")
def reference() -> Diagnosis:
    return ask(bank(OTHER, EFFECT))


def test_the_same_seed_gives_the_same_verdict(reference: Diagnosis) -> None:
    again = ask(bank(OTHER, EFFECT))
    assert again.verdict == reference.verdict
    assert again.values == reference.values


def test_the_order_of_the_runs_does_not_matter(reference: Diagnosis) -> None:
    assert ask(bank(OTHER, EFFECT)[::-1]).verdict == reference.verdict


def test_the_names_and_order_of_the_candidates_do_not_matter(reference: Diagnosis) -> None:
    names = {"sticky_fan": "a", "sensor_lag": "zz", "coupling": "m"}
    other = ask(bank(OTHER, EFFECT), renamed(HeaterPlant(), names)).verdict
    assert other.outcome == reference.verdict.outcome
    assert other.effects == ["a"]
    assert other.shrink == pytest.approx(reference.verdict.shrink, abs=1e-6)
    assert other.probability == pytest.approx(reference.verdict.probability, abs=1e-6)


def test_the_number_of_workers_does_not_matter(reference: Diagnosis) -> None:
    with ThreadPoolExecutor(max_workers=5) as pool:
        assert ask(bank(OTHER, EFFECT), executor=pool).verdict == reference.verdict
