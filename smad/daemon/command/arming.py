"""Arming, in two steps: every board gives a token, then every board is confirmed.

A board that gives none keeps all of them from being armed. Where one is not confirmed, the others
may be armed by then, and the bench is stopped.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from firmware_protocol.messages import ArmConfirm, ArmRequest, ArmToken, Message
from smad.api import Reason
from smad.control.commands import Idle
from smad.daemon.axis import Axis
from smad.daemon.command.bench import Bench
from smad.daemon.command.conditions import parameters_read, require_armable
from smad.daemon.command.lease import Caller
from smad.daemon.errors import Refusal


class Arming:
    """Arms axes, one arming at a time."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._busy = False

    async def arm(
        self, axes: Sequence[Axis], generation: int, caller: Caller, details: dict[str, Any]
    ) -> None:
        """Arm these axes, as asked in this generation. Raises Refusal, told with the axis.

        The run log, which begins once all boards have given a token, keeps `details`.
        """
        bench, now_us = self._bench, self._bench.means.clocks.us
        if self._busy:
            raise Refusal(
                Reason.BUSY,
                "the bench is being armed already",
                action="wait for the reply to that (smad status)",
            )

        def still_wanted() -> None:
            bench.stops.require(generation, [axis.stop for axis in axes])
            bench.lease.check(caller.lease, now_us())

        self._busy = True
        try:
            tokens = await self._tokens(axes, still_wanted)
            if bench.config.recorder.automatic and not bench.recorder.recording:
                await bench.recorder.start("", by_command=False)
                still_wanted()
            bench.means.say("command", "arm", details)
            bench.means.say("arm", "arming", {})
            for axis in axes:
                axis.stop.arming()
            with self._none_alone(axes):
                await _all_of(axes, lambda a: ArmConfirm(a.config.link.axis, tokens[a.name]))
                still_wanted()
                bench.dead_man.watch(caller.client, now_us())
                for axis in axes:
                    await axis.stop.until_armed(generation)
            still_wanted()
        finally:
            self._busy = False

    async def _tokens(
        self, axes: Sequence[Axis], still_wanted: Callable[[], None]
    ) -> dict[str, int]:
        for axis in axes:
            await parameters_read(axis)
        still_wanted()
        self._require_armable(axes)
        self._bench.groups.forget([axis.name for axis in axes])
        for axis in axes:
            axis.controller.command(Idle())
        given = await _all_of(
            axes, lambda a: ArmRequest(a.config.link.axis, a.watch.parameters.crc)
        )
        still_wanted()
        return {name: token.token for name, token in given.items() if isinstance(token, ArmToken)}

    @contextmanager
    def _none_alone(self, axes: Sequence[Axis]) -> Iterator[None]:
        """Stop the bench when something is refused: others may be armed, which nobody asked for."""
        try:
            yield
        except Refusal as refusal:
            if len(axes) > 1 and refusal.reason is not Reason.STOPPED:
                self._bench.stops.begin(f"arming failed: {refusal.cause}")
            raise

    def _require_armable(self, axes: Sequence[Axis]) -> None:
        refusals: list[Refusal] = []
        for axis in axes:
            try:
                require_armable(axis, self._bench.axes)
            except Refusal as refusal:
                refusals.append(refusal)
        if refusals:
            # What each axis lacks, in one reply; what to do is that of the first.
            refusals[0].cause = "; ".join(refusal.cause for refusal in refusals)
            raise refusals[0]


async def _all_of(axes: Sequence[Axis], request: Callable[[Axis], Message]) -> dict[str, Message]:
    """Ask every board at once; return their replies by axis. Raises Refusal, told with the axis."""
    asked: list[tuple[Axis, asyncio.Future[Message]]] = []
    for axis in axes:
        with axis.told():
            asked.append((axis, axis.requests.start(request(axis))))
    replies = {}
    for axis, future in asked:
        with axis.told():
            replies[axis.name] = await future
    return replies
