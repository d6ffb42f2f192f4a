"""What is replayed depends on the points and the evidence asked, not on what was asked before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from smad.gap import Settings
from smad.gap.fit.coarse import serving_replays
from smad.gap.fit.lsq import Problem, drive, fitting
from smad.gap.model.whiten import OutputNoise, Whitening

from smad.diagnosis.data.grid import Dataset, Detail
from smad.diagnosis.data.noise import estimate_floors
from smad.diagnosis.data.views import local_views
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.search.space import Space
from tests.smad.gap.cases import OTHER, SHOWN, ask, bank
from tests.smad.gap.heater_plant import NOMINAL, HeaterPlant, recorded

HERE, THERE = ModelPoint(NOMINAL), ModelPoint({**NOMINAL, **OTHER})


class Coarse(HeaterPlant):
    """A plant whose quick replays are off by an amount that depends on where they are made."""

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        exact = super().simulate(point, run, views, fast=fast)
        return {k: v + 0.1 * point.theta["c_J_K"] * fast for k, v in exact.items()}


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    plant = Coarse()
    runs = [recorded("random", seed, OTHER, duration_s=20.0) for seed in (1, 2)]
    return Dataset(plant, runs, local_views(plant), Settings())


def test_calibrated_evidence_replays_its_own_point_as_in_full_detail(dataset: Dataset) -> None:
    fine = dataset.predict([HERE], detail=Detail.FINE)
    assert not np.allclose(dataset.predict([HERE]), fine)
    there = dataset.calibrated(HERE)
    assert np.allclose(there.predict([HERE]), fine)
    assert np.allclose(there.predict([HERE], detail=Detail.ROUGH), fine)


def test_making_evidence_with_another_correction_changes_nothing_of_the_first(
    dataset: Dataset,
) -> None:
    points = [HERE, THERE]
    before = dataset.predict(points)
    one = dataset.calibrated(HERE)
    first = one.predict(points)
    other = one.calibrated(THERE).matching(HERE, first[0] + 1.0)
    assert not np.allclose(other.predict(points), first)
    assert np.array_equal(one.predict(points), first)
    assert np.array_equal(dataset.predict(points), before)


def test_fits_with_corrections_of_their_own_may_go_side_by_side(dataset: Dataset) -> None:
    noise = {k: OutputNoise(0.1) for k in dataset.keys}
    plain = Problem(dataset, Whitening(dataset, noise), np.zeros(dataset.n))
    problems = [plain.calibrated(HERE), plain.calibrated(THERE)]
    space = Space(tuple(HeaterPlant().parameters))
    alone = [drive([fitting(p, space, space.start(), iterations=2)])[0] for p in problems]
    together = drive([fitting(p, space, space.start(), iterations=2) for p in problems])
    for a, b in zip(alone, together, strict=True):
        assert np.array_equal(a.p, b.p)
        assert a.problem is b.problem
    assert not np.array_equal(alone[0].p, alone[1].p)


class OnlyFine(HeaterPlant):
    """A plant whose quick replays know no play in the dial, as long steps may not."""

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        effects = {k: v for k, v in point.effects.items() if not fast or k != "backlash"}
        return super().simulate(replace(point, effects=effects), run, views, fast=fast)


def test_a_plant_that_is_right_at_its_own_step_only_is_replayed_at_it_and_that_is_said() -> None:
    runs = bank(OTHER, {"backlash": SHOWN["backlash"]})
    found = ask(runs, OnlyFine())
    assert found.verdict.effects == ["backlash"]
    assert [f.kind for f in found.findings if f.run == "all runs"] == ["own step"]
    assert not any(f.kind == "own step" for f in ask(runs).findings)


class OnlyInShortSteps(OnlyFine):
    """The same, in steps of more than 0.15 s."""

    def simulate(
        self, point: ModelPoint, run: GapRun, views: Sequence[str], *, fast: bool = False
    ) -> dict[str, Array]:
        return super().simulate(point, run, views, fast=fast and run.dt_s > 0.15)


@pytest.mark.parametrize(
    ("plant", "divided_by"), [(HeaterPlant(), 1), (OnlyInShortSteps(), 2), (OnlyFine(), 0)]
)
def test_steps_are_as_long_as_they_may_be(plant: HeaterPlant, divided_by: int) -> None:
    run = recorded("random", 1, duration_s=20.0)
    settings, views = Settings(period_s=0.4), local_views(plant)
    floors = estimate_floors([run], plant, settings)
    found = serving_replays(lambda n: Dataset(plant, [run], views, settings, fast=n), floors)
    assert found == divided_by
