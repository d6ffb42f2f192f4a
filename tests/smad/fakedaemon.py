"""A stand-in for the daemon: answers each method with a prepared reply, and remembers what came."""

from __future__ import annotations

import contextlib
import json
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import zmq

from smad import api
from smad.daemon.endpoints import Connection, Endpoints, write_connection

MOTION = api.Motion(
    running="idle",
    done=True,
    armed=True,
    mode="ARMED",
    reference_mm=None,
    displacement_mm=1.25,
    board_time_s=10.0,
)
Answer = Any | Callable[[dict[str, Any]], Any]


class Silent:
    """Stands for no reply at all."""


class FakeDaemon:
    """Serves on ipc in a thread. `answers` maps methods to results, errors, or functions."""

    def __init__(self, folder: Path) -> None:
        self.endpoints = Endpoints(folder, "bench")
        self.asked: list[dict[str, Any]] = []
        self.answers: dict[str, Answer] = {"motion": MOTION}
        self.before_reply: bytes | None = None
        """Sent ahead of the next reply: a late one."""
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._sockets = [self._context.socket(zmq.ROUTER) for _ in range(2)]
        self._stop = threading.Event()
        self.publisher = self._context.socket(zmq.PUB)
        self.publisher.bind(self.endpoints.telemetry)
        for socket, address in zip(
            self._sockets, (self.endpoints.command, self.endpoints.stop), strict=True
        ):
            socket.setsockopt(zmq.LINGER, 0)
            socket.bind(address)
        write_connection(
            self.endpoints.connection_file,
            Connection(
                bench="bench",
                pid=os.getpid(),
                version="0",
                command=self.endpoints.command,
                stop=self.endpoints.stop,
                telemetry=self.endpoints.telemetry,
            ),
            0o077,
        )
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        poller = zmq.Poller()
        for socket in self._sockets:
            poller.register(socket, zmq.POLLIN)
        while not self._stop.is_set():
            for socket, _ in poller.poll(20):
                client, data = socket.recv_multipart()
                request = json.loads(data)
                request["channel"] = "stop" if socket is self._sockets[1] else "command"
                self.asked.append(request)
                reply = self._reply(request)
                if self.before_reply is not None:
                    socket.send_multipart([client, self.before_reply])
                    self.before_reply = None
                if reply is not None:
                    socket.send_multipart([client, reply])

    def _reply(self, request: dict[str, Any]) -> bytes | None:
        answer = self.answers.get(request["method"], MOTION)
        if callable(answer):
            answer = answer(request)
        if isinstance(answer, Silent):
            return None
        if isinstance(answer, bytes):
            return answer
        body: dict[str, Any] = {"jsonrpc": "2.0", "id": request["id"]}
        if isinstance(answer, api.ErrorData):
            body["error"] = {"code": -32000, "message": answer.cause, "data": answer}
        else:
            body["result"] = answer
        return msgspec.json.encode(body)

    def close(self) -> None:
        """Stop serving."""
        self._stop.set()
        self._thread.join()
        self._context.destroy(linger=0)


@contextlib.contextmanager
def fake_daemon(folder: Path) -> Iterator[FakeDaemon]:
    """A stand-in for as long as the block lasts."""
    daemon = FakeDaemon(folder)
    try:
        yield daemon
    finally:
        daemon.close()
