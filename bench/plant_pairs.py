"""The plant of this tree against that of another one, in interleaved pairs.

`python -m bench.plant_pairs OTHER` (a checkout of another commit) replays the same 60 s in both, by
turns, and prints the ratio of the processor times, and whether the results are the same to the last
bit. With `--zero` this tree's replay is given a forcing of zero everywhere.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parents[1]
_WORKER = """
import hashlib, sys, time
import numpy as np
from sim_device.plant import Inputs, Replay, load_parameters
n = 6001
t = np.arange(n) * 0.01
wave = 2.5 * np.sin(2 * np.pi * t / 7.0)
i = np.column_stack([np.maximum(wave, 0.0), np.maximum(-wave, 0.0)])
inputs = Inputs(t, i, np.ascontiguousarray(i[:, ::-1]) / 4.0)
names = ("rtd_x_degC", "rtd_y_degC", "displacement_m", "force_N", "v_x_V", "v_y_V")
options = {}
if sys.argv[1] == "zero":
    from sim_device.plant.places import SLOTS
    options = {"forcing": {key: np.zeros(n) for key in SLOTS}}
replay = Replay(inputs, outputs=names, **options)
setup = replay.setup(load_parameters("A"))
out = replay.run_setup(setup)
digest = hashlib.sha256(b"".join(out[name].tobytes() for name in names)).hexdigest()
print(digest, flush=True)
for _ in sys.stdin:
    start = time.process_time()
    replay.run_setup(setup)
    print(time.process_time() - start, flush=True)
"""


class Worker:
    """A process that replays in one tree when it is told to."""

    def __init__(self, tree: Path, how: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", _WORKER, how],
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.digest = self._line()

    def _line(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline().strip()
        if not line:
            raise SystemExit("a replay failed; see above")
        return line

    def seconds(self) -> float:
        """Processor time of one replay."""
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return float(self._line())

    def close(self) -> None:
        self.process.communicate()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="checkout of another commit")
    parser.add_argument("--pairs", type=int, default=60)
    parser.add_argument("--zero", action="store_true", help="force zero everywhere in this tree")
    given = parser.parse_args()
    other = Worker(given.other.resolve(), "plain")
    own = Worker(HERE, "zero" if given.zero else "plain")
    ratios = []
    for n in range(given.pairs):
        first, second = (own, other) if n % 2 else (other, own)
        one, two = first.seconds(), second.seconds()
        ratios.append(one / two if first is own else two / one)
    own.close()
    other.close()
    print(
        f"this tree to the other, {given.pairs} pairs: min {min(ratios):.3f},"
        f" median {median(ratios):.3f}, max {max(ratios):.3f}"
    )
    print("results are", "the same to the last bit" if own.digest == other.digest else "DIFFERENT")


if __name__ == "__main__":
    main()
