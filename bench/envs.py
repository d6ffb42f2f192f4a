"""Steps of the vector environment beside single ones, and replays on executors beside a loop.

`python -m bench.envs` prints both tables. Rates are of this machine; the ratios are within a run.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from multiprocessing import get_context
from typing import Any

import gymnasium
import numpy as np

import smad.envs
from sim_device.plant.models import Model
from sim_device.plant.parameters import load_parameters
from sim_device.plant.plants import Plants, Result
from sim_device.plant.replay import Inputs

SIZES = (1, 8, 64, 512)
STEPS = 2000
"""Steps of 10 ms that are timed, of all environments together, at the least."""
MODELS, RUN_S = 400, 20.0
TURNS = 3


def steps_per_s(env: Any, size: int, steps: int) -> float:
    """Environment steps a second of wall time, with actions that are all different."""
    rng = np.random.default_rng(0)
    space = env.action_space
    actions = [rng.uniform(space.low, space.high).astype(np.float32) for _ in range(16)]
    env.reset(seed=0)
    for action in actions:
        env.step(action)
    start_s = time.perf_counter()
    for n in range(steps):
        env.step(actions[n % len(actions)])
    return size * steps / (time.perf_counter() - start_s)


def table_of_steps() -> Iterator[str]:
    """Lines: size, single environments, the vector on one thread and on two, ratios."""
    options: dict[str, Any] = {"episode_s": 3600.0}
    heads = f"{'N single':>12}{'1 thread':>12}{'2 threads':>12}{'ratio':>8}"
    yield f"{'N':>5}{heads}   steps/s of 10 ms"
    for size in SIZES:
        steps = max(STEPS // size, 40)
        made: list[Callable[[], Any]] = [
            lambda size=size: gymnasium.vector.SyncVectorEnv(  # type: ignore[misc]
                [lambda: gymnasium.make(smad.envs.NAME, **options)] * size
            ),
            *(
                lambda size=size, threads=threads: gymnasium.make_vec(
                    smad.envs.NAME, num_envs=size, threads=threads, **options
                )
                for threads in (1, 2)
            ),
        ]
        best = [0.0] * len(made)
        for _ in range(TURNS):
            for place, make in enumerate(made):
                env = make()
                best[place] = max(best[place], steps_per_s(env, size, steps))
                env.close()
        ratio = max(best[1:]) / best[0]
        yield "".join([f"{size:5}", *(f"{rate:12.0f}" for rate in best), f"{ratio:8.1f}"])


def peak(result: Result) -> Result:
    """What is kept of a replay."""
    return {"peak_degC": np.array(result["rtd_x_degC"].max())}


def plants() -> Plants:
    """Models that differ in their film, through one run of pulses."""
    t_s = np.arange(0.0, RUN_S, 0.01)
    i_A = np.zeros((t_s.size, 2))
    i_A[:, 0] = np.where(t_s % 8.0 < 3.0, 3.0, 0.0)
    duty = np.zeros((t_s.size, 2))
    duty[:, 0] = np.where(t_s % 8.0 > 4.0, 1.0, 0.0)
    a = load_parameters("A")
    models = [
        Model(a.replace(film_scale=scale), "extended", {}, "A")
        for scale in np.linspace(0.7, 1.3, MODELS).tolist()
    ]
    return Plants(
        models=models,
        runs=[Inputs(t_s=t_s, i_A=i_A, pump_duty=duty)],
        outputs=("rtd_x_degC",),
        keep=peak,
    )


@contextmanager
def dask_executor() -> Iterator[Executor]:
    """Two worker processes of one thread each, on this machine."""
    import distributed

    make: Any = distributed.Client

    with make(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster.get_executor()


def table_of_replays() -> Iterator[str]:
    """Lines: what carries the replays out, replays a second, ratio to the loop."""
    many = plants()
    ways: dict[str, Callable[[], Any]] = {
        "a loop": nullcontext,
        "two threads": lambda: ThreadPoolExecutor(2),
        "two processes": lambda: ProcessPoolExecutor(2, get_context("spawn")),
        "dask, two workers": dask_executor,
    }
    yield f"{'':20}{'replays/s':>12}{'ratio':>8}   replays of {RUN_S:.0f} s at 100 Hz"
    loop = 0.0
    for name, way in ways.items():
        with way() as executor:
            many.replay(executor)
            rates = []
            for _ in range(TURNS):
                start_s = time.perf_counter()
                many.replay(executor)
                rates.append(many.size / (time.perf_counter() - start_s))
        loop = loop or max(rates)
        yield f"{name:20}{max(rates):12.0f}{max(rates) / loop:8.2f}"


def main() -> None:
    """Print both tables."""
    print(f"processors: {os.cpu_count()}, load {os.getloadavg()[0]:.1f}; best of {TURNS} turns\n")
    for line in table_of_steps():
        print(line, flush=True)
    print()
    for line in table_of_replays():
        print(line, flush=True)


if __name__ == "__main__":
    main()
