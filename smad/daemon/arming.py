"""Arming and stopping as one state machine, without clock, port or task.

Rules:

1. Whatever is not known to be off is being stopped, axis by axis. An axis is known to be off when
   its board took a DISARM and a later sample shows it, when a sample shows FAULT or ESTOP, when a
   new session has disarmed it and a sample shows it, or when it got no setpoint for as long as its
   own watchdog takes. Nothing is known of an axis when the daemon starts.
2. An arming is whole or it is taken back: when one of its axes is refused, is late or is stopped,
   every axis that was asked is stopped, and the refusal is sent once all of them are off.
3. A stop that is open on any axis refuses arming on every axis, and any stop ends an arming that is
   under way. A stop is open until all its axes are off and its reply is sent.
4. Every stop begins a generation, which carries the daemon's boot id: what was asked for in an
   earlier generation, or of an earlier daemon, is refused.

`TRANSITIONS` is the machine of one axis; docs/safety.md shows it. `Arming` is that of the bench:
its methods take what was asked or heard, `take_sends` has what is to be sent. A test drives both
through every interleaving of two axes and two clients on lines that lose and delay.
"""

import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

BOOT_ID_BITS = 28
COUNT_BITS = 24
"""Both parts of a generation fit the whole numbers that every JSON reader keeps exactly."""


class Phase(enum.Enum):
    """What is known of an axis."""

    OFF = "known to be off"
    ASKED = "asked for a token"
    GRANTED = "gave a token"
    CONFIRMED = "ARM_CONFIRM was sent: it may be armed"
    TAKEN = "took ARM_CONFIRM; no sample shows it yet"
    ARMED = "armed, and a sample shows it"
    STOPPING = "DISARM was sent: it may be armed"
    STOPPED = "took DISARM; no sample shows it yet"
    NEW_SESSION = "a new session, which disarms; no sample shows it yet"
    NO_SESSION = "without a session: its own watchdog ends heating"


class Input(enum.Enum):
    """What is done to an axis, or heard of it."""

    ASK = "ARM_REQUEST is sent"
    TOKEN = "ARM_TOKEN came"
    CONFIRM = "ARM_CONFIRM is sent"
    TOOK = "DONE of ARM_CONFIRM came"
    SHOWS_ARMED = "a sample shows ARMED or HOLD"
    STOP = "a stop, or an arming that is taken back"
    DISARMED = "DONE of DISARM came"
    SHOWS_OFF = "a sample shows SAFE, COOL or BOOT"
    SHOWS_FAULT = "a sample shows FAULT or ESTOP"
    LOST = "the session is over"
    CONNECTED = "a new session, which disarms"
    WATCHDOG_EXPIRED = "no setpoint for as long as the board's watchdog takes"


_ARMING = (Phase.ASKED, Phase.GRANTED, Phase.CONFIRMED, Phase.TAKEN, Phase.ARMED)
OPEN = frozenset({Phase.STOPPING, Phase.STOPPED, Phase.NEW_SESSION, Phase.NO_SESSION})
"""Not known to be off, and not to be armed."""

_FROM_ANY_ARMING = {Input.STOP: Phase.STOPPING, Input.LOST: Phase.NO_SESSION}

TRANSITIONS: Mapping[Phase, Mapping[Input, Phase]] = {
    Phase.OFF: {
        Input.ASK: Phase.ASKED,
        Input.STOP: Phase.STOPPING,
        Input.CONNECTED: Phase.NEW_SESSION,
    },
    Phase.ASKED: {Input.TOKEN: Phase.GRANTED, **_FROM_ANY_ARMING},
    Phase.GRANTED: {Input.CONFIRM: Phase.CONFIRMED, **_FROM_ANY_ARMING},
    Phase.CONFIRMED: {Input.TOOK: Phase.TAKEN, **_FROM_ANY_ARMING},
    Phase.TAKEN: {Input.SHOWS_ARMED: Phase.ARMED, **_FROM_ANY_ARMING},
    Phase.ARMED: _FROM_ANY_ARMING,
    Phase.STOPPING: {
        Input.DISARMED: Phase.STOPPED,
        Input.SHOWS_FAULT: Phase.OFF,
        Input.WATCHDOG_EXPIRED: Phase.OFF,
        Input.LOST: Phase.NO_SESSION,
    },
    Phase.STOPPED: {
        Input.SHOWS_OFF: Phase.OFF,
        Input.SHOWS_FAULT: Phase.OFF,
        Input.STOP: Phase.STOPPING,
        Input.LOST: Phase.NO_SESSION,
    },
    Phase.NEW_SESSION: {
        Input.SHOWS_OFF: Phase.OFF,
        Input.SHOWS_FAULT: Phase.OFF,
        Input.STOP: Phase.STOPPING,
        Input.LOST: Phase.NO_SESSION,
    },
    Phase.NO_SESSION: {Input.CONNECTED: Phase.NEW_SESSION, Input.WATCHDOG_EXPIRED: Phase.OFF},
}
"""What each input leads to; one that a phase does not list changes nothing."""


class Send(enum.Enum):
    """What is to be sent to a board."""

    ARM_REQUEST = enum.auto()
    ARM_CONFIRM = enum.auto()
    DISARM = enum.auto()
    """After every request to arm that still waits was taken back."""


class WhyNot(enum.Enum):
    """Why an arming cannot begin."""

    BUSY = "another arming is under way"
    OPEN = "a stop is open"
    STALE = "a stop came after it was asked for"
    ARMED = "an axis is armed"


@dataclass
class AxisArming:
    """What is known of one axis."""

    phase: Phase = Phase.NO_SESSION
    reachable: bool = False
    """Whether there is a session, with a board that takes requests."""
    withheld: bool = False
    """Whether it gets no setpoints, so that its own watchdog stops it."""
    since: int = 0
    """Generation of its last stop."""

    def take(self, event: Input) -> None:
        """Change the phase as TRANSITIONS says."""
        self.phase = TRANSITIONS[self.phase].get(event, self.phase)
        if self.phase is Phase.OFF:
            self.withheld = False


@dataclass
class Attempt:
    """An arming under way: of these axes, asked for in this generation."""

    names: tuple[str, ...]
    generation: int
    failed: bool = False
    confirming: bool = False
    """Whether an ARM_CONFIRM was sent: an axis may have been armed."""


@dataclass
class Arming:
    """The axes of a bench, one arming at a time, and the generation.

    `alone` names the axes whose own failures stop no other. `boot_id` is of this daemon's start.
    """

    names: tuple[str, ...]
    alone: frozenset[str] = frozenset()
    boot_id: int = 0
    generation: int = 0
    attempt: Attempt | None = None
    replies_open: int = 0
    """Stops whose replies are not sent yet."""
    axes: dict[str, AxisArming] = field(default_factory=dict)
    _sends: list[tuple[str, Send]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.generation = (self.boot_id & ((1 << BOOT_ID_BITS) - 1)) << COUNT_BITS
        self.axes = {name: AxisArming(since=self.generation) for name in self.names}

    # What is known

    def open_axes(self, names: Iterable[str] | None = None) -> list[str]:
        """Return which axes, of these or of all, are neither known to be off nor to be armed."""
        looked_at = self.names if names is None else names
        return [name for name in looked_at if self.axes[name].phase in OPEN]

    def awaits_first_sample(self, names: Iterable[str]) -> bool:
        """Return whether each of these axes only waits for the first sample of a new session."""
        return all(self.axes[name].phase is Phase.NEW_SESSION for name in names)

    def all_off(self, names: Iterable[str]) -> bool:
        """Return whether these axes are known to be off."""
        return all(self.axes[name].phase is Phase.OFF for name in names)

    def is_current(self, generation: int, names: Iterable[str]) -> bool:
        """Return whether no stop of these axes came after `generation`, which is this daemon's."""
        since = max((self.axes[name].since for name in names), default=self.generation)
        return since <= generation <= self.generation

    def take_sends(self) -> list[tuple[str, Send]]:
        """Return what is to be sent now, axis by axis; a second call returns nothing."""
        sends, self._sends = self._sends, []
        return sends

    # Arming

    def why_not(self, names: Sequence[str], generation: int) -> WhyNot | None:
        """Return why these axes cannot be armed, as asked for in `generation`; None: they can."""
        if self.attempt is not None:
            return WhyNot.BUSY
        if self.replies_open or self.open_axes():
            return WhyNot.OPEN
        if not self.is_current(generation, names):
            return WhyNot.STALE
        return None if self.all_off(names) else WhyNot.ARMED

    def begin(self, names: Sequence[str], generation: int) -> None:
        """Begin an arming that `why_not` allows; nothing is asked of a board yet."""
        self.attempt = Attempt(tuple(names), generation)

    def ask(self) -> None:
        """Ask every board of the arming for a token."""
        self._advance(Input.ASK, Send.ARM_REQUEST, Phase.OFF)

    def granted(self, name: str) -> None:
        """A board gave a token."""
        self.axes[name].take(Input.TOKEN)

    def confirm(self) -> None:
        """Send every board its token, once each has given one; nothing after a stop."""
        self._advance(Input.CONFIRM, Send.ARM_CONFIRM, Phase.GRANTED)

    def took(self, name: str) -> None:
        """A board took its token."""
        self.axes[name].take(Input.TOOK)

    def fail(self) -> None:
        """Take the arming back: stop every axis that was asked."""
        attempt = self.attempt
        if attempt is None or attempt.failed:
            return
        attempt.failed = True
        for name in attempt.names:
            if self.axes[name].phase in _ARMING:
                self._stop(name)

    def end(self) -> None:
        """The reply to the arming is about to be sent."""
        self.attempt = None

    @property
    def whole(self) -> bool:
        """Whether every axis of the arming is armed, as a sample shows."""
        attempt = self.attempt
        return attempt is not None and not attempt.failed and self._all_in(attempt, Phase.ARMED)

    # Stopping

    def stopped_by(self, name: str) -> tuple[str, ...]:
        """Return the axes that are stopped by a failure of this one."""
        return (name,) if name in self.alone else self.names

    def stop(self, names: Iterable[str]) -> None:
        """Begin a generation: these axes are stopped, and so are those of an arming under way."""
        self.generation += 1
        for name in names:
            self.axes[name].since = self.generation
            self._stop(name)
        self.fail()

    def disarmed(self, name: str) -> None:
        """A board took a DISARM that was sent after every ARM_CONFIRM."""
        self.axes[name].take(Input.DISARMED)

    def withhold_setpoints(self, name: str) -> None:
        """A board does not confirm: it gets no setpoints until it is known to be off."""
        axis = self.axes[name]
        axis.withheld = axis.withheld or axis.phase is Phase.STOPPING

    def watchdog_expired(self, name: str) -> None:
        """A board got no setpoint, and showed nothing of heating, for as long as it takes."""
        self.axes[name].take(Input.WATCHDOG_EXPIRED)

    def shows(self, name: str, event: Input) -> bool:
        """Take a sample (one of SHOWS_…); return whether it contradicts what is known.

        Then the axis has to be stopped: it is armed and should not be, or the other way round.
        """
        axis = self.axes[name]
        before = axis.phase
        axis.take(event)
        if event is Input.SHOWS_ARMED:
            return before in (
                Phase.OFF,
                Phase.ASKED,
                Phase.GRANTED,
                Phase.STOPPED,
                Phase.NEW_SESSION,
            )
        return before is Phase.ARMED

    # Sessions

    def connected(self, name: str) -> None:
        """A session was opened with a board that takes requests."""
        self.axes[name].reachable = True
        self.axes[name].take(Input.CONNECTED)

    def lost(self, name: str) -> None:
        """The session is over."""
        self.axes[name].reachable = False
        self.axes[name].take(Input.LOST)

    def _advance(self, event: Input, send: Send, only_from: Phase) -> None:
        attempt = self.attempt
        if attempt is None or attempt.failed or not self._all_in(attempt, only_from):
            return
        attempt.confirming = send is Send.ARM_CONFIRM
        for name in attempt.names:
            self.axes[name].take(event)
            self._sends.append((name, send))

    def _all_in(self, attempt: Attempt, phase: Phase) -> bool:
        return all(self.axes[name].phase is phase for name in attempt.names)

    def _stop(self, name: str) -> None:
        axis = self.axes[name]
        # Without a session there is nobody to tell: an axis that was off stays off.
        if axis.reachable:
            axis.take(Input.STOP)
            self._sends.append((name, Send.DISARM))
