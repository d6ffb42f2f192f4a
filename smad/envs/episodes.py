"""Many spring pairs in episodes: what one environment and a vector of them share."""

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from firmware_protocol.enums import Fault
from sim_device.plant.draws import draw, draw_between, setup_of
from sim_device.plant.errors import PlantError
from sim_device.plant.many import PlantArray
from sim_device.plant.models import Model, built_in, read_model
from sim_device.plant.parameters import BUILT_IN
from sim_device.plant.setup import Setup
from sim_device.plant.units import ZERO_C
from smad.arrays import Array, Index, Mask, Singles
from smad.envs import references, signals
from smad.envs.board import Boards
from smad.envs.errors import EnvError

Ranges = Mapping[str, tuple[float, float]]
Randomise = None | str | Ranges | Callable[[Model, np.random.Generator], Model]
POSTERIOR = "posterior"


def model_of(source: str | Path | Model) -> Model:
    """A built-in parameter set by name, a model file, or a model as it is.

    Raises EnvError for a file that is not a model of the spring pair.
    """
    if isinstance(source, Model):
        return source
    if str(source) in BUILT_IN:
        return built_in(str(source))
    try:
        return read_model(source)
    except PlantError as error:
        raise EnvError(
            "this is not a model of the spring pair",
            value=str(error),
            action="give a file that smad gap diagnose --apply or save_model wrote",
        ) from None


class Source:
    """Where plants come from: `setup(rng)` gives one for an episode.

    randomise: None (always the model), "posterior" (from the covariance of the model file), ranges
    by hand (name to (low, high), SI), or a function of model and generator.
    Raises EnvError for what cannot be drawn from.
    """

    def __init__(self, model: str | Path | Model, randomise: Randomise = None) -> None:
        self.model, self._randomise = model_of(model), randomise
        self._fixed = setup_of(self.model) if randomise is None else None
        if isinstance(randomise, str) and randomise != POSTERIOR:
            raise EnvError(
                "unknown way to randomise", value=randomise, limit=f"{POSTERIOR}, ranges, None"
            )
        if randomise is not None:
            self.drawn(np.random.default_rng(0))

    def drawn(self, rng: np.random.Generator) -> Model:
        """One model."""
        try:
            if self._randomise is None:
                return self.model
            if isinstance(self._randomise, str):
                return draw(self.model, rng)
            if isinstance(self._randomise, Mapping):
                return draw_between(self.model, self._randomise, rng)
            return self._randomise(self.model, rng)
        except PlantError as error:
            raise EnvError("no plant can be drawn", value=str(error)) from None

    def setup(self, rng: np.random.Generator) -> Setup:
        """One model as the kernel takes it."""
        return self._fixed if self._fixed is not None else setup_of(self.drawn(rng))


SOLVER = "solver"


@dataclass(frozen=True, kw_only=True)
class Task:
    """What an environment is made with.

    model: a built-in parameter set ("A"), a model file, or a `Model`. randomise: None, "posterior"
    (plants drawn from the covariance of the model file), ranges by hand (name to (low, high), SI),
    or a function of model and generator. action: "currents" or "demand", see `signals`. reference:
    "sines", "levels", or a function of generator and times. An episode lasts `episode_s`, a step
    1/`rate_hz`. Raises EnvError.
    """

    model: str | Path | Model = "A"
    randomise: Randomise = None
    action: str = "currents"
    reference: str | references.Reference = "sines"
    episode_s: float = 20.0
    rate_hz: int = 100

    def __post_init__(self) -> None:
        if not 50 <= self.rate_hz <= 1000:
            raise EnvError("rate_hz out of range", value=self.rate_hz, limit="50 to 1000")
        if not 0.1 <= self.episode_s <= 3600.0:
            raise EnvError("episode_s out of range", value=self.episode_s, limit="0.1 to 3600")

    @property
    def steps(self) -> int:
        """Steps of an episode."""
        return round(self.episode_s * self.rate_hz)


@dataclass(frozen=True, kw_only=True)
class Stepped:
    """What a step gave, an element for each plant. `faults`: the board's, 0 for none."""

    observations: Singles
    rewards: Array
    terminated: Mask
    truncated: Mask
    faults: npt.NDArray[np.int64]
    solved: Mask


class Episodes:
    """`size` pairs on boards, each in an episode of its own."""

    def __init__(
        self, size: int, task: Task, *, executor: Executor | None = None, workers: int = 1
    ) -> None:
        self.task, self.size = task, size
        self._source = Source(task.model, task.randomise)
        signals.action_range(task.action)
        setup = self._source.setup(np.random.default_rng(0))
        self.plants = PlantArray(size, setup, executor=executor, workers=workers)
        self.boards = Boards(size)
        self._dt_s = 1.0 / task.rate_hz
        self._dt_us = 1_000_000 // task.rate_hz
        ahead = round(signals.PREVIEW_S * task.rate_hz)
        self._ahead = ahead
        self._times: Array = np.arange(task.steps + ahead + 1, dtype=np.float64) * self._dt_s
        references.drawn(task.reference, np.random.default_rng(0), self._times)
        self._references = np.zeros((size, self._times.size))
        self.step_number = np.zeros(size, dtype=np.int64)
        self._every = np.arange(size)
        self._seen = np.zeros((size, len(signals.NAMES)))
        self._true_m = self.plants.column("shared.displacement")

    def begin(
        self, i: int, rng: np.random.Generator, options: Mapping[str, Any] | None = None
    ) -> None:
        """Let an episode begin: plant, reference and noise are drawn from `rng` in this order.

        options: `reference_mm`, positions for every step or a function as of `references`. Raises
        EnvError for others.
        """
        rest = dict(options or {})
        reference = rest.pop("reference_mm", self.task.reference)
        if rest:
            raise EnvError("unknown option", value=sorted(rest)[0], limit="reference_mm")
        setup = self._source.setup(rng)
        self._references[i] = self._positions(reference, rng)
        self.plants.put(i, setup, seed=int(rng.integers(2**32)))
        self.boards.begin(i)
        self.step_number[i] = 0

    def _positions(self, reference: Any, rng: np.random.Generator) -> Array:
        if isinstance(reference, str) or callable(reference):
            return references.drawn(reference, rng, self._times)
        row = np.atleast_1d(np.asarray(reference, dtype=np.float64))
        if row.ndim != 1 or not self.task.steps <= row.size or not np.isfinite(row).all():
            raise EnvError(
                "reference_mm has not one finite position for each step",
                value=f"shape {row.shape}",
                limit=f"({self.task.steps},)",
            )
        row = row[: self._times.size]
        return np.concatenate([row, np.full(self._times.size - row.size, row[-1])])

    def observe(self, which: Index | None = None) -> Singles:
        """What plants that have just begun show (all, or these), in steps of the wire."""
        begun = np.zeros(self.size, dtype=np.bool_)
        begun[self._every if which is None else which] = True
        self._take(self.plants.read_only(begun), np.flatnonzero(begun))
        return self.observations()

    def observations(self) -> Singles:
        """The latest observations, shape (size, 12), columns `signals.NAMES`."""
        return np.clip(self._seen.astype(np.float32), signals.LOW, signals.HIGH)

    def _take(self, read: Array, which: Index) -> None:
        measured = np.empty((len(which), len(signals.MEASURED)))
        rows = read[which]
        measured[:, 0] = rows[:, 8] * 1e3
        measured[:, 1] = rows[:, 9]
        measured[:, 2:6] = rows[:, 4:8] - ZERO_C
        measured[:, 6:8] = rows[:, 0:2]
        measured[:, 8:10] = rows[:, 2:4]
        self._seen[which, : measured.shape[1]] = np.rint(measured / signals.STEPS) * signals.STEPS
        moment = self.step_number[which]
        self._seen[which, -2] = self._references[which, moment]
        self._seen[which, -1] = self._references[which, moment + self._ahead]

    def step(self, actions: Any, over: Mask | None = None) -> Stepped:
        """Apply actions (size, …) for one sample. Plants that are `held` stay as they are: their
        next episode has just begun.

        Raises ActionRefused.
        """
        commands = signals.driven(self.task.action, actions, self.size)
        going = np.ones(self.size, dtype=np.bool_) if over is None else ~over
        every = self._every if over is None else np.flatnonzero(going)
        drive = self.plants.drive
        drive[every, :2] = self.boards.regulate(commands[:, :2], self._dt_us, going)[every]
        drive[every, 2:4] = commands[every, 2:]
        if over is not None and over.any():
            self._advance_only(going)
        else:
            self.plants.advance(self._dt_s)
        self.step_number[every] += 1
        solved = self.plants.statuses == 0
        good = every[solved[every]]
        if good.size:
            self._take(self.plants.read_only(going & solved), good)
        faults = self._faults(going & solved)
        return self._outcome(going, solved, faults)

    def _advance_only(self, going: Mask) -> None:
        """Advance the plants that go on; the others are put back as they were."""
        finished_plants = self.plants.copied(~going)
        self.plants.advance(self._dt_s)
        self.plants.restore(~going, finished_plants)

    def _faults(self, which: Mask) -> npt.NDArray[np.int64]:
        t_cC = np.rint(self._seen[:, 2:4] * 100.0).astype(np.int64)
        i_mA = np.rint(self._seen[:, 6:8] * 1e3).astype(np.int64)
        return np.where(which, self.boards.observe(t_cC, i_mA, self._dt_us, which), 0)

    def _outcome(self, going: Mask, solved: Mask, faults: npt.NDArray[np.int64]) -> Stepped:
        rewards = -np.abs(self._seen[:, 0] - self._seen[:, -2])
        stopped = faults != 0
        # Whoever is stopped misses all that is left, by the whole reach to either side.
        steps_left = self.task.steps - self.step_number
        rewards = np.where(stopped, -2.0 * references.REACH_mm * (steps_left + 1), rewards)
        rewards = np.where(going, rewards, 0.0)
        ended = (self.step_number >= self.task.steps) | ~solved
        return Stepped(
            observations=self.observations(),
            rewards=rewards,
            terminated=stopped & going,
            truncated=ended & ~stopped & going,
            faults=faults,
            solved=solved,
        )

    @property
    def true_mm(self) -> Array:
        """Where the tendon is, mm."""
        return self._true_m * 1e3

    def why(self, stepped: Stepped, i: int) -> str:
        """What ended the episode: a fault of the board, "solver", or "" (time, or not ended)."""
        if stepped.faults[i]:
            return Fault(int(stepped.faults[i])).name
        return "" if stepped.solved[i] else SOLVER
