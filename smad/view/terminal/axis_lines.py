"""What each axis of a bench does, a line each. Pure."""

from collections.abc import Iterator, Mapping

from smad.api import AxisStatus, Motion, Percentiles
from smad.counted import counted

OLD_AFTER_S = 1.0
"""What is older is not shown as if it were of now."""


def axis_lines(axes: Mapping[str, AxisStatus], skew: Percentiles) -> Iterator[str]:
    """What each axis does, a line each, and how well motions begin together."""
    width = max(map(len, axes))
    for name, axis in axes.items():
        row, motion = axis.sample, axis.motion
        state = motion.mode if axis.link.state not in ("disconnected", "sync") else axis.link.state
        readings = "no readings yet"
        if row is not None:
            readings = (
                f"{number(row.displacement_mm, 2):>6} mm, {number(row.rtd_x_degC, 1)} and "
                f"{number(row.rtd_y_degC, 1)} °C{aged(motion)}"
            )
        fault = f", {motion.fault.in_words()}" if motion.fault else ""
        missed = axis.counts.missed
        yield (
            f"{name:<{width}} {state:<7} {readings}; {motion.in_words()}; "
            f"{axis.link.rate_hz} Hz, {missed} missed{fault}"
        )
    if skew.count:
        yield f"{counted(skew.count, 'simultaneous start')}, within {skew.max_us / 1000:.2f} ms"


def aged(motion: Motion) -> str:
    """Return how old the last readings are, to stand behind each; empty while samples come."""
    age_s = motion.sample_age_s
    return "" if age_s is None or age_s <= OLD_AFTER_S else f" ({age_s:.0f} s old)"


def number(value: float | None, digits: int) -> str:
    """Return a number with so many digits and no negative zero; a dash for one not known."""
    return "–" if value is None else f"{value:z.{digits}f}"
