"""What an axis can be told and asked: the part of the blocking client that has one.

Written by `python -m tools.blocking_client` from async_commands.py: edit that.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from smad import api
from smad.client.channel import Channel, pause
from smad.client.errors import Stopped
from smad.client.progress import Wait
from smad.client.wire import Reply
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

POLL_S = 0.05


class Commands(ABC):
    """Commands of an axis: of the one that is named, else of a bench that has one."""

    name: str
    timeout_s: float
    _channel: Channel

    def _call(
        self,
        params: Any,
        kind: type[Reply],
        *,
        stop: bool = False,
        timeout_s: float | None = None,
        axes: tuple[str, ...] = (),
    ) -> Reply:
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        return self._channel.call(params, kind, limit_s, stop=stop, axes=axes or self.name)

    def _begin(self, params: Any, *axes: str) -> api.Motion:
        """Command a motion, and know it again: somebody else may replace it before it ends."""
        motion = self._call(params, api.Motion)
        self._channel.conversation.commanded(motion, *(axes or (self.name,)))
        return motion

    @abstractmethod
    def _ended(self, motion: api.Motion) -> None:
        """Take note that a motion ended before it was done."""

    def status(self) -> api.Status:
        """Everything about the bench now."""
        return self._call(api.GetStatus(), api.Status)

    def motion(self) -> api.Motion:
        """What the controller is doing and whether it is done."""
        return self._call(api.GetMotion(), api.Motion)

    def config(self) -> str:
        """The configuration in force, as TOML; on an axis, that of the axis."""
        replied = self._call(api.GetConfig(), api.ConfigText)
        return replied.toml

    def reset_timing(self) -> api.Timing:
        """Restart the percentiles of the timing."""
        return self._call(api.ResetTiming(), api.Timing)

    def clear(self, fault: int | None = None) -> api.Motion:
        """Acknowledge the latched fault; with `fault`, only if it has that number.

        It says that a person has seen what stopped the bench: `arm` is allowed again.
        """
        motion = self._call(api.Clear(fault=fault), api.Motion)
        self._channel.conversation.begin(None)
        return motion

    def move(self, *trajectories: Trajectory, queue: bool = False) -> api.Motion:
        """Follow trajectories one after the other; `queue` appends them to the present motion."""
        return self._follow(trajectories, queue=queue)

    def _follow(self, trajectories: Sequence[Trajectory], *, queue: bool) -> api.Motion:
        motion: api.Motion | None = None
        for piece in (piece for whole in trajectories for piece in in_pieces(whole)):
            command = Follow(trajectories=(piece,), queue=queue or motion is not None)
            motion = self._begin(command)
        if motion is None:
            return self._begin(Follow(trajectories=()))
        return motion

    def heat(
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
        return self._begin(command)

    def current(self, command: DriveCurrent) -> api.Motion:
        """Apply currents and pump duties without feedback."""
        return self._begin(command)

    def follow_inputs(self, command: FollowInputs) -> api.Motion:
        """Play recorded currents and duties of any length; they are sent in parts."""
        first, *rest = rows_in_pieces(command)
        motion = self._begin(first)
        for piece in rest:
            motion = self._begin(piece)
        return motion

    def stage(self, stage_mm: float, rate_mm_per_s: float) -> api.Motion:
        """Move the stretching stage."""
        return self._call(MoveStage(stage_mm=stage_mm, rate_mm_per_s=rate_mm_per_s), api.Motion)

    def idle(self) -> api.Motion:
        """End the motion: no current, no water. The bench stays armed."""
        return self._begin(Idle())

    def tune(self, command: Tune) -> api.Motion:
        """Change gains and options of the running controller."""
        return self._call(command, api.Motion)

    def params(self) -> tuple[api.Param, ...]:
        """The parameters stored on the board."""
        replied = self._call(api.ListParams(), api.ParamList)
        return replied.params

    def get_param(self, name: str) -> api.Param:
        """One parameter of the board."""
        return self._call(api.GetParam(name=name), api.Param)

    def set_param(self, name: str, value: float) -> api.Param:
        """Change one parameter of the board; returns it as the board has it now."""
        return self._call(api.SetParam(name=name, value=value), api.Param)

    def save_params(self) -> tuple[api.Param, ...]:
        """Keep the parameters over a power cycle."""
        replied = self._call(api.SaveParams(), api.ParamList)
        return replied.params

    def wait_until_done(
        self,
        progress: Callable[[api.Motion], None] | None = None,
        *,
        timeout_s: float | None = None,
    ) -> api.Motion:
        """Return when every commanded motion is done; `progress` is called with each poll.

        Raises Stopped if a stop ends the motion (disarm, fault, lost board) or another client ends
        or replaces the one that this client has commanded, NoAnswer after `timeout_s`.
        """
        conversation = self._channel.conversation
        wait = Wait(time.monotonic(), timeout_s, conversation.generation)
        while True:
            motion = self.motion()
            if progress is not None:
                progress(motion)
            try:
                ours = conversation.is_ours(motion, self.name)
                if wait.over(motion, time.monotonic(), ours=ours):
                    return motion
            except Stopped:
                self._ended(motion)
                raise
            pause(POLL_S)

    def telemetry(
        self, *, timeout_s: float | None = None, queue: int = 1000
    ) -> Iterator[api.Telemetry]:
        """Iterate over published samples. Raises NoAnswer after `timeout_s` without a sample."""
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        return self._channel.telemetry(limit_s, queue, self.name)
