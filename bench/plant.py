"""What the plant costs, each figure beside one measured in the same run.

`python -m bench.plant` prints the table; `rows()` returns it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.reference import Reference
from sim_device.plant.models import Model
from sim_device.plant.parameters import ParameterSet, load_parameters
from sim_device.plant.plant import Plant
from sim_device.plant.plants import Plants, Result
from sim_device.plant.records import Drive
from sim_device.plant.replay import Inputs, Replay, simulate

Array = npt.NDArray[np.float64]
# What a controller can see of a difference: one standard deviation of a sensor's noise and one step
# of its converter, of RTD, encoder and force sensor.
VISIBLE_K, VISIBLE_M, VISIBLE_N = 0.02 + 0.01, 2e-6 + 1e-6, 2e-3 + 1e-3
RUN_S = 60.0
SETS = 1000


@dataclass(frozen=True)
class Row:
    """One figure: its value, and the ratio to what it is measured against, if there is one."""

    name: str
    value: float
    unit: str
    ratio: float | None = None
    against: str = ""


def best_of(
    repeats: int,
    task: Callable[[], object],
    clock: Callable[[], float] = time.process_time,
) -> float:
    """Shortest time of several runs, s. Processor time, which a busy machine disturbs less."""
    shortest = float("inf")
    for _ in range(repeats):
        start = clock()
        task()
        shortest = min(shortest, clock() - start)
    return shortest


def tracking(seconds: float) -> Inputs:
    """Recorded inputs of PI control at 100 Hz following 2 mm in 7 s, water cooled."""
    plant = Plant(load_parameters("A"), seed=1)
    n = int(seconds * 100)
    rows = np.zeros((n, 4))
    total = 0.0
    for sample in range(1, n):
        wanted = 2e-3 * np.sin(2 * np.pi * sample * 0.01 / 7.0)
        miss = wanted - plant.read().displacement_m
        total = min(4.0, max(-4.0, total + 30.0 * miss))
        u = min(4.0, max(-4.0, 15e3 * miss + total))
        duty = abs(u) / 4.0
        rows[sample] = (max(u, 0.0), max(-u, 0.0), duty * (u < 0), duty * (u > 0))
        drive = Drive(i_A=(rows[sample, 0], rows[sample, 1]), pump_duty=tuple(rows[sample, 2:]))
        plant.advance(drive, 0.01)
    times = np.arange(n, dtype=np.float64) * 0.01
    return Inputs(times, rows[:, :2], rows[:, 2:])


def kernel_row(inputs: Inputs) -> Row:
    """60 s of the pair at 1 ms; ratio: model time to wall time."""
    replay = Replay(inputs, outputs=("displacement_m", "force_N"))
    parameters = load_parameters("A")
    replay.run(parameters)
    spent = best_of(15, lambda: replay.run(parameters))
    seconds = float(inputs.t_s[-1])
    return Row(
        f"replay of {seconds:.0f} s at 1 ms", spent * 1e3, "ms", seconds / spent, "real time"
    )


def advance_rows() -> Iterator[Row]:
    """One `Plant.advance` of 10 ms at substeps of 1 ms, and one `Plant.read`."""
    plant = Plant(load_parameters("A"))
    drives = [Drive(i_A=(1.0 + 0.1 * n, 0.0)) for n in range(4)]

    def advance() -> None:
        for n in range(1000):
            plant.advance(drives[n % 4], 0.01)

    def read() -> None:
        for _ in range(1000):
            plant.read()

    advance()
    yield Row("Plant.advance(10 ms)", best_of(7, advance) * 1e3, "us")
    yield Row("Plant.read()", best_of(7, read) * 1e3, "us")


def visible(exact: Array, got: dict[str, Array], reference: Reference) -> bool:
    """Whether a controller could see the difference to the exact solution."""
    return bool(
        np.abs(got["T_x_K"] - exact[0]).max() > VISIBLE_K
        or np.abs(got["displacement_m"] - reference.displacement(exact)).max() > VISIBLE_M
        or np.abs(got["force_N"] - reference.force(exact)).max() > VISIBLE_N
    )


def solver_rows(inputs: Inputs, label: str) -> Iterator[Row]:
    """Kernel and LSODA, each at the cheapest setting whose error a controller cannot see.

    LSODA has its right side compiled too. It starts anew at each change of the inputs, as it must.
    """
    parameters = load_parameters("A")
    reference = Reference.make(parameters)
    times, drives = inputs.t_s, inputs.rows[:, :4]
    exact = reference.solve(times, drives, rtol=1e-8, atol=1e-11, max_step=0.01)

    def by_kernel(step_s: float) -> dict[str, Array]:
        names = ("T_x_K", "displacement_m", "force_N")
        return simulate(parameters, inputs, dt_s=step_s, outputs=names)

    def by_lsoda(rtol: float) -> dict[str, Array]:
        y = reference.solve(times, drives, rtol=rtol, atol=rtol * 1e-2)
        moved = {"displacement_m": reference.displacement(y), "force_N": reference.force(y)}
        return {"T_x_K": y[0], **moved}

    def good(run: Callable[[float], dict[str, Array]], setting: float) -> bool:
        try:
            return not visible(exact, run(setting), reference)
        except (ValueError, RuntimeError):
            return False  # LSODA with a loose tolerance can leave the region where ξ has a meaning

    step_s = next((h for h in (10e-3, 5e-3, 2e-3, 1e-3, 5e-4) if good(by_kernel, h)), 2e-4)
    rtol = next((r for r in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7) if good(by_lsoda, r)), 1e-8)
    kernel = best_of(15, lambda: by_kernel(step_s))
    lsoda = best_of(3, lambda: by_lsoda(rtol))
    yield Row(f"{label}: LSODA, rtol {rtol:.0e}", lsoda * 1e3, "ms")
    yield Row(f"{label}: kernel, {step_s * 1e3:g} ms", kernel * 1e3, "ms", lsoda / kernel, "LSODA")


def legs(seconds: float) -> Inputs:
    """Currents and pumps held for seconds at a time: the kindest case for an adaptive solver."""
    t = np.arange(int(seconds * 100), dtype=np.float64) * 0.01
    phase_x, phase_y = t % 16.0, (t + 8.0) % 16.0
    late = t > 6.0
    i_A = np.zeros((t.size, 2))
    duty = np.zeros((t.size, 2))
    i_A[(phase_x < 5.0) & (t > 0), 0] = 3.6
    i_A[(phase_y < 5.0) & late, 1] = 3.6
    duty[(phase_x > 5.5) & (phase_x < 14.0), 0] = 0.8
    duty[(phase_y > 5.5) & late, 1] = 0.8
    return Inputs(t, i_A, duty)


def _end(result: Result) -> Result:
    return {"end_m": result["displacement_m"][-1:]}


def parallel_rows(inputs: Inputs, sets: int) -> Iterator[Row]:
    """Many parameter sets on one thread and on two; ratio: how much faster two are."""
    a = load_parameters("A")
    many = Plants(
        models=[
            Model(a.replace(resistivity=(0.6 + 0.4 * n / sets) * 1e-6), "extended", {}, "A")
            for n in range(sets)
        ],
        runs=[inputs],
        outputs=("displacement_m",),
        keep=_end,
        chunk=max(1, sets // 8),
    )
    with ThreadPoolExecutor(2) as threads:
        many.replay(threads)
        seconds = best_of(2, many.replay, time.perf_counter)
        two = best_of(2, lambda: many.replay(threads), time.perf_counter)
    span = float(inputs.t_s[-1])
    yield Row(f"{sets} sets of {span:.0f} s, one thread", seconds, "s")
    yield Row(f"{sets} sets of {span:.0f} s, two threads", two, "s", seconds / two, "one thread")


_PLAIN = """
import time
from sim_device.plant import load_parameters, simulate
from bench.plant import legs
inputs = legs(0.5)
start = time.process_time()
simulate(load_parameters("A"), inputs)
print(time.process_time() - start)
"""


# Transformations that overlap (M_S above A_S, by far), with five cells and unified_kinetics: what
# fits may come by, and where plain Newton steps go to and fro between two branches.
LAWS = {
    "unified_kinetics": {"on": 1.0, "tails": 0.5},
    "cooling_front": {"share": 0.5, "place": 0.5},
}
OVERLAPPING: dict[str, dict[str, float]] = {
    "narrow heating range": {
        "austenite_start": 299.7, "austenite_finish": 300.2, "martensite_start": 304.1,
        "martensite_finish": 292.5, "latent_heating": 22130.0, "latent_cooling": 14660.0,
    },
    "wide cooling range": {
        "austenite_start": 302.0, "austenite_finish": 303.4, "martensite_start": 308.0,
        "martensite_finish": 296.6, "slope_austenite": 6.88e6, "slope_martensite": 3.64e6,
    },
    "cooling range above the heating range": {
        "austenite_start": 300.2, "austenite_finish": 303.5, "martensite_start": 310.2,
        "martensite_finish": 307.2, "slope_martensite": 3.56e6, "latent_heating": 17770.0,
    },
}  # fmt: skip


def overlapping(name: str | None) -> ParameterSet:
    """Set A, or with the transformations of one of OVERLAPPING."""
    return load_parameters("A").replace(**(OVERLAPPING[name] if name else {}))


def thinned(inputs: Inputs, every: int) -> Inputs:
    """Every so many samples of inputs."""
    return Inputs(inputs.t_s[::every], inputs.i_A[::every], inputs.pump_duty[::every])


def evaluations_per_substep(name: str | None, every: int) -> float:
    """Evaluations of the kinetics of one cell in a substep of `every` 10 ms, over 60 s of legs."""
    inputs = thinned(legs(RUN_S), every)
    out = simulate(
        overlapping(name), inputs, effects=LAWS, dt_s=1.0, outputs=("kinetics_evaluations",)
    )
    return float(out["kinetics_evaluations"][-1]) / (inputs.t_s.size - 1)


def overlap_rows() -> Iterator[Row]:
    """60 s where transformations overlap, five cells, 10 ms; ratio: to set A's transformations."""
    replay = Replay(legs(RUN_S), outputs=("displacement_m",))

    def spent(name: str | None) -> float:
        parameters = overlapping(name)
        return best_of(7, lambda: replay.run(parameters, LAWS, dt_s=0.01))

    usual = spent(None)
    for name in OVERLAPPING:
        took = spent(name)
        yield Row(f"five cells, {name}", took * 1e3, "ms", took / usual, "set A")


def plain_row() -> Row:
    """0.5 s of the pair at 1 ms in plain Python; ratio: how much faster compiled code is."""
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", _PLAIN],
        cwd=Path(__file__).resolve().parents[1],
        env=env,
        capture_output=True,
        text=True,
        check=True,
    )
    plain = float(done.stdout)
    inputs, parameters = legs(0.5), load_parameters("A")
    compiled = best_of(15, lambda: simulate(parameters, inputs))
    return Row("0.5 s at 1 ms in plain Python", plain * 1e3, "ms", plain / compiled, "compiled")


def rows(sets: int = SETS) -> list[Row]:
    """All figures of the plant. Takes about a minute and a half on two free cores."""
    inputs = tracking(RUN_S)
    short = Inputs(inputs.t_s[:1000], inputs.i_A[:1000], inputs.pump_duty[:1000])
    return [
        kernel_row(inputs),
        *advance_rows(),
        *overlap_rows(),
        *solver_rows(legs(RUN_S), "60 s of long legs"),
        *solver_rows(short, "10 s of 100 Hz control"),
        plain_row(),
        *parallel_rows(short, sets),
    ]


def table(rows: list[Row]) -> str:
    """The rows as text."""
    lines = [f"{'':44}{'value':>12}  {'':6}{'ratio':>8}"]
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:8.1f} x {row.against}"
        lines.append(f"{row.name:44}{row.value:12.3f}  {row.unit:6}{ratio}")
    return "\n".join(lines)


def main() -> int:
    print(table(rows()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
