"""The spring pair in Gymnasium."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import smad.envs
from firmware_protocol.enums import Fault
from firmware_protocol.messages import Setpoint
from firmware_protocol.supervisor.limits import compiled_limits
from sim_device.bench import SimulatedBench
from sim_device.plant.covariance import Covariance
from sim_device.plant.models import save_model
from smad.config.axes import DEGREES_PER_MM
from smad.envs.board import Boards
from smad.envs.errors import ActionRefused, EnvError
from smad.envs.signals import ACTIONS, MOST_A, NAMES, action_range, driven

AT = {name: i for i, name in enumerate(NAMES)}


def posterior(path: Path) -> Path:
    save_model(
        path,
        effects={"rtd_lag": {"tau_s": 0.8}},
        covariance=Covariance(
            ("parameters.film_scale", "effects.rtd_lag.tau_s"), np.diag([0.04, 0.04])
        ),
    )
    return path


def run_of(env: Any, seed: int, steps: int) -> np.ndarray:
    seen, _ = env.reset(seed=seed)
    rows = [seen]
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        action = rng.uniform(env.action_space.low, env.action_space.high)
        rows.append(env.step(action.astype(np.float32))[0])
    return np.array(rows)


@pytest.mark.parametrize("action", ["currents", "demand"])
def test_gymnasium_finds_nothing_wrong_with_the_environment(action: str) -> None:
    env = gymnasium.make(smad.envs.NAME, action=action, episode_s=0.5, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Actions are in A and duties, as the bench takes them, and not normalised.
        warnings.filterwarnings("ignore", message=".*symmetric and normalized.*")
        check_env(env.unwrapped)


def test_an_episode_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    env = gymnasium.make(smad.envs.NAME, episode_s=1.0)
    first, again, other = run_of(env, 3, 50), run_of(env, 3, 50), run_of(env, 4, 50)
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:, AT["reference_mm"]], other[:, AT["reference_mm"]])


def test_vector_and_single_environments_give_the_same_bits_over_several_episodes(
    tmp_path: Path,
) -> None:
    options: dict[str, Any] = {
        "model": posterior(tmp_path / "better.toml"),
        "randomise": "posterior",
        "episode_s": 0.4,
        "reference": "levels",
    }
    many = gymnasium.make_vec(smad.envs.NAME, num_envs=17, **options)
    single = gymnasium.vector.SyncVectorEnv(
        [lambda: gymnasium.make(smad.envs.NAME, **options)] * 17
    )
    assert isinstance(many.unwrapped, smad.envs.SpringPairVectorEnv)
    rng = np.random.default_rng(1)
    assert np.array_equal(many.reset(seed=5)[0], single.reset(seed=5)[0])
    ended = 0
    for _ in range(130):
        actions = rng.uniform(many.action_space.low, many.action_space.high).astype(np.float32)
        got, expected = many.step(actions), single.step(actions)
        for ours, theirs in zip(got[:4], expected[:4], strict=True):
            assert np.array_equal(ours, theirs)
        assert np.array_equal(got[4]["true_displacement_mm"], expected[4]["true_displacement_mm"])
        ended += int(got[3].sum())
    assert ended == 3 * 17
    many.close()
    single.close()


def test_environments_that_end_at_different_times_leave_the_others_as_they_are() -> None:
    """A hot one is stopped by its board, begins anew, and its neighbours go on."""
    options: dict[str, Any] = {"episode_s": 60.0, "rate_hz": 50}
    many = gymnasium.make_vec(smad.envs.NAME, num_envs=3, **options)
    single = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(smad.envs.NAME, **options)] * 3)
    inner = many.unwrapped
    assert isinstance(inner, smad.envs.SpringPairVectorEnv)
    limits = compiled_limits()
    limits.temperature_limit_cC = 3000
    limits.temperature_hysteresis_cC = 100
    inner._episodes.boards.limits = limits
    for env in single.envs:
        env.unwrapped._episodes.boards.limits = limits  # type: ignore[attr-defined]
    actions = np.zeros((3, 4), dtype=np.float32)
    actions[:, 0] = [0.5, 3.0, 4.0]
    many.reset(seed=1)
    single.reset(seed=1)
    stops = np.zeros(3, dtype=int)
    for _ in range(500):
        got, expected = many.step(actions), single.step(actions)
        assert np.array_equal(got[0], expected[0])
        assert np.array_equal(got[1], expected[1])
        assert np.array_equal(got[2], expected[2])
        stops += got[2]
    assert stops[0] == 0
    assert 0 < stops[1] < stops[2]
    many.close()
    single.close()


def test_a_spring_that_gets_too_hot_ends_the_episode_by_the_boards_own_limit() -> None:
    env = gymnasium.make(
        smad.envs.NAME, episode_s=120.0, model="A", reference=lambda rng, t_s: 0.0 * t_s
    )
    env.reset(seed=0)
    boards = env.unwrapped._episodes.boards  # type: ignore[attr-defined]
    # Without the fold-back no good bench gets there: it is switched off to show the check.
    boards.limits.fold_start_cC = boards.limits.fold_end_cC = 20_000
    hottest = 0.0
    for _ in range(12_000):
        seen, reward, terminated, _, info = env.step(np.array([4.0, 0.0, 0.0, 0.0], np.float32))
        hottest = max(hottest, float(seen[AT["rtd_x_degC"]]))
        if terminated:
            break
    assert terminated
    assert info["ended_by"] == Fault.OVER_TEMPERATURE.name
    assert hottest > compiled_limits().temperature_limit_cC * 0.01
    assert reward < -1000.0


def test_the_board_of_the_environment_lets_through_what_the_simulated_board_does() -> None:
    bench = SimulatedBench(seed=1)
    bench.arm()
    boards, going = Boards(1), np.ones(1, dtype=np.bool_)
    state = bench.step_typed(None)
    wanted = np.array([[4.0, 2.5]])
    folded = 0
    for n in range(3000):
        t_cC = np.array([state.rtd_cC[:2]], dtype=np.int64)
        i_mA = np.array([state.i_meas_mA], dtype=np.int64)
        assert not boards.observe(t_cC, i_mA, 10_000, going).any()
        applied = boards.regulate(wanted, 10_000, going)
        setpoint = Setpoint(0, state.t_us, (4000, 2500), (0, 0), 0, 100, 0)
        state = bench.step_typed(setpoint)
        given = bench.board.outputs.applied_mA
        if n > 2:
            # The board's fold-back may also look at a model of the spring, which is below its RTD.
            assert applied[0, 1] * 1e3 == given[1]
            assert abs(applied[0, 0] * 1e3 - given[0]) <= 100
        folded += given[0] < 4000
    assert folded > 100


@pytest.mark.parametrize(
    ("action", "said"),
    [
        ([np.nan, 0.0, 0.0, 0.0], "i_x_A"),
        ([0.0, 4.5, 0.0, 0.0], "i_y_A"),
        ([0.0, 0.0, -0.1, 0.0], "duty_x"),
        ([0.0, 0.0], "shape"),
    ],
)
def test_an_action_outside_its_space_is_refused_in_a_line(action: list[float], said: str) -> None:
    env = smad.envs.SpringPairEnv(episode_s=1.0)
    env.reset(seed=0)
    with pytest.raises(ActionRefused, match=said) as refused:
        env.step(np.array(action))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"action": "voltage"}, "voltage"),
        ({"reference": "spirals"}, "spirals"),
        ({"randomise": "wildly"}, "wildly"),
        ({"randomise": "posterior"}, "nothing to draw from"),
        ({"randomise": {"parameters.nothing": (0.0, 1.0)}}, "nothing"),
        ({"rate_hz": 1}, "rate_hz"),
        ({"episode_s": 0.0}, "episode_s"),
        ({"render_mode": "human"}, "render_mode"),
        ({"model": "missing.toml"}, "missing.toml"),
    ],
)
def test_what_it_cannot_be_made_with_is_refused_in_a_line(
    options: dict[str, Any], said: str
) -> None:
    with pytest.raises(EnvError, match=said) as refused:
        smad.envs.SpringPairEnv(**options)
    assert "\n" not in str(refused.value)


def test_a_model_file_of_another_plant_is_refused_in_a_line(tmp_path: Path) -> None:
    other = tmp_path / "tank.toml"
    other.write_text('format = "tank-model"\nlevel = 3.0\n')
    with pytest.raises(EnvError, match=r"not a model of the spring pair.*tank\.toml"):
        smad.envs.SpringPairEnv(model=other)


def test_randomised_episodes_are_of_different_plants(tmp_path: Path) -> None:
    model = posterior(tmp_path / "better.toml")
    still = {"reference": lambda rng, t_s: 0.0 * t_s, "episode_s": 3.0}
    warm = np.array([3.0, 0.0, 0.0, 0.0], dtype=np.float32)

    def ends(env: Any) -> list[float]:
        out = []
        for seed in range(4):
            env.reset(seed=seed)
            for _ in range(200):
                seen = env.step(warm)[0]
            out.append(float(seen[AT["rtd_x_degC"]]))
        return out

    fixed = np.std(ends(smad.envs.SpringPairEnv(model=model, **still)))
    drawn = np.std(ends(smad.envs.SpringPairEnv(model=model, randomise="posterior", **still)))
    assert drawn > 5.0 * fixed


def test_a_reference_of_ones_own_is_tracked() -> None:
    env = smad.envs.SpringPairEnv(episode_s=1.0)
    wanted = np.linspace(0.0, 2.0, 100)
    seen, _ = env.reset(seed=0, options={"reference_mm": wanted})
    assert seen[AT["reference_mm"]] == 0.0
    assert seen[AT["reference_ahead_mm"]] == pytest.approx(wanted[50])
    seen, reward, *_ = env.step(np.zeros(4))
    assert reward == pytest.approx(-abs(seen[AT["displacement_mm"]] - wanted[1]), abs=1e-6)
    with pytest.raises(EnvError, match="reference_mm"):
        env.reset(options={"reference_mm": [1.0, 2.0]})
    with pytest.raises(EnvError, match="unknown option"):
        env.reset(options={"reference": 1.0})


def test_a_demand_goes_to_the_spring_on_its_side() -> None:
    env = smad.envs.SpringPairEnv(action="demand", episode_s=1.0)
    env.reset(seed=0)
    for demand, x, y in ((0.5, 0.5, 0.0), (-0.25, 0.0, 0.25)):
        for _ in range(10):
            seen = env.step(np.array([demand, 0.0, 0.0]))[0]
        assert seen[AT["i_meas_x_A"]] == pytest.approx(x * MOST_A, abs=0.2)
        assert seen[AT["i_meas_y_A"]] == pytest.approx(y * MOST_A, abs=0.2)


def test_angles_are_degrees_of_the_segment() -> None:
    plain = smad.envs.SpringPairEnv(episode_s=1.0)
    angles = smad.envs.Degrees(smad.envs.SpringPairEnv(episode_s=1.0))
    a, b = plain.reset(seed=2)[0], angles.reset(seed=2)[0]
    assert b[AT["reference_ahead_mm"]] == pytest.approx(
        DEGREES_PER_MM * a[AT["reference_ahead_mm"]]
    )
    assert b[AT["rtd_x_degC"]] == a[AT["rtd_x_degC"]]
    r, s = plain.step(np.zeros(4))[1], angles.step(np.zeros(4))[1]
    assert s == pytest.approx(DEGREES_PER_MM * r)


def test_the_picture_shows_where_the_block_is_and_which_spring_is_warm() -> None:
    from smad.envs.picture import HEIGHT, WIDTH, picture

    seen = np.zeros(len(NAMES), dtype=np.float32)
    seen[AT["rtd_x_degC"]], seen[AT["rtd_y_degC"]] = 75.0, 22.0
    rest = picture(seen)
    seen[AT["displacement_mm"]] = 5.0
    moved = picture(seen)
    assert rest.shape == (HEIGHT, WIDTH, 3)
    assert rest.dtype == np.uint8
    dark = [
        np.flatnonzero((p[60, 20:-20] == (40, 44, 52)).all(axis=1)).mean() for p in (rest, moved)
    ]
    assert dark[1] < dark[0] - 50
    left, right = rest[:, 20:220].astype(int), rest[:, 260:460].astype(int)
    assert (left[..., 0] - left[..., 2]).max() > 50
    assert (right[..., 2] - right[..., 0]).max() > 50


@pytest.mark.parametrize("kind", ACTIONS)
def test_an_action_that_rounding_puts_beyond_its_space_is_taken_at_the_edge(kind: str) -> None:
    low, high = action_range(kind)
    for edge, beyond in ((low, -1e-12), (high, 1e-12)):
        exact = edge[None].astype(np.float64)
        np.testing.assert_array_equal(driven(kind, exact + beyond, 1), driven(kind, exact, 1))
        with pytest.raises(ActionRefused, match="lies outside its space"):
            driven(kind, exact + 1e10 * beyond, 1)
