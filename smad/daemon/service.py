"""Each command of the API as one method. A refused command names field, value, limit, next step.

Methods that only look or that the controller takes at the next sample return at once; those that
the board has to agree to are coroutines.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
from msgspec import Struct

from firmware_protocol.enums import BoardState, Capability, Fault
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
    HoldTemperature,
    Idle,
    MoveStage,
    Tune,
)
from smad.control.controller import Controller
from smad.daemon.control import ControlTask
from smad.daemon.errors import Refusal
from smad.daemon.hoststop import HostStop
from smad.daemon.lease import DeadMan, Lease
from smad.daemon.recorder import Recorder
from smad.daemon.requests import BoardRequests
from smad.daemon.status import StatusReport
from smad.daemon.stops import Stops
from smad.daemon.tighter import require_tighter
from smad.daemon.watch import BoardWatch, Say, disagreement

_PARAMETER_POLLS = 100
_PARAMETER_POLL_S = 0.02

_LOGGED_BESIDES = (api.AddNote, api.TakeControl, api.ReleaseControl)
"""Open to those who only watch, and yet worth a line in the run log."""

_BEGIN_A_LOG = (api.Arm, api.StartRecording)
"""Told to the run log once it is open, which may be this command's doing."""


class Caller(Struct, frozen=True):
    """Who asks: the name of its socket, the secret of its lease (empty: it has none)."""

    client: bytes
    lease: str = ""


Answer = Struct | Awaitable[Struct]


class Service:
    """Carries out commands. `perform` checks who asks; everything else is one method a command."""

    def __init__(
        self,
        config: Config,
        *,
        control: ControlTask,
        requests: BoardRequests,
        watch: BoardWatch,
        recorder: Recorder,
        status: StatusReport,
        lease: Lease,
        host_stop: HostStop,
        dead_man: DeadMan,
        stops: Stops,
        say: Say,
        clock_us: Callable[[], int],
    ) -> None:
        self.stopping = False
        self._arming = False
        self._config = config
        self._control = control
        self._controller: Controller = control.controller
        self._requests = requests
        self._watch = watch
        self._recorder = recorder
        self._status = status
        self._lease = lease
        self._host_stop = host_stop
        self._dead_man = dead_man
        self._stops = stops
        self._say = say
        self._clock_us = clock_us
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
            self._stops.require(self._stops.generation if generation is None else generation)
            self._stops.require_confirmed()
        answer = self.methods[type(params)](params, caller)
        logged = method.access != "watch" or type(params) in _LOGGED_BESIDES
        if logged and type(params) not in _BEGIN_A_LOG:
            self._say("command", method.name, _details(params))
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
            self._stops.order(cause, f"{cause}; disarming", data)
        if self._dead_man.expired(now_us):
            cause = "the client that armed has fallen silent"
            self._stops.order(cause, f"{cause}; disarming", {})

    def arm(self, params: api.Arm, caller: Caller) -> Awaitable[api.Motion]:
        """Ask the board for a token, begin the run log, confirm."""
        if self._arming:
            raise Refusal(
                Reason.BUSY,
                "the bench is being armed already",
                action="wait for the reply to that (smad status)",
            )
        self._arming = True
        return self._arm_alone(params, caller, self._stops.generation)

    async def _arm_alone(self, params: api.Arm, caller: Caller, generation: int) -> api.Motion:
        try:
            return await self._arm(params, caller, generation)
        finally:
            self._arming = False

    async def _arm(self, params: api.Arm, caller: Caller, generation: int) -> api.Motion:
        def still_wanted() -> None:
            self._stops.require(generation)
            self._lease.check(caller.lease, self._clock_us())

        await self._parameters_read()
        still_wanted()
        self._require_armable()
        axis = self._config.link.axis
        self._controller.command(Idle())
        token = await self._requests.ask(ArmRequest(axis, self._watch.parameters.crc))
        assert isinstance(token, ArmToken)
        still_wanted()
        if self._config.recorder.automatic and not self._recorder.recording:
            await self._recorder.start("", by_command=False)
            still_wanted()
        self._say("command", "arm", _details(params))
        self._say("arm", "arming", {})
        await self._requests.ask(ArmConfirm(axis, token.token))
        still_wanted()
        self._dead_man.watch(caller.client, self._clock_us())
        return self._status.motion()

    def disarm(self, params: api.Disarm, caller: Caller) -> Awaitable[api.Motion]:
        """Current off with the next sample, the board's DISARM; replies when it is not armed."""
        self._stops.begin("disarm")
        self._require_connected()
        return self._after(self._stops.until_disarmed())

    def estop(self, params: api.EStop, caller: Caller) -> Awaitable[api.Motion]:
        """Three copies at once, and again until the board says ESTOP; replies when it does."""
        if self._control.session.state is HostState.DISCONNECTED:
            self._stops.begin("estop")
            raise _not_connected("ESTOP cannot be sent", "cut the power")
        self._stops.estop()
        self._control.flush()
        return self._after(self._stops.until_estop())

    async def _after(self, stopped: Awaitable[None]) -> api.Motion:
        await stopped
        self._require_connected()
        return self._status.motion()

    async def clear(self, params: api.Clear, caller: Caller) -> api.Motion:
        """Acknowledge the latched fault, and a stop of the host."""
        self._require_connected()
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
        self, params: Follow | HoldTemperature | DriveCurrent | MoveStage, caller: Caller
    ) -> api.Motion:
        """Hand a motion to the controller; it begins with the next sample."""
        self._require_armed()
        if isinstance(params, MoveStage):
            self._require_stage()
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
        self._require_connected()
        self._require_disarmed()
        parameters = self._watch.parameters
        param = await parameters.set(params.name, params.value, self._requests.ask)
        self._watch.rescale()
        return param

    async def save_params(self, params: api.SaveParams, caller: Caller) -> api.ParamList:
        """Keep the parameters over a power cycle."""
        self._require_connected()
        self._require_disarmed()
        await self._requests.ask(ParamSave())
        return self._watch.parameters.all()

    async def start_recording(
        self, params: api.StartRecording, caller: Caller
    ) -> api.RecorderStatus:
        """Begin a run log."""
        await self._recorder.start(params.name, by_command=True)
        self._say("command", "record.start", _details(params))
        return self._recorder.status()

    async def stop_recording(self, params: api.StopRecording, caller: Caller) -> api.RecorderStatus:
        """Close the run log."""
        if not self._recorder.recording:
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

    def _require_connected(self) -> None:
        if self._control.session.state in (HostState.DISCONNECTED, HostState.SYNC):
            raise _not_connected(
                "the board is not connected",
                "plug it in; the daemon reconnects by itself (smad status)",
            )
        if self._watch.incompatible is not None:
            raise Refusal(
                Reason.DISAGREEMENT,
                "board and smad disagree, so the board can only be watched",
                value=disagreement(self._watch.incompatible),
                action="update the older of the two",
            )

    def _require_disarmed(self) -> None:
        if self._control.session.state in (HostState.RUNNING, HostState.READY):
            raise Refusal(Reason.ARMED, "the bench is armed", action="disarm first (smad disarm)")

    async def _parameters_read(self) -> None:
        # Right after a connection they are on their way; that is no reason to refuse.
        for _ in range(_PARAMETER_POLLS):
            if self._watch.parameters.agree is not None or not self._watch.reading:
                return
            await asyncio.sleep(_PARAMETER_POLL_S)

    def _require_armable(self) -> None:
        self._require_connected()
        self._require_not_faulted()
        self._require_disarmed()
        agree = self._watch.parameters.agree
        if agree is None:
            raise Refusal(
                Reason.BUSY,
                "the board's parameters are still being read",
                action="try again in a second",
            )
        if not agree:
            raise Refusal(
                Reason.DISAGREEMENT,
                "the board's parameters are not those that were read from it",
                action="unplug it and plug it in again, so that they are read anew",
            )
        require_tighter(self._config, self._watch.parameters)

    def _require_not_faulted(self) -> None:
        by_host = self._host_stop.fault
        if by_host is not None:
            raise Refusal(
                Reason.FAULTED,
                "a limit of the host stopped the bench",
                value=by_host.in_words(),
                action="smad faults explain says what to do; then smad clear",
            )
        if self._control.session.state is not HostState.FAULTED:
            return
        fault = self._watch.fault
        stopped = self._watch.mode is BoardState.ESTOP
        raise Refusal(
            Reason.FAULTED,
            f"the board is in {'ESTOP' if stopped else 'FAULT'}",
            value=None if fault is None else fault.in_words(),
            action="power-cycle the board: nothing else ends ESTOP"
            if stopped
            else "smad faults explain says what to do; then smad clear",
        )

    def _require_stage(self) -> None:
        # Displacement is the stage's doing once one is used, and not limited any more.
        ident = self._watch.ident
        if ident is None or not ident.capabilities & Capability.STAGE:
            raise Refusal(
                Reason.INVALID,
                "this board moves no stretching stage",
                limit="a board with the capability `stage`",
                action="nothing was changed; smad status --json lists what the board has",
            )

    def _require_armed(self) -> None:
        self._require_connected()
        self._require_not_faulted()
        if self._control.session.state is not HostState.RUNNING:
            raise Refusal(
                Reason.NOT_ARMED, "the bench is not armed", action="arm it first (smad arm)"
            )


def _not_connected(cause: str, action: str) -> Refusal:
    return Refusal(Reason.NOT_CONNECTED, cause, action=action)


def _details(params: Struct) -> dict[str, Any]:
    details = msgspec.to_builtins(params)
    assert isinstance(details, dict)
    return details
