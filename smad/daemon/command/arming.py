"""Arming, in two steps: every board gives a token, then every board is confirmed.

A board that gives none keeps all of them from being armed. Where one is not confirmed, the others
may be armed by then, and the bench is stopped.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass

from firmware_protocol.messages import ArmConfirm, ArmRequest, ArmToken, Message
from smad.api import Reason
from smad.control.commands import Idle
from smad.daemon.axis import Axis
from smad.daemon.bench import Bench
from smad.daemon.command.conditions import Conditions
from smad.daemon.errors import Refusal


@dataclass(frozen=True)
class Steps:
    """What is done between the steps.

    `still_wanted` raises Refusal when a stop, or another client, came in between. `begin` opens the
    run log once all boards have given a token; `armed` is told once all are confirmed.
    """

    still_wanted: Callable[[], None]
    begin: Callable[[], Awaitable[None]]
    armed: Callable[[], None]


class Arming:
    """Arms axes, one arming at a time. `conditions` are by axis."""

    def __init__(self, bench: Bench, conditions: Mapping[str, Conditions]) -> None:
        self._bench = bench
        self._conditions = conditions
        self._busy = False

    async def arm(self, axes: Sequence[Axis], generation: int, steps: Steps) -> None:
        """Arm these axes, as asked in this generation. Raises Refusal, told with the axis."""
        if self._busy:
            raise Refusal(
                Reason.BUSY,
                "the bench is being armed already",
                action="wait for the reply to that (smad status)",
            )
        self._busy = True
        try:
            tokens = await self._tokens(axes, steps)
            await steps.begin()
            for axis in axes:
                axis.stop.arming()
            await self._confirm(axes, tokens, generation, steps)
            steps.still_wanted()
        finally:
            self._busy = False

    async def _tokens(self, axes: Sequence[Axis], steps: Steps) -> dict[str, int]:
        for axis in axes:
            await self._conditions[axis.name].parameters_read()
        steps.still_wanted()
        self._require_armable(axes)
        self._bench.groups.forget([axis.name for axis in axes])
        for axis in axes:
            axis.controller.command(Idle())
        given = await _all_of(
            axes, lambda a: ArmRequest(a.config.link.axis, a.watch.parameters.crc)
        )
        steps.still_wanted()
        return {name: token.token for name, token in given.items() if isinstance(token, ArmToken)}

    async def _confirm(
        self, axes: Sequence[Axis], tokens: Mapping[str, int], generation: int, steps: Steps
    ) -> None:
        try:
            await _all_of(axes, lambda a: ArmConfirm(a.config.link.axis, tokens[a.name]))
            steps.still_wanted()
            steps.armed()
            for axis in axes:
                await axis.stop.until_armed(generation)
        except Refusal as refusal:
            if len(axes) > 1 and refusal.reason is not Reason.STOPPED:
                # The others may be armed by now, and nobody asked for a part of them.
                self._bench.stops.begin(f"arming failed: {refusal.cause}")
            raise

    def _require_armable(self, axes: Sequence[Axis]) -> None:
        refusals: list[Refusal] = []
        for axis in axes:
            try:
                with axis.told():
                    self._conditions[axis.name].require_armable()
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
