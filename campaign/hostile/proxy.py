"""A line between a client and a server that somebody listens on, and repeats what was said."""

from __future__ import annotations

import contextlib
import select
import socket
import threading

_PIECE = 65_536
_LOOK_S = 0.05


class Proxy:
    """Passes one TCP connection on to `server`, and keeps what the client said, in pieces."""

    def __init__(self, server: tuple[str, int]) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._server_address = server
        self._server: socket.socket | None = None
        self._pieces: list[bytes] = []
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._pass_on, daemon=True)

    @property
    def address(self) -> str:
        """Where the client has to connect to."""
        return f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    def heard(self) -> list[bytes]:
        """What the client said so far."""
        return list(self._pieces)

    def repeat_last(self) -> None:
        """Say the client's last piece once more, on the same connection."""
        assert self._server is not None
        self._server.sendall(self._pieces[-1])

    def __enter__(self) -> Proxy:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ending.set()
        self._thread.join()
        self._listener.close()

    def _pass_on(self) -> None:
        self._listener.settimeout(_LOOK_S)
        while not self._ending.is_set():
            with contextlib.suppress(TimeoutError):
                client, _ = self._listener.accept()
                with client, socket.create_connection(self._server_address) as server:
                    self._server = server
                    with contextlib.suppress(OSError):
                        self._exchange(client, server)

    def _exchange(self, client: socket.socket, server: socket.socket) -> None:
        while not self._ending.is_set():
            readable, _, _ = select.select([client, server], [], [], _LOOK_S)
            for source in readable:
                data = source.recv(_PIECE)
                if not data:
                    return
                if source is client:
                    self._pieces.append(data)
                    server.sendall(data)
                else:
                    client.sendall(data)
