"""The client for asyncio: one method for each command of `smad.api`, to be awaited.

Calls of one client go one after the other; use several clients for calls side by side. The
blocking client is this file without its `await`s: `python -m tools.blocking_client` writes it.
"""

from __future__ import annotations

import contextlib
import time
import weakref
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from smad import api
from smad.client.async_channel import AsyncChannel, pause
from smad.client.endpoints import Connection
from smad.client.errors import Refused, Stopped
from smad.client.progress import Wait
from smad.client.renewal import DEFAULT_LEASE_S, Renewal, program_name
from smad.client.signals import ended_by_signals
from smad.client.wire import Keys, Reply, find_daemon, remote
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Spring,
    Trajectory,
    Tune,
)
from smad.control.pieces import in_pieces, rows_in_pieces
from smad.errors import SmadError

DEFAULT_TIMEOUT_S = 5.0
POLL_S = 0.05


class AsyncClient:
    """Talks to the daemon of one bench.

    Finds a daemon on this machine by `bench` (and `folder`, where that is not the usual one).
    `AsyncClient.remote(...)` reaches one on another machine.

    Who arms has exclusive control from before it arms until it disarms, under a lease of `lease_s`
    that is renewed in the background: a program that is killed leaves a bench that is disarmed
    after so long. None: no lease, nobody is missed, and other clients may command.

    Raises NoDaemon when none is running. Every method may raise NoAnswer after `timeout_s`, and
    Refused (NotReady, NotInControl, BoardRefused) when the daemon refuses.
    """

    def __init__(
        self,
        bench: str = "bench",
        *,
        folder: str | Path | None = None,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        lease_s: float | None = DEFAULT_LEASE_S,
    ) -> None:
        self._open(find_daemon(bench, folder), None, timeout_s, lease_s)

    @classmethod
    def remote(
        cls,
        address: str,
        stop_address: str,
        keys: Keys,
        *,
        telemetry: str = "",
        timeout_s: float = DEFAULT_TIMEOUT_S,
        lease_s: float | None = DEFAULT_LEASE_S,
    ) -> AsyncClient:
        """A client of a daemon on another machine: `tcp://host:port` for commands and for stops."""
        client = cls.__new__(cls)
        connection = remote(address, stop_address, telemetry, keys)
        client._open(connection, keys, timeout_s, lease_s)
        return client

    def _open(
        self, connection: Connection, keys: Keys | None, timeout_s: float, lease_s: float | None
    ) -> None:
        self.connection = connection
        self.timeout_s = timeout_s
        self.lease_s = lease_s
        self._leased = False
        """Whether the lease is the one that arming takes by itself."""
        self._renewal = Renewal(connection, keys)
        # A client that nobody has any more is none that could be missed.
        weakref.finalize(self, self._renewal.end)
        self._channel = AsyncChannel(connection, keys)
        self._conversation = self._channel.conversation

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the sockets back. What was armed under our lease is disarmed when that lapses."""
        self._renewal.end()
        self._channel.close()

    async def status(self) -> api.Status:
        """Everything about the bench now."""
        return await self._call(api.GetStatus(), api.Status)

    async def motion(self) -> api.Motion:
        """What the controller is doing and whether it is done."""
        return await self._call(api.GetMotion(), api.Motion)

    async def config(self) -> str:
        """The configuration in force, as TOML."""
        replied = await self._call(api.GetConfig(), api.ConfigText)
        return replied.toml

    async def reset_timing(self) -> api.Timing:
        """Begin the timing's percentiles anew, to measure a stretch by itself."""
        return await self._call(api.ResetTiming(), api.Timing)

    async def arm(self) -> api.Motion:
        """Arm the bench. What you ask for afterwards is refused once anybody has stopped it.

        So is another arming: only after a disarm of this client, and no other stop, does it arm
        again. A person starts it anew: with a new client, `clear`, or `as_of(None)`.
        """
        # Before anything is armed: who is killed while it arms is missed, too.
        if self._leased or (self.lease_s is not None and not self._conversation.lease):
            await self._take_lease()
        try:
            motion = await self._call(api.Arm(), api.Motion)
        except Refused as refused:
            if self._leased and refused.reason is not api.Reason.ARMED:
                await self._return_lease()
            raise
        except BaseException:
            # It may be armed: only the lease's end is sure to disarm it now.
            if self._leased:
                self._renewal.end()
            raise
        self._conversation.begin(motion.generation, known=motion.generation)
        return motion

    async def _take_lease(self) -> None:
        lease_s = DEFAULT_LEASE_S if self.lease_s is None else self.lease_s
        await self.take_control(program_name(), lease_s)
        self._leased = True
        self._renewal.begin(self._conversation.lease, lease_s)

    async def _return_lease(self) -> None:
        # Without an answer it lapses.
        with contextlib.suppress(SmadError):
            await self.release_control()
        self._conversation.lease = ""
        self._leased = False

    def as_of(self, generation: int | None) -> int | None:
        """Refuse what is asked from now on if a stop came after `generation`; None: after none.

        For who passes on what a person asked, and for a program at its beginning: the person knew
        of the stops up to this one (`Motion.generation`). The next arming is refused, too. None
        starts anew. Returns the generation that was in force.
        """
        before = self._conversation.known
        self._conversation.begin(generation, known=generation)
        return before

    async def disarm(self) -> api.Motion:
        """Current off, water on until cool; returns when the board is not armed any more.

        Goes over the stop channel, which is served first. Raises BoardRefused when the board does
        not confirm within a second; the daemon goes on asking it.
        """
        if self._leased:
            # From here on nothing keeps a bench armed whose disarm is not answered.
            self._renewal.end()
        motion = await self._call(api.Disarm(), api.Motion, stop=True)
        self._conversation.stopped(motion.generation)
        if self._leased:
            await self._return_lease()
        return motion

    async def estop(self) -> api.Motion:
        """Everything off until the board's power is cycled; returns when the board says ESTOP."""
        return await self._call(api.EStop(), api.Motion, stop=True)

    async def clear(self, fault: int | None = None) -> api.Motion:
        """Acknowledge the latched fault (or the one of that number, if it is the latched one).

        A person has seen what stopped the bench: the next `arm` starts anew.
        """
        motion = await self._call(api.Clear(fault=fault), api.Motion)
        self._conversation.begin(None)
        return motion

    async def move(self, *trajectories: Trajectory, queue: bool = False) -> api.Motion:
        """Follow trajectories one after the other; `queue` appends to what runs already."""
        motion: api.Motion | None = None
        for piece in (piece for whole in trajectories for piece in in_pieces(whole)):
            command = Follow(trajectories=(piece,), queue=queue or motion is not None)
            motion = await self._call(command, api.Motion)
        if motion is None:
            return await self._call(Follow(trajectories=()), api.Motion)
        return motion

    async def together(
        self, moves: dict[str, tuple[Trajectory, ...]], *, queue: bool = False
    ) -> api.Motion:
        """Let several axes begin together; `queue`: once the slowest of them has ended."""
        return await self._call(api.Together(moves=moves, queue=queue), api.Motion)

    async def heat(
        self,
        spring: Spring,
        temperature_degC: float,
        *,
        rate_K_per_s: float | None = None,
        duration_s: float | None = None,
        use_water: bool = True,
    ) -> api.Motion:
        """Hold a spring at a temperature."""
        command = HoldTemperature(
            spring=spring,
            temperature_degC=temperature_degC,
            rate_K_per_s=rate_K_per_s,
            duration_s=duration_s,
            use_water=use_water,
        )
        return await self._call(command, api.Motion)

    async def current(self, command: DriveCurrent) -> api.Motion:
        """Plain currents and pump duties, without feedback."""
        return await self._call(command, api.Motion)

    async def follow_inputs(self, command: FollowInputs) -> api.Motion:
        """Play recorded currents and duties; of any length, it is sent in pieces."""
        first, *rest = rows_in_pieces(command)
        motion = await self._call(first, api.Motion)
        for piece in rest:
            motion = await self._call(piece, api.Motion)
        return motion

    async def stage(self, stage_mm: float, rate_mm_per_s: float) -> api.Motion:
        """Move the stretching stage."""
        return await self._call(
            MoveStage(stage_mm=stage_mm, rate_mm_per_s=rate_mm_per_s), api.Motion
        )

    async def idle(self) -> api.Motion:
        """No current, no water; stays armed."""
        return await self._call(Idle(), api.Motion)

    async def tune(self, command: Tune) -> api.Motion:
        """Change gains and options of the running controller."""
        return await self._call(command, api.Motion)

    async def params(self) -> tuple[api.Param, ...]:
        """The parameters stored on the board."""
        replied = await self._call(api.ListParams(), api.ParamList)
        return replied.params

    async def get_param(self, name: str) -> api.Param:
        """One parameter of the board."""
        return await self._call(api.GetParam(name=name), api.Param)

    async def set_param(self, name: str, value: float) -> api.Param:
        """Change one parameter of the board; returns it as the board has it now."""
        return await self._call(api.SetParam(name=name, value=value), api.Param)

    async def save_params(self) -> tuple[api.Param, ...]:
        """Keep the parameters over a power cycle."""
        replied = await self._call(api.SaveParams(), api.ParamList)
        return replied.params

    async def start_recording(self, name: str = "", repeats: str = "") -> api.RecorderStatus:
        """Begin a run log; `repeats` names the run whose inputs it plays again."""
        return await self._call(api.StartRecording(name=name, repeats=repeats), api.RecorderStatus)

    async def stop_recording(self) -> api.RecorderStatus:
        """Close the run log; returns its path and how many rows it holds."""
        return await self._call(api.StopRecording(), api.RecorderStatus, timeout_s=30.0)

    async def note(self, text: str) -> api.RecorderStatus:
        """Write a note into the run log."""
        return await self._call(api.AddNote(text=text), api.RecorderStatus)

    async def take_control(self, name: str, lease_s: float = 10.0) -> api.Control:
        """Take, or renew, exclusive control; every call of yours renews it too.

        When you fall silent for `lease_s` while the bench is armed, it is disarmed. Control of a
        bench that somebody else armed is refused: disarm it first.
        """
        self._renewal.end()
        self._leased = False
        control = await self._call(api.TakeControl(name=name, lease_s=lease_s), api.Control)
        self._conversation.lease = control.lease
        return control

    async def release_control(self) -> api.Control:
        """Give exclusive control back."""
        self._renewal.end()
        control = await self._call(api.ReleaseControl(), api.Control)
        self._conversation.lease = ""
        return control

    @contextlib.asynccontextmanager
    async def armed(self) -> AsyncIterator[None]:
        """Armed for as long as the block lasts: disarmed at its end, on an exception, on ctrl-C.

        And on SIGTERM and SIGHUP, where the program has no handler of its own for them. One that
        is killed cannot disarm; the daemon misses it and does, within the lease.
        """
        refused = False
        with ended_by_signals():
            try:
                try:
                    await self.arm()
                except Refused:
                    # Somebody else may have armed it; that is not ours to end.
                    refused = True
                    raise
                yield
                await self.disarm()
            except BaseException:
                if not refused:
                    await self._disarm_after_an_error()
                raise

    async def _disarm_after_an_error(self) -> None:
        # What ended the block is what its caller has to hear of.
        with contextlib.suppress(SmadError):
            while True:
                try:
                    await self.disarm()
                except (KeyboardInterrupt, SystemExit):
                    # Whoever presses ctrl-C twice wants it stopped all the more.
                    continue
                return

    @contextlib.asynccontextmanager
    async def in_control(self, name: str, lease_s: float = 10.0) -> AsyncIterator[None]:
        """Have exclusive control for as long as the block lasts; raises NotInControl.

        The lease is renewed in the background. A program that is killed inside the block leaves a
        bench that is disarmed after `lease_s`.
        """
        await self.take_control(name, lease_s)
        self._renewal.begin(self._conversation.lease, lease_s)
        try:
            yield
        finally:
            await self.release_control()

    @contextlib.asynccontextmanager
    async def record(self, name: str = "") -> AsyncIterator[api.RecorderStatus]:
        """Record for as long as the block lasts."""
        status = await self.start_recording(name)
        try:
            yield status
        finally:
            await self.stop_recording()

    async def wait_until_done(
        self,
        progress: Callable[[api.Motion], None] | None = None,
        *,
        timeout_s: float | None = None,
    ) -> api.Motion:
        """Return once everything commanded has been carried out; `progress` sees each poll.

        Raises Stopped when it never will be (disarmed, fault, board gone), NoAnswer after
        `timeout_s`.
        """
        wait = Wait(time.monotonic(), timeout_s, self._conversation.generation)
        while True:
            motion = await self.motion()
            if progress is not None:
                progress(motion)
            try:
                if wait.over(motion, time.monotonic()):
                    return motion
            except Stopped:
                # Nothing of ours is armed: somebody else may clear the fault and begin anew.
                if self._leased and not motion.armed:
                    await self._return_lease()
                raise
            await pause(POLL_S)

    def telemetry(
        self, *, timeout_s: float | None = None, queue: int = 1000
    ) -> AsyncIterator[api.Telemetry]:
        """Published samples, as they come. Raises NoAnswer when none comes for `timeout_s`."""
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        return self._channel.telemetry(limit_s, queue)

    async def _call(
        self,
        params: Any,
        kind: type[Reply],
        *,
        stop: bool = False,
        timeout_s: float | None = None,
    ) -> Reply:
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        return await self._channel.call(params, kind, limit_s, stop=stop)
