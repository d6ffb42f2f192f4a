"""The generated C's door for setpoints as a program, asked one setpoint at a time."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.firmware_protocol.c_peer import COMPILER, FLAGS, FOLDER

__all__ = ["COMPILER", "CGate", "Gate", "build", "random_setpoints"]

Gate = Callable[[int, int, int], int | None]
"""`gate(t_ref_us, seq, now_us)`: the age of a setpoint that passes, None for one that does not."""

_WRAP = 1 << 32
_MAIN = """\
#include "smad_protocol.h"
#include <inttypes.h>
#include <stdio.h>

int main(void)
{
    static struct smad_setpoint_gate gate;
    uint32_t t_ref_us;
    unsigned seq;
    int64_t now_us;
    while (scanf("%" SCNu32 " %u %" SCNd64, &t_ref_us, &seq, &now_us) == 3) {
        printf("%" PRId64 "\\n", smad_setpoint_gate_admit(&gate, t_ref_us, (uint8_t)seq, now_us));
        fflush(stdout);
    }
    return 0;
}
"""


def build(folder: Path) -> Path:
    """Compile codec and program; return the program."""
    source, program = folder / "gate.c", folder / "gate"
    source.write_text(_MAIN)
    command = [str(COMPILER), *FLAGS, f"-I{FOLDER}", str(source), str(FOLDER / "smad_protocol.c")]
    subprocess.run([*command, "-o", str(program)], check=True, capture_output=True, text=True)
    return program


class CGate:
    """The running program."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen(
            [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def admit(self, t_ref_us: int, seq: int, now_us: int) -> int | None:
        """Ask for one setpoint."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{t_ref_us % _WRAP} {seq} {now_us}\n")
        self._process.stdin.flush()
        age_us = int(self._process.stdout.readline())
        return None if age_us < 0 else age_us

    def close(self) -> int:
        """End the program; return its status (the sanitizers make it non-zero)."""
        self._process.communicate("")
        return self._process.returncode


def random_setpoints(seed: int, count: int) -> Iterator[tuple[int, int, int]]:
    """Yield (t_ref_us, seq, now_us): mostly in order, with copies, late ones and long pauses."""
    rng = random.Random(seed)
    now_us, seq, t_ref_us = rng.randrange(1 << 40), 0, 0
    for _ in range(count):
        now_us += rng.choice((0, 2000, 10_000, 10_000, rng.randrange(1 << 34)))
        kind = rng.random()
        if kind < 0.6:
            seq, t_ref_us = (seq + 1) & 0xFF, now_us - rng.randrange(60_000)
        elif kind < 0.8:
            seq = (seq + rng.choice((0, 1, 127, 128, 255))) & 0xFF
        else:
            t_ref_us = rng.randrange(_WRAP)
        yield t_ref_us, seq, now_us
