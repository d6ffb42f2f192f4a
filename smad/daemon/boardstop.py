"""The stop of one board: its motion is ended, it is told to disarm, and replies wait until it did.

What is known of it is a phase in `smad.daemon.arming`; here is what moves it on: the board's
replies and samples, and the time in which its own watchdog must have acted.
"""

import asyncio
from collections.abc import Callable

from firmware_protocol.enums import BoardState
from firmware_protocol.messages import Disarm, Done, State
from firmware_protocol.mirror import HOT, STOPPED
from firmware_protocol.supervisor.limits import compiled_limits
from smad.api import Reason
from smad.control.commands import Idle
from smad.daemon.arming import Arming, Input, Phase
from smad.daemon.control import ControlTask
from smad.daemon.errors import Refusal
from smad.daemon.link.requests import BoardRequests
from smad.daemon.link.watch import BoardWatch
from smad.daemon.services import Services

PATIENCE_US = 1_000_000
"""How long a reply to a stop waits for the board."""
LONGEST_STOP_US = 4_000_000
"""How long a refusal to arm does: longer than the slowest way in which a board can stop."""

ASK_AGAIN_US = 500_000
WITHHOLD_US = 250_000
"""After so long without a confirmation a board gets no setpoints. Three DISARMs were lost by then,
and its watchdog (`WATCHDOG_EXPIRED_US`) still ends within `PATIENCE_US`."""

_LIMITS = compiled_limits()
_MARGIN_US = 50_000
WATCHDOG_EXPIRED_US = (
    _LIMITS.setpoint_age_us + _LIMITS.setpoint_ttl_ms * 1000 + _LIMITS.hold_us + _MARGIN_US
)
"""A board that got no setpoint for so long has stopped: setpoint too old, ARMED, HOLD, FAULT."""
TOKEN_US = _LIMITS.token_us
"""For so long an ARM_CONFIRM that was not answered may still come late and be taken."""

_NOT_STOPPED = "the board has not confirmed that it stopped"
_EARLIER = 1 << 31
"""Set in a difference of two of the board's times of 32 bits: the first is before the second."""


class BoardStop:
    """The stop of one board: what it ends, what is known of it, who waits for that.

    `on_failure` is called when the board itself is what stops, with its label, why, and what
    stopped it as a noun (`Stops.board_failed`).
    """

    def __init__(
        self,
        arming: Arming,
        control: ControlTask,
        requests: BoardRequests,
        watch: BoardWatch,
        services: Services,
        *,
        on_failure: Callable[[str, str, str], None],
    ) -> None:
        self.label = services.axis
        """Names the board in messages; empty for the only one."""
        self.ended = ""
        """What ended the last arming, "stopped by …"; empty from an arming until then."""
        self._arming = arming
        self._on_failure = on_failure
        self._control = control
        self._session = control.session
        self._controller = control.controller
        self._requests = requests
        self._watch = watch
        self._axis = control.axis
        self._say = services.say
        self._spawn = services.spawn
        self._clock_us = services.clocks.us
        self._armed = False
        """Armed, or about to be, since the last stop."""
        self._confirmed_us: int | None = None
        """Board time of what the board confirmed last, until a sample is later: an earlier one does
        not show it yet."""
        self._stopped = False
        self._armings = 0
        """ARM_CONFIRMs so far: a DISARM that was asked for before one says nothing of it."""
        self._asking: set[int] = set()
        """After how many of them each DISARM that is not answered yet was asked for."""
        self._asked_us = 0
        self._stopping_us = 0
        self._heating_until_us = self._clock_us()
        """Until then, by what was sent and heard, its own watchdog had no reason to begin."""
        self._looked_at = asyncio.Event()

    @property
    def phase(self) -> Phase:
        """What is known of the board."""
        return self._arming.axes[self.label].phase

    @property
    def off(self) -> bool:
        """Whether the board is known to be off."""
        return self.phase is Phase.OFF

    def stop_after_failure(self, why: str, *, by: str = "") -> None:
        """This board is what stops: with the others or, where it holds none, by itself."""
        lead = f"{self.label}: " if self.label else ""
        self._on_failure(self.label, f"{lead}{why}", f"{lead}{by}" if by else "")

    def end(self, ended: str, *, orderly: bool) -> bool:
        """End the motion. Returns whether that cuts a run (see `Stops.begin`)."""
        first = not self.ended
        cut = first and self._armed and not (orderly and self._controller.done)
        if first:
            # What comes later, such as the program's own disarm, follows from the first.
            self.ended = ended
        self._armed = False
        self._controller.command(Idle())
        return cut

    def ask_to_stop(self) -> None:
        """Take back what was on its way to arm the board, and tell it to disarm."""
        for event in self._session.withdraw_arming(self._clock_us()):
            self._requests.handle(event)
        self._confirmed_us = None
        self._stopping_us = self._clock_us()
        self._ask()

    def arming(self) -> None:
        """The board is about to be armed: what ended the last arming is over."""
        self.ended = ""
        self._armed = True
        self._armings += 1
        self._heating_until_us = max(self._heating_until_us, self._clock_us() + TOKEN_US)

    def took(self, done: Done) -> None:
        """The board took its token."""
        self._confirmed_us = done.t_us
        self._heating_until_us = self._clock_us()
        self._arming.took(self.label)

    async def until_confirmed(self) -> None:
        """Return once the board has confirmed the stop. Raises Refusal if it does not."""
        confirmed = (Phase.STOPPED, Phase.OFF, Phase.NO_SESSION)
        await self._until(
            lambda: self.phase in confirmed, _NOT_STOPPED, "the daemon goes on asking"
        )

    async def until_off(self, patience_us: int = PATIENCE_US) -> None:
        """Return once the board is known to be off. Raises Refusal if that takes too long."""
        await self._until(lambda: self.off, _NOT_STOPPED, "the daemon goes on asking", patience_us)

    async def until_estop(self) -> None:
        """Return once the board says ESTOP. Raises Refusal if it does not."""
        await self._until(
            lambda: self.off and (self._watch.mode is BoardState.ESTOP or not self.reachable),
            _NOT_STOPPED,
            "ESTOP is sent until it does",
        )

    async def until_armed(self, generation: int) -> None:
        """Return once a sample shows that the board is armed, or a stop came after `generation`.

        Raises Refusal if neither happens.
        """
        await self._until(
            lambda: self.phase is Phase.ARMED or self._arming.generation > generation,
            "the board took the confirmation, and no sample shows that it is armed",
            "it was disarmed; see smad status, then arm again",
        )

    def connected(self) -> None:
        """A session was opened; it has disarmed the board, which a sample has to show."""
        if not self._requests.watch_only:
            self._confirmed_us = None
            self._arming.connected(self.label)

    def link_lost(self, why: str) -> None:
        """The session is over, and with it whatever could have armed the board."""
        self._arming.lost(self.label)
        self.stop_after_failure(why, by=f"loss of the link: {why}")
        self._look()

    def reported(self) -> None:
        """The board reported a fault of this axis, which is in FAULT."""
        if not self._stopped:
            self._stopped = True
            self._fails_in(BoardState.FAULT)
        self._look()

    def on_sample(self, state: State) -> None:
        """A sample was published: the mode of the board may be another."""
        stopped = state.mode in STOPPED
        if stopped and not self._stopped:
            self._fails_in(state.mode)
        if state.mode in HOT:
            # It has lived for a setpoint's life and a hold; only what is left counts.
            self._heating_until_us = max(self._heating_until_us, self._clock_us())
        earlier = self._confirmed_us is not None and (state.t_us - self._confirmed_us) & _EARLIER
        if not earlier:
            # Later ones are later, too; half an hour on, the difference would wrap and hide them.
            self._confirmed_us = None
        if stopped or not earlier:
            # From FAULT and ESTOP, no request that is still on its way leads back to ARMED.
            self._stopped = stopped
            self._on_shown_mode(state)
        self._withhold_in_time()
        self._look()

    def _on_shown_mode(self, state: State) -> None:
        hot, stopped = state.mode in HOT, state.mode in STOPPED
        event = Input.SHOWS_ARMED if hot else Input.SHOWS_FAULT if stopped else Input.SHOWS_OFF
        if not self._arming.shows(self.label, event) or stopped:
            return
        if hot:
            text = "the board was found armed by somebody else; telling it to disarm"
            self._say("disarm", text, {})
            self.stop_after_failure(
                "the board was found armed", by="the daemon, which found it armed"
            )
        else:
            self.stop_after_failure("the board is not armed any more")

    def _fails_in(self, mode: int) -> None:
        name = BoardState(mode).name
        self.stop_after_failure(
            f"the board went into {name}", by=f"the board, which went into {name}"
        )

    def tick(self) -> None:
        """Ask again what was not confirmed, leave the rest to the board's own watchdog, and let
        replies that waited too long go out."""
        now_us = self._clock_us()
        if self.phase is Phase.STOPPING and now_us - self._asked_us >= ASK_AGAIN_US:
            self._ask()
        self._withhold_in_time()
        self.note_watchdog()
        self._look()

    def _withhold_in_time(self) -> None:
        """Send no more setpoints to a board that did not confirm a stop in time.

        Looked at with every sample: a tick can come late, and then the reply would be sent before
        the watchdog has stopped the board.
        """
        if self.phase is Phase.STOPPING and self._clock_us() - self._stopping_us >= WITHHOLD_US:
            self._arming.withhold_setpoints(self.label)
        self._control.withheld = self._arming.axes[self.label].withheld

    def note_watchdog(self) -> None:
        """Note that the board's own watchdog must have stopped it, once that is so."""
        fed_us = max(self._control.fed_us, self._heating_until_us)
        if self._clock_us() - fed_us >= WATCHDOG_EXPIRED_US:
            self._arming.watchdog_expired(self.label)

    @property
    def reachable(self) -> bool:
        """Whether there is a session, with a board that takes requests."""
        return self._arming.axes[self.label].reachable

    def _ask(self) -> None:
        if self._armings not in self._asking and self.phase is Phase.STOPPING:
            self._asking.add(self._armings)
            self._asked_us = self._clock_us()
            self._spawn("disarm", self._ask_board(self._armings))

    async def _ask_board(self, armings: int) -> None:
        try:
            done = await self._requests.ask(Disarm(self._axis))
        except Refusal as refusal:
            self._say("warning", f"the board did not confirm the disarm: {refusal}", {})
        else:
            assert isinstance(done, Done)
            if armings == self._armings:
                self._confirmed_us = done.t_us
                self._heating_until_us = self._clock_us()
                self._arming.disarmed(self.label)
        finally:
            self._asking.discard(armings)
        self._look()

    async def _until(
        self, reached: Callable[[], bool], cause: str, action: str, patience_us: int = PATIENCE_US
    ) -> None:
        deadline_us = self._clock_us() + patience_us
        while not reached():
            if self._clock_us() >= deadline_us:
                mode = self._watch.mode
                raise Refusal(
                    Reason.NO_REPLY,
                    cause,
                    value=f"it is in {'an unknown state' if mode is None else mode.name}",
                    limit=f"{patience_us / 1e6:g} s",
                    action=f"{action}; if current still flows, cut the power",
                )
            await self._looked_at.wait()

    def _look(self) -> None:
        """Let those who wait for the board look at it again."""
        self._looked_at.set()
        self._looked_at.clear()
