"""Each command of the API as one method. A refused command names field, value, limit, next step.

Methods that only look or that the controller takes at the next sample return at once; those that
the board has to agree to are coroutines.
"""

from collections.abc import Awaitable, Callable, Coroutine, Sequence
from typing import Any

import msgspec
from msgspec import Struct

from firmware_protocol.enums import Fault
from firmware_protocol.events import HostState
from firmware_protocol.messages import ClearFault, ParamSave
from smad import api
from smad.api import METHODS, Reason
from smad.config import config_to_toml
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Tune,
)
from smad.daemon.axis import Axis
from smad.daemon.command.arming import ArmCommand, ArmingRequest
from smad.daemon.command.bench import Bench
from smad.daemon.command.conditions import (
    not_connected,
    require_armed,
    require_connected,
    require_disarmed,
    require_stage,
)
from smad.daemon.command.lease import Caller, Holder
from smad.daemon.command.status import StatusReport
from smad.daemon.errors import Refusal, raise_together
from smad.errors import RunLogError

_NO_PORT = HostState.DISCONNECTED
_BEGIN_A_LOG = (api.Arm, api.StartRecording)
"""Told to the run log once it is open, which may be this command's doing."""

Answer = Struct | Coroutine[Any, Any, Struct]


class Service:
    """Carries out commands. `perform` checks who asks.

    Everything else is a method for each of `api.METHODS`, by its name with `_` for the dot.
    """

    def __init__(self, bench: Bench, status: StatusReport) -> None:
        self.stopping = False
        self._bench = bench
        self._recorder = bench.recorder
        self._status = status
        self._lease = bench.lease
        self._dead_man = bench.dead_man
        self._stops = bench.stops
        self._say = bench.services.say
        self._clock_us = bench.services.clocks.us
        self._arm_command = ArmCommand(bench)
        self._recording_by = b""
        """The client that began the run log by command."""
        self._gains_before: dict[str, Tune] = {}
        """Those in force when somebody took exclusive control, by axis."""
        self.methods: dict[type[Struct], Callable[[Any, Caller], Answer]] = {
            method.params: getattr(self, method.name.replace(".", "_")) for method in METHODS
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
            moved = params.moves if isinstance(params, api.Together) else caller.axes
            boards = [axis.stop for axis in self._bench.named(tuple(moved))]
            if isinstance(params, api.Arm):
                self._stops.require_all_closed()
            self._stops.require_confirmed(boards)
            before = caller.behind and generation is None
            asked_in = self._stops.generation - 1 if before else generation
            self._stops.require(self._stops.generation if asked_in is None else asked_in, boards)
        answer = self.methods[type(params)](params, caller)
        if method.logged and type(params) not in _BEGIN_A_LOG:
            self._say("command", method.name, _details(params, caller))
        return answer

    def status(self, params: api.GetStatus, caller: Caller) -> api.Status:
        """Everything about the bench now."""
        return self._status.full(caller.lease, self._bench.named(caller.axes))

    def motion(self, params: api.GetMotion, caller: Caller) -> api.Motion:
        """What the controllers are doing."""
        return self._status.motion(self._bench.named(caller.axes))

    def config(self, params: api.GetConfig, caller: Caller) -> api.ConfigText:
        """The configuration in force: of the axis that is named, else of the bench."""
        config = self._bench.only_axis(caller.axes).config if caller.axes else self._bench.config
        return api.ConfigText(toml=config_to_toml(config))

    def timing_reset(self, params: api.ResetTiming, caller: Caller) -> api.Timing:
        """Forget the percentiles so far."""
        axes = self._bench.named(caller.axes)
        for axis in axes:
            axis.control.clear_timing()
        self._bench.groups.skew.clear()
        self._status.refresh()
        return self._status.timing(axes[0])

    def end_what_lapsed(self, now_us: int) -> None:
        """Stop the bench if who had exclusive control, or who armed, has fallen silent."""
        lapsed = self._lease.lapsed(now_us)
        if lapsed is not None and lapsed.client == self._recording_by:
            # A run log belongs to who began it, and ends with its lease.
            self._recorder.end_by_itself()
        if lapsed is not None and self._bench.armed:
            silent_s = lapsed.duration_us * 1e-6
            cause = f"{lapsed.name} had exclusive control and sent nothing for {silent_s:g} s"
            data = {"holder": lapsed.name, "silent_s": silent_s}
            by = f"a lapsed lease: {cause}"
            self._stops.stop_by_daemon(cause, f"{cause}; disarming", data, by=by)
        if lapsed is not None:
            self._undo_tuning_of(lapsed)
        if self._dead_man.expired(now_us):
            cause = "the client that armed the bench stopped sending"
            self._stops.stop_by_daemon(
                cause, f"{cause}; disarming", {}, by=f"the dead-man: {cause}"
            )

    def _undo_tuning_of(self, lapsed: Holder) -> None:
        """Bring back the gains from before a holder that vanished: it can no longer do so."""
        for name, gains in self._gains_before.items():
            axis = self._bench.axes[name]
            if axis.controller.gains != gains:
                axis.controller.command(gains)
                why = f"gains are those from before {lapsed.name} took control"
                axis.services.say("warning", why, {"holder": lapsed.name})

    def arm(self, params: api.Arm, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Ask the boards for tokens, begin the run log, confirm: the axes named, or all."""
        # Now, not when its turn comes: a stop until then has to be noticed.
        generation = self._stops.generation
        return self._armed(self._bench.named(caller.axes), generation, caller, params)

    async def _armed(
        self, axes: Sequence[Axis], generation: int, caller: Caller, params: api.Arm
    ) -> api.Motion:
        await self._arm_command.arm(
            ArmingRequest(axes, generation, caller), _details(params, caller)
        )
        return self._status.motion(axes)

    def disarm(self, params: api.Disarm, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Current off with the next sample, DISARM to every board; replies when none is armed."""
        holder = self._lease.holder(self._clock_us())
        orderly = holder is None or holder.secret == caller.lease
        armed_by = {self._dead_man.armed_by(name) for name in self._bench.axes} - {None}
        if armed_by - {caller.client}:
            self._bench.black_box.want(f"disarm of {self._who(caller)}, who had not armed")
        self._stops.begin(f"disarm of {self._who(caller)}", orderly=orderly)
        return self._after(lambda axis: axis.stop.until_off(), self._require_boards)

    def estop(self, params: api.EStop, caller: Caller) -> Coroutine[Any, Any, api.Motion]:
        """Three copies to each board, and again until it says ESTOP; replies when all have."""
        away = [axis for axis in self._bench.axes.values() if axis.session.state is _NO_PORT]
        self._stops.begin(f"estop of {self._who(caller)}")
        for axis in self._bench.axes.values():
            if axis not in away:
                axis.session.send_estop()
                axis.control.flush()

        def require_sent() -> None:
            for axis in away:
                with axis.naming_axis():
                    raise not_connected("ESTOP cannot be sent", "cut the power")
            self._require_boards()

        return self._after(lambda axis: axis.stop.until_estop(), require_sent)

    def _who(self, caller: Caller) -> str:
        """A stop's caller in words: only who has control has told its name."""
        now_us = self._clock_us()
        holder = self._lease.holder(now_us)
        # A stop may carry anything in place of a secret.
        return holder.name if holder and holder.secret == caller.lease else "a client"

    async def _after(
        self, stopped: Callable[[Axis], Awaitable[None]], require: Callable[[], None]
    ) -> api.Motion:
        refusals: list[Refusal] = []
        with self._stops.reply_open():
            for axis in self._bench.axes.values():
                # One that does not answer keeps nobody from hearing of the others.
                try:
                    with axis.naming_axis():
                        await stopped(axis)
                except Refusal as refusal:
                    refusals.append(refusal)
            raise_together(refusals)
            require()
            return self._status.motion(list(self._bench.axes.values()))

    def _require_boards(self) -> None:
        """Raise Refusal where a board that was there is not any more: nothing is known of it."""
        for axis in self._bench.axes.values():
            if len(self._bench.axes) == 1 or axis.watch.identified.is_set():
                require_connected(axis)

    async def clear(self, params: api.Clear, caller: Caller) -> api.Motion:
        """Acknowledge the latched fault, and a stop of the host, of each axis that has one.

        One that is refused keeps no other from being cleared; the refusal names all of those.
        """
        axes = self._bench.named(caller.axes)
        faulted = [a for a in axes if a.watch.fault is not None or a.host_stop.fault is not None]
        refusals: list[Refusal] = []
        for axis in faulted or axes[:1]:
            try:
                with axis.naming_axis():
                    await self._clear(axis, params.fault)
            except Refusal as refusal:
                refusals.append(refusal)
        raise_together(refusals)
        return self._status.motion(axes)

    async def _clear(self, axis: Axis, number: int | None) -> None:
        require_connected(axis)
        by_host = axis.host_stop.fault
        latched = axis.watch.fault
        if by_host is not None and number in (None, by_host.number):
            if latched is None:
                axis.host_stop.clear()
                return
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
        await axis.requests.ask(ClearFault(axis.config.link.axis, Fault(number)))
        # What has stopped the bench since has not been seen by who asked.
        self._stops.require(generation, [axis.stop])
        axis.watch.fault = None
        axis.host_stop.clear()

    def move(
        self,
        params: Follow | HoldTemperature | DriveCurrent | FollowInputs | MoveStage,
        caller: Caller,
    ) -> api.Motion:
        """Hand a motion to the controller of an axis; it begins with the next sample."""
        axis = self._bench.only_axis(caller.axes)
        require_armed(axis)
        if isinstance(params, MoveStage):
            require_stage(axis)
        with axis.naming_axis():
            axis.controller.command(params)
        if not (isinstance(params, Follow | FollowInputs) and params.queue):
            self._bench.groups.forget([axis.name])
        return self._status.motion([axis])

    heat = current = inputs = stage = move

    def together(self, params: api.Together, caller: Caller) -> api.Motion:
        """Hand motions to several controllers at once; `queue`: once the slowest has ended."""
        axes = self._bench.named(tuple(params.moves))
        for axis in axes:
            require_armed(axis)
        groups = self._bench.groups
        group = {name: Follow(trajectories=moves) for name, moves in params.moves.items()}
        (groups.queue if params.queue else groups.begin)(group)
        return self._status.motion(axes)

    def idle(self, params: Idle, caller: Caller) -> api.Motion:
        """End the motions of the axes named, or of all; they stay armed."""
        axes = self._bench.named(caller.axes)
        self._bench.groups.forget([axis.name for axis in axes])
        for axis in axes:
            axis.controller.command(params)
        return self._status.motion(axes)

    def tune(self, params: Tune, caller: Caller) -> api.Motion:
        """Change gains and options of an axis."""
        axis = self._bench.only_axis(caller.axes)
        with axis.naming_axis():
            axis.controller.command(params)
        return self._status.motion([axis])

    def params_list(self, params: api.ListParams, caller: Caller) -> api.ParamList:
        """The parameters as read when the board connected."""
        return self._bench.only_axis(caller.axes).watch.parameters.all()

    def params_get(self, params: api.GetParam, caller: Caller) -> api.Param:
        """One parameter."""
        return self._bench.only_axis(caller.axes).watch.parameters.value_of(params.name)

    async def params_set(self, params: api.SetParam, caller: Caller) -> api.Param:
        """Change one parameter on the board."""
        axis = self._changeable(caller)
        parameters = axis.watch.parameters
        param = await parameters.set(params.name, params.value, axis.requests.ask)
        axis.watch.rescale()
        return param

    async def params_save(self, params: api.SaveParams, caller: Caller) -> api.ParamList:
        """Keep the parameters over a power cycle."""
        axis = self._changeable(caller)
        await axis.requests.ask(ParamSave())
        return axis.watch.parameters.all()

    def _changeable(self, caller: Caller) -> Axis:
        """Return the axis whose board is to be changed. Raises Refusal unless it can be."""
        axis = self._bench.only_axis(caller.axes)
        require_connected(axis)
        require_disarmed(axis)
        return axis

    async def record_start(self, params: api.StartRecording, caller: Caller) -> api.RecorderStatus:
        """Begin a run log."""
        await self._recorder.start(params.name, by_command=True, repeats=params.repeats)
        self._recording_by = caller.client
        self._say("command", "record.start", api.logged_details(params))
        return self._status.recorder()

    async def record_stop(self, params: api.StopRecording, caller: Caller) -> api.RecorderStatus:
        """Close the run log, also one that failed."""
        if not self._recorder.recording and not self._recorder.failure():
            raise Refusal(
                Reason.RECORDER, "nothing is being recorded", action="smad record start begins"
            )
        await self._recorder.stop()
        return self._status.recorder()

    def record_note(self, params: api.AddNote, caller: Caller) -> api.RecorderStatus:
        """Write a note into the run log."""
        if not self._recorder.recording:
            raise Refusal(
                Reason.RECORDER,
                "nothing is being recorded, so the note has nowhere to go",
                action="smad record start begins a run log",
            )
        self._say("note", params.text, {})
        return self._status.recorder()

    async def record_last(self, params: api.RecordLast, caller: Caller) -> api.RecorderStatus:
        """Write what the black box keeps."""
        box = self._bench.black_box
        if params.seconds > box.keep_s:
            raise Refusal(
                Reason.RECORDER,
                "so much is not kept in memory",
                value=params.seconds,
                limit=f"{box.keep_s:g} s",
                action="ask for less, or set recorder.black_box_s",
            )
        try:
            await box.write(params.seconds)
        except RunLogError as error:
            raise Refusal(Reason.RECORDER, error.cause, **error.parts) from error
        return self._status.recorder()

    def control_take(self, params: api.TakeControl, caller: Caller) -> api.Control:
        """Take or renew exclusive control. It changes hands only while the bench is not armed."""
        now_us = self._clock_us()
        if not self._lease.is_held_with(caller.lease, now_us):
            self._lease.check("", now_us)
            self._require_not_armed_by_another(caller)
            axes = self._bench.axes.items()
            self._gains_before = {name: axis.controller.gains for name, axis in axes}
        duration_us = int(params.lease_s * 1e6)
        holder = self._lease.take(caller.lease, params.name, duration_us, now_us, caller.client)
        return msgspec.structs.replace(self._status.lease(holder.secret), lease=holder.secret)

    def control_release(self, params: api.ReleaseControl, caller: Caller) -> api.Control:
        """Give exclusive control back; does nothing for who does not have it."""
        self._lease.release(caller.lease, self._clock_us())
        return self._status.lease(caller.lease)

    def _require_not_armed_by_another(self, caller: Caller) -> None:
        self._stops.require_confirmed([b for b in self._stops.boards if b.reachable])
        hot = [name for name, axis in self._bench.axes.items() if axis.hot]
        if any(self._dead_man.armed_by(name) != caller.client for name in hot):
            raise Refusal(
                Reason.ARMED,
                "the bench was armed by another client",
                action="disarm it first (smad disarm); exclusive control does not take over an "
                "armed bench",
            )


def _details(params: Struct, caller: Caller) -> dict[str, Any]:
    """What the run log keeps of a command, with the axes that it named."""
    details = api.logged_details(params)
    return {"axes": list(caller.axes), **details} if caller.axes else details
