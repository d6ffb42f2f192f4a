"""What goes wrong with the record of a bench."""

from smad.errors import SmadError


class HealthError(SmadError):
    """The record cannot be read or written, or a file gives no row."""
