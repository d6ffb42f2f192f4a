"""What a page may ask for, and the call of the ordinary client that each becomes.

The table is `COMMANDS`. A stop is not in it: it goes past everything that waits (`server`). What a
person asked for is refused by the daemon when a stop came that the page had not shown yet:
`generation` is the one that it showed.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from smad.client import AsyncClient, Refused
from smad.control.commands import Trajectory, Tune

LEASE_S = 10.0
"""A page that keeps control and goes away leaves a bench that is disarmed after so long."""
HOLDER = "live page"


class Ask(Struct, tag_field="do", frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Something a page asks for. `id` comes back with the reply."""

    id: int = 0
    generation: int | None = None


class Drawn(Ask, tag="drawn", frozen=True, kw_only=True):
    """A frame is on the screen: the next may come."""


class Alive(Ask, tag="alive", frozen=True, kw_only=True):
    """The status has arrived: the page is there, and so is who looks at it."""


class LookAt(Ask, tag="look_at", frozen=True, kw_only=True):
    """Show another window of time."""

    window: Annotated[int, Meta(ge=0, le=2)]


class Stop(Ask, tag="stop", frozen=True, kw_only=True):
    """Disarm, over the stop channel."""


class Arm(Ask, tag="arm", frozen=True, kw_only=True):
    """Arm; with `keep_control` nobody else commands, and a page that goes away disarms."""

    keep_control: bool = True


class Clear(Ask, tag="clear", frozen=True, kw_only=True):
    """Acknowledge the fault that the page showed."""

    fault: int


class Move(Ask, tag="move", frozen=True, kw_only=True):
    """Follow a trajectory."""

    trajectory: Trajectory
    queue: bool = False


class Rest(Ask, tag="idle", frozen=True, kw_only=True):
    """No current and no water, and stay armed."""


class Gains(Ask, tag="tune", frozen=True, kw_only=True):
    """Change gains."""

    tune: Tune


class Note(Ask, tag="note", frozen=True, kw_only=True):
    """Write into the run log."""

    text: Annotated[str, Meta(min_length=1, max_length=500)]


class Record(Ask, tag="record", frozen=True, kw_only=True):
    """Begin a run log."""

    name: Annotated[str, Meta(max_length=64)] = ""


class EndRecord(Ask, tag="end_record", frozen=True, kw_only=True):
    """Close the run log."""


Command = Arm | Clear | Move | Rest | Gains | Note | Record | EndRecord
Message = Drawn | Alive | LookAt | Stop | Command
WATCHING = (Drawn, Alive, LookAt, Stop)
"""What a page without the right to command may say: anybody may stop."""

decoder = msgspec.json.Decoder(Message)


class Control:
    """Exclusive control as one page has it: taken when it arms, renewed while it is there."""

    def __init__(self, client: AsyncClient) -> None:
        self._client = client
        self.held = False
        self.armed = False
        """Armed under it, and not yet seen to be stopped."""

    async def take(self) -> None:
        """Take or renew it. Raises NotInControl while somebody else has it."""
        await self._client.take_control(HOLDER, LEASE_S)
        self.held = True

    async def release(self) -> None:
        """Give it back, if this page has it."""
        if self.held:
            self.held = self.armed = False
            await self._client.release_control()


async def _arm(client: AsyncClient, control: Control, ask: Arm) -> str:
    if ask.keep_control:
        await control.take()
    try:
        await client.arm()
    except Refused:
        await control.release()
        raise
    control.armed = True
    return "armed: current flows from now on when you command it"


async def _clear(client: AsyncClient, control: Control, ask: Clear) -> str:
    await client.clear(ask.fault)
    return "the fault is cleared"


async def _move(client: AsyncClient, control: Control, ask: Move) -> str:
    await client.move(ask.trajectory, queue=ask.queue)
    name = type(ask.trajectory).__name__
    return f"{name}: {'queued' if ask.queue else 'begun'}"


async def _rest(client: AsyncClient, control: Control, ask: Rest) -> str:
    await client.idle()
    return "idle: no current, no water; still armed"


async def _tune(client: AsyncClient, control: Control, ask: Gains) -> str:
    await client.tune(ask.tune)
    fields = msgspec.to_builtins(ask.tune)
    changed = (
        f"{name} {fields[name]}" for name in ask.tune.__struct_fields__ if fields[name] is not None
    )
    return "set: " + (", ".join(changed) or "nothing")


async def _note(client: AsyncClient, control: Control, ask: Note) -> str:
    await client.note(ask.text)
    return f"noted in the run log: {ask.text}"


async def _record(client: AsyncClient, control: Control, ask: Record) -> str:
    return f"recording to {(await client.start_recording(ask.name)).path}"


async def _end_record(client: AsyncClient, control: Control, ask: EndRecord) -> str:
    ended = await client.stop_recording()
    return f"{ended.path}: {ended.rows} samples"


COMMANDS: Mapping[type[Ask], Callable[[AsyncClient, Control, Any], Awaitable[str]]] = {
    Arm: _arm,
    Clear: _clear,
    Move: _move,
    Rest: _rest,
    Gains: _tune,
    Note: _note,
    Record: _record,
    EndRecord: _end_record,
}


async def carry_out(client: AsyncClient, control: Control, ask: Command) -> str:
    """Do what a page asked for; return what to tell it. Raises what the client raises."""
    client.as_of(ask.generation)
    return await COMMANDS[type(ask)](client, control, ask)
