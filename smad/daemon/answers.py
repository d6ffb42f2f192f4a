"""From a message to its reply: at once, or when the board has answered."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from msgspec import Struct

from smad.api import Reason
from smad.daemon.errors import Refusal
from smad.daemon.journal import Journal
from smad.daemon.rpc import Call, Decoder, error_reply, result_reply
from smad.daemon.server import Send
from smad.daemon.service import Caller, Service
from smad.daemon.status import CommandCounts
from smad.errors import SmadError

MOST_WAITING = 64


class Answers:
    """Decodes, performs, replies. Every message with an id gets exactly one reply.

    `waiting` says how many things wait for the board; with too many of them only stops are taken.
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
        self._commands = Decoder()
        self._stops = Decoder("stop")

    def command(self, client: bytes, data: bytes, send: Send) -> None:
        """Answer a message of the command socket."""
        self._answer(self._commands, client, data, send)

    def stop(self, client: bytes, data: bytes, send: Send) -> None:
        """Answer a message of the stop channel."""
        self._answer(self._stops, client, data, send)

    def _answer(self, decoder: Decoder, client: bytes, data: bytes, send: Send) -> None:
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
            self._require_room(call)
            answer = self._service.perform(
                call.method, call.params, Caller(client, call.lease), call.generation
            )
        except Exception as error:
            self._refuse(call, error, reply)
            return
        if isinstance(answer, Struct):
            self._counts.done += 1
            reply(result_reply(call.id, answer))
        else:
            self._spawn(call.method.name, self._answer_later(call, answer, reply))

    async def _answer_later(self, call: Call, answer: Awaitable[Struct], reply: Send) -> None:
        try:
            result = await answer
        except Exception as error:
            self._refuse(call, error, reply)
            return
        self._counts.done += 1
        reply(result_reply(call.id, result))

    def _require_room(self, call: Call) -> None:
        if call.method.access != "stop" and self._waiting() >= MOST_WAITING:
            raise Refusal(
                Reason.BUSY,
                "too many commands wait for the board",
                value=self._waiting(),
                limit=MOST_WAITING,
                action="wait for replies before sending more",
            )

    def _refuse(self, call: Call, error: Exception, reply: Send) -> None:
        # A mistake of ours in one command is told to who sent it; the run goes on.
        self._counts.refused += 1
        if not isinstance(error, SmadError):
            self._journal.say(f"internal error in {call.method.name}: {error!r}")
            error = Refusal(
                Reason.INTERNAL,
                f"an error in the daemon: {error!r}",
                action="please report it; smad status shows whether the bench is armed",
            )
        reply(error_reply(call.id, error))
