"""Stops: each begins a new generation, and nothing that was asked for before it is carried out.

A stop is a client's disarm or estop, a client that fell silent, a limit of the host, a lost link.
From its beginning until the boards have confirmed that they are not armed, nothing that moves the
bench is accepted. A stop joins the one before it while that is not confirmed: one DISARM serves
both. There is one generation for all axes, because a stop is for all of them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import ExitStack
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
from smad.daemon.means import Means, Say
from smad.runlog.schema import CUT

PATIENCE_US = 1_000_000
"""How long a reply to a stop waits for the board."""

ASK_AGAIN_US = 500_000
_NOT_STOPPED = "the board has not confirmed that it stopped"
_EARLIER = 1 << 31
"""Set in a difference of two of the board's times of 32 bits: the first is before the second."""


class Stops:
    """The generation, and the boards that a stop is for.

    `on_begin` is called with the boards that each new generation stops, before anything is sent.
    """

    def __init__(self, say: Say, *, on_begin: Callable[[Sequence[BoardStop]], None]) -> None:
        self.generation = 0
        self.why = ""
        self.boards: list[BoardStop] = []
        self._say = say
        self._on_begin = on_begin

    def require(self, generation: int, boards: Sequence[BoardStop]) -> None:
        """Raise Refusal when a stop of any of the boards came after `generation`."""
        since = max((board.since for board in boards), default=self.generation)
        if not since <= generation <= self.generation:
            raise Refusal(
                Reason.STOPPED,
                f"the bench was stopped after this was asked for ({self.why})",
                value=f"asked in generation {generation}",
                limit=f"generation {self.generation}",
                action="nothing was changed; see smad status, arm again and ask again",
            )

    def require_confirmed(self, boards: Sequence[BoardStop]) -> None:
        """Raise Refusal until each board has confirmed the last stop, and a sample shows it.

        The replies to the stop tell of that sample: nothing may come in between.
        """
        open_ones = [board.label for board in boards if not board.shown]
        if open_ones:
            raise Refusal(
                Reason.STOPPED,
                f"the bench is being stopped ({self.why}) and the board has not confirmed it yet",
                value=", ".join(open_ones) or None,
                action="wait until smad status shows that it is not armed, then arm again",
            )

    def begin(
        self, why: str, *, by: str = "", orderly: bool = False, only: BoardStop | None = None
    ) -> None:
        """Begin a generation: end the motions, take back what was on its way to arm a board.

        `by` is what stopped it, as a noun; `why` where that is one. A run that is being recorded
        is marked as cut, unless its motion was over and who asked is `orderly`: is free to end it.
        `only` is the one board that is stopped, where it alone fails and holds no other.
        """
        self.generation += 1
        self.why = why
        ended = f"stopped by {by or why}"
        cut: list[BoardStop] = []

        def end(board: BoardStop) -> None:
            if board.end(ended, self.generation, orderly=orderly):
                cut.append(board)

        def tell() -> None:
            if cut:
                self._say("note", f"{CUT}{ended}", {"generation": self.generation})

        stopped = self.boards if only is None else [only]
        # Whatever raises, the rest is done all the same: no board is left out of a stop.
        with ExitStack() as last_first:
            for board in reversed(stopped):
                last_first.callback(board.ask_to_stop)
            last_first.callback(self._on_begin, stopped)
            last_first.callback(tell)
            for board in reversed(stopped):
                last_first.callback(end, board)

    def order(self, why: str, text: str, data: dict[str, Any], *, by: str) -> None:
        """Stop on the daemon's own account, and tell why."""
        self._say("disarm", text, data)
        self.begin(why, by=by)


class BoardStop:
    """The stop of one board: what it ends, whether the board has confirmed it, who waits for that.

    With `holds_others` its own failures (a fault, a limit of the host, a lost link) stop the whole
    bench.
    """

    def __init__(
        self,
        stops: Stops,
        control: ControlTask,
        requests: BoardRequests,
        watch: BoardWatch,
        means: Means,
        *,
        holds_others: bool,
    ) -> None:
        self.since = 0
        """Generation of the last stop of this board."""
        self.label = means.axis
        """Names the board in messages; empty for the only one."""
        self.ended = ""
        """What ended the last arming, "stopped by …"; empty from an arming until then."""
        self._stops = stops
        self._holds_others = holds_others
        self._session = control.session
        self._controller = control.controller
        self._requests = requests
        self._watch = watch
        self._axis = control.axis
        self._say = means.say
        self._spawn = means.spawn
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
        stops.boards.append(self)

    @property
    def shown(self) -> bool:
        """Whether the board has confirmed the last stop, and a sample shows it."""
        return self._confirmed and self._confirmed_us is None

    def fails(self, why: str, *, by: str = "") -> None:
        """This board is what stops: with the others or, where it holds none, by itself."""
        lead = f"{self.label}: " if self.label else ""
        only = None if self._holds_others else self
        self._stops.begin(f"{lead}{why}", by=f"{lead}{by}" if by else "", only=only)

    def end(self, ended: str, generation: int, *, orderly: bool) -> bool:
        """End the motion. Returns whether that cuts a run (see `Stops.begin`)."""
        first = not self.ended
        cut = first and self._armed and not (orderly and self._controller.done)
        if first:
            # What comes later, such as the program's own disarm, follows from the first.
            self.ended = ended
        self.since = generation
        self._armed = False
        self._controller.command(Idle())
        return cut

    def ask_to_stop(self) -> None:
        """Take back what was on its way to arm the board, and tell it to disarm."""
        for event in self._session.withdraw_arming(self._clock_us()):
            self._requests.handle(event)
        self._confirmed = not self._could_be_armed
        self._confirmed_us = None
        self._ask()

    def arming(self) -> None:
        """The board is about to be armed: what ended the last arming is over."""
        self.ended = ""
        self._armed = True

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
            lambda: self._watch.mode in HOT or self.since > generation,
            "the board took the confirmation, and no sample shows yet that it is armed",
            "it may be armed: disarm",
        )

    def link_lost(self, why: str) -> None:
        """The session is over, and with it whatever could have armed the board."""
        self.fails(why, by=f"loss of the link: {why}")
        self._look()

    def on_sample(self, state: State) -> None:
        """A sample was published: the mode of the board may be another."""
        stopped = state.mode in STOPPED
        if stopped and not self._stopped:
            name = BoardState(state.mode).name
            self.fails(f"the board went into {name}", by=f"the board, which went into {name}")
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
