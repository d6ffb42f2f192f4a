"""One open page: what it is sent, and what it asks for.

A frame goes out only when the page has drawn the one before, and the status only when it has
confirmed the one before: a slow browser gets the newest, and nothing queues up for it.

A stop does not wait for anything. It has the stop channel to itself and takes with it what the
page had asked for before and was not carried out yet.
"""

import asyncio
import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode

from smad.client import AsyncClient
from smad.config import Config
from smad.errors import SmadError
from smad.style import assets, strips
from smad.view import commands, forms
from smad.view.access import Right
from smad.view.feed import FRAMES_PER_S, WINDOWS, Cursor, View
from smad.view.queries import Queries
from smad.view.source import Axis, Source
from smad.view.state import MODE_MEANS, Condition, control_condition
from smad.view.tasks import cancel_and_wait
from smad.view.tier import Frame, Moments

IN_FLIGHT = 2
"""Frames on their way to a page, or being drawn: one while the other travels."""
MOST_WAITING = 16
"""Commands of one page that wait; more are refused. A stop never waits."""
MOST_STOPS = 8
"""Stops of one page at once; each has a connection of its own while another is under way."""
PATIENCE_S = 10.0
"""A page that has not confirmed a status for so long gives up its place."""
LOOK_EVERY_S = 0.5
FRESH_STATUSES = 2
"""So many statuses after arming, one has been asked for since, and knows of it."""
_HUNG = f"This page did not respond for {PATIENCE_S:g} seconds and was disconnected."
_WATCH_ONLY = "this link is for watching and stopping: it commands nothing else"
_encode = msgspec.json.Encoder().encode


class Page:
    """A browser's page at the other end of a WebSocket.

    `clients` makes a client of the bench, or raises NoDaemon.
    """

    def __init__(
        self,
        connection: ServerConnection,
        right: Right,
        source: Source,
        clients: Callable[[], AsyncClient],
        queries: Queries,
    ) -> None:
        self._connection = connection
        self._right = right
        self._source = source
        self._clients = clients
        self._queries = queries
        self._axis = source.axis("")
        self._cursor = Cursor(self._axis.feed)
        self._shows = commands.ShowChannels(live=False)
        self._back: commands.ShowPast | None = None
        self._looked = asyncio.Event()
        self._job_version = 0
        self._marks_set = -1
        self._frames = 0
        self._unconfirmed_s: float | None = None
        self._config: Config | None = None
        self._version = -1
        self._armed_at = 0
        self._silent = False
        self._waiting: asyncio.Queue[commands.Command | commands.Alive] = asyncio.Queue(
            MOST_WAITING
        )
        self._questions: asyncio.Queue[commands.Question] = asyncio.Queue(MOST_WAITING)
        self._client: AsyncClient | None = None
        self._control: commands.Control | None = None
        self._stops: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve the page until it goes away."""
        try:
            async with asyncio.TaskGroup() as tasks:
                loops = (self._feed, self._work, self._miss, self._look_back, self._inquire)
                rest = [tasks.create_task(loop()) for loop in loops]
                await self._read()
                await cancel_and_wait(*rest)
        except* ConnectionClosed:
            pass
        finally:
            for task in tuple(self._stops):
                # A stop is carried out, whether or not somebody is there to read its reply.
                with contextlib.suppress(SmadError, ConnectionClosed):
                    await task
            if self._client is not None:
                # A lease is left to lapse: who vanishes while armed is to be missed.
                self._client.close()

    async def _read(self) -> None:
        async for text in self._connection:
            try:
                ask = commands.decoder.decode(text)
            except msgspec.MsgspecError as error:
                await self._reply(commands.id_of(text), False, f"not understood: {error}")
                continue
            await self._take(ask)

    async def _take(self, ask: commands.Message) -> None:
        if self._right != "command" and not isinstance(ask, commands.WATCHING):
            await self._reply(ask.id, False, _WATCH_ONLY)
        elif isinstance(ask, commands.FrameDrawn):
            self._frames = max(0, self._frames - 1)
        elif isinstance(ask, commands.Alive):
            self._unconfirmed_s = None
            # Whatever the page asks for renews its lease, so nothing waits behind a renewal.
            if self._waiting.empty():
                self._waiting.put_nowait(ask)
        elif isinstance(ask, commands.ShowChannels):
            await self._show(ask)
        elif isinstance(ask, commands.SelectAxis):
            self._axis = self._source.axis(ask.axis)
            self._config = None
        elif isinstance(ask, commands.ShowPast):
            # Of several that wait, only the last is worth an answer.
            if self._looked.is_set() and self._back is not None:
                await self._reply(self._back.id, False, "a newer request replaced this one")
            self._back = ask
            self._looked.set()
        elif isinstance(ask, commands.Stop) and len(self._stops) >= MOST_STOPS:
            await self._reply(ask.id, False, f"{MOST_STOPS} stops are under way already")
        elif isinstance(ask, commands.Stop):
            task = asyncio.create_task(self._stop(ask, self._take_back()))
            self._stops.add(task)
            task.add_done_callback(self._stops.discard)
        else:
            question = isinstance(ask, commands.QUESTIONS)
            waiting: asyncio.Queue[Any] = self._questions if question else self._waiting
            try:
                waiting.put_nowait(ask)
            except asyncio.QueueFull:
                await self._reply(ask.id, False, f"{MOST_WAITING} commands wait already")

    async def _show(self, ask: commands.ShowChannels) -> None:
        unknown = [name for name in (*ask.channels, *ask.xy) if name not in strips.PLACES]
        if unknown:
            await self._reply(ask.id, False, f"there is no channel {unknown[0]}")
            return
        self._shows = ask
        self._cursor.look_at(
            View(
                window=ask.window,
                channels=tuple(strips.PLACES[name] for name in ask.channels),
                xy=tuple(strips.PLACES[name] for name in ask.xy),
                tail_s=ask.tail_s,
            )
        )

    def _take_back(self) -> list[int]:
        taken = []
        for queue in (self._waiting, self._questions):
            with contextlib.suppress(asyncio.QueueEmpty):
                while True:
                    taken.append(queue.get_nowait().id)
        return taken

    async def _stop(self, ask: commands.Stop, taken_back: list[int]) -> None:
        spare: AsyncClient | None = None
        # One that has only just begun would else arm after the stop.
        self._queries.jobs.interrupt(on_the_bench=True)
        try:
            client, control = self._connected()
            if len(self._stops) > 1:
                # One client's stops go one after the other; this one does not wait for the last.
                client = spare = self._clients()
            motion = await client.disarm()
            done, text = True, f"stopped: the board is in {motion.mode}"
        except SmadError as error:
            done, text = False, str(error)
        finally:
            if spare is not None:
                spare.close()
        with contextlib.suppress(ConnectionClosed):
            await self._reply(ask.id, done, text)
            for number in filter(None, taken_back):
                await self._reply(number, False, "not carried out: you stopped the bench")
        if done:
            with contextlib.suppress(SmadError):
                await control.release()

    async def _work(self) -> None:
        while True:
            ask = await self._waiting.get()
            if isinstance(ask, commands.Alive):
                await self._renew()
                continue
            try:
                client, control = self._connected()
                done, text = True, await commands.carry_out(client, control, ask)
                if isinstance(ask, commands.Arm):
                    self._armed_at = self._source.version
                elif isinstance(ask, commands.MARKING):
                    self._source.mark(ask.mark())
            except SmadError as error:
                done, text = False, str(error)
            await self._reply(ask.id, done, text)

    async def _inquire(self) -> None:
        while True:
            ask = await self._questions.get()
            result = None
            try:
                text, result = await self._queries.answer(ask)
                done = True
            except SmadError as error:
                done, text = False, str(error)
            await self._reply(ask.id, done, text, result)

    async def _look_back(self) -> None:
        while True:
            await self._looked.wait()
            self._looked.clear()
            ask = self._back
            assert ask is not None
            if ask.to_s <= ask.from_s:
                await self._reply(ask.id, False, "the end of the span must come after its start")
                continue
            past = await self._queries.past(self._axis, ask.from_s, ask.to_s, self._cursor.view)
            await self._reply(ask.id, True, "", past)

    async def _renew(self) -> None:
        control = self._control
        if control is None or not control.has_control:
            return
        try:
            # Control is for driving: once somebody has ended that, it is anybody's again.
            await (control.release() if self._is_over(control) else control.renew())
        except SmadError:
            control.has_control = False

    def _is_over(self, control: commands.Control) -> bool:
        return (
            control.armed
            and not self._source.armed
            and self._source.version >= self._armed_at + FRESH_STATUSES
        )

    def _connected(self) -> tuple[AsyncClient, commands.Control]:
        if self._client is None or self._control is None:
            self._client = self._clients()
            self._control = commands.Control(self._client)
        return self._client, self._control

    async def _feed(self) -> None:
        while True:
            for message in self._changed_messages():
                await self._connection.send(message)
            await asyncio.sleep(1 / FRAMES_PER_S)

    async def _miss(self) -> None:
        """End a page whose script hangs: its browser would answer a ping of the protocol for it."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            since_s = self._unconfirmed_s
            if since_s is not None and self._source.clock_s() - since_s > PATIENCE_S:
                await self._connection.close(CloseCode.POLICY_VIOLATION, _HUNG)

    def _changed_messages(self) -> Iterator[str]:
        source = self._source
        if source.config is not self._config:
            # Another axis is looked at, or the daemon was started again, perhaps with other gains
            # and limits: begin anew.
            self._config = source.config
            self._axis = source.axis(self._axis.name)
            self._cursor = Cursor(self._axis.feed)
            self._shows = commands.ShowChannels(live=False)
            self._frames = 0
            self._version = self._marks_set = -1
            yield _encode(hello(source, self._axis, self._right)).decode()
        silent = self._axis.silent_s > 0
        changed = source.version != self._version or silent != self._silent
        if self._unconfirmed_s is None and changed:
            self._version, self._silent = source.version, silent
            self._unconfirmed_s = source.clock_s()
            ours = self._control is not None and self._control.has_control
            yield _encode(status_message(source, self._axis, ours=ours)).decode()
            yield from self._other_messages()
        if self._frames < IN_FLIGHT and not silent and self._shows.live:
            taken = self._cursor.take()
            if taken is not None:
                self._frames += 1
                yield _encode(self._frame(*taken)).decode()

    def _other_messages(self) -> Iterator[str]:
        source, jobs = self._source, self._queries.jobs
        if source.marks_set != self._marks_set:
            self._marks_set = source.marks_set
            yield _encode({"type": "marks", "marks": list(source.marks)}).decode()
        if jobs.version != self._job_version and self._right == "command":
            self._job_version = jobs.version
            yield _encode({"type": "job", "job": jobs.snapshot()}).decode()

    def _frame(self, frame: Frame, moments: Moments | None, whole: bool) -> dict[str, Any]:
        return {
            "type": "frame",
            # Which request it answers: frames of an earlier one are on their way still.
            "view": self._shows.id,
            "whole": whole,
            "from_s": frame.from_s,
            "t": frame.t,
            "y": frame.y,
            "xy": moments,
            "now": [self._axis.now[place] for place in self._cursor.view.channels],
            "mode": self._axis.mode_name,
        }

    async def _reply(self, number: int, done: bool, text: str, result: Any = None) -> None:
        reply = {"type": "reply", "id": number, "done": done, "text": text, "found": result}
        await self._connection.send(_encode(reply).decode())


def hello(source: Source, axis: Axis, right: Right) -> dict[str, Any]:
    """Return the first message: all that the page of an axis is built from."""
    return {
        "type": "hello",
        "bench": source.bench,
        "axis": axis.name,
        "right": right,
        "modes": MODE_MEANS,
        "windows": [{"label": w.label, "span_s": w.span_s} for w in WINDOWS],
        "channels": strips.CHANNELS,
        "layout": {"strips": strips.LAYOUT, "xy": strips.XY_LAYOUT},
        "limits": strips.limits(axis.config),
        "trajectories": forms.trajectories(),
        "tuning": forms.tuning(axis.config),
    }


def status_message(source: Source, axis: Axis, *, ours: bool) -> dict[str, Any]:
    """Return the status, and why it is not to be trusted if so; `ours`: the page has control."""
    now = axis.shown
    if now is not None:
        conditions = (*_arming(source), control_condition(now.holder, ours=ours))
        holder = "this page" if ours and now.holder else now.holder
        # Frames and status both carry the mode. Neither overwrites a newer value from the other.
        now = msgspec.structs.replace(
            now, mode=axis.mode_name, holder=holder, conditions=conditions
        )
    return {
        "type": "status",
        "away": source.why_away,
        "silent_s": round(axis.silent_s, 1),
        "status": now,
        "tiles": [of_axis.tile for of_axis in source.axes.values()] if source.several else [],
        "armed": source.armed,
        "first_s": axis.first_s,
        "limits": strips.limits(axis.config),
    }


def _arming(source: Source) -> Iterator[Condition]:
    """What has to hold to arm: a line for each axis that is not armed."""
    for name, axis in source.axes.items():
        now = axis.shown
        if now is not None and not now.armed:
            text = name or "The daemon knows of no obstacle"
            yield Condition(text, not now.obstacle, now.obstacle, axis=name)


def static_files() -> dict[str, tuple[str, bytes]]:
    """Return each path that is served, with its type and content: nothing else can be asked for."""
    by_name = assets.files_in(Path(__file__).parent / "static")
    by_name[""] = by_name.pop("index.html")
    by_name |= {f"style/{path}": file for path, file in assets.files().items()}
    return {f"/{path}": file for path, file in by_name.items()}
