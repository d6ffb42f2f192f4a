"""`smad/SpringPair-v0`: the bench as a Gymnasium environment, and its angles for the lengths."""

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from smad.arrays import Singles
from smad.config.axes import DEGREES_PER_MM
from smad.envs import signals
from smad.envs.episodes import Episodes, Task
from smad.envs.errors import EnvError
from smad.envs.picture import picture
from smad.envs.signals import NAMES

FRAMES_PER_S = 100


def observation_space() -> spaces.Box:
    """What an agent sees: `signals.NAMES`, mm, N, °C, A, V."""
    return spaces.Box(signals.LOW, signals.HIGH, dtype=np.float32)


def action_space(kind: str) -> spaces.Box:
    """What an agent does, by the kind of `signals.ACTIONS`."""
    low, high = signals.action_range(kind)
    return spaces.Box(low, high, dtype=np.float32)


class SpringPairEnv(gymnasium.Env[Singles, npt.NDArray[np.floating[Any]]]):
    """Two springs on one tendon, which is to follow a reference.

    `task` has the fields of `episodes.Task`.

    The reward of a step is −|displacement − reference|, mm, both as seen. The board's limits on
    current act on what is asked for; an over-temperature or I²t fault of the board terminates the
    episode. `info` has `true_displacement_mm` and `ended_by`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_S}  # noqa: RUF012

    def __init__(self, *, render_mode: str | None = None, **task: Any) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise EnvError("no such render_mode", value=render_mode, limit="rgb_array")
        self.render_mode = render_mode
        self._episodes = Episodes(1, Task(**task))
        self._begun = False
        self.observation_space: Any = observation_space()
        self.action_space: Any = action_space(self._episodes.task.action)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin an episode. options: `reference_mm`, positions for every step or a function."""
        super().reset(seed=seed)
        self._episodes.begin(0, self.np_random, options)
        self._begun = True
        return self._episodes.observe()[0], self._info("")

    def step(self, action: npt.ArrayLike) -> tuple[Singles, float, bool, bool, dict[str, Any]]:
        """Apply an action for one sample. Raises ActionRefused for one outside its space."""
        if not self._begun:
            raise EnvError("no episode has begun", action="call reset first")
        stepped = self._episodes.step(np.asarray(action)[None])
        return (
            stepped.observations[0],
            float(stepped.rewards[0]),
            bool(stepped.terminated[0]),
            bool(stepped.truncated[0]),
            self._info(self._episodes.why(stepped, 0)),
        )

    def _info(self, ended_by: str) -> dict[str, Any]:
        return {"true_displacement_mm": float(self._episodes.true_mm[0]), "ended_by": ended_by}

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The pair as a picture, shape (160, 480, 3), if `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        return picture(self._episodes.observations()[0])


_ANGLES = np.array([name.endswith("_mm") for name in NAMES])
_GAIN = np.where(_ANGLES, DEGREES_PER_MM, 1.0).astype(np.float32)


class Degrees(gymnasium.Wrapper[Singles, Any, Singles, Any]):
    """Displacement and references in degrees of the end segment, 6.25° a mm; the reward too."""

    def __init__(self, env: gymnasium.Env[Singles, Any]) -> None:
        super().__init__(env)
        inner = env.observation_space
        assert isinstance(inner, spaces.Box)
        self.observation_space = spaces.Box(inner.low * _GAIN, inner.high * _GAIN, dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        seen, info = self.env.reset(seed=seed, options=options)
        return seen * _GAIN, info

    def step(self, action: Any) -> tuple[Singles, float, bool, bool, dict[str, Any]]:
        seen, reward, terminated, truncated, info = self.env.step(action)
        return seen * _GAIN, float(reward) * DEGREES_PER_MM, terminated, truncated, info
