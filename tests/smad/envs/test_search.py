"""The small policy and its search."""

from __future__ import annotations

import numpy as np
import pytest

from smad.envs.errors import EnvError
from smad.envs.pair import action_space
from smad.envs.search import START, WEIGHTS, Search, act, tracking_error_mm
from smad.envs.signals import HIGH, LOW, NAMES
from smad.envs.vector import SpringPairVectorEnv

SEARCH = Search(population=8, episodes=2, generations=3, elite=3)


def env(size: int) -> SpringPairVectorEnv:
    return SpringPairVectorEnv(size, action="demand", episode_s=6.0, rate_hz=50)


def test_a_search_finds_a_policy_that_tracks_better_than_none_and_again_the_same() -> None:
    found = SEARCH.run(env(SEARCH.num_envs), seed=1)
    tried = env(8)
    still = np.zeros(len(WEIGHTS))
    errors = [tracking_error_mm(tried, weights, 50).mean() for weights in (found, still)]
    assert errors[0] < 0.6 * errors[1]
    assert np.array_equal(found, SEARCH.run(env(SEARCH.num_envs), seed=1))
    with pytest.raises(EnvError, match="num_envs=16"):
        SEARCH.run(env(4), seed=1)


def test_whatever_the_weights_the_action_lies_in_its_space() -> None:
    rng = np.random.default_rng(0)
    space = action_space("demand")
    for _ in range(200):
        seen = rng.uniform(LOW, HIGH).astype(np.float32)
        assert space.contains(act(rng.normal(0.0, 5.0, len(WEIGHTS)), seen))


def test_the_policy_treats_the_springs_alike() -> None:
    seen = np.zeros(len(NAMES), dtype=np.float32)
    swapped = seen.copy()
    at = {name: i for i, name in enumerate(NAMES)}
    mirrored = (
        ("displacement_mm", "displacement_mm", -1.0),
        ("reference_mm", "reference_mm", -1.0),
        ("reference_ahead_mm", "reference_ahead_mm", -1.0),
        ("rtd_x_degC", "rtd_y_degC", 1.0),
        ("rtd_y_degC", "rtd_x_degC", 1.0),
    )
    for here, _, _ in mirrored:
        seen[at[here]] = 0.3 * (1 + at[here])
    for here, there, sign in mirrored:
        swapped[at[there]] = sign * seen[at[here]]
    weights = START + 0.1
    one, other = act(weights, seen), act(weights, swapped)
    assert np.allclose(other, [-one[0], one[2], one[1]])
