"""Software of a shape-memory-alloy bench: daemon, clients, run logs, experiments, diagnosis.

`smad.Client` and `smad.AsyncClient` command a running daemon, `smad.read_run` reads a run log,
`with smad.simulated() as bench:` is a simulated bench with its client.
"""

from typing import TYPE_CHECKING, Any

from smad.version import VERSION

if TYPE_CHECKING:
    from smad.client import AsyncClient, Client
    from smad.processes.simulated import simulated
    from smad.runlog.reader import read_run

__version__ = VERSION
__all__ = ["AsyncClient", "Client", "__version__", "read_run", "simulated"]
_HOMES = {
    "AsyncClient": "smad.client",
    "Client": "smad.client",
    "read_run": "smad.runlog.reader",
    "simulated": "smad.processes.simulated",
}


def __getattr__(name: str) -> Any:
    # The physics and the diagnosis import this package too, and need no sockets.
    if name in _HOMES:
        from smad.extras import part

        return getattr(part(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
