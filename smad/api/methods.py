"""The parameters of each command, and the one list of what a client can ask, and who may.

Those of motions are in `smad.control.commands`.
"""

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from smad.api.replies import (
    ConfigText,
    Control,
    Motion,
    Param,
    ParamList,
    RecorderStatus,
    Status,
    Timing,
)
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Trajectory,
    Tune,
)

Name = Annotated[str, Meta(min_length=1, max_length=64)]


class Params(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The parameters of a command."""


class GetStatus(Params, frozen=True, kw_only=True):
    """Everything about the bench now: link, board, motion, timing, recorder, lease."""


class GetMotion(Params, frozen=True, kw_only=True):
    """What the controller is doing and whether it is done; short, for polling."""


class GetConfig(Params, frozen=True, kw_only=True):
    """The configuration in force, as TOML text."""


class ResetTiming(Params, frozen=True, kw_only=True):
    """Restart the percentiles of the timing."""


class Arm(Params, frozen=True, kw_only=True):
    """Arm the bench: afterwards current may flow.

    Needs a connected board without a fault whose message schema and parameters agree with ours.
    """


class Disarm(Params, frozen=True, kw_only=True):
    """Current off, water on until cool. Anyone may do this at any time."""


class EStop(Params, frozen=True, kw_only=True):
    """Everything off until the board's power is cycled. Anyone may do this at any time."""


class Clear(Params, frozen=True, kw_only=True):
    """Acknowledge the latched fault; works once its cause is gone and the springs are cold."""

    fault: Annotated[
        int | None, Meta(description="number of the fault; empty: the one that is latched")
    ] = None


class Together(Params, frozen=True, kw_only=True):
    """Trajectories of several axes that begin together, each at its board's next sample."""

    moves: Annotated[
        dict[str, tuple[Trajectory, ...]],
        Meta(min_length=1, max_length=16, description="what each axis, by name, is to follow"),
    ]
    queue: Annotated[
        bool, Meta(description="begin when the slowest of these axes has ended what it does")
    ] = False


class ListParams(Params, frozen=True, kw_only=True):
    """The parameters stored on the board, as read when it connected."""


class GetParam(Params, frozen=True, kw_only=True):
    """Read one parameter from the board."""

    name: Annotated[Name, Meta(description="name of the parameter")]


class SetParam(Params, frozen=True, kw_only=True):
    """Change one parameter of the board; only while it is not armed."""

    name: Annotated[Name, Meta(description="name of the parameter")]
    value: Annotated[
        float, Meta(ge=-1e12, le=1e12, description="new value, in the parameter's unit")
    ]


class SaveParams(Params, frozen=True, kw_only=True):
    """Keep the board's parameters over a power cycle; only while it is not armed."""


class StartRecording(Params, frozen=True, kw_only=True):
    """Begin a run log; it goes on until stopped, armed or not."""

    name: Annotated[str, Meta(max_length=64, description="goes into the file's name")] = ""
    repeats: Annotated[
        str, Meta(max_length=300, description="the run that this one repeats, for its header")
    ] = ""


class StopRecording(Params, frozen=True, kw_only=True):
    """Close the run log."""


class AddNote(Params, frozen=True, kw_only=True):
    """Write a person's note into the run log."""

    text: Annotated[str, Meta(min_length=1, max_length=500, description="one line")]


class RecordLast(Params, frozen=True, kw_only=True):
    """Write the last seconds into a log, recorded or not."""

    seconds: Annotated[
        float, Meta(ge=1.0, le=600.0, description="at most recorder.black_box_s")
    ] = 60.0


class TakeControl(Params, frozen=True, kw_only=True):
    """Take or renew exclusive control."""

    name: Annotated[Name, Meta(description="who you are, for the messages others get")]
    lease_s: Annotated[
        float,
        Meta(ge=0.5, le=3600.0, description="silence that ends it, and disarms an armed bench"),
    ] = 10.0


class ReleaseControl(Params, frozen=True, kw_only=True):
    """Release exclusive control."""


Access = Literal["watch", "control", "stop"]


class Method(Struct, frozen=True):
    """One thing a client can ask: name on the wire, parameters, reply, and who may ask it.

    `watch`: anyone; `control`: the holder of exclusive control, or anyone while there is none;
    `stop`: anyone, also on the stop channel. What `ends_with_stop` is refused when a stop came
    after it was asked for, and until the board has confirmed that stop.
    """

    name: str
    params: type[Struct]
    reply: type[Struct]
    access: Access
    ends_with_stop: bool = False

    @property
    def summary(self) -> str:
        """First line of the documentation of the parameters."""
        return (self.params.__doc__ or "").strip().splitlines()[0]

    @property
    def logged(self) -> bool:
        """Whether the run log has it: all but what only looks."""
        return self.access != "watch" or self.params in (AddNote, TakeControl, ReleaseControl)


METHODS: tuple[Method, ...] = (
    Method("status", GetStatus, Status, "watch"),
    Method("motion", GetMotion, Motion, "watch"),
    Method("config", GetConfig, ConfigText, "watch"),
    Method("timing.reset", ResetTiming, Timing, "watch"),
    Method("arm", Arm, Motion, "control", ends_with_stop=True),
    Method("disarm", Disarm, Motion, "stop"),
    Method("estop", EStop, Motion, "stop"),
    Method("clear", Clear, Motion, "control"),
    Method("move", Follow, Motion, "control", ends_with_stop=True),
    Method("together", Together, Motion, "control", ends_with_stop=True),
    Method("heat", HoldTemperature, Motion, "control", ends_with_stop=True),
    Method("current", DriveCurrent, Motion, "control", ends_with_stop=True),
    Method("inputs", FollowInputs, Motion, "control", ends_with_stop=True),
    Method("stage", MoveStage, Motion, "control", ends_with_stop=True),
    Method("idle", Idle, Motion, "control"),
    Method("tune", Tune, Motion, "control", ends_with_stop=True),
    Method("params.list", ListParams, ParamList, "watch"),
    Method("params.get", GetParam, Param, "watch"),
    Method("params.set", SetParam, Param, "control"),
    Method("params.save", SaveParams, ParamList, "control"),
    Method("record.start", StartRecording, RecorderStatus, "control"),
    Method("record.stop", StopRecording, RecorderStatus, "control"),
    Method("record.note", AddNote, RecorderStatus, "watch"),
    Method("record.last", RecordLast, RecorderStatus, "watch"),
    Method("control.take", TakeControl, Control, "watch"),
    Method("control.release", ReleaseControl, Control, "watch"),
)

BY_PARAMS: dict[type[Struct], Method] = {method.params: method for method in METHODS}


def logged_details(params: Struct) -> dict[str, Any]:
    """What the run log keeps of a command: its fields; of inputs, whose rows it has, how many."""
    if isinstance(params, FollowInputs):
        return {"rows": len(params.t_s), "begin_s": params.t_s[0], "end_s": params.end_s}
    details = msgspec.to_builtins(params)
    assert isinstance(details, dict)
    return details
