"""A daemon on virtual time (`campaign.virtual`) as the tests start, ask and hear it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from campaign import virtual
from campaign.virtual import Line, result_of
from sim_device.bench import SimulatedBench
from smad.config import Config, DaemonConfig, LinkConfig, RecorderConfig

T = TypeVar("T")
_PATIENCE_S = 300.0
_CONNECTED_S = 0.5
"""By then the daemon has read the parameters of every board, and their clocks agree."""


class Rig(virtual.Rig):
    """A bench and a daemon, with what tests ask of both."""

    async def connected(self) -> None:
        """Let board time pass until any axis can be armed."""
        await self.run_for(_CONNECTED_S)

    async def arm(self) -> None:
        """Connect and arm."""
        await self.connected()
        await self.ask("arm")

    @property
    def heard(self) -> list[str]:
        """Texts of all events, those of the run log alone included."""
        return [event.text for event in self.events]

    @property
    def said(self) -> str:
        """Everything in the journal."""
        return "\n".join(entry.text for entry in self.journal.recent)

    def pull_the_plug(self) -> None:
        """The port goes away, and stays away until `plug_in`."""
        self.lines[""].pull_the_plug()

    def plug_in(self) -> None:
        """The port can be opened again."""
        self.lines[""].plug_in()

    async def reopened(self) -> None:
        """Plug in, and wait until the daemon has opened the port."""
        self.plug_in()
        while self.axis.link.transport is None:
            await asyncio.sleep(0.01)

    async def wait_for(self, done: Awaitable[T]) -> T:
        """Wait for something that a thread does while board time stands still."""
        return await asyncio.wait_for(done, _PATIENCE_S)

    async def ask_still(self, method: str, **params: Any) -> Any:
        """Ask while board time stands still: what follows begins at the same sample every time."""
        return result_of(await self.wait_for(self.begin(method, **params)))


def config_in(folder: Path, **sections: Any) -> Config:
    """A configuration that writes into `folder` and reopens the port at once."""
    defaults: dict[str, Any] = {
        "link": LinkConfig(reconnect_interval_s=0.05),
        "recorder": RecorderConfig(folder=str(folder / "runs"), automatic=False),
        "daemon": DaemonConfig(ipc_dir=str(folder)),
    }
    return Config(**{**defaults, **sections})


@contextlib.asynccontextmanager
async def rig_in(
    folder: Path,
    bench: SimulatedBench | Mapping[str, Line] | None = None,
    *,
    without_missing: bool = False,
    nonce: int = 7,
    **sections: Any,
) -> AsyncIterator[Rig]:
    """A rig whose daemon is started, and closed at the end; `nonce` is of the daemon's start."""
    rig = Rig(config_in(folder, **sections), bench or SimulatedBench(seed=1), nonce)
    rig.daemon.start(without_missing=without_missing)
    try:
        yield rig
    finally:
        await rig.close()
