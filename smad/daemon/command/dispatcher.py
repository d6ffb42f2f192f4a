"""From a message to its reply: at once, or when the board has answered."""

import asyncio
import inspect
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from typing import Any

from msgspec import Struct

from smad.api import Reason
from smad.daemon.command.bench import CommandCounts
from smad.daemon.command.lease import Caller
from smad.daemon.command.rpc import Call, Decoder, error_reply, result_reply
from smad.daemon.command.server import Send
from smad.daemon.command.service import Service
from smad.daemon.errors import Refusal
from smad.daemon.journal import Journal
from smad.errors import SmadError

MOST_WAITING = 64
MOST_WAITING_EACH = 16
"""Of one client: one that floods is refused, and the others find room."""


@dataclass(frozen=True, eq=False)
class _PendingReply:
    """A call whose reply has to wait for the board."""

    client: bytes
    call: Call
    reply: Send
    answer: Coroutine[Any, Any, Struct]
    replied: asyncio.Future[None]


class RequestDispatcher:
    """Decodes, performs, replies. Every message with an id gets exactly one reply.

    `waiting` says how many things wait for the board; with too many of them, in all or of one
    client, only stops are taken.
    """

    def __init__(
        self,
        service: Service,
        counts: CommandCounts,
        *,
        spawn: Callable[[str, Coroutine[Any, Any, None]], None],
        journal: Journal,
        waiting: Callable[[], int],
    ) -> None:
        self._service = service
        self._counts = counts
        self._spawn = spawn
        self._journal = journal
        self._waiting = waiting
        self._pending: set[_PendingReply] = set()
        self.command = partial(self._answer, Decoder())
        """Answers a message of the command socket."""
        self.stop = partial(self._answer, Decoder("stop"))
        """Answers a message of the stop channel."""

    def _answer(
        self, decoder: Decoder, client: bytes, data: bytes, send: Send, behind: bool = False
    ) -> None:
        """Answer a message; `behind`: it may have come before a stop."""
        call = decoder.decode(data)
        if not isinstance(call, Call):
            self._counts.refused += 1
            self._counts.malformed += 1
            if call is not None:
                send(call)
            return

        def reply(text: bytes) -> None:
            if call.wants_reply:
                send(text)

        try:
            self._require_room(client, call)
            caller = Caller(client, call.lease, behind, call.axes)
            answer = self._service.perform(call.method, call.params, caller, call.generation)
        except Exception as error:
            self._refuse(call, error, reply)
            return
        if isinstance(answer, Struct):
            self._counts.done += 1
            reply(result_reply(call.id, answer))
        else:
            replied = asyncio.get_running_loop().create_future()
            pending = _PendingReply(client, call, reply, answer, replied)
            self._pending.add(pending)
            self._spawn(call.method.name, self._answer_pending(pending))

    async def until_replied(self, longest_s: float) -> None:
        """Return once nobody waits for a reply, or after so long."""
        if self._pending:
            await asyncio.wait([pending.replied for pending in self._pending], timeout=longest_s)

    def give_up(self) -> None:
        """Tell everybody who still waits for a reply that the daemon ends."""
        while self._pending:
            pending = self._pending.pop()
            self._refuse(pending.call, _ending(), pending.reply)
            if inspect.getcoroutinestate(pending.answer) == inspect.CORO_CREATED:
                pending.answer.close()

    async def _answer_pending(self, pending: _PendingReply) -> None:
        call, reply = pending.call, pending.reply
        try:
            result = await pending.answer
        except Exception as error:
            self._refuse(call, error, reply)
        else:
            self._counts.done += 1
            reply(result_reply(call.id, result))
        finally:
            self._pending.discard(pending)
            pending.replied.set_result(None)

    def _require_room(self, client: bytes, call: Call) -> None:
        if call.method.access == "stop":
            return
        of_client = sum(pending.client == client for pending in self._pending)
        for waiting, most in ((of_client, MOST_WAITING_EACH), (self._waiting(), MOST_WAITING)):
            if waiting >= most:
                raise Refusal(
                    Reason.BUSY,
                    "too many commands wait for the board",
                    value=waiting,
                    limit=most,
                    action="wait for replies before sending more",
                )

    def _refuse(self, call: Call, error: Exception, reply: Send) -> None:
        # An error in one command is reported to its sender; the run goes on.
        self._counts.refused += 1
        if not isinstance(error, SmadError):
            self._journal.say(f"internal error in {call.method.name}: {error!r}")
            error = Refusal(
                Reason.INTERNAL,
                f"an error in the daemon: {error!r}",
                action="please report it; smad status shows whether the bench is armed",
            )
        reply(error_reply(call.id, error))


def _ending() -> Refusal:
    return Refusal(
        Reason.STOPPED,
        "the daemon ended before the board had answered",
        action="the command may have been carried out; start the daemon again and see smad status",
    )
