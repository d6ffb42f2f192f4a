"""What is kept between replays: found by the object it was made of, bounded, and never stale."""

from __future__ import annotations

import pickle
from functools import cache, partial

import numpy as np
import pytest

from smad.diagnosis.data.grid import thinned
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.spring_pair.replays import Recent

LAWS = {"driver_lag": {"tau_s": 0.02}, "unified_kinetics": {"tails": 0.2}}
# Parameters that act in different passes, or in none.
POINTS = [
    ModelPoint({}),
    ModelPoint({"displacement_zero": 0.3}),
    ModelPoint({"side_resistance": 0.05}),
    ModelPoint({"water_temperature": 295.0, "side_flow": 0.1}, LAWS),
]


@cache
def whole() -> GapRun:
    return recorded("mixed", SmaPlant(), ModelPoint({}), 3, noise=True, duration_s=20.0)


def test_a_thing_is_made_once_for_each_source_and_not_for_its_equal() -> None:
    recent: Recent[list[int], object] = Recent(4)
    one, equal = [1], [1]
    made = recent.of(one, object)
    assert recent.of(one, object) is made
    assert recent.of(equal, object) is not made


def test_only_so_many_are_kept_and_the_oldest_goes_first() -> None:
    recent: Recent[list[int], int] = Recent(3)
    sources = [[i] for i in range(5)]
    for source in sources:
        recent.of(source, partial(int, source[0]))
    assert len(recent) == 3
    assert recent.of(sources[4], lambda: -1) == 4
    assert recent.of(sources[0], lambda: -1) == -1
    assert len(recent) == 3


def test_what_failed_to_be_made_is_tried_again() -> None:
    recent: Recent[list[int], int] = Recent(3)
    source = [1]

    def fail() -> int:
        raise ValueError

    with pytest.raises(ValueError):
        recent.of(source, fail)
    assert recent.of(source, lambda: 2) == 2


def test_a_copy_sent_elsewhere_begins_empty() -> None:
    recent: Recent[list[int], int] = Recent(3)
    recent.of([1], lambda: 1)
    copy = pickle.loads(pickle.dumps(recent))
    assert len(copy) == 0
    for i in range(5):
        copy.of([i], lambda: 1)
    assert len(copy) <= 3


@pytest.mark.parametrize("fast", [False, True])
def test_a_plant_that_has_replayed_much_gives_what_a_fresh_one_gives(fast: bool) -> None:
    used = SmaPlant()
    run = thinned(whole(), 0.1, SmaPlant.inputs) if fast else whole()
    for point in POINTS:
        used.simulate(point, whole(), fast=fast)
    for point in POINTS * 2:
        found = used.simulate(point, run, fast=fast)
        fresh = SmaPlant().simulate(point, run, fast=fast)
        assert found.keys() == fresh.keys()
        for key, values in found.items():
            np.testing.assert_array_equal(values, fresh[key], err_msg=key)
        assert np.isfinite(found["force_N"]).all()


def test_a_plant_keeps_no_more_points_than_are_replayed_together() -> None:
    plant = SmaPlant()
    short = whole().part(0, 20)
    for i in range(70):
        plant.simulate(ModelPoint({"displacement_zero": 1e-3 * i}), short)
    assert len(plant.given_points) <= 64
    assert len(plant.given_runs) == 1
