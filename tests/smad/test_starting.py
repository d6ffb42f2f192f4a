"""A start may take as long as it works, and is given up when it does nothing."""

import subprocess
import sys
import time

from smad.processes.starting import LEAST_S, STALLED_S, StallDetector, processor_s


def stalled_at(used_s: dict[float, float]) -> float | None:
    """When a process whose processor time is as given, by the time it has it, counts as stalled."""
    now_s = 0.0

    def looked(pid: int) -> float:
        return max(s for at, s in used_s.items() if at <= now_s)

    stall = StallDetector(1, clock_s=lambda: now_s, used_s=looked)
    while now_s < 2000.0:
        now_s += 0.5
        if stall.stalled():
            return now_s
    return None


def test_a_process_that_works_slowly_is_waited_for() -> None:
    starved = {float(at): 0.02 * at for at in range(2001)}
    assert stalled_at(starved) is None


def test_a_process_that_only_looks_now_and_then_is_given_up() -> None:
    looks = {float(at): 2e-4 * at for at in range(2001)}
    at_s = stalled_at({0.0: 0.0, 30.0: 12.0} | {at: 12.0 + s for at, s in looks.items() if at > 30})
    assert at_s is not None
    assert 30.0 + STALLED_S < at_s < 35.0 + STALLED_S


def test_the_time_of_children_counts() -> None:
    spin = f"import time\nwhile time.process_time() < {1.2 * LEAST_S}: pass\n"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {spin!r}]); input()"
    child = subprocess.Popen([sys.executable, "-c", parent], stdin=subprocess.PIPE)
    try:
        assert child.stdin is not None
        while child.poll() is None and processor_s(child.pid) < LEAST_S:
            time.sleep(0.02)
        assert processor_s(child.pid) >= LEAST_S
    finally:
        child.communicate(b"\n", timeout=60)
