"""The names of the axes of MINIR-II, for a bench that is simulated without a configuration."""

from __future__ import annotations

from msgspec.structs import replace

from smad.config.model import AxisConfig, Config
from smad.errors import ConfigError

USUAL_NAMES = ("pitch-1", "yaw-1", "pitch-2", "yaw-2", "pitch-3", "yaw-3")
"""Three segments, from the base to the tip, each with an axis for pitch and one for yaw."""


def with_axes(config: Config, count: int | None) -> Config:
    """Return the configuration with so many axes: the usual ones, or the first it has.

    None leaves it as it is, and so does 1 where it has none. Raises ConfigError when it has fewer.
    """
    if count is None or (count == 1 and not config.axes):
        return config
    axes = config.axes or tuple(AxisConfig(name=name) for name in USUAL_NAMES)
    if count > len(axes):
        raise ConfigError(
            "there are not so many axes in the configuration",
            value=count,
            limit=len(axes),
            action="add [[axes]] to it",
        )
    return replace(config, axes=axes[:count])
