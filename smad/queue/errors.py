"""What goes wrong with a queue."""

from smad.errors import SmadError


class QueueError(SmadError):
    """The queue refused something; nothing was changed."""


class StoreError(QueueError):
    """The file of the queue cannot be read or written."""


class ArmingError(QueueError):
    """The queue cannot be armed as asked."""
