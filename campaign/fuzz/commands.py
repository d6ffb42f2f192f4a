"""The command server without its sockets: every message gets one reply, none an internal error."""

from __future__ import annotations

import asyncio
import functools
from typing import Any

import msgspec

from campaign.fuzz.program import require
from campaign.fuzz.served_bench import CLIENTS, discard, served_bench
from firmware_protocol.events import HostState
from smad.api import LARGEST_MESSAGE, Reason
from smad.control.commands import Tune
from smad.daemon.command.auth import KeyAuthenticator
from smad.daemon.command.rpc import Call, Decoder

_SAMPLES_A_MESSAGE = 2
_MOST_MESSAGES = 12


class _Reply(msgspec.Struct, forbid_unknown_fields=True):
    jsonrpc: str
    id: int | str | None
    result: dict[str, Any] | None = None
    error: dict[str, Any] | None = None


_REPLY = msgspec.json.Decoder(_Reply)
_MEMBERS = msgspec.json.Decoder(dict[str, msgspec.Raw])
_DECODERS = (Decoder(), Decoder("stop"))


def run(data: bytes) -> None:
    """The first byte says whether the bench is armed, then come messages, a line each."""
    _doorkeeper(data)
    armed, lines = bool(data[:1] and data[0] & 1), data[1:].split(b"\n")[:_MOST_MESSAGES]
    for line in lines:
        for decoder in _DECODERS:
            _decoded(decoder.decode(line), line)
    _loop().run_until_complete(_perform(lines, armed))


def forget() -> None:
    """End the daemon that earlier inputs used, if there is one."""
    _loop().run_until_complete(discard())


def _decoded(decoded: Call | bytes | None, line: bytes) -> None:
    if decoded is None:
        require("id" not in _MEMBERS.decode(line), "a request with an id got no reply")
        return
    if isinstance(decoded, bytes):
        reply = _checked(decoded)
        require(reply.error is not None, "a message that was not understood was not refused")
        require(len(decoded) <= 8 * len(line) + 4096, "{} bytes of refusal", len(decoded))
        return
    # Converting checks every range once more, on values instead of text.
    plain = msgspec.to_builtins(decoded.params)
    again = msgspec.convert(plain, type(decoded.params))
    require(again == decoded.params, "parameters do not survive a check of their ranges")


def _checked(text: bytes) -> _Reply:
    require(len(text) <= LARGEST_MESSAGE, "a reply of {} bytes", len(text))
    reply = _REPLY.decode(text)
    require(reply.jsonrpc == "2.0", "not JSON-RPC 2.0")
    require((reply.result is None) != (reply.error is None), "neither or both of result and error")
    if reply.error is not None:
        data = reply.error["data"]
        require(data["reason"] != Reason.INTERNAL, "internal error: {}", data["cause"])
        require(reply.error["message"].strip(), "a refusal without words")
    return reply


async def _perform(lines: list[bytes], armed: bool) -> None:
    bench = await served_bench()
    if armed != (bench.state is HostState.RUNNING):
        await bench.ask(CLIENTS[0], "arm" if armed else "disarm")
    replies: list[bytes] = []
    wanted = 0
    tuned = False
    for number, line in enumerate(lines):
        stop = line[:1] == b" "
        call = _DECODERS[stop].decode(line)
        wanted += isinstance(call, bytes) or (call is not None and call.wants_reply)
        tuned |= isinstance(call, Call) and call.method.params is Tune
        bench.say(CLIENTS[number % 2], line, replies.append, stop=stop)
        await bench.run(_SAMPLES_A_MESSAGE)
    await bench.until(lambda: len(replies) >= wanted)
    require(len(replies) == wanted, "{} replies to {} requests", len(replies), wanted)
    for reply in replies:
        _checked(reply)
    if tuned or not await bench.tidy():
        await discard()


@functools.cache
def _loop() -> asyncio.AbstractEventLoop:
    return asyncio.new_event_loop()


def _doorkeeper(data: bytes) -> None:
    """A ZAP request comes from the library, but its key and its texts come from a stranger."""
    keeper = KeyAuthenticator(["x" * 40])
    frames = data.split(b"\n")
    for request in (frames, [b"1.0", b"1", b"smad", b"", b"", b"CURVE", data[:32]]):
        reply = keeper.answer(request)
        require(reply is None or reply[2] == b"400", "a stranger's key was let in")
