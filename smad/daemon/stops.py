"""Stops: each begins a new generation, and nothing that was asked for before it is carried out.

A stop is a client's disarm or estop, a client that sends nothing, a limit of the host, a lost link.
From its beginning until its boards are known to be off, nothing that moves the bench is accepted,
and no axis is armed. What is known of each axis is in `smad.daemon.arming`; what happens to one
board is in `smad.daemon.boardstop`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from smad.api import Reason
from smad.daemon.arming import Arming, Send, WhyNot
from smad.daemon.boardstop import BoardStop
from smad.daemon.errors import Refusal
from smad.daemon.services import Say
from smad.runlog.schema import CUT


class Stops:
    """The boards that a stop is for, and the machine that knows what is off.

    `on_begin` is called with the boards that each new generation stops, before anything is sent;
    `on_failure` with what stopped them, where that was no client that asked.
    """

    def __init__(
        self,
        say: Say,
        arming: Arming,
        *,
        on_begin: Callable[[Sequence[BoardStop]], None],
        on_failure: Callable[[str], None],
    ) -> None:
        self.arming = arming
        self.why = ""
        self.boards: list[BoardStop] = []
        self._say = say
        self._on_begin = on_begin
        self.on_failure = on_failure

    @property
    def generation(self) -> int:
        """The generation in force."""
        return self.arming.generation

    def require(self, generation: int, boards: Sequence[BoardStop]) -> None:
        """Raise Refusal when a stop of any of the boards came after `generation`."""
        if not self.arming.is_current(generation, [board.label for board in boards]):
            why = self.why or "the daemon was started again"
            raise Refusal(
                Reason.STOPPED,
                f"the bench was stopped after this command was issued ({why})",
                value=f"issued in generation {generation}",
                limit=f"generation {self.generation}",
                action="nothing was changed; see smad status, arm again and send it again",
            )

    def require_confirmed(self, boards: Sequence[BoardStop]) -> None:
        """Raise Refusal until each of the boards is known to be off, or armed.

        The replies to the stop tell of the sample that shows it: nothing may come in between.
        """
        self._require_closed(self.arming.open_axes(board.label for board in boards))

    def require_all_closed(self) -> None:
        """Raise Refusal while a stop is open on any axis, or its reply is not sent yet."""
        for board in self.boards:
            board.note_watchdog()
        waiting = [board.label for board in self.boards] if self.arming.replies_open else []
        self._require_closed(self.arming.open_axes() or waiting)

    def _require_closed(self, open_ones: Sequence[str]) -> None:
        if self.arming.awaits_first_sample(open_ones):
            # Right after a connection a sample is on its way; who arms waits for it.
            return
        if open_ones:
            why = self.why or "the daemon has just started"
            raise Refusal(
                Reason.STOPPED,
                f"the bench is being stopped ({why}) and the board has not confirmed it yet",
                value=", ".join(open_ones) or None,
                action="wait until smad status shows that it is not armed, then arm again",
            )

    def begin_arming(self, boards: Sequence[BoardStop], generation: int) -> None:
        """Begin an arming of these boards. Raises Refusal when it cannot be."""
        names = [board.label for board in boards]
        why_not = self.arming.why_not(names, generation)
        if why_not is WhyNot.BUSY:
            raise Refusal(
                Reason.BUSY,
                "the bench is being armed already",
                action="wait for the reply to that (smad status)",
            )
        if why_not is WhyNot.OPEN:
            self.require_all_closed()
            raise Refusal(
                Reason.NOT_CONNECTED,
                "the board sends no samples, so its state is unknown",
                value=", ".join(self.arming.open_axes()) or None,
                action="look at the link (smad status), then arm again",
            )
        if why_not is WhyNot.STALE:
            self.require(generation, boards)
        if why_not is WhyNot.ARMED:
            raise Refusal(Reason.ARMED, "the bench is armed", action="disarm first (smad disarm)")
        self.arming.begin(names, generation)

    def begin(
        self,
        why: str,
        *,
        by: str = "",
        orderly: bool = False,
        boards: Sequence[BoardStop] | None = None,
    ) -> None:
        """Begin a generation: end the motions, take back what was on its way to arm a board.

        `by` is what stopped it, as a noun; `why` where that is one. A run that is being recorded
        is marked as cut, unless its motion was over and who asked is `orderly`: is free to end it.
        `boards` are those that are stopped; all by default.
        """
        self.why = why
        ended = f"stopped by {by or why}"
        cut: list[BoardStop] = []

        def end(board: BoardStop) -> None:
            if board.end(ended, orderly=orderly):
                cut.append(board)

        def tell() -> None:
            if cut:
                self._say("note", f"{CUT}{ended}", {"generation": self.generation})

        stopped = self.boards if boards is None else boards
        self.arming.stop(board.label for board in stopped)
        # Whatever raises, the rest is done all the same: no board is left out of a stop.
        with ExitStack() as last_first:
            last_first.callback(self.send)
            last_first.callback(self._on_begin, stopped)
            last_first.callback(tell)
            for board in reversed(stopped):
                last_first.callback(end, board)

    def send(self) -> None:
        """Send what the machine wants sent; who arms sends its own messages."""
        by_name = {board.label: board for board in self.boards}
        with ExitStack() as last_first:
            for name, send in reversed(self.arming.take_sends()):
                if send is Send.DISARM:
                    last_first.callback(by_name[name].ask_to_stop)

    def board_failed(self, label: str, why: str, by: str) -> None:
        """Stop the boards that a failure of this one stops, itself among them."""
        names = self.arming.stopped_by(label)
        self.begin(why, by=by, boards=[board for board in self.boards if board.label in names])
        self.on_failure(why)

    def stop_by_daemon(self, why: str, text: str, data: dict[str, Any], *, by: str) -> None:
        """Stop on the daemon's own account, and tell why."""
        self._say("disarm", text, data)
        self.begin(why, by=by)
        self.on_failure(why)

    @contextmanager
    def reply_open(self) -> Iterator[None]:
        """Keep every axis from being armed until the reply to a stop is sent."""
        self.arming.replies_open += 1
        try:
            yield
        finally:
            self.arming.replies_open -= 1
