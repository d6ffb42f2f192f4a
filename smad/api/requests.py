"""The parameters of each command; those of motions are in `smad.control.commands`."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from smad.control.commands import Trajectory

Name = Annotated[str, Meta(min_length=1, max_length=64)]


class Params(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The parameters of a command."""


class GetStatus(Params, frozen=True, kw_only=True):
    """Everything about the bench now: link, board, motion, timing, recorder, lease."""


class GetMotion(Params, frozen=True, kw_only=True):
    """What the controller is doing and whether it is done; short, made to be polled."""


class GetConfig(Params, frozen=True, kw_only=True):
    """The configuration in force, as TOML text."""


class ResetTiming(Params, frozen=True, kw_only=True):
    """Begin the timing's percentiles anew, to measure a stretch by itself."""


class Arm(Params, frozen=True, kw_only=True):
    """Arm the bench: the board checks itself and lets current through afterwards.

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


class TakeControl(Params, frozen=True, kw_only=True):
    """Take, or renew, exclusive control: until it ends, only this client's commands count."""

    name: Annotated[Name, Meta(description="who you are, for the messages others get")]
    lease_s: Annotated[
        float,
        Meta(ge=0.5, le=3600.0, description="silence that ends it, and disarms an armed bench"),
    ] = 10.0


class ReleaseControl(Params, frozen=True, kw_only=True):
    """Give exclusive control back."""
