"""The independent plant of the evaluation as environments, for policies to be tried on.

What a policy sees and does, the board's limits and the reward are those of `smad.envs`; the plant,
its days and the noise of its sensors are the evaluation's, which shares no code with our simulator.
"""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from evaluation.bank.recorder import COLOURED, STEPS, WHITE, COLOUR_s, today
from evaluation.plant.compiled import compiled
from evaluation.plant.effects import Active, magnitudes
from evaluation.plant.kernel import at_rest, tick
from evaluation.plant.layout import AMBIENT, COLUMNS, INLET, INPUTS, LUCK_X, READINGS
from evaluation.plant.parameters import Bench
from smad.envs import references, signals
from smad.envs.board import Boards

Array = npt.NDArray[np.float64]
DT_S = 0.01
_DT_US = 10_000
_WATER_DEGC = 26.85
_SHOWN = [
    READINGS.index(name)
    for name in (
        "displacement_mm", "force_N", "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC",
        "rtd_ambient_degC", "i_meas_x_A", "i_meas_y_A", "v_x_V", "v_y_V",
    )
]  # fmt: skip
"""Where each number of `signals.MEASURED` stands among the readings."""


@compiled
def _advance(
    p: Array,
    e: Array,
    u: Array,
    dt: float,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    rows: Array,
    heat: Array,
    scratch: Array,
    out: Array,
) -> None:
    for i in range(u.shape[0]):
        tick(
            p[i],
            e,
            u[i],
            dt,
            cells[i],
            side[i],
            pair[i],
            ring[i],
            rows[i],
            heat[i],
            scratch[i],
            out[i],
        )


class IndependentPairs:
    """`num_envs` episodes of one bench, as `smad.envs.search` takes them; action "demand".

    Each episode has a day of its own (`days`): parameters that no log tells, room and water.
    `inputs` are those of the last sample. An episode that the board ends counts as in
    `smad.envs.episodes`.
    """

    def __init__(
        self, num_envs: int, bench: Bench, active: tuple[Active, ...], *, episode_s: float
    ) -> None:
        self.num_envs, self.steps = num_envs, round(episode_s / DT_S)
        self._bench, self._effects = bench, magnitudes(active)
        self._ahead = round(signals.PREVIEW_S / DT_S)
        self._times = np.arange(self.steps + self._ahead + 1, dtype=np.float64) * DT_S

    def reset(self, *, seed: Sequence[int]) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Begin all episodes, one seed each."""
        self._boards, self._step = Boards(self.num_envs), 0
        self._rng = np.random.default_rng(list(seed))
        begun = [self._begun(np.random.default_rng(each)) for each in seed]
        self.days, inputs, wanted, states = zip(*begun, strict=True)
        self.inputs, self._references = np.array(inputs), np.array(wanted)
        self._parameters = np.array([day.vector() for day in self.days])
        cells, side, pair, ring, rows, heat, scratch = (
            np.array(part) for part in zip(*states, strict=True)
        )
        self._plants = cells, side, pair, ring, rows, heat, scratch
        self._out = np.zeros((self.num_envs, len(COLUMNS)))
        self._coloured = self._rng.standard_normal((self.num_envs, len(READINGS))) * COLOURED
        self._pass()
        return self._observed(), {}

    def _begun(self, rng: np.random.Generator) -> tuple[Bench, Array, Array, tuple[Array, ...]]:
        wanted = references.drawn("sines", rng, self._times)
        day = today(rng, self._bench)
        row = np.zeros(len(INPUTS))
        row[INLET], row[AMBIENT] = _WATER_DEGC + rng.normal(0.0, (0.5, 1.0))
        state = at_rest(day, self._effects, water_degC=row[INLET], ambient_degC=row[AMBIENT])
        return day, row, wanted, state.arrays()

    def _pass(self) -> None:
        """Let a sample pass, and read the sensors: as `wire_board.Surroundings`, for all."""
        self.inputs[:, LUCK_X:] = self._rng.uniform(size=(self.num_envs, 2))
        _advance(self._parameters, self._effects, self.inputs, DT_S, *self._plants, self._out)
        keep = np.exp(-DT_S / COLOUR_s)
        fresh, white = self._rng.standard_normal((2, self.num_envs, len(READINGS)))
        self._coloured = keep * self._coloured + np.sqrt(1.0 - keep**2) * COLOURED * fresh
        noisy = self._out[:, : len(READINGS)] + self._coloured + white * WHITE
        self._read = STEPS * np.round(noisy / STEPS)

    def _observed(self) -> npt.NDArray[np.float32]:
        ahead = self._references[:, [self._step, self._step + self._ahead]]
        seen = np.column_stack([self._read[:, _SHOWN], ahead])
        return np.clip(seen.astype(np.float32), signals.LOW, signals.HIGH)

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Array, Any, Any, dict[str, Any]]:
        """One sample of all. What comes after an end is of no use until the next reset."""
        every = np.ones(self.num_envs, dtype=np.bool_)
        wanted = signals.driven("demand", actions, self.num_envs)
        self.inputs[:, :2] = self._boards.regulate(wanted[:, :2], _DT_US, every)
        self.inputs[:, 2:4] = wanted[:, 2:]
        self._step += 1
        self._pass()
        seen = self._observed()
        t_cC = np.rint(seen[:, 2:4] * 100.0).astype(np.int64)
        i_mA = np.rint(seen[:, 6:8] * 1e3).astype(np.int64)
        stopped = self._boards.observe(t_cC, i_mA, _DT_US, every) != 0
        missed = 2.0 * references.REACH_mm * (self.steps - self._step + 1)
        rewards = np.where(stopped, -missed, -np.abs(seen[:, 0] - seen[:, -2]))
        return seen, rewards, stopped, np.full(self.num_envs, self._step >= self.steps), {}

    def close(self) -> None:
        """There is nothing to give back."""
