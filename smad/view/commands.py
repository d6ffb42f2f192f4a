"""What a page may ask for, and the call of the ordinary client that each becomes.

`Command` is for the bench, `Question` for the server itself (`queries`). A stop is neither: it goes
past everything that waits (`server`). What a person asked for is refused by the daemon when a stop
came that the page had not shown yet: `generation` is its own.
"""

import asyncio
from collections.abc import Iterator
from typing import Annotated, get_args

import msgspec
from msgspec import Meta, Struct

from smad.api import Reason
from smad.client import AsyncClient, Refused
from smad.client.async_commands import AsyncCommands
from smad.control.commands import Trajectory, Tune
from smad.counted import counted
from smad.view.feed import LONGEST_TAIL_S, WINDOWS
from smad.view.jobs import Job, RunName, Settings
from smad.view.queue import Verb

LEASE_S = 10.0
"""A page that keeps control and goes away leaves a bench that is disarmed after so long."""
HOLDER = "live page"


class Control:
    """Exclusive control as one page has it: taken when it arms, renewed while it is there."""

    def __init__(self, client: AsyncClient) -> None:
        self._client = client
        self.has_control = False
        self.armed = False
        """Armed under it, and not yet seen to be stopped."""
        # A renewal that is on its way must not take back what was given away meanwhile.
        self._one_at_a_time = asyncio.Lock()

    async def take(self) -> None:
        """Take it. Raises NotInControl while somebody else has it."""
        async with self._one_at_a_time:
            await self._client.take_control(HOLDER, LEASE_S)
            self.has_control = True

    async def renew(self) -> None:
        """Renew it, if this page has it. Raises NotInControl when somebody else has it by now."""
        async with self._one_at_a_time:
            if self.has_control:
                await self._client.take_control(HOLDER, LEASE_S)

    async def release(self) -> None:
        """Give it back, if this page has it."""
        async with self._one_at_a_time:
            if self.has_control:
                self.has_control = self.armed = False
                await self._client.release_control()


class PageRequest(Struct, tag_field="do", frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Something a page asks for. `id` comes back with the reply; `axis` is the one it looks at."""

    id: int = 0
    generation: int | None = None
    axis: str = ""

    def target(self, client: AsyncClient) -> AsyncCommands:
        """Return what commands the axis that the page looks at."""
        return client[self.axis] if self.axis else client


class FrameDrawn(PageRequest, tag="drawn", frozen=True, kw_only=True):
    """A frame is on the screen: the next may come."""


class Alive(PageRequest, tag="alive", frozen=True, kw_only=True):
    """The status has arrived: the page is there, and so is who looks at it."""


Channels = Annotated[tuple[str, ...], Meta(max_length=64)]


class ShowChannels(PageRequest, tag="show", frozen=True, kw_only=True):
    """Send these channels of a window from now on, and these for XY plots; `live`: or nothing."""

    window: Annotated[int, Meta(ge=0, lt=len(WINDOWS))] = 0
    channels: Channels = ()
    xy: Channels = ()
    tail_s: Annotated[float, Meta(gt=0.0, le=LONGEST_TAIL_S)] = 60.0
    live: bool = True


class SelectAxis(PageRequest, tag="look_at", frozen=True, kw_only=True):
    """Show another axis from now on: the page begins anew with it."""


class ShowPast(PageRequest, tag="look_back", frozen=True, kw_only=True):
    """Send what was shown between two Unix times, once."""

    from_s: Annotated[float, Meta(ge=0.0, le=1e11)]
    to_s: Annotated[float, Meta(ge=0.0, le=1e11)]


class Stop(PageRequest, tag="stop", frozen=True, kw_only=True):
    """Disarm, over the stop channel."""


class Arm(PageRequest, tag="arm", frozen=True, kw_only=True):
    """Arm the bench, or the `axes` named.

    With `keep_control` nobody else commands, and a page that goes away disarms.
    """

    keep_control: bool = True
    axes: Annotated[tuple[str, ...], Meta(max_length=16)] = ()

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        if self.keep_control:
            await control.take()
            # A stop of this page that came meanwhile is not known to who asked for this.
            client.as_of(self.generation)
        try:
            await client.arm(*self.axes)
        except Refused:
            await control.release()
            raise
        control.armed = True
        return "armed: the bench heats when you command it"


class Clear(PageRequest, tag="clear", frozen=True, kw_only=True):
    """Acknowledge the fault that the page showed."""

    fault: int

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        await self.target(client).clear(self.fault)
        return "the fault is cleared"


class Move(PageRequest, tag="move", frozen=True, kw_only=True):
    """Follow a trajectory."""

    trajectory: Trajectory
    queue: bool = False

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        await self.target(client).move(self.trajectory, queue=self.queue)
        return f"{type(self.trajectory).__name__}: {'queued' if self.queue else 'begun'}"


class GoIdle(PageRequest, tag="idle", frozen=True, kw_only=True):
    """No current and no water, and stay armed."""

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        await self.target(client).idle()
        return "idle: no current, no water; still armed"


def changed(tune: Tune) -> Iterator[tuple[str, object]]:
    """Yield each field that is to change, and its new value."""
    for name in tune.__struct_fields__:
        if (value := getattr(tune, name)) is not None:
            yield name, value


class ChangeGains(PageRequest, tag="tune", frozen=True, kw_only=True):
    """Change gains."""

    tune: Tune

    def mark(self) -> str:
        """Return what stands on the strips where they were changed."""
        values = ", ".join(f"{name} {value}" for name, value in changed(self.tune))
        return f"{self.axis}: {values}" if self.axis and values else values

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        await self.target(client).tune(self.tune)
        return "set: " + (self.mark() or "nothing")


class Note(PageRequest, tag="note", frozen=True, kw_only=True):
    """Mark this moment on the strips, and in the run log if there is one."""

    text: Annotated[str, Meta(min_length=1, max_length=500)]

    def mark(self) -> str:
        """Return what stands on the strips."""
        return self.text

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        try:
            await client.note(self.text)
        except Refused as refused:
            if refused.reason is not Reason.RECORDER:
                raise
            return f"marked on the strips alone, as nothing is being recorded: {self.text}"
        return f"noted in the run log: {self.text}"


class Record(PageRequest, tag="record", frozen=True, kw_only=True):
    """Begin a run log."""

    name: Annotated[str, Meta(max_length=64)] = ""

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        return f"recording to {(await client.start_recording(self.name)).path}"


class EndRecord(PageRequest, tag="end_record", frozen=True, kw_only=True):
    """Close the run log."""

    async def carry_out(self, client: AsyncClient, control: Control) -> str:
        ended = await client.stop_recording()
        return f"{ended.path}: {counted(ended.rows, 'sample')}"


class Runs(PageRequest, tag="runs", frozen=True, kw_only=True):
    """List the last runs."""


class Results(PageRequest, tag="results", frozen=True, kw_only=True):
    """Say in a table what a run came to."""

    run: RunName


class Experiments(PageRequest, tag="experiments", frozen=True, kw_only=True):
    """Make the forms of the experiments."""


class Preview(PageRequest, tag="preview", frozen=True, kw_only=True):
    """Draw a piece of motion before it is commanded."""

    trajectory: Trajectory


class PreviewExperiment(PageRequest, tag="preview_experiment", frozen=True, kw_only=True):
    """Draw what an experiment will ask of the bench."""

    experiment: RunName
    settings: Settings = {}


class Begin(PageRequest, tag="begin", frozen=True, kw_only=True):
    """Begin a job."""

    job: Job


class EndJob(PageRequest, tag="end_job", frozen=True, kw_only=True):
    """Interrupt the job, as ctrl-C does."""


class ShowQueue(PageRequest, tag="queue", frozen=True, kw_only=True):
    """Show the queue. A page that only watches may ask it, too."""


class ChangeQueue(PageRequest, tag="change_queue", frozen=True, kw_only=True):
    """Add to the queue, change or arm it."""

    change: Verb


Command = Arm | Clear | Move | GoIdle | ChangeGains | Note | Record | EndRecord
Question = (
    Runs
    | Results
    | Experiments
    | Preview
    | PreviewExperiment
    | Begin
    | EndJob
    | ShowQueue
    | ChangeQueue
)
Watching = FrameDrawn | Alive | ShowChannels | SelectAxis | ShowPast | Stop | ShowQueue
Message = Watching | Command | Question
MARKING = (Note, ChangeGains)
QUESTIONS = get_args(Question)
WATCHING = get_args(Watching)
"""What a page without the right to command may say: anybody may look back, and stop."""

decoder = msgspec.json.Decoder(Message)


class _Numbered(Struct, frozen=True):
    """A message of which only the number counts."""

    id: int = 0


def id_of(text: str | bytes) -> int:
    """Return the number of a message that is none of ours; 0 where it has none."""
    try:
        return msgspec.json.decode(text, type=_Numbered).id
    except msgspec.MsgspecError:
        return 0


async def carry_out(client: AsyncClient, control: Control, ask: Command) -> str:
    """Do what a page asked for; return what to tell it. Raises what the client raises."""
    client.as_of(ask.generation)
    return await ask.carry_out(client, control)
