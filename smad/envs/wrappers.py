"""Wrappers: the angle of the robot's end segment in place of the displacement."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from smad.arrays import Singles
from smad.config.axes import DEGREES_PER_MM
from smad.envs.signals import NAMES

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
