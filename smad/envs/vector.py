"""Many spring pairs as one vector environment: one kernel call for each thread."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from smad.arrays import Array, Mask, Singles
from smad.envs.episodes import Episodes, Stepped, Task
from smad.envs.errors import EnvError
from smad.envs.pair import FRAMES_PER_S, action_space, observation_space


class SpringPairVectorEnv(VectorEnv[Any, Any, Any]):
    """`num_envs` environments of `SpringPairEnv`, with the same numbers to the last bit.

    `task` as there; `threads` advance the plants, by default one for each processor. An episode
    that has ended begins anew at the next step, whose action is not used (AutoresetMode.NEXT_STEP).
    """

    metadata = {  # noqa: RUF012
        "render_modes": [],
        "render_fps": FRAMES_PER_S,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        render_mode: None = None,
        **task: Any,
    ) -> None:
        if num_envs < 1:
            raise EnvError("num_envs out of range", value=num_envs, limit="1 or more")
        workers = threads or os.cpu_count() or 1
        self._pool = ThreadPoolExecutor(workers) if workers > 1 else None
        settings = Task(**task)
        self._episodes = Episodes(num_envs, settings, executor=self._pool, workers=workers)
        self.num_envs = num_envs
        self.steps = settings.steps
        """Steps of an episode."""
        self.render_mode = render_mode
        self.single_observation_space = observation_space()
        self.single_action_space = action_space(settings.action)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._generators: list[np.random.Generator] = []
        self._over = np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin all episodes. seed: one each, or that of the first, the others counting up."""
        seeds = self._seeds(seed)
        if not self._generators or seed is not None:
            self._generators = [seeding.np_random(number)[0] for number in seeds]
        for i, rng in enumerate(self._generators):
            self._episodes.begin(i, rng, options)
        self._over[:] = False
        return self._episodes.observe(), self._info(np.full(self.num_envs, "", dtype=object))

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise EnvError("not one seed for each", value=len(seed), limit=self.num_envs)
        return list(seed)

    def step(self, actions: npt.ArrayLike) -> tuple[Singles, Array, Mask, Mask, dict[str, Any]]:
        """One sample of all. Raises ActionRefused where an action lies outside its space."""
        if not self._generators:
            raise EnvError("no episode has begun", action="call reset first")
        over = self._over.copy() if self._over.any() else None
        if over is not None:
            restarted = np.flatnonzero(over)
            for i in restarted:
                self._episodes.begin(int(i), self._generators[i])
            self._episodes.observe(restarted)
        stepped = self._episodes.step(actions, over)
        self._over = stepped.terminated | stepped.truncated
        return (
            stepped.observations,
            stepped.rewards,
            stepped.terminated,
            stepped.truncated,
            self._info(self._why(stepped)),
        )

    def _why(self, stepped: Stepped) -> npt.NDArray[np.object_]:
        why = np.full(self.num_envs, "", dtype=object)
        for i in np.flatnonzero((stepped.faults != 0) | ~stepped.solved):
            why[i] = self._episodes.why(stepped, int(i))
        return why

    def _info(self, ended_by: npt.NDArray[np.object_]) -> dict[str, Any]:
        every = np.ones(self.num_envs, dtype=np.bool_)
        return {
            "true_displacement_mm": self._episodes.true_mm.copy(),
            "_true_displacement_mm": every,
            "ended_by": ended_by,
            "_ended_by": every,
        }

    def close_extras(self, **_: Any) -> None:
        """Give the threads back."""
        if self._pool is not None:
            self._pool.shutdown()
