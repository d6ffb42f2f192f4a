"""What a board of another version says of its messages: watched as far as it goes, never driven.

The host builds a decoder from the description it downloads, so the description decides what later
frames mean.
"""

from __future__ import annotations

import zlib

import msgspec

from campaign.fuzz.program import Program, require
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.errors import NotAllowedError, NotConnectedError
from firmware_protocol.events import HostEvent, HostState
from firmware_protocol.framing import MAX_PAYLOAD, FrameDecoder, encode_frame
from firmware_protocol.host import HostSession
from tests.firmware_protocol.pair import IDENT, setpoint

SEPARATOR = b"\f"
"""Between the description and the frames that come after it."""

RAW = b"!"
"""Begins an input that is all description, and taken as it is, not compressed first."""

_SESSION = 5
_MOST_SLICES = 1000
_SLICE = 96
_WATCHING = (HostState.MONITOR, HostState.FAULTED, HostState.SYNC)


def run(data: bytes) -> None:
    """The input is the description as JSON and, behind a form feed, frames of such a board."""
    text, _, frames = data.partition(SEPARATOR)
    raw = data[:1] == RAW
    blob = data[1:] if raw else zlib.compress(text, 1)
    board = _Board(blob)
    board.answer()
    board.check()
    program = Program(b"" if raw else frames)
    while program:
        number, size = program.u8(), program.u8() % (MAX_PAYLOAD + 1)
        board.say(encode_frame(number, 0, _SESSION, program.take(size)))
        board.answer()
        board.check()


class _Board:
    """Identifies itself as one of another schema, and answers DESCRIBE."""

    def __init__(self, blob: bytes) -> None:
        self._blob = blob
        self._now_us = 1000
        self._heard = FrameDecoder()
        self.host = HostSession(nonce=9)
        self.host.connect(0)
        [frame] = self._heard.feed(self.host.data_to_send())
        hello = CODEC.unpack(frame.type, frame.payload)
        assert isinstance(hello, m.Hello)
        ident = msgspec.structs.replace(IDENT, schema_crc=1, nonce=hello.nonce, session=_SESSION)
        self.say(CODEC.frame(ident, 0, _SESSION))
        require(self.host.state is HostState.MONITOR, "the handshake came to nothing")

    def say(self, data: bytes) -> None:
        self._now_us += 1000
        events = self.host.receive(data, self._now_us)
        require(all(isinstance(event, HostEvent) for event in events), "no event came out")

    def answer(self) -> None:
        for _ in range(_MOST_SLICES):
            asked = self._heard.feed(self.host.data_to_send())
            describes = [frame for frame in asked if frame.type == m.Describe.info.number]
            for frame in describes:
                request = CODEC.unpack(frame.type, frame.payload)
                assert isinstance(request, m.Describe)
                piece = self._blob[request.offset : request.offset + _SLICE]
                total = min(len(self._blob), 0xFFFF)
                reply = m.Description(request.offset, total, len(piece), piece)
                self.say(CODEC.frame(reply, frame.seq, _SESSION))
            require(
                not any(frame.type == m.Setpoint.info.number for frame in asked),
                "a setpoint was sent to a board of another schema",
            )
            if not describes:
                return
        require(False, "the description is asked for without end")

    def check(self) -> None:
        host = self.host
        require(host.state in _WATCHING, "{} with a board of another schema", host.state)
        host.send_setpoint(setpoint(0))
        for request in (m.ArmRequest(0, 0), m.ArmConfirm(0, 1)):
            try:
                host.request(request, self._now_us)
            except (NotAllowedError, NotConnectedError):
                continue
            require(False, "{} was let through to a board of another schema", request)
