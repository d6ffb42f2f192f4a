"""What is kept between replays: found by the object it was made of, bounded, and never stale."""

from __future__ import annotations

import gc
import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from smad.diagnosis.data.grid import thinned
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded
from smad.diagnosis.spring_pair.replays import GivenPoint, GivenRun

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


def kept(kind: type) -> int:
    """How many objects of a kind there are."""
    gc.collect()
    return sum(type(x) is kind for x in gc.get_objects())


def test_a_point_is_prepared_once_and_not_for_its_equal() -> None:
    plant, run, before = SmaPlant(), whole().part(0, 20), kept(GivenPoint)
    for point in (POINTS[1], POINTS[1], replace(POINTS[1])):
        plant.simulate(point, run)
    assert kept(GivenPoint) - before == 2


def test_a_copy_sent_elsewhere_begins_empty_and_gives_the_same() -> None:
    plant, run = SmaPlant(), whole().part(0, 20)
    here = plant.simulate(POINTS[0], run)
    before = kept(GivenPoint)
    copy = pickle.loads(pickle.dumps(plant))
    assert kept(GivenPoint) == before
    np.testing.assert_array_equal(copy.simulate(POINTS[0], run)["force_N"], here["force_N"])


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
    points, runs = kept(GivenPoint), kept(GivenRun)
    for i in range(70):
        plant.simulate(ModelPoint({"displacement_zero": 1e-3 * i}), short)
    assert kept(GivenPoint) - points == 64
    assert kept(GivenRun) - runs == 1
