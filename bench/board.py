"""What a simulated sample costs: `python -m bench.board`.

CPU time of this process, best of several rounds, so that a busy machine does not count.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

from firmware_protocol import messages as wire
from sim_device.bench import SimulatedBench

Row = tuple[str, float, str]

ROUNDS = 5
SAMPLES = 4000


def rows() -> list[Row]:
    """Return (name, value, unit) of each measurement."""
    typed_us = _best(_typed)
    return [
        ("supervisor: one sample, armed and heating", _best(_supervisor), "us"),
        ("board without plant and session: one sample", _best(_board), "us"),
        ("plant: advance one 100 Hz sample and read it", _best(_plant), "us"),
        ("whole bench, typed: one sample", typed_us, "us"),
        ("whole bench, bytes out: one sample", _best(_bytes), "us"),
        ("real-time factor at 100 Hz, typed", 10_000.0 / typed_us, "x"),
    ]


def _best(round_of: Callable[[], Callable[[int], None]]) -> float:
    """Return the least CPU time of a step, in µs."""
    best = math.inf
    for _ in range(ROUNDS):
        step = round_of()
        begin = time.process_time()
        for n in range(SAMPLES):
            step(n)
        best = min(best, time.process_time() - begin)
    return best / SAMPLES * 1e6


def _armed() -> SimulatedBench:
    bench = SimulatedBench(seed=1)
    bench.arm()
    bench.step_typed(None)
    return bench


def _answer(bench: SimulatedBench, n: int) -> wire.Setpoint:
    """A setpoint that heats one spring and flushes the other, in turn."""
    wave = math.sin(n * 0.01)
    pumps = (0, 255) if wave > 0 else (255, 0)
    currents = (round(900 * max(wave, 0.0)), round(900 * max(-wave, 0.0)))
    return wire.Setpoint(0, bench.board.now_us % (1 << 32), currents, pumps, 0, 100)


def _supervisor() -> Callable[[int], None]:
    bench = _armed()
    supervisor, now_us = bench.board.supervisor, bench.board.now_us
    warm = supervisor.measurements
    warm.i_mA[0], warm.applied_mA[0], warm.v_mV[0], warm.rtd_cC[0] = 800, 800, 608, 3700

    def step(n: int) -> None:
        warm.rtd_cC[0] ^= 1
        supervisor.sample(warm, now_us + (n + 1) * 10_000)
        supervisor.setpoint((800, 0), (0, 0), 0, 100_000, now_us + (n + 1) * 10_000)

    return step


def _board() -> Callable[[int], None]:
    bench = _armed()
    board, readings, start_us = bench.board, bench.plant.read(), bench.board.now_us

    def step(n: int) -> None:
        setpoint = wire.Setpoint(0, 0, (0, 0), (0, 0), 0, 100)
        board.apply_setpoint(setpoint, n & 0xFF, 0, board.now_us)
        board.sample(readings, start_us + (n + 1) * 10_000, talk=False)

    return step


def _plant() -> Callable[[int], None]:
    bench = _armed()
    plant, drive = bench.plant, bench.drive()

    def step(n: int) -> None:
        plant.advance(drive, 0.01)
        plant.read()

    return step


def _typed() -> Callable[[int], None]:
    bench = _armed()

    def step(n: int) -> None:
        bench.step_typed(_answer(bench, n))

    return step


def _bytes() -> Callable[[int], None]:
    bench = SimulatedBench(seed=1)

    def step(n: int) -> None:
        bench.step()

    return step


def main() -> int:
    """Print the rows."""
    for name, value, unit in rows():
        print(f"{name:<48} {value:>8.1f} {unit}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
