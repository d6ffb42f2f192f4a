"""Stops: each begins a new generation, and nothing that was asked for before it is carried out.

A stop is a client's disarm or estop, a client that fell silent, a limit of the host, a lost link.
From its beginning until the board has confirmed that it is not armed, nothing that moves the bench
is accepted. A stop joins the one before it while that is not confirmed: one DISARM serves both.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState
from firmware_protocol.messages import Disarm, Done, State
from firmware_protocol.mirror import HOT, STOPPED
from smad.api import Reason
from smad.control.commands import Idle
from smad.daemon.control import ControlTask
from smad.daemon.errors import Refusal
from smad.daemon.link.requests import BoardRequests
from smad.daemon.link.watch import BoardWatch
from smad.daemon.means import Means
from smad.runlog.schema import CUT

PATIENCE_US = 1_000_000
"""How long a reply to a stop waits for the board."""

ASK_AGAIN_US = 500_000
_NOT_STOPPED = "the board has not confirmed that it stopped"
_EARLIER = 1 << 31
"""Set in a difference of two of the board's times of 32 bits: the first is before the second."""


class Stops:
    """The generation, and whether the board has confirmed its stop.

    `on_begin` is called with each new generation, before anything is sent.
    """

    def __init__(
        self,
        control: ControlTask,
        requests: BoardRequests,
        watch: BoardWatch,
        means: Means,
        *,
        on_begin: Callable[[], None],
    ) -> None:
        self.generation = 0
        self.why = ""
        self.ended = ""
        """What ended the last arming, "stopped by …"; empty from an arming until then."""
        self._session = control.session
        self._controller = control.controller
        self._requests = requests
        self._watch = watch
        self._axis = control.axis
        self._say = means.say
        self._spawn = means.spawn
        self._on_begin = on_begin
        self._clock_us = means.clocks.us
        self._armed = False
        """Armed, or about to be, since the last stop."""
        self._confirmed = True
        self._confirmed_us: int | None = None
        """Board time of the confirmation, until a sample after it was published."""
        self._stopped = False
        self._asking = False
        self._asked_us = 0
        self._waiting: list[asyncio.Future[None]] = []

    def require(self, generation: int) -> None:
        """Raise Refusal when a stop came after `generation`."""
        if generation != self.generation:
            raise Refusal(
                Reason.STOPPED,
                f"the bench was stopped after this was asked for ({self.why})",
                value=f"asked in generation {generation}",
                limit=f"generation {self.generation}",
                action="nothing was changed; see smad status, arm again and ask again",
            )

    def require_confirmed(self) -> None:
        """Raise Refusal until the board has confirmed the last stop, and a sample shows it.

        The replies to the stop tell of that sample: nothing may come in between.
        """
        if not self._confirmed or self._confirmed_us is not None:
            raise Refusal(
                Reason.STOPPED,
                f"the bench is being stopped ({self.why}) and the board has not confirmed it yet",
                action="wait until smad status shows that it is not armed, then arm again",
            )

    def begin(self, why: str, *, by: str = "", orderly: bool = False) -> None:
        """Begin a generation: end the motion, take back what was on its way to arm the board.

        `by` is what stopped it, as a noun; `why` where that is one. A run that is being recorded
        is marked as cut, unless its motion was over and who asked is `orderly`: is free to end it.
        """
        self.generation += 1
        self.why = why
        if not self.ended:
            # What comes later, such as the program's own disarm, follows from the first.
            self.ended = f"stopped by {by or why}"
            if self._armed and not (orderly and self._controller.done):
                self._say("note", f"{CUT}{self.ended}", {"generation": self.generation})
        self._armed = False
        self._controller.command(Idle())
        self._on_begin()
        for event in self._session.withdraw_arming(self._clock_us()):
            self._requests.handle(event)
        self._confirmed = not self._could_be_armed
        self._confirmed_us = None
        self._ask()

    def order(self, why: str, text: str, data: dict[str, Any], *, by: str) -> None:
        """Stop on the daemon's own account, and tell why."""
        self._say("disarm", text, data)
        self.begin(why, by=by)

    def arming(self) -> None:
        """The board is about to be armed: what ended the last arming is over."""
        self.ended = ""
        self._armed = True

    def estop(self, why: str) -> None:
        """Begin a stop that only a power cycle ends. Raises NotConnectedError without a port."""
        self.begin(why)
        self._session.send_estop()

    async def until_confirmed(self) -> None:
        """Return once the board has confirmed the stop. Raises Refusal if it does not."""
        await self._until(lambda: self._confirmed, _NOT_STOPPED, "the daemon goes on asking")

    async def until_disarmed(self) -> None:
        """Return once a sample shows it, too, for a reply that tells the board's state."""
        await self._until(
            lambda: (
                self._confirmed
                and self._confirmed_us is None
                and self._watch.mode not in (None, *HOT)
            ),
            _NOT_STOPPED,
            "the daemon goes on asking",
        )

    async def until_estop(self) -> None:
        """Return once the board says ESTOP. Raises Refusal if it does not."""
        await self._until(
            lambda: self._confirmed and self._watch.mode is BoardState.ESTOP,
            _NOT_STOPPED,
            "ESTOP is sent until it does",
        )

    async def until_armed(self, generation: int) -> None:
        """Return once a sample shows that the board is armed, or a stop came after `generation`.

        Raises Refusal if neither happens.
        """
        await self._until(
            lambda: self._watch.mode in HOT or self.generation != generation,
            "the board took the confirmation, and no sample shows yet that it is armed",
            "it may be armed: disarm",
        )

    def link_lost(self, why: str) -> None:
        """The session is over, and with it whatever could have armed the board."""
        self.begin(why, by=f"loss of the link: {why}")
        self._look()

    def on_sample(self, state: State) -> None:
        """A sample was published: the mode of the board may be another."""
        stopped = state.mode in STOPPED
        if stopped and not self._stopped:
            name = BoardState(state.mode).name
            self.begin(f"the board went into {name}", by=f"the board, which went into {name}")
        self._stopped = stopped
        if stopped:
            # From these, no request that is still on its way leads back to ARMED.
            self._confirmed = True
            self._confirmed_us = None
        if self._confirmed_us is not None and not (state.t_us - self._confirmed_us) & _EARLIER:
            self._confirmed_us = None
        self._look()

    def tick(self) -> None:
        """Let replies that waited too long go out, and ask again what was not confirmed."""
        if not self._confirmed and self._clock_us() - self._asked_us >= ASK_AGAIN_US:
            self._ask()
        self._look()

    @property
    def _could_be_armed(self) -> bool:
        connected = self._session.state not in (HostState.DISCONNECTED, HostState.SYNC)
        return connected and not self._requests.watch_only

    def _ask(self) -> None:
        if not self._asking and not self._confirmed:
            self._asking = True
            self._asked_us = self._clock_us()
            self._spawn("disarm", self._ask_board())

    async def _ask_board(self) -> None:
        try:
            done = await self._requests.ask(Disarm(self._axis))
        except Refusal as refusal:
            self._say("warning", f"the board did not confirm the disarm: {refusal}", {})
        else:
            assert isinstance(done, Done)
            self._confirmed = True
            self._confirmed_us = done.t_us
        finally:
            self._asking = False
        self._look()

    async def _until(self, reached: Callable[[], bool], cause: str, action: str) -> None:
        deadline_us = self._clock_us() + PATIENCE_US
        while self._could_be_armed:
            if reached():
                return
            if self._clock_us() >= deadline_us:
                mode = self._watch.mode
                raise Refusal(
                    Reason.NO_REPLY,
                    cause,
                    value=f"it is in {'an unknown state' if mode is None else mode.name}",
                    limit=f"{PATIENCE_US / 1e6:g} s",
                    action=f"{action}; if current still flows, cut the power",
                )
            waiting: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            self._waiting.append(waiting)
            await waiting

    def _look(self) -> None:
        """Let those who wait for the board look at it again."""
        waiting, self._waiting = self._waiting, []
        for future in waiting:
            if not future.done():
                future.set_result(None)
