"""The line to the board, counted for some seconds: what was lost, and how late setpoints are."""

import time
from dataclasses import dataclass

from smad.api import Status
from smad.client.blocking import Client
from smad.counted import counted
from smad.errors import PortError
from smad.progress import Say

_ERRORS = ("crc_errors", "cobs_errors", "length_errors", "payload_errors")
_PERCENTILES_S = 1.1
"""A little more than the second after which the daemon works them out anew."""


@dataclass(frozen=True)
class LinkCounts:
    """The status before and after `took_s`."""

    before: Status
    after: Status
    took_s: float

    def since(self, name: str) -> int:
        """How far a counter of `Status.counts` has come."""
        return int(getattr(self.after.counts, name) - getattr(self.before.counts, name))

    @property
    def damaged(self) -> int:
        """Frames from the board that could not be read."""
        before, after = self.before.link.frames, self.after.link.frames
        return sum(after.get(name, 0) - before.get(name, 0) for name in _ERRORS)

    def require_samples(self) -> None:
        """Raise PortError where no sample came."""
        if self.since("samples") == 0:
            raise PortError(
                "no sample came",
                value=f"link is {self.after.link.state}",
                limit=f"{self.after.link.rate_hz * self.took_s:.0f} in {self.took_s:.1f} s",
                action="check cable and power of the board; smad status says more",
            )

    def require_clean(self) -> None:
        """Raise PortError where anything was lost."""
        if lost := self.since("missed") + self.damaged + self.since("setpoints_dropped"):
            raise PortError(
                "the link is not clean",
                value=f"{lost} lost of {counted(self.since('samples'), 'sample')}",
                limit="0",
                action="try another cable or USB port, or a lower rate; see smad docs guide/daemon",
            )


def count_link(client: Client, duration_s: float, say: Say) -> LinkCounts:
    """Count for so long."""
    client.reset_timing()
    before = client.status()
    began_s = time.monotonic()
    while (left_s := began_s + duration_s - time.monotonic()) > 0:
        say(f"testing the link, {left_s:.0f} s to go")
        time.sleep(min(0.5, left_s))
    time.sleep(_PERCENTILES_S)
    return LinkCounts(before, client.status(), time.monotonic() - began_s)
