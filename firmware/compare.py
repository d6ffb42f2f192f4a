"""`python -m firmware.compare`: the Python board and the C firmware under the same stimulus.

The same random events (setpoints, commands, broken parts, damaged bytes, hangs, resets) and
the same readings go into both. After each sample everything they said and what their pins do must
be equal: every field of STATE, FAULT_REPORT and every answer, gate, currents and pumps. Left out
are what each makes up for itself (arming token, chip number, name, speed of its port) and how long
a write to the parameter memory takes.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from firmware.chip_twin import ChipTwins
from firmware.stimulus import Stimulus
from firmware.twin import Twins
from firmware_protocol.enums import Fault
from sim_device.errors import BenchError
from sim_device.firmware.build import build

KEPT = 12


@dataclass
class Verdict:
    """What came of a comparison; `differences` is empty when the boards agree."""

    events: Counter[str] = field(default_factory=Counter)
    ticks: int = 0
    states: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)
    differences: list[str] = field(default_factory=list)

    @property
    def total(self) -> int:
        """Number of events."""
        return sum(self.events.values())


def compare(port: str, events: int, seed: int) -> Verdict:
    """Give the Python board and the firmware of a port so many random events.

    Stops at the first difference. Raises BuildError and LinkError.
    """
    verdict = Verdict()
    latest: deque[str] = deque(maxlen=KEPT)
    with tempfile.TemporaryDirectory(prefix="smad-compare-") as folder:
        kind = ChipTwins if port == "avr" else Twins
        twins = kind(build(port), Path(folder), seed)
        try:
            stimulus = Stimulus(twins, random.Random(seed))
            verdict.events = stimulus.counts
            stimulus.begin()
            latched = 0
            while verdict.total < events and not verdict.differences:
                before = Counter(verdict.events)
                stimulus.tick()
                verdict.ticks += 1
                s = twins.python.outputs
                state = twins.python.state.name
                verdict.states[state] += 1
                if s.latched and not latched:
                    verdict.faults[Fault(s.first_fault).name] += 1
                latched = s.latched
                done = ", ".join((verdict.events - before).elements()) or "nothing"
                latest.append(f"  {twins.now_us} us, {state}: {done}")
                differing = twins.differences()
                if differing:
                    verdict.differences = [*differing, "before that:", *latest]
            verdict.differences = verdict.differences or twins.last_differences()
        finally:
            twins.close()
    return verdict


def report(verdict: Verdict) -> str:
    """Return the verdict as text."""
    lines = []
    for title, counts in (
        ("events", verdict.events),
        ("samples by state", verdict.states),
        ("first faults", verdict.faults),
    ):
        parts = ", ".join(f"{name} {count}" for name, count in counts.most_common())
        lines.append(f"{title}: {parts or 'none'}")
    if verdict.differences:
        lines += ["DIFFERENT:", *verdict.differences]
    else:
        lines.append(f"equal in all {verdict.ticks} samples over {verdict.total} events")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare; exit status 1 if the boards differ."""
    parser = argparse.ArgumentParser(
        prog="python -m firmware.compare",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--port", choices=("host", "avr"), default="host", help="avr is the emulated Mega (host)"
    )
    parser.add_argument("--events", type=int, default=10_000, help="random events (10000)")
    parser.add_argument("--seed", type=int, default=0, help="of everything random (0)")
    options = parser.parse_args(arguments)
    try:
        verdict = compare(options.port, options.events, options.seed)
    except BenchError as error:
        print(f"firmware.compare: {error}", file=sys.stderr)
        return 2
    print(report(verdict))
    return 1 if verdict.differences else 0


if __name__ == "__main__":
    raise SystemExit(main())
