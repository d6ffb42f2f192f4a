"""What keeps the machine busy during the benchmark: `python -m bench.daemon_load KIND ADDRESS`.

hog: computes for ever. flood: sends commands as fast as replies come. deaf: subscribes and never
reads. answer: answers a flood where there is no daemon, so that a comparison has the same load.
"""

from __future__ import annotations

import sys

import zmq

_IN_FLIGHT = 64


def hog(address: str) -> None:
    """Compute for ever."""
    number = 0
    while True:
        number += 1


def flood(address: str) -> None:
    """Send commands without pause, a few of them always on their way."""
    from smad.api import GetMotion
    from smad.client.wire import Conversation, connect, new_identity

    socket = connect(zmq.Context(), address, None, new_identity())
    conversation = Conversation()
    for _ in range(_IN_FLIGHT):
        socket.send(conversation.request(GetMotion())[1])
    while True:
        socket.recv()
        socket.send(conversation.request(GetMotion())[1])


def deaf(address: str) -> None:
    """Subscribe and never read."""
    import signal

    from smad.client.wire import subscribe

    socket = subscribe(zmq.Context(), address, b"", queue=1)
    socket.poll()
    signal.pause()


def answer(address: str) -> None:
    """Answer every message with what a daemon's reply weighs."""
    socket = zmq.Context().socket(zmq.ROUTER)
    socket.bind(address)
    while True:
        client, _ = socket.recv_multipart()
        socket.send_multipart([client, b"x" * 300])


KINDS = {"hog": hog, "flood": flood, "deaf": deaf, "answer": answer}

if __name__ == "__main__":
    KINDS[sys.argv[1]](sys.argv[2])
