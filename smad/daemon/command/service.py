"""Each command of the API as one method. A refused command names field, value, limit, next step.

Methods that only look or that the controller takes at the next sample return at once; those that
the board has to agree to are coroutines.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import Struct

from firmware_protocol.enums import Fault
from firmware_protocol.events import HostState
from firmware_protocol.messages import (
    ArmConfirm,
    ArmRequest,
    ArmToken,
    ClearFault,
    ParamSave,
)
from smad import api
from smad.api import Reason
from smad.config import Config, config_to_toml
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Tune,
)
from smad.control.controller import Controller
from smad.daemon.boardside import BoardSide
from smad.daemon.command.conditions import Conditions, not_connected
from smad.daemon.command.lease import DeadMan, Lease
from smad.daemon.command.status import StatusReport
from smad.daemon.errors import Refusal
from smad.daemon.means import Means
from smad.daemon.telemetry.recorder import Recorder

_BEGIN_A_LOG = (api.Arm, api.StartRecording)
"""Told to the run log once it is open, which may be this command's doing."""


class Caller(Struct, frozen=True):
    """Who asks: the name of its socket, the secret of its lease (empty: it has none).

    `behind`: what it asks may have been sent before the last stop.
    """

    client: bytes
    lease: str = ""
    behind: bool = False


Answer = Struct | Coroutine[Any, Any, Struct]


@dataclass(frozen=True)
class Claims:
    """Who may command: exclusive control, and the client that armed and must be heard."""

    lease: Lease
    dead_man: DeadMan


class Service:
    """Carries out commands. `perform` checks who asks; everything else is one method a command."""

    def __init__(
        self,
        config: Config,
        board: BoardSide,
        recorder: Recorder,
        status: StatusReport,
        *,
        claims: Claims,
        means: Means,
    ) -> None:
        self.stopping = False
        self._arming = False
        self._config = config
        self._control = board.control
        self._controller: Controller = board.control.controller
        self._requests = board.requests
        self._watch = board.watch
        self._recorder = recorder
        self._status = status
        self._lease = claims.lease
        self._host_stop = board.host_stop
        self._dead_man = claims.dead_man
        self._stops = board.stops
        self._say = means.say
        self._clock_us = means.clocks.us
        self._conditions = Conditions(config, board)
        self.methods: dict[type[Struct], Callable[[Any, Caller], Answer]] = {
            api.GetStatus: self.status,
            api.GetMotion: self.motion,
            api.GetConfig: self.config,
            api.ResetTiming: self.reset_timing,
            api.Arm: self.arm,
            api.Disarm: self.disarm,
            api.EStop: self.estop,
            api.Clear: self.clear,
            Follow: self.drive,
            HoldTemperature: self.drive,
            DriveCurrent: self.drive,
            FollowInputs: self.drive,
            MoveStage: self.drive,
            Idle: self.settle,
            Tune: self.settle,
            api.ListParams: self.list_params,
            api.GetParam: self.get_param,
            api.SetParam: self.set_param,
            api.SaveParams: self.save_params,
            api.StartRecording: self.start_recording,
            api.StopRecording: self.stop_recording,
            api.AddNote: self.add_note,
            api.TakeControl: self.take_control,
            api.ReleaseControl: self.release_control,
        }

    def perform(
        self, method: api.Method, params: Struct, caller: Caller, generation: int | None = None
    ) -> Answer:
        """Carry a command out, or begin to. Raises Refusal, or CommandError from the controller.

        `generation` is the one in which it was asked for, if the caller knows it.
        """
        now_us = self._clock_us()
        self.end_what_lapsed(now_us)
        self._dead_man.heard(caller.client, now_us)
        self._lease.heard(caller.lease, now_us)
        if method.access == "control":
            self._lease.check(caller.lease, now_us)
            if self.stopping:
                raise Refusal(
                    Reason.BUSY, "the daemon is ending", action="start it again (smad start)"
                )
        if method.ends_with_stop:
            self._stops.require_confirmed()
            before = caller.behind and generation is None
            asked_in = self._stops.generation - 1 if before else generation
            self._stops.require(self._stops.generation if asked_in is None else asked_in)
        answer = self.methods[type(params)](params, caller)
        if method.logged and type(params) not in _BEGIN_A_LOG:
            self._say("command", method.name, api.logged_details(params))
        return answer

    def status(self, params: api.GetStatus, caller: Caller) -> api.Status:
        """Everything about the bench now."""
        return self._status.full(caller.lease)

    def motion(self, params: api.GetMotion, caller: Caller) -> api.Motion:
        """What the controller is doing."""
        return self._status.motion()

    def config(self, params: api.GetConfig, caller: Caller) -> api.ConfigText:
        """The configuration in force."""
        return api.ConfigText(toml=config_to_toml(self._config))

    def reset_timing(self, params: api.ResetTiming, caller: Caller) -> api.Timing:
        """Forget the percentiles so far."""
        self._control.clear_timing()
        return self._status.refresh()

    def end_what_lapsed(self, now_us: int) -> None:
        """Stop the bench if who had exclusive control, or who armed, has fallen silent."""
        gone = self._lease.lapsed(now_us)
        hot = self._control.session.state in (HostState.RUNNING, HostState.READY)
        if gone is not None and hot:
            silent_s = gone.duration_us * 1e-6
            cause = f"{gone.name}, who had exclusive control, fell silent for {silent_s:g} s"
            data = {"holder": gone.name, "silent_s": silent_s}
            by = f"a lapsed lease: {cause}"
            self._stops.order(cause, f"{cause}; disarming", data, by=by)
        if self._dead_man.expired(now_us):
            cause = "the client that armed has fallen silent"
            self._stops.order(cause, f"{cause}; disarming", {}, by=f"the dead-man: {cause}")

    def arm(self, params: api.Arm, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Ask the board for a token, begin the run log, confirm."""
        return self._arm_alone(params, caller, self._stops.generation)

    async def _arm_alone(self, params: api.Arm, caller: Caller, generation: int) -> api.Motion:
        if self._arming:
            raise Refusal(
                Reason.BUSY,
                "the bench is being armed already",
                action="wait for the reply to that (smad status)",
            )
        self._arming = True
        try:
            return await self._arm(params, caller, generation)
        finally:
            self._arming = False

    async def _arm(self, params: api.Arm, caller: Caller, generation: int) -> api.Motion:
        def still_wanted() -> None:
            self._stops.require(generation)
            self._lease.check(caller.lease, self._clock_us())

        await self._conditions.parameters_read()
        still_wanted()
        self._conditions.require_armable()
        axis = self._config.link.axis
        self._controller.command(Idle())
        token = await self._requests.ask(ArmRequest(axis, self._watch.parameters.crc))
        assert isinstance(token, ArmToken)
        still_wanted()
        if self._config.recorder.automatic and not self._recorder.recording:
            await self._recorder.start("", by_command=False)
            still_wanted()
        self._say("command", "arm", api.logged_details(params))
        self._say("arm", "arming", {})
        self._stops.arming()
        await self._requests.ask(ArmConfirm(axis, token.token))
        still_wanted()
        self._dead_man.watch(caller.client, self._clock_us())
        await self._stops.until_armed(generation)
        still_wanted()
        return self._status.motion()

    def disarm(self, params: api.Disarm, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Current off with the next sample, the board's DISARM; replies when it is not armed."""
        holder = self._lease.holder(self._clock_us())
        orderly = holder is None or holder.secret == caller.lease
        self._stops.begin(f"disarm of {self._who(caller)}", orderly=orderly)
        self._conditions.require_connected()
        return self._after(self._stops.until_disarmed())

    def estop(self, params: api.EStop, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Three copies at once, and again until the board says ESTOP; replies when it does."""
        if self._control.session.state is HostState.DISCONNECTED:
            self._stops.begin(f"estop of {self._who(caller)}")
            raise not_connected("ESTOP cannot be sent", "cut the power")
        self._stops.estop(f"estop of {self._who(caller)}")
        self._control.flush()
        return self._after(self._stops.until_estop())

    def _who(self, caller: Caller) -> str:
        """A stop's caller in words: only who has control has told its name."""
        now_us = self._clock_us()
        holder = self._lease.holder(now_us)
        # A stop may carry anything in place of a secret.
        return holder.name if holder and holder.secret == caller.lease else "a client"

    async def _after(self, stopped: Awaitable[None]) -> api.Motion:
        await stopped
        self._conditions.require_connected()
        return self._status.motion()

    async def clear(self, params: api.Clear, caller: Caller) -> api.Motion:
        """Acknowledge the latched fault, and a stop of the host."""
        self._conditions.require_connected()
        by_host = self._host_stop.fault
        latched = self._watch.fault
        number = params.fault
        if by_host is not None and number in (None, by_host.number):
            if latched is None:
                self._host_stop.clear()
                return self._status.motion()
            number = latched.number
        if number is None:
            if latched is None:
                raise Refusal(
                    Reason.INVALID, "no fault is latched", action="nothing to clear (smad status)"
                )
            number = latched.number
        if number not in set(Fault):
            raise Refusal(
                Reason.INVALID,
                "there is no fault of this number",
                value=number,
                action="see smad status for the latched one",
            )
        generation = self._stops.generation
        await self._requests.ask(ClearFault(self._config.link.axis, Fault(number)))
        # What has stopped the bench since has not been seen by who asked.
        self._stops.require(generation)
        self._watch.fault = None
        self._host_stop.clear()
        return self._status.motion()

    def drive(
        self,
        params: Follow | HoldTemperature | DriveCurrent | FollowInputs | MoveStage,
        caller: Caller,
    ) -> api.Motion:
        """Hand a motion to the controller; it begins with the next sample."""
        self._conditions.require_armed()
        if isinstance(params, MoveStage):
            self._conditions.require_stage()
        self._controller.command(params)
        return self._status.motion()

    def settle(self, params: Idle | Tune, caller: Caller) -> api.Motion:
        """Hand the controller something that needs no armed board."""
        self._controller.command(params)
        return self._status.motion()

    def list_params(self, params: api.ListParams, caller: Caller) -> api.ParamList:
        """The parameters as read when the board connected."""
        return self._watch.parameters.all()

    def get_param(self, params: api.GetParam, caller: Caller) -> api.Param:
        """One parameter."""
        return self._watch.parameters.one(params.name)

    async def set_param(self, params: api.SetParam, caller: Caller) -> api.Param:
        """Change one parameter on the board."""
        self._conditions.require_connected()
        self._conditions.require_disarmed()
        parameters = self._watch.parameters
        param = await parameters.set(params.name, params.value, self._requests.ask)
        self._watch.rescale()
        return param

    async def save_params(self, params: api.SaveParams, caller: Caller) -> api.ParamList:
        """Keep the parameters over a power cycle."""
        self._conditions.require_connected()
        self._conditions.require_disarmed()
        await self._requests.ask(ParamSave())
        return self._watch.parameters.all()

    async def start_recording(
        self, params: api.StartRecording, caller: Caller
    ) -> api.RecorderStatus:
        """Begin a run log."""
        await self._recorder.start(params.name, by_command=True, repeats=params.repeats)
        self._say("command", "record.start", api.logged_details(params))
        return self._recorder.status()

    async def stop_recording(self, params: api.StopRecording, caller: Caller) -> api.RecorderStatus:
        """Close the run log, also one that failed."""
        if not self._recorder.recording and not self._recorder.failure():
            raise Refusal(
                Reason.RECORDER, "nothing is being recorded", action="smad record start begins"
            )
        await self._recorder.stop()
        return self._recorder.status()

    def add_note(self, params: api.AddNote, caller: Caller) -> api.RecorderStatus:
        """Write a note into the run log."""
        if not self._recorder.recording:
            raise Refusal(
                Reason.RECORDER,
                "nothing is being recorded, so the note has nowhere to go",
                action="smad record start begins a run log",
            )
        self._say("note", params.text, {})
        return self._recorder.status()

    def take_control(self, params: api.TakeControl, caller: Caller) -> api.Control:
        """Take or renew exclusive control. It changes hands only while the bench is not armed."""
        now_us = self._clock_us()
        if not self._lease.held_with(caller.lease, now_us):
            self._lease.check("", now_us)
            self._require_not_armed_by_another(caller)
        holder = self._lease.take(caller.lease, params.name, int(params.lease_s * 1e6), now_us)
        return msgspec.structs.replace(self._status.lease(holder.secret), lease=holder.secret)

    def release_control(self, params: api.ReleaseControl, caller: Caller) -> api.Control:
        """Give exclusive control back; does nothing for who does not have it."""
        self._lease.release(caller.lease, self._clock_us())
        return self._status.lease(caller.lease)

    def _require_not_armed_by_another(self, caller: Caller) -> None:
        self._stops.require_confirmed()
        armed = self._control.session.state in (HostState.RUNNING, HostState.READY)
        if armed and self._dead_man.client != caller.client:
            raise Refusal(
                Reason.ARMED,
                "the bench was armed by another client",
                action="disarm it first (smad disarm); exclusive control does not take over an "
                "armed bench",
            )
