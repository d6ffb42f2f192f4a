"""What the plant costs in two states of the code, measured in turn so that the machine is the same.

python tools/plant_pairs.py OLD NEW [ROUNDS]    OLD, NEW: folders with a checkout each

Each case runs once in either state, ROUNDS times (31 by default), in turn. Printed are the median
of the processor time in OLD and in NEW, and the median of the ratio new to old within a round.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

ROUNDS = 31


def tasks() -> dict[str, Callable[[], object]]:
    """What is measured, by name. Only the public interface of the plant is used."""
    import numpy as np

    from sim_device.plant import Drive, Inputs, Plant, Replay, load_parameters
    from sim_device.plant.effects import EFFECTS

    A = load_parameters("A")
    sets = [A.replace(resistivity=(0.6 + 0.01 * n) * 1e-6) for n in range(20)]
    t = np.arange(6000) * 0.01
    phase_x, phase_y = t % 16.0, (t + 8.0) % 16.0
    i_A = 3.2 * np.column_stack([phase_x < 5.0, (phase_y < 5.0) & (t > 6.0)])
    duty = 0.8 * np.column_stack([(phase_x > 5.5) & (phase_x < 14.0), (phase_y > 5.5) & (t > 6.0)])
    inputs = Inputs(t, i_A, duty)
    rough = Inputs(t[::10], i_A[::10], duty[::10])
    unified = {"unified_kinetics": {"on": 1.0, "tails": 0.4}}
    laws = unified | {"cooling_front": {"share": 0.8, "place": 0.5}}
    every = {entry.name: {} for entry in EFFECTS if entry.name != "water_warming"}
    temperature = {"temperature_K": np.column_stack([300 + 20 * np.sin(t / 5) ** 2] * 2)}
    plant, drives = Plant(A), [Drive(i_A=(1.0 + 0.1 * n, 0.0)) for n in range(4)]

    def replayed(given: Inputs, effects: object, dt_s: float, times: int, **options: object):  # type: ignore[no-untyped-def]
        run = Replay(given, **options)

        def task() -> None:
            for n in range(times):
                run.run(sets[n], effects, dt_s=dt_s)

        return task

    def advance() -> None:
        for n in range(2000):
            plant.advance(drives[n % 4], 0.01)

    def read() -> None:
        for _ in range(5000):
            plant.read()

    return {
        "replay of 60 s at 1 ms": replayed(inputs, {}, 1e-3, 3),
        "replay of 60 s at 10 ms": replayed(inputs, {}, 1e-2, 10),
        "replay of 60 s at 100 ms, two outputs": replayed(
            rough, {}, 0.1, 20, outputs=("rtd_x_degC", "displacement_m")
        ),
        "unified_kinetics at 10 ms": replayed(inputs, unified, 1e-2, 5),
        "unified_kinetics, five cells at 10 ms": replayed(inputs, laws, 1e-2, 3),
        "unified_kinetics, five cells at 100 ms": replayed(rough, laws, 0.1, 20),
        "every effect at 10 ms": replayed(inputs, every, 1e-2, 1),
        "fed temperature at 10 ms": replayed(inputs, {}, 1e-2, 10, feeds=temperature),
        "blocked spring at 10 ms": replayed(inputs, {}, 1e-2, 10, fixture="blocked"),
        "2000 Plant.advance(10 ms)": advance,
        "5000 Plant.read()": read,
    }


def work() -> None:
    """A worker: a case a line in, its processor time in seconds out."""
    known = tasks()
    for task in known.values():
        task()
    print(*known, sep="\t", flush=True)
    for line in sys.stdin:
        start = time.process_time()
        known[line.rstrip("\n")]()
        print(time.process_time() - start, flush=True)


class Worker:
    """A process that measures in one checkout."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--work"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.names = self._line().split("\t")

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().rstrip("\n")

    def run(self, name: str) -> float:
        assert self._process.stdin is not None
        self._process.stdin.write(name + "\n")
        self._process.stdin.flush()
        return float(self._line())

    def close(self) -> None:
        self._process.communicate()


def import_s(folder: Path) -> float:
    """Processor time of a process that imports the plant and makes one, s."""
    code = "from sim_device.plant import Plant, load_parameters; Plant(load_parameters('A'))"
    before = sum(os.times()[2:4])
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, check=True)
    return sum(os.times()[2:4]) - before


def main(arguments: list[str]) -> int:
    if arguments == ["--work"]:
        work()
        return 0
    if len(arguments) not in {2, 3}:
        print(__doc__, file=sys.stderr)
        return 2
    old, new = (Path(folder).resolve() for folder in arguments[:2])
    rounds = int(arguments[2]) if arguments[2:] else ROUNDS
    workers = [Worker(old), Worker(new)]
    print(f"{'':42}{'old, ms':>10}{'new, ms':>10}{'new/old':>9}")
    for name in workers[1].names:
        pairs = [[worker.run(name) for worker in workers] for _ in range(rounds)]
        show(name, pairs)
    for worker in workers:
        worker.close()
    show("import, and one Plant", [[import_s(old), import_s(new)] for _ in range(5)])
    return 0


def show(name: str, pairs: list[list[float]]) -> None:
    one, other = (1e3 * median(column) for column in zip(*pairs, strict=True))
    ratio = median(b / a for a, b in pairs)
    print(f"{name:42}{one:10.2f}{other:10.2f}{ratio:9.3f}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
