"""The one list of what a client can ask, and who may."""

from __future__ import annotations

from typing import Any, Literal

import msgspec
from msgspec import Struct

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
from smad.api.requests import (
    AddNote,
    Arm,
    Clear,
    Disarm,
    EStop,
    GetConfig,
    GetMotion,
    GetParam,
    GetStatus,
    ListParams,
    ReleaseControl,
    ResetTiming,
    SaveParams,
    SetParam,
    StartRecording,
    StopRecording,
    TakeControl,
    Together,
)
from smad.control.commands import (
    DriveCurrent,
    Follow,
    FollowInputs,
    HoldTemperature,
    Idle,
    MoveStage,
    Tune,
)

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
