"""A queue of commands that outlives terminals, kills and power losses.

`Queue` is what clients use; `runner` carries the items out; `machine` decides, without any I/O.
"""

from smad.queue.errors import QueueError
from smad.queue.queue import Queue
from smad.queue.states import Budget

__all__ = ["Budget", "Queue", "QueueError"]
