"""What the process gives its daemon."""

import asyncio
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field

import zmq

from smad.config import Config
from smad.daemon.journal import Journal
from smad.daemon.notify import Notifier
from smad.daemon.services import Clocks
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.trace import Trace


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a daemon is run.

    `reread` reads the configuration file again, if there is one: on SIGHUP, for the list of keys.
    `parameter_text` marks a simulated bench. `check_baud` off: the transport has no baud rate.
    `trace` is for a benchmark: every step's time, saved at the end. `patience` multiplies how long
    a silent board is waited for (`HostSession`). `without_missing`: start when some board answers.
    """

    parameter_text: str | None = None
    reread: Callable[[], Config] | None = None
    check_baud: bool = True
    trace: Trace | None = None
    patience: int = 1
    without_missing: bool = False


@dataclass(frozen=True)
class Process:
    """What the process gives its daemon.

    `nonce` tells the board's answers to this daemon from those to an earlier one. `reserve` is a
    block in which descriptors of the reserve may be used.
    """

    loop: asyncio.AbstractEventLoop
    context: zmq.Context[zmq.Socket[bytes]]
    journal: Journal
    notifier: Notifier
    nonce: int
    reserve: Reserve = nullcontext
    options: Options = Options()
    clocks: Clocks = field(default_factory=Clocks)
