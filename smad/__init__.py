"""Software of a shape-memory-alloy bench: daemon, clients, run logs, experiments, diagnosis.

`smad.Client` and `smad.AsyncClient` command a running daemon.
"""

from typing import TYPE_CHECKING, Any

from smad.version import VERSION

if TYPE_CHECKING:
    from smad.client import AsyncClient, Client

__version__ = VERSION
__all__ = ["AsyncClient", "Client", "__version__"]


def __getattr__(name: str) -> Any:
    # The physics and the diagnosis import this package too, and need no sockets.
    if name in ("AsyncClient", "Client"):
        import smad.client

        return getattr(smad.client, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
