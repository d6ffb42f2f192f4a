"""Arming, in two steps: every board gives a token, then every board is confirmed.

What may be done when is the machine's to say (`smad.daemon.arming`); here it is carried out. An
arming that is refused or not finished is taken back, and who asked hears so once the boards are
off.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from firmware_protocol.messages import ArmConfirm, ArmRequest, ArmToken, Done, Message
from smad.api import Reason
from smad.control.commands import Idle
from smad.daemon.arming import Send
from smad.daemon.axis import Axis
from smad.daemon.boardstop import LONGEST_STOP_US, BoardStop
from smad.daemon.command.bench import Bench
from smad.daemon.command.conditions import first_samples, parameters_read, require_armable
from smad.daemon.command.lease import Caller
from smad.daemon.errors import Refusal, raise_together


@dataclass(frozen=True)
class ArmingRequest:
    """Which axes are to be armed, in which generation that was asked, and by whom."""

    axes: Sequence[Axis]
    generation: int
    caller: Caller

    @property
    def names(self) -> list[str]:
        """Of the axes."""
        return [axis.name for axis in self.axes]

    @property
    def boards(self) -> list[BoardStop]:
        """Of the axes."""
        return [axis.stop for axis in self.axes]


class ArmCommand:
    """Arms axes, one arming at a time."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._stops = bench.stops
        self._arming = bench.stops.arming
        self._now_us = bench.services.clocks.us

    async def arm(self, request: ArmingRequest, details: dict[str, Any]) -> None:
        """Arm these axes. Raises Refusal, told with the axis, once every axis asked is off.

        The run log, which begins once all boards have given a token, keeps `details`.
        """
        await first_samples(self._stops.boards)
        self._stops.begin_arming(request.boards, request.generation)
        try:
            await self._carry_out(request, details)
        except BaseException as error:
            stopped = self._take_back(request, error)
            if isinstance(error, Exception):
                await _until_off(stopped, error)
            raise
        finally:
            self._arming.end()

    async def _carry_out(self, request: ArmingRequest, details: dict[str, Any]) -> None:
        bench = self._bench
        tokens = await self._tokens(request)
        if bench.config.recorder.automatic and not bench.recorder.recording:
            await bench.recorder.start("", by_command=False)
        self._require_wanted(request)
        bench.services.say("command", "arm", details)
        bench.services.say("arm", "arming", {})
        bench.dead_man.watch(request.names, request.caller.client, self._now_us())
        for board in request.boards:
            board.arming()
        self._arming.confirm()
        await self._all_of(
            request,
            Send.ARM_CONFIRM,
            lambda axis: ArmConfirm(axis.config.link.axis, tokens[axis.name]),
            _took,
        )
        for axis in request.axes:
            with axis.naming_axis():
                await axis.stop.until_armed(request.generation)
        self._require_wanted(request)

    async def _tokens(self, request: ArmingRequest) -> Mapping[str, int]:
        for axis in request.axes:
            await parameters_read(axis)
        self._require_wanted(request)
        self._require_armable(request.axes)
        self._bench.groups.forget(request.names)
        for axis in request.axes:
            axis.controller.command(Idle())
        tokens: dict[str, int] = {}

        def granted(axis: Axis, reply: Message) -> None:
            assert isinstance(reply, ArmToken)
            tokens[axis.name] = reply.token
            self._arming.granted(axis.name)

        self._arming.ask()
        await self._all_of(
            request,
            Send.ARM_REQUEST,
            lambda axis: ArmRequest(axis.config.link.axis, axis.watch.parameters.crc),
            granted,
        )
        self._require_wanted(request)
        return tokens

    def _require_wanted(self, request: ArmingRequest) -> None:
        """Raise Refusal when a stop came, or who asked is not in control any more."""
        self._stops.require(request.generation, request.boards)
        self._bench.lease.check(request.caller.lease, self._now_us())
        attempt = self._arming.attempt
        if attempt is None or attempt.failed:
            raise Refusal(
                Reason.STOPPED,
                f"another axis was stopped while this was being armed ({self._stops.why})",
                action="no axis was armed; see smad status, then arm again",
            )

    def _require_armable(self, axes: Sequence[Axis]) -> None:
        refusals: list[Refusal] = []
        for axis in axes:
            try:
                require_armable(axis, self._bench.axes)
            except Refusal as refusal:
                refusals.append(refusal)
        raise_together(refusals)

    async def _all_of(
        self,
        request: ArmingRequest,
        kind: Send,
        message: Callable[[Axis], Message],
        answered: Callable[[Axis, Message], None],
    ) -> None:
        """Ask every board that the machine names, at once. Raises the first Refusal, with the axis.

        The others may be on their way still, and are taken back by a stop.
        """
        to_send = {name for name, send in self._arming.take_sends() if send is kind}
        futures: dict[asyncio.Future[Message], Axis] = {}
        for axis in request.axes:
            if axis.name in to_send:
                with axis.naming_axis():
                    futures[axis.requests.start(message(axis))] = axis
        waiting: Iterable[asyncio.Future[Message]] = futures
        while waiting:
            done, waiting = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for future in done:
                with futures[future].naming_axis():
                    answered(futures[future], future.result())

    def _take_back(self, request: ArmingRequest, error: BaseException) -> Sequence[Axis]:
        """Stop every axis that was asked; return the axes that a refusal has to wait for.

        Once a board may have been armed, that is a stop like any other, of all that its failures
        stop.
        """
        attempt = self._arming.attempt
        assert attempt is not None
        if not attempt.confirming:
            self._arming.fail()
            self._stops.send()
            return request.axes
        if attempt.failed:
            # The stop that failed it has chosen whom it stops; another axis may stay armed.
            return request.axes
        names = {other for name in request.names for other in self._arming.stopped_by(name)}
        stopped = [axis for axis in self._bench.axes.values() if axis.name in names]
        cause = error.cause if isinstance(error, Refusal) else repr(error)
        self._stops.begin(f"arming failed: {cause}", boards=[axis.stop for axis in stopped])
        return stopped


def _took(axis: Axis, reply: Message) -> None:
    assert isinstance(reply, Done)
    axis.stop.took(reply)


async def _until_off(axes: Sequence[Axis], error: Exception) -> None:
    """Return once these axes are off; where one is not in time, let the error say so."""
    for axis in axes:
        try:
            with axis.naming_axis():
                await axis.stop.until_off(LONGEST_STOP_US)
        except Refusal as open_one:
            if isinstance(error, Refusal):
                error.cause = f"{error.cause}; {open_one.cause}"
                error.action = open_one.action
