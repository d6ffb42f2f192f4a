"""The host's mirror of the board: which of its own states follows from what the board says."""

from __future__ import annotations

from firmware_protocol.enums import BoardState
from firmware_protocol.events import HostState

HOT = frozenset({BoardState.ARMED, BoardState.HOLD})
STOPPED = frozenset({BoardState.FAULT, BoardState.ESTOP})


class Mirror:
    """State of an open session. All axes share one state: the worst of them counts.

    An answer that changes the board's mode carries the board's time. A sample older than that time
    is not asked about the mode, so that frames that overtook each other on the way cannot undo it.
    """

    def __init__(self) -> None:
        self.state = HostState.MONITOR
        self._modes: dict[int, BoardState] = {}
        self._since_us: dict[int, int] = {}
        self._armed: set[int] = set()
        self._token_until_us: int | None = None

    def sample(self, axis: int, mode: BoardState, board_us: int) -> None:
        """Take in the mode of a sample."""
        if self._modes.get(axis) is mode or board_us < self._since_us.get(axis, board_us):
            return
        self._modes[axis] = mode
        if mode not in HOT:
            self._armed.discard(axis)
        self._settle()

    def granted(self, until_us: int) -> None:
        """Note that the board gave a token."""
        self._token_until_us = until_us
        self._settle()

    def confirmed(self, axis: int, board_us: int) -> None:
        """Note that the board armed an axis for this host."""
        self._enter(axis, BoardState.ARMED, board_us)
        self._armed.add(axis)
        self._token_until_us = None
        self._settle()

    def disarmed(self, axis: int, board_us: int) -> None:
        """Note that the board disarmed an axis."""
        if self._modes.get(axis) in HOT:
            self._enter(axis, BoardState.COOL, board_us)
        self._armed.discard(axis)
        self._settle()

    def refused(self) -> None:
        """Note that the board did not arm."""
        self._token_until_us = None
        self._settle()

    def stopped(self, axis: int, board_us: int) -> None:
        """Note a fault that the board reported."""
        self._enter(axis, BoardState.FAULT, board_us)
        self._armed.discard(axis)
        self._settle()

    def tick(self, now_us: int) -> None:
        """Let a token expire."""
        if self._token_until_us is not None and now_us >= self._token_until_us:
            self.refused()

    @property
    def deadline_us(self) -> int | None:
        """When `tick` is needed next."""
        return self._token_until_us

    def _enter(self, axis: int, mode: BoardState, board_us: int) -> None:
        self._modes[axis] = mode
        self._since_us[axis] = board_us

    def _settle(self) -> None:
        if any(mode in STOPPED for mode in self._modes.values()):
            self.state = HostState.FAULTED
        elif self._armed:
            self.state = HostState.RUNNING
        elif self._token_until_us is not None:
            self.state = HostState.READY
        else:
            self.state = HostState.MONITOR
