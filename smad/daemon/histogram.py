"""A histogram of durations that costs one array increment a sample and never allocates.

Buckets are logarithmic with 32 steps to the octave, so a percentile is right within 2.2 percent.
"""

from array import array

from smad.api import Percentiles

_STEP_BITS = 5
_STEPS = 1 << _STEP_BITS
_OCTAVES = 40


class Histogram:
    """Durations in nanoseconds, 0 to 18 minutes; longer ones count as the longest."""

    __slots__ = ("_buckets", "_max_ns", "count")

    def __init__(self) -> None:
        self._buckets = array("Q", bytes(8 * _STEPS * _OCTAVES))
        self._max_ns = 0
        self.count = 0

    def add(self, duration_ns: int) -> None:
        """Count one duration; a negative one counts as zero."""
        if duration_ns < _STEPS:
            index = max(duration_ns, 0)
        else:
            shift = duration_ns.bit_length() - _STEP_BITS - 1
            index = (shift << _STEP_BITS) + (duration_ns >> shift)
            if index >= _STEPS * _OCTAVES:
                index = _STEPS * _OCTAVES - 1
        self._buckets[index] += 1
        self.count += 1
        self._max_ns = max(self._max_ns, duration_ns)

    def percentile_ns(self, fraction: float) -> float:
        """Return the middle of the bucket below which `fraction` of the samples lie; 0 if empty."""
        rank = fraction * self.count
        seen = 0
        for index, count in enumerate(self._buckets):
            seen += count
            if count and seen >= rank:
                return min(_middle_ns(index), float(self._max_ns))
        return 0.0

    def percentiles(self) -> Percentiles:
        """Return the usual percentiles."""
        return Percentiles(
            count=self.count,
            p50_us=self.percentile_ns(0.5) / 1e3,
            p99_us=self.percentile_ns(0.99) / 1e3,
            p999_us=self.percentile_ns(0.999) / 1e3,
            max_us=self._max_ns / 1e3,
        )

    def clear(self) -> None:
        """Forget everything."""
        for index in range(len(self._buckets)):
            self._buckets[index] = 0
        self._max_ns = 0
        self.count = 0


def _middle_ns(index: int) -> float:
    if index < _STEPS:
        return float(index)
    shift = (index >> _STEP_BITS) - 1
    low = ((index & (_STEPS - 1)) + _STEPS) << shift
    return low + (1 << shift) / 2
