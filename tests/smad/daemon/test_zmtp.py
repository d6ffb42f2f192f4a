"""The wire protocol of local connections, without sockets, and against ZeroMQ's own bytes."""

import random
from collections.abc import Iterator

import pytest

from smad.daemon.zmtp import (
    GREETING,
    Broken,
    Greeted,
    Message,
    Peer,
    Reply,
    Subscription,
    Taken,
    TooLong,
    encoded,
    ready,
)

CLIENTS = frozenset((b"DEALER", b"REQ"))
LONGEST = 1000
HELLO = GREETING + ready(b"DEALER", b"me")


def peer(*, publishes: bool = False) -> Peer:
    kinds = frozenset((b"SUB",)) if publishes else CLIENTS
    return Peer(kinds, LONGEST, publishes=publishes)


def taken(peer: Peer, data: bytes) -> list[Taken]:
    peer.receive(data)
    return list(_all(peer))


def _all(peer: Peer) -> Iterator[Taken]:
    while (one := peer.take()) is not None:
        yield one


def test_a_conversation_is_understood_however_it_is_cut() -> None:
    said = HELLO + encoded([b"hello"]) + encoded([b"", b"x" * 300]) + b"\x04\x07\x04PING\0\0"
    whole = taken(peer(), said)
    assert whole == [
        Greeted(b"me"),
        Message([b"hello"]),
        Message([b"", b"x" * 300]),
        Reply(b"\x04\x05\x04PONG"),
    ]
    for size in (1, 2, 3, 7, 63, 64, 65):
        one = peer()
        pieces = [said[at : at + size] for at in range(0, len(said), size)]
        assert [item for piece in pieces for item in taken(one, piece)] == whole


def test_a_subscriber_asks_in_the_old_way_and_in_the_new_one() -> None:
    said = GREETING + ready(b"SUB") + encoded([b"\1smad"]) + encoded([b"\0smad"])
    said += b"\x04\x0e\x09SUBSCRIBEsmad" + b"\x04\x0b\x06CANCELsmad" + encoded([b"what"])
    assert taken(peer(publishes=True), said)[1:] == [
        Subscription(b"smad", True),
        Subscription(b"smad", False),
        Subscription(b"smad", True),
        Subscription(b"smad", False),
    ]


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "no ZMTP greeting"),
        (b"\xff" + bytes(9), "no ZMTP greeting"),
        (GREETING[:10] + b"\x01", "before 3"),
        (GREETING[:12] + b"CURVE".ljust(20, b"\0") + bytes(32), "another mechanism"),
        (GREETING + encoded([b"hello"]), "a message before READY"),
        (GREETING + b"\x04\x06\x05HELLO", "a command before READY"),
        (GREETING + b"\x04\x00", "without a name"),
        (GREETING + b"\x04\x03\x05RE", "without a name"),
        (GREETING + ready(b"PUB"), "does not belong here"),
        (GREETING + ready(b"DEALER", b"\0me"), "identity"),
        (GREETING + ready(b"DEALER", b"m" * 256), "identity"),
        (GREETING + ready(b"DEALER")[:-1], None),
        (GREETING + b"\x04\x0a\x05READY\x01a\x00\x00", "cut short"),
        (GREETING + b"\x06" + (2000).to_bytes(8, "big"), "a command that is too long"),
        (HELLO + b"\x05\x00", "unknown kind"),
        (HELLO + b"\x80\x00", "unknown kind"),
        (HELLO + b"\x04\x06\x05ERROR", "gave up"),
    ],
)
def test_what_is_not_the_protocol_is_refused(said: bytes, why: str | None) -> None:
    if why is None:
        assert taken(peer(), said) == []
        return
    with pytest.raises(Broken, match=why):
        taken(peer(), said)


@pytest.mark.parametrize(
    "said",
    [
        encoded([b"x" * 1001]),
        b"\x02" + (2**63).to_bytes(8, "big"),
        encoded([b"x" * 600, b"x" * 600]),
        encoded([b""] * 17),
    ],
)
def test_a_message_that_is_too_long_is_refused_before_it_has_come(said: bytes) -> None:
    one = peer()
    assert taken(one, HELLO) == [Greeted(b"me")]
    with pytest.raises(TooLong):
        taken(one, said)


def test_any_bytes_are_understood_or_refused() -> None:
    rng = random.Random(5)
    for _ in range(3000):
        said = bytearray(HELLO + encoded([rng.randbytes(rng.randrange(400))]) * 3)
        for _ in range(rng.randrange(1, 6)):
            said[rng.randrange(len(said))] = rng.randrange(256)
        one = peer(publishes=rng.random() < 0.3)
        try:
            items = taken(one, bytes(said))
        except Broken:
            continue
        assert all(isinstance(item, Taken) for item in items)
        assert one.waiting <= len(said)
