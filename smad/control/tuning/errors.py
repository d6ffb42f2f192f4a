"""Why a bench cannot be tuned."""

from smad.errors import SmadError


class TuningError(SmadError):
    """The bench cannot be tuned: what was seen, what would be needed, what to do."""
