"""Every step's time, kept for a benchmark: when its sample was read, and how long the step took.

Pairs of 64-bit nanoseconds (the machine's monotonic clock), in memory until the end.
"""

from array import array
from pathlib import Path

CAPACITY = 1_000_000


class Trace:
    """Room for a million steps, made beforehand; later ones are left out."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._values = array("q", bytes(16 * CAPACITY))
        self._count = 0

    def add(self, read_ns: int, took_ns: int) -> None:
        """Note one step."""
        if self._count < CAPACITY:
            self._values[2 * self._count] = read_ns
            self._values[2 * self._count + 1] = took_ns
            self._count += 1

    def save(self) -> None:
        """Write the pairs to the file."""
        self._path.write_bytes(self._values[: 2 * self._count].tobytes())


def load(path: Path) -> list[tuple[int, int]]:
    """Return the pairs of a file."""
    values = array("q", path.read_bytes())
    return list(zip(values[::2], values[1::2], strict=True))
