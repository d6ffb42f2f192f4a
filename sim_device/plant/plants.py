"""Many plants through many recorded inputs: one call, on whatever executor there is."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel
from sim_device.plant.errors import InputError, SolverError
from sim_device.plant.law_file import laws_as_tables
from sim_device.plant.models import Model
from sim_device.plant.replay import DEFAULT_STEP_S, OUTPUTS, Inputs, Replay

Array = npt.NDArray[np.float64]
Result = dict[str, Array]
Keep = Callable[[Result], Result]
Progress = Callable[[int, int], None]
"""Called with the replays that are done, and all of them."""
CHUNK = 100
"""Replays a task: what a scheduler costs is small beside them."""
_Pair = tuple[int, int]


def whole(result: Result) -> Result:
    """Keep all of a replay."""
    return result


@dataclass(frozen=True, kw_only=True)
class Plants:
    """Every one of `models` through every one of `runs`.

    outputs: of `replay.OUTPUTS`. keep: reduces each replay where it was made, to arrays by name; a
    function of a module, where processes carry it out. A replay that finds no solution is NaN.
    Raises InputError.
    """

    models: Sequence[Model]
    runs: Sequence[Inputs]
    outputs: tuple[str, ...] = ("displacement_m", "force_N", "rtd_x_degC", "rtd_y_degC")
    keep: Keep = whole
    dt_s: float = DEFAULT_STEP_S
    chunk: int = CHUNK

    def __post_init__(self) -> None:
        if not self.models or not self.runs:
            raise InputError("plants need at least one model and one run")
        if self.chunk < 1:
            raise InputError(f"chunk = {self.chunk}; a task has at least one replay")
        unknown = [name for name in self.outputs if name not in OUTPUTS]
        if unknown:
            raise InputError(f"output {unknown[0]!r} is unknown; known are {', '.join(OUTPUTS)}")

    @property
    def size(self) -> int:
        """How many replays there are."""
        return len(self.models) * len(self.runs)

    def replay(
        self,
        executor: Executor | None = None,
        *,
        folder: str | Path | None = None,
        progress: Progress | None = None,
    ) -> list[list[Result]]:
        """Results by model, then by run.

        executor: threads, processes, dask's `Client.get_executor()`; None: here, one by one.
        folder: results are kept there, a file a task, and found again by a digest of all that they
        depend on; a call that was broken off goes on where it was. Raises PlantError for a model
        that cannot be set up.
        """
        stored = None if folder is None else _Folder(Path(folder))
        results: list[list[Result]] = [[{} for _ in self.runs] for _ in self.models]
        tasks, done = [], 0

        def take(pairs: Sequence[_Pair], answers: Sequence[Result]) -> None:
            nonlocal done
            for (i, j), result in zip(pairs, answers, strict=True):
                results[i][j] = result
            done += len(pairs)
            if progress is not None:
                progress(done, self.size)

        for pairs in self._pairs():
            answers = None if stored is None else stored.find(self._digest(pairs), len(pairs))
            if answers is None:
                tasks.append(pairs)
            else:
                take(pairs, answers)
        for pairs, fresh in self._computed(tasks, executor):
            if stored is not None:
                stored.keep(self._digest(pairs), fresh)
            take(pairs, fresh)
        return results

    def _pairs(self) -> Iterator[list[_Pair]]:
        # By run first: a task then makes few runs ready, for many models.
        every = [(i, j) for j in range(len(self.runs)) for i in range(len(self.models))]
        for first in range(0, len(every), self.chunk):
            yield every[first : first + self.chunk]

    def _computed(
        self, tasks: Sequence[list[_Pair]], executor: Executor | None
    ) -> Iterator[tuple[list[_Pair], list[Result]]]:
        if executor is None:
            for pairs in tasks:
                yield pairs, _replayed(self._part(pairs), self.keep)
            return
        waiting = {executor.submit(_replayed, self._part(p), self.keep): p for p in tasks}
        try:
            for future in as_completed(waiting):
                if future.exception() is not None:
                    break
                yield waiting.pop(future), future.result()
            # What others had ready when one failed is kept.
            for future in [f for f in waiting if f.done() and f.exception() is None]:
                yield waiting.pop(future), future.result()
            for future in waiting:
                if future.done():
                    future.result()
        finally:
            for future in waiting:
                future.cancel()

    def _part(self, pairs: Sequence[_Pair]) -> _Part:
        used_models, used_runs = (sorted({pair[position] for pair in pairs}) for position in (0, 1))
        place_m, place_r = ({v: n for n, v in enumerate(u)} for u in (used_models, used_runs))
        return _Part(
            [self.models[i] for i in used_models],
            [self.runs[j] for j in used_runs],
            [(place_m[i], place_r[j]) for i, j in pairs],
            self.outputs,
            self.dt_s,
        )

    def _digest(self, pairs: Sequence[_Pair]) -> str:
        digest = hashlib.sha256()
        digest.update(
            json.dumps(
                [
                    kernel.text_digest(),
                    self.outputs,
                    self.dt_s,
                    self.keep.__module__,
                    self.keep.__qualname__,
                ]
            ).encode()
        )
        for i, j in pairs:
            digest.update(self._model_digests[i] + self._run_digests[j])
        return digest.hexdigest()[:32]

    @cached_property
    def _model_digests(self) -> list[bytes]:
        return [
            hashlib.sha256(
                json.dumps(
                    [m.parameters.digest(), m.variant, m.effects, laws_as_tables(m.laws)],
                    sort_keys=True,
                ).encode()
            ).digest()
            for m in self.models
        ]

    @cached_property
    def _run_digests(self) -> list[bytes]:
        return [_run_digest(run) for run in self.runs]


@dataclass(frozen=True)
class _Part:
    """One task: what it needs and no more, since it may be sent to another machine."""

    models: list[Model]
    runs: list[Inputs]
    pairs: list[_Pair]
    outputs: tuple[str, ...]
    dt_s: float


def _replayed(part: _Part, keep: Keep) -> list[Result]:
    ready: dict[tuple[int, str], Replay] = {}
    results = []
    for i, j in part.pairs:
        model, inputs = part.models[i], part.runs[j]
        replay = ready.get((j, model.variant))
        if replay is None:
            replay = Replay(inputs, variant=model.variant, outputs=part.outputs)
            ready[j, model.variant] = replay
        try:
            outputs = replay.run(model.parameters, model.effects, model.laws, dt_s=part.dt_s)
        except SolverError:
            outputs = {name: np.full(inputs.t_s.size, np.nan) for name in part.outputs}
        results.append(keep(outputs))
    return results


def _run_digest(run: Inputs) -> bytes:
    digest = hashlib.sha256()
    for series in (run.t_s, run.rows, run.inlet_K, run.ambient_K):
        digest.update(b"-" if series is None else np.ascontiguousarray(series).tobytes())
    return digest.digest()


class _Folder:
    """Results of tasks, a file each."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder

    def _path(self, digest: str) -> Path:
        return self._folder / f"{digest}.npz"

    def find(self, digest: str, count: int) -> list[Result] | None:
        try:
            with np.load(self._path(digest), allow_pickle=False) as file:
                results: list[Result] = [{} for _ in range(count)]
                for key in file.files:
                    number, _, name = key.partition(":")
                    results[int(number)][name] = file[key]
                return results
        except (OSError, ValueError, IndexError, EOFError, zipfile.BadZipFile):
            # Not there, or cut short: it is made again.
            return None

    def keep(self, digest: str, results: Sequence[Result]) -> None:
        arrays = {f"{n}:{name}": v for n, r in enumerate(results) for name, v in r.items()}
        trial = self._path(f".{digest}.{os.getpid()}")
        with trial.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        trial.replace(self._path(digest))
