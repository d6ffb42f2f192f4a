"""A client that sends what it is told, also what is wrong, and notes what was acknowledged."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import msgspec
import zmq
from msgspec import Struct

from smad.api import BY_PARAMS, ReleaseControl, TakeControl, logged_details
from smad.client.wire import Conversation, connect, new_identity
from smad.errors import DaemonError

_ENCODER = msgspec.json.Encoder()
_PATIENCE_S = 60.0


@dataclass(frozen=True)
class Answer:
    """What came back: the result, or the reason of the refusal."""

    result: Any = None
    refused: str = ""


@dataclass
class Acknowledged:
    """Commands that the daemon said were carried out: method and parameters, in their order."""

    commands: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    refused: int = 0


class ScriptedClient:
    """One DEALER socket. `call` waits for the answer; `send` and `drain` do not wait."""

    def __init__(self, address: str) -> None:
        self.sent = 0
        self.answered = 0
        self.acknowledged = Acknowledged()
        self._conversation = Conversation()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = connect(self._context, address, None, new_identity())

    def call(self, params: Struct) -> Answer:
        """Send a command and return its answer. Raises DaemonError when none comes."""
        number = self.send(params)
        deadline_s = time.monotonic() + _PATIENCE_S
        while True:
            left_ms = int((deadline_s - time.monotonic()) * 1000)
            if left_ms <= 0 or not self._socket.poll(left_ms):
                raise DaemonError(
                    "the daemon did not answer",
                    value=BY_PARAMS[type(params)].name,
                    limit=f"{_PATIENCE_S:g} s",
                )
            data = msgspec.json.decode(self._socket.recv())
            self.answered += 1
            if data["id"] == number:
                return self._noted(params, data)

    def send(self, params: Struct) -> int:
        """Send a command; return its number."""
        self.sent += 1
        number, data = self._conversation.request(params)
        self._socket.send(data)
        return number

    def next_answer(self) -> Answer:
        """Wait for the next answer, whatever it belongs to. Raises DaemonError when none comes."""
        if not self._socket.poll(int(_PATIENCE_S * 1000)):
            raise DaemonError("the daemon did not answer", limit=f"{_PATIENCE_S:g} s")
        data = msgspec.json.decode(self._socket.recv())
        self.answered += 1
        return _answer(data)

    def send_raw(self, data: bytes) -> None:
        """Send bytes that are no command; they are owed an answer as well."""
        self.sent += 1
        self._socket.send(data)

    @property
    def unanswered(self) -> int:
        """How many messages have no answer yet."""
        return self.sent - self.answered

    def drain(self) -> None:
        """Count the answers that are there."""
        while self.answered < self.sent and self._socket.poll(0):
            self._socket.recv()
            self.answered += 1

    def drain_one(self) -> None:
        """Wait for one answer, and count it. Raises DaemonError when none comes."""
        self.next_answer()

    def drain_all(self) -> None:
        """Count the answers until every command has one, or none comes any more."""
        while self.answered < self.sent and self._socket.poll(int(_PATIENCE_S * 1000)):
            self._socket.recv()
            self.answered += 1

    def close(self) -> None:
        """Give the socket back."""
        self._context.destroy(linger=0)

    def _noted(self, params: Struct, data: dict[str, Any]) -> Answer:
        answer = _answer(data)
        if answer.refused:
            self.acknowledged.refused += 1
            return answer
        details = msgspec.json.decode(_ENCODER.encode(logged_details(params)))
        self.acknowledged.commands.append((BY_PARAMS[type(params)].name, details))
        if isinstance(params, TakeControl):
            self._conversation.lease = data["result"]["lease"]
        elif isinstance(params, ReleaseControl):
            self._conversation.lease = ""
        return answer


def _answer(data: dict[str, Any]) -> Answer:
    if "error" in data:
        return Answer(refused=data["error"]["data"]["reason"])
    return Answer(result=data["result"])
