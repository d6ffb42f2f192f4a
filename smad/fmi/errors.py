"""The errors of what goes out to FMI and comes in from it."""

from smad.errors import SmadError


class FmiError(SmadError):
    """A unit cannot be written, opened or run, or does not fit what it was mapped to."""
