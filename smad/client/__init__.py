"""Clients of the daemon: `Client` blocks (scripts, notebooks), `AsyncClient` is for asyncio.

Both have one method for each command of `smad.api`; their errors say what to do next.
"""

from typing import TYPE_CHECKING, Any

from smad.client.blocking import Client
from smad.client.errors import (
    BoardRefused,
    NoAnswer,
    NoDaemon,
    NotInControl,
    NotReady,
    Refused,
    Stopped,
)
from smad.client.wire import Keys

if TYPE_CHECKING:
    from smad.client.asynchronous import AsyncClient

__all__ = [
    "AsyncClient",
    "BoardRefused",
    "Client",
    "Keys",
    "NoAnswer",
    "NoDaemon",
    "NotInControl",
    "NotReady",
    "Refused",
    "Stopped",
]


def __getattr__(name: str) -> Any:
    # asyncio takes a third of the command line's start-up time, and a blocking client needs none.
    if name == "AsyncClient":
        from smad.client.asynchronous import AsyncClient

        return AsyncClient
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), "AsyncClient"})
