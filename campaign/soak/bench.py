"""`python -m campaign.soak.bench`: the simulated bench of the soak, in a process of its own.

It waits for its host also while not armed, so that a busy machine makes a soak slower and never
costs a sample. A line on standard input names a fault to begin with the next sample; the end of
the input ends it, and it prints how often the host did not answer.
"""

from __future__ import annotations

import sys
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from firmware_protocol import messages as wire
from sim_device.bench import SimulatedBench
from sim_device.faults import Injection, parse_injection
from sim_device.ports import PortCounts, PtyPort
from sim_device.pty import Server

READY = "ready"
_ARMED_WAIT_S = 10.0
_UNARMED_WAIT_S = 0.5
"""A host without a session answers no STATE; the board must go on for it to be greeted."""
_SILENT_PERIOD_S = 0.05
"""From one sample to the next then: a host that only got no turn of the processor misses none."""


class SoakBench(SimulatedBench):
    """A bench that takes injections from another thread."""

    def __init__(self, *, rate_hz: int, seed: int) -> None:
        self.arriving: deque[Injection] = deque()
        super().__init__(rate_hz=rate_hz, seed=seed)

    def advance(self) -> wire.State | None:
        """Advance by one sample; what arrived begins now."""
        while self.arriving:
            self.faults.add(replace(self.arriving.popleft(), at_us=self.now_us))
        return super().advance()


class PatientServer(Server):
    """Takes the next sample when the host has said something since the last one, armed or not.

    `answering` is whether it did last time: a host that is gone is waited for once.
    """

    def __init__(self, bench: SimulatedBench, symlink: Path, speed: float) -> None:
        self.line = PortCounts()
        self.unanswered = 0
        self._heard = -1
        self._answering = True
        super().__init__(
            bench,
            lambda: PtyPort(symlink, self.line),
            speed=speed,
            paced_by_host=True,
            host_timeout_s=_ARMED_WAIT_S,
        )

    def _waits_for_host(self) -> bool:
        if self.port is None or self.port.fileno() is None:
            return False
        if super()._waits_for_host():
            return True
        if self.line.bytes_in != self._heard:
            self._answering = True
            return False
        if not self._answering:
            return self._clock() < self._sampled_s + _SILENT_PERIOD_S
        if self._clock() < self._sampled_s + _UNARMED_WAIT_S:
            return True
        self._answering = False
        self.unanswered += 1
        return False

    def _sample(self) -> None:
        self._heard = self.line.bytes_in
        super()._sample()


def main(arguments: Sequence[str]) -> None:
    """Serve `RATE SEED SPEED SYMLINK` until the input ends."""
    rate, seed, speed, symlink = arguments
    SoakBench(rate_hz=100, seed=0).step()
    bench = SoakBench(rate_hz=int(rate), seed=int(seed))
    server = PatientServer(bench, Path(symlink), float(speed))
    print(READY, flush=True)
    threading.Thread(target=_listen, args=(bench, server), daemon=True).start()
    try:
        server.run()
    finally:
        server.close()
    print(
        f"{server.stats.samples} {server.stats.host_timeouts} {server.unanswered} "
        f"{server.line.dropped}",
        flush=True,
    )


def _listen(bench: SoakBench, server: PatientServer) -> None:
    for line in sys.stdin:
        bench.arriving.append(parse_injection(line.strip()))
    server.stop()


if __name__ == "__main__":
    main(sys.argv[1:])
