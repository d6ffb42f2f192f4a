"""The benches of the policies' table are the evaluation's plant, seen as an environment."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.independent import DT_S, IndependentPairs
from bench.policies import EFFECTS, Table, benches, ranges_by_hand
from evaluation.plant.effects import magnitudes
from evaluation.plant.kernel import simulate
from evaluation.plant.parameters import Bench
from sim_device.plant.draws import draw_between
from smad.envs.episodes import model_of
from smad.envs.pair import observation_space
from smad.envs.search import START, Search, act, tracking_error_mm

HEAT_X = np.array([[1.0, 0.0, 0.5], [0.3, 0.0, 0.0]], dtype=np.float32)


def pairs(size: int = 2) -> IndependentPairs:
    bench = next(benches(1))
    return IndependentPairs(size, bench.bench, (bench.active,), episode_s=4.0)


def test_an_episode_is_a_run_of_the_evaluations_plant() -> None:
    env = pairs()
    seen, _ = env.reset(seed=[1, 2])
    given, shown = [env.inputs.copy()], [seen]
    for _ in range(env.steps):
        seen, *_ = env.step(HEAT_X)
        given.append(env.inputs.copy())
        shown.append(seen)
    effects = magnitudes((next(benches(1)).active,))
    for i, day in enumerate(env.days):
        own = simulate(day, np.array(given)[:, i], DT_S, effects)
        for column, name, off in ((0, "displacement_mm", 0.03), (2, "rtd_x_degC", 0.2)):
            assert np.abs(np.array(shown)[:, i, column] - own[name]).max() < off
    assert shown[-1][0, 0] > 1.0


def test_an_episode_follows_from_its_seed_and_lies_in_the_space() -> None:
    one, again = pairs(), pairs()
    seen, _ = one.reset(seed=[5, 6])
    assert np.array_equal(seen, again.reset(seed=[5, 6])[0])
    space = observation_space()
    for _ in range(50):
        action = act(START, seen)
        seen, rewards, *_ = one.step(action)
        assert np.array_equal(seen, again.step(action)[0])
        assert all(space.contains(row) for row in seen)
        assert np.allclose(rewards, -np.abs(seen[:, 0] - seen[:, 10]))
    assert not np.array_equal(seen[0], seen[1])


def test_a_policy_that_follows_is_nearer_than_one_that_does_nothing() -> None:
    env = pairs(8)
    errors = [tracking_error_mm(env, w, 100).mean() for w in (START, 0.0 * START)]
    assert errors[0] < 0.8 * errors[1]


def test_every_bench_has_its_effect_and_constants_of_its_own() -> None:
    made = list(benches(6))
    assert [b.active.name for b in made] == [name for name, _ in EFFECTS] * 2
    films = {b.bench.film_static_W_K for b in made}
    assert len(films | {Bench().film_static_W_K}) == 7


def test_the_ranges_by_hand_can_be_drawn_from() -> None:
    model = draw_between(model_of("A"), ranges_by_hand(), np.random.default_rng(0))
    assert set(model.effects) == {name for name, _ in EFFECTS}


class Never(Executor):
    """A pool that may not be asked for more."""

    def map(self, fn: Any, *iterables: Any, **_: Any) -> Any:
        assert not any(iterables), "searched again"
        return iter(())


def test_a_search_that_was_made_is_found_again(tmp_path: Path) -> None:
    search = Search(population=4, episodes=1, generations=1, elite=2)

    def weights(pool: Executor) -> Sequence[Sequence[float]]:
        table = Table(search=search, seeds=2, folder=tmp_path, pool=pool)
        return table.searched("wrong")

    with ThreadPoolExecutor(1) as pool:
        found = weights(pool)
    assert weights(Never()) == found
    assert np.shape(found) == (2, len(START))
    with pytest.raises(AssertionError, match="searched again"):
        Table(search=search, seeds=3, folder=tmp_path, pool=Never()).searched("wrong")
