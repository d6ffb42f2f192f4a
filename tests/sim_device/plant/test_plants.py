"""Many plants through many runs, on any executor."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_device.plant import Inputs, load_parameters, simulate
from sim_device.plant.errors import InputError
from sim_device.plant.laws import Law, Term
from sim_device.plant.models import Model
from sim_device.plant.plants import Plants, Result

A = load_parameters("A")


def run_of(current_A: float, seconds: float = 1.0) -> Inputs:
    t_s = np.arange(0.0, seconds, 0.01)
    i_A = np.zeros((t_s.size, 2))
    i_A[10:, 0] = current_A
    return Inputs(t_s=t_s, i_A=i_A, pump_duty=np.zeros((t_s.size, 2)))


def peak(result: Result) -> Result:
    return {"peak_degC": np.array(result["rtd_x_degC"].max())}


MODELS = [
    Model(A.replace(film_scale=scale), "extended", effects, "A")
    for scale in (0.8, 1.0, 1.2)
    for effects in ({}, {"rtd_lag": {"tau_s": 0.5, "y_share": 1.0}})
]
RUNS = [run_of(2.0), run_of(3.0, 0.7)]


def plants(**options: Any) -> Plants:
    return Plants(models=MODELS, runs=RUNS, chunk=5, **options)


def same(a: list[list[Result]], b: list[list[Result]]) -> bool:
    return all(
        x.keys() == y.keys() and all(np.array_equal(x[k], y[k]) for k in x)
        for row, other in zip(a, b, strict=True)
        for x, y in zip(row, other, strict=True)
    )


def test_every_model_goes_through_every_run() -> None:
    found = plants().replay()
    for i, model in enumerate(MODELS):
        for j, run in enumerate(RUNS):
            alone = simulate(model.parameters, run, effects=model.effects)
            assert np.array_equal(found[i][j]["rtd_x_degC"], alone["rtd_x_degC"])


def test_threads_and_processes_give_what_a_loop_gives() -> None:
    told: list[tuple[int, int]] = []
    alone = plants(keep=peak).replay()
    with ThreadPoolExecutor(2) as threads:
        found = plants(keep=peak).replay(threads, progress=lambda n, of: told.append((n, of)))
    assert same(found, alone)
    assert [n for n, _ in told] == sorted(n for n, _ in told)
    assert told[-1] == (12, 12)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as processes:
        assert same(plants(keep=peak).replay(processes), alone)


def test_a_cluster_of_dask_gives_what_a_loop_gives() -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        found = plants(keep=peak).replay(cluster.get_executor())
    assert same(found, plants(keep=peak).replay())


class Failing(ThreadPoolExecutor):
    """Carries out so many tasks, and fails then."""

    def __init__(self, good: int) -> None:
        super().__init__(1)
        self.asked, self.good = 0, good

    def submit(self, *args: Any, **kwargs: Any) -> Future[Any]:
        self.asked += 1
        if self.asked > self.good:
            broken: Future[Any] = Future()
            broken.set_exception(RuntimeError("the cluster is gone"))
            return broken
        future = super().submit(*args, **kwargs)
        future.result()
        return future


def test_a_call_that_was_broken_off_goes_on_where_it_was(tmp_path: Path) -> None:
    with Failing(0) as broken, pytest.raises(RuntimeError, match="gone"):
        plants().replay(broken, folder=tmp_path)
    with Failing(1) as broken, pytest.raises(RuntimeError, match="gone"):
        plants().replay(broken, folder=tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 1
    with Failing(99) as rest:
        found = plants().replay(rest, folder=tmp_path)
        assert rest.asked == 2
    with Failing(0) as none:
        assert same(plants().replay(none, folder=tmp_path), found)
    assert same(found, plants().replay())


def test_results_are_not_taken_for_those_of_another_question(tmp_path: Path) -> None:
    plants().replay(folder=tmp_path)
    before = set(tmp_path.iterdir())
    coarse = plants(dt_s=2e-3).replay(folder=tmp_path)
    assert len(set(tmp_path.iterdir()) - before) == 3
    assert same(coarse, plants(dt_s=2e-3).replay())


def test_a_file_that_was_cut_short_is_made_again(tmp_path: Path) -> None:
    found = plants().replay(folder=tmp_path)
    for path in tmp_path.glob("*.npz"):
        path.write_bytes(path.read_bytes()[:100])
    assert same(plants().replay(folder=tmp_path), found)


def test_what_cannot_be_replayed_is_refused() -> None:
    with pytest.raises(InputError, match="at least one model"):
        Plants(models=[], runs=RUNS)
    with pytest.raises(InputError, match="unknown"):
        plants(outputs=("speed",))
    with pytest.raises(InputError, match="chunk"):
        Plants(models=MODELS, runs=RUNS, chunk=0)


def test_a_model_with_a_law_is_replayed_with_it_and_kept_apart(tmp_path: Path) -> None:
    warmer = Law("heat_into_wire", "x", (Term(name="constant", coefficient=0.3),))
    bare = Model(A, "extended", {}, "A")
    for model in (bare, replace(bare, laws=(warmer,))):
        found = Plants(models=[model], runs=[run_of(2.0)]).replay(folder=tmp_path)[0][0]
        alone = simulate(A, run_of(2.0), laws=model.laws)
        assert np.array_equal(found["rtd_x_degC"], alone["rtd_x_degC"])
