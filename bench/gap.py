"""How long a diagnosis takes, and how that grows: rows for the benchmark report.

`python -m bench.gap` prints them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from smad.diagnosis.plant import ModelPoint, PlantModel
    from smad.diagnosis.runs import GapRun
    from smad.diagnosis.spring_pair import SmaPlant

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

RUN_S = 75.0
CANDIDATES = 25
RUNS = 6


@dataclass(frozen=True)
class Row:
    """One result. `ratio` compares with what `name` says; NaN without comparison."""

    name: str
    value: float
    unit: str
    ratio: float = float("nan")


def rows() -> list[Row]:
    """All measurements; about three minutes on two free cores."""
    from smad.diagnosis.plant import ModelPoint
    from smad.diagnosis.spring_pair import SmaPlant

    plant = SmaPlant()
    names = tuple(e.name for e in plant.effects)
    theta = {"flow_max": 0.93 * plant.parameter_set["flow_max"]}
    bench = ModelPoint(theta, {"rtd_lag": {"tau_s": 0.4}})
    runs = _runs(plant, bench)
    some = replace(plant, only=("rtd_lag", *[n for n in names if n != "rtd_lag"][: CANDIDATES - 1]))
    _seconds(some, [r.part(0, 1500) for r in runs[:2]])
    whole, evaluations, cpu = _seconds(some, runs)
    # Beginnings as long as those that tell how coarse replays may be: the pace stays the same.
    shorter, _, _ = _seconds(some, [r.part(0, 2 * len(r.t_s) // 3) for r in runs])
    fewer, _, _ = _seconds(replace(some, only=some.only[:13] if some.only else None), runs)
    quick_s, exact_s, even_s, solver = _replay_s(some, runs[0])
    return [
        Row(f"diagnosis, {RUNS} runs of {RUN_S:g} s, {CANDIDATES} candidates", whole, "s"),
        Row("  processor time of it", cpu, "s"),
        Row("  replays of one run in it", float(evaluations), "1"),
        Row("  peak memory of the process", _peak_MB(), "MB"),
        Row("runs of 50 s (ratio to whole; linear is 0.67)", shorter, "s", shorter / whole),
        Row("13 of 25 candidates (ratio to whole; linear is 0.5)", fewer, "s", fewer / whole),
        Row("one replay of averaged inputs of one run", 1e3 * quick_s, "ms"),
        Row("one exact replay (ratio to averaged)", 1e3 * exact_s, "ms", exact_s / quick_s),
        Row("  the same in even steps", 1e3 * even_s, "ms", even_s / exact_s),
        Row("same replays by solve_ivp, estimated", solver * evaluations, "s", solver / quick_s),
    ]


def _runs(plant: SmaPlant, bench: ModelPoint) -> list[GapRun]:
    """What sensors show of a bench that plays the check-up's first runs.

    Those inputs are a file: runs of the controller would be other work whenever it is tuned.
    """
    import numpy as np

    from smad.checkup.programme import shipped

    rng = np.random.default_rng(27)
    out = []
    for played in shipped().runs[:RUNS]:
        run = played.as_run(inlet_degC=22.0, ambient_degC=23.0)
        true = plant.simulate(bench, run)
        shown = {}
        for c in plant.channels:
            y = true[c.name] + c.noise * rng.standard_normal(len(run.t_s))
            shown[c.name] = np.round(y / c.quantum) * c.quantum
        out.append(run.with_columns(outputs=shown))
    return out


def _seconds(plant: SmaPlant, runs: Sequence[GapRun]) -> tuple[float, int, float]:
    """Wall seconds, replays and processor seconds of one diagnosis."""
    from smad.diagnosis import diagnose

    counted = _Counting(plant)
    began, cpu = time.perf_counter(), time.process_time()
    diagnose(runs, plant=cast("PlantModel", counted))
    return time.perf_counter() - began, counted.count, time.process_time() - cpu


class _Counting:
    """A plant that counts its replays."""

    def __init__(self, plant: SmaPlant) -> None:
        self._plant, self.count = plant, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def simulate(self, *args: Any, **options: Any) -> dict[str, Any]:
        self.count += 1
        return self._plant.simulate(*args, **options)

    def forced(self, *args: Any, **options: Any) -> dict[str, Any]:
        self.count += 1
        return self._plant.forced(*args, **options)


def _replay_s(plant: SmaPlant, run: GapRun) -> tuple[float, float, float, float]:
    """Processor seconds of one replay: of averaged inputs, exact, exact in even steps, and by
    solve_ivp."""
    import numpy as np

    from bench.reference import Reference
    from sim_device.plant.replay import Replay
    from smad.diagnosis.data.grid import PERIOD_S
    from smad.diagnosis.data.played import Played
    from smad.diagnosis.plant import ModelPoint
    from smad.diagnosis.spring_pair.replays import GivenPoint, GivenRun
    from smad.diagnosis.spring_pair.steps import STEP_S

    averaged = Played.of(run, plant.inputs, period_s=PERIOD_S).run
    given = GivenPoint(plant, ModelPoint({}))
    samples = Replay(GivenRun(run).inputs(given), variant=plant.variant)
    drives = np.column_stack(
        [averaged.inputs[n] for n in ("i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y")]
    )
    reference = Reference.make(plant.parameter_set)
    return (
        _least_s(lambda: plant.simulate(ModelPoint({}), averaged, fast=True)),
        _least_s(lambda: plant.simulate(ModelPoint({}), run)),
        _least_s(lambda: samples.run_setup(given.setup, dt_s=STEP_S)),
        _least_s(lambda: reference.solve(averaged.t_s, drives, rtol=1e-5, atol=1e-7), times=2),
    )


def _least_s(call: Callable[[], object], times: int = 5) -> float:
    """Least processor seconds of some calls, after one that does not count."""
    call()
    return min(_timed(call) for _ in range(times))


def _timed(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def _peak_MB() -> float:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


if __name__ == "__main__":
    for row in rows():
        ratio = "" if row.ratio != row.ratio else f"   ×{row.ratio:.3g}"
        print(f"{row.name:<58} {row.value:>9.1f} {row.unit}{ratio}")
