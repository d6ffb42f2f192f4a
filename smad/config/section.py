"""What every table of the configuration is, and what the host may ask of a board."""

from typing import Any

from msgspec import Meta, Struct

from firmware_protocol.supervisor.host import host_limits
from firmware_protocol.supervisor.limits import compiled_limits

HOST = host_limits(compiled_limits())
"""What the host may ask of a board that nobody tightened; a tightened one is asked at arming."""


def about(description: str) -> Meta:
    """What a key is for: its line in the commented default file."""
    return Meta(description=description)


def between(least: Any, most: Any, description: str) -> Meta:
    """The same of a number, with both bounds."""
    return Meta(ge=least, le=most, description=description)


def above(least: Any, most: Any, description: str) -> Meta:
    """The same of a number that must not be the least itself."""
    return Meta(gt=least, le=most, description=description)


class Section(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of the configuration file."""

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if isinstance(value, str) and "\0" in value:
                raise ValueError(f"`{name}` {value!r} contains a NUL character; leave it out")
