"""What the process gives its daemon."""

from __future__ import annotations

import asyncio
from contextlib import nullcontext
from dataclasses import dataclass, field

import zmq

from smad.daemon.journal import Journal
from smad.daemon.means import Clocks
from smad.daemon.notify import Notifier
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.trace import Trace


@dataclass(frozen=True)
class Process:
    """What the process gives its daemon.

    `nonce` tells the board's answers to this daemon from those to an earlier one. `reserve` is a
    block in which descriptors of the reserve may be used. `parameter_text` is the parameter file
    of a simulated bench, None on a real one. `patience` is that of the session with the board.
    """

    loop: asyncio.AbstractEventLoop
    context: zmq.Context[zmq.Socket[bytes]]
    journal: Journal
    notifier: Notifier
    nonce: int
    reserve: Reserve = nullcontext
    parameter_text: str | None = None
    patience: int = 1
    trace: Trace | None = None
    clocks: Clocks = field(default_factory=Clocks)
