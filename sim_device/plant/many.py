"""Many plants side by side, advanced by one kernel call for each thread."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k
from sim_device.plant.errors import InputError, ModelError, SolverError
from sim_device.plant.plant import MAX_STEP_S, NOISE_OF_READINGS, SENSED, solver_error
from sim_device.plant.setup import Setup

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

READINGS = (
    "i_x_A", "i_y_A", "v_x_V", "v_y_V", "rtd_x_K", "rtd_y_K", "rtd_inlet_K", "rtd_ambient_K",
    "displacement_m", "force_N",
)  # fmt: skip
"""Columns of `PlantArray.read`."""
DRIVE = ("i_x_A", "i_y_A", "duty_x", "duty_y", "drain_x", "drain_y", "stage_m")
"""Columns of `PlantArray.drive`."""
_DRIVE = slice(k.place_of(k.Work, "drive.i_x"), k.place_of(k.Work, "drive.stage") + 1)
_FORCES = k.place_of(k.Work, "forces")
_BLOCK = 64
_LEAST_A_THREAD = 8


class PlantArray:
    """`size` plants, each with parameters, effects, state and sensor noise of its own.

    `setup`, laws included, is what all begin with; `put` replaces one. `drive` (size, 7) is what
    the boards apply, columns DRIVE, SI, not checked; it is read by `advance`. With an `executor` of
    threads the plants are advanced in `workers` parts. Each plant gives the numbers of `Plant` to
    the last bit.
    """

    def __init__(
        self,
        size: int,
        setup: Setup,
        *,
        executor: Executor | None = None,
        workers: int = 1,
        max_step_s: float = MAX_STEP_S,
    ) -> None:
        if size < 1:
            raise InputError(f"size = {size}; an array has at least one plant")
        self.size = size
        self._table, self._max_step_s = setup.table, max_step_s
        self._states = k.zeros(k.State, size)
        self._works = k.zeros(k.Work, size)
        self._models = k.zeros(k.Model, size)
        self._late = False
        self._rings = np.zeros((size, 1, k.RING_COLUMNS))
        self._laws = np.zeros((size, *setup.laws.shape))
        self._memory = np.zeros((size, *setup.memory().shape))
        self._counts = np.zeros(size)
        self.rows: Array = k.numbers(self._states).reshape(size, -1)
        """Numbers of the states; where one stands says `kernel.place_of(State, …)`."""
        self._work_rows = k.numbers(self._works).reshape(size, -1)
        self.drive: Array = self._work_rows[:, _DRIVE]
        self._model_rows = k.numbers(self._models).reshape(size, -1)
        self._sigma = np.zeros((size, len(READINGS)))
        self._noise = np.zeros((_BLOCK, size, len(READINGS)))
        self._drawn = np.full(size, _BLOCK)
        self._streams = [np.random.default_rng(0) for _ in range(size)]
        self._every = np.arange(size)
        self.statuses = np.zeros(size)
        self._executor = executor
        parts = max(1, min(workers if executor is not None else 1, size // _LEAST_A_THREAD))
        edges = np.linspace(0, size, parts + 1).astype(int).tolist()
        self._parts = list(pairwise(edges))
        for i in range(size):
            self.put(i, setup)

    def put(
        self, i: int, setup: Setup, *, seed: int = 0, temperature_K: float | None = None
    ) -> None:
        """Let plant `i` begin anew at rest. seed: of its sensor noise.

        Raises ModelError for a setup of another variant than that of the array.
        """
        if setup.table is not self._table:
            raise ModelError("the plants of an array are of one variant; use an array for each")
        if setup.late and not self._late:
            self._late = True
            self._rings = np.zeros((self.size, k.RING_ROWS, k.RING_COLUMNS))
        self.rows[i] = k.numbers(setup.state(temperature_K))
        self._model_rows[i] = k.numbers(setup.model)
        self._rings[i] = 0.0
        self._put_laws(i, setup)
        self.drive[i] = 0.0
        self._sigma[i] = [setup.parameters[name] for name in NOISE_OF_READINGS]
        self._streams[i] = np.random.default_rng(seed)
        self._drawn[i] = _BLOCK
        self.statuses[i] = k.OK

    def _put_laws(self, i: int, setup: Setup) -> None:
        count = len(setup.laws)
        more = count - self._laws.shape[1]
        if more > 0:
            room = ((0, 0), (0, more), (0, 0))
            self._laws, self._memory = np.pad(self._laws, room), np.pad(self._memory, room)
        self._laws[i, :count] = setup.laws
        self._memory[i] = 0.0
        self._counts[i] = count
        self._work_rows[i, _FORCES] = 1.0 if count else 0.0

    def advance(self, dt_s: float) -> bool:
        """Hold `drive` for `dt_s`. Returns whether every plant was solved.

        `statuses` says which was not; `error(i)` makes the error of it. The state of such a plant
        is of no use, and `put` begins it anew.
        """
        if not 0.0 < dt_s < math.inf:
            raise InputError(f"dt_s = {dt_s} s; a sample needs a positive finite duration")
        steps = max(1, math.ceil(dt_s / self._max_step_s - 1e-9))
        if self._executor is None or len(self._parts) == 1:
            self._advance_part(0, self.size, dt_s / steps, steps)
        else:
            tasks = [
                self._executor.submit(self._advance_part, first, last, dt_s / steps, steps)
                for first, last in self._parts
            ]
            for task in tasks:
                task.result()
        return not self.statuses.any()

    def _advance_part(self, first: int, last: int, dt: float, steps: int) -> None:
        k.advance_many(
            self._states,
            self._works,
            self._models,
            self._rings.reshape(-1, k.RING_COLUMNS),
            self._rings.shape[1],
            self._table,
            self._laws.reshape(-1, self._laws.shape[2]),
            self._memory.reshape(-1, self._memory.shape[2]),
            self._laws.shape[1],
            self._counts,
            dt,
            steps,
            first,
            last,
            self.statuses,
        )

    def error(self, i: int) -> SolverError:
        """The error of a plant whose status is not OK."""
        return solver_error(int(self.statuses[i]), self.rows[i])

    def read(self) -> Array:
        """What all sensors say now, shape (size, 10), columns READINGS. Draws new noise."""
        return self.rows[:, SENSED] + self._next_noise() * self._sigma

    def read_only(self, which: Flags) -> Array:
        """As `read`, of which the rows of other plants are of no use; they draw no noise."""
        read: Array = self.rows[:, SENSED] + self._next_noise(which) * self._sigma
        return read

    def copied(self, which: Flags) -> tuple[Array, Array, Array]:
        """A copy of what the state of some plants is."""
        return self.rows[which].copy(), self._rings[which].copy(), self._memory[which].copy()

    def restore(self, which: Flags, copied: tuple[Array, Array, Array]) -> None:
        """Put plants back to what `copied` copied."""
        self.rows[which], self._rings[which], self._memory[which] = copied
        self.statuses[which] = k.OK

    def _next_noise(self, which: Flags | None = None) -> Array:
        # A block of numbers of a Generator is what as many single calls give.
        for i in np.flatnonzero(self._drawn == _BLOCK):
            self._noise[:, i] = self._streams[i].standard_normal((_BLOCK, len(READINGS)))
            self._drawn[i] = 0
        drawn: Array = self._noise[self._drawn, self._every]
        self._drawn += 1 if which is None else which
        return drawn

    def column(self, path: str) -> Array:
        """One number of every state, "shared.displacement" for instance; a view, shape (size,)."""
        view: Array = self.rows[:, k.place_of(k.State, path)]
        return view
