"""Who may command over TCP: CURVE keys, and the list of those let in (ZAP, RFC 27). Pure.

The server's key pair is made once and kept in a file that only its owner can read.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path

import zmq
from zmq.utils import z85

from smad.errors import ConfigError

ZAP_ADDRESS = "inproc://zeromq.zap.01"
_ZAP_VERSION = b"1.0"
_REQUEST_FRAMES = 7


class Doorkeeper:
    """Answers ZeroMQ's question whether a key may connect. Counts those turned away."""

    def __init__(self, allowed_keys: Iterable[str]) -> None:
        self._allowed = frozenset(allowed_keys)
        self.refused = 0

    def answer(self, frames: Sequence[bytes]) -> list[bytes] | None:
        """Return the reply to a ZAP request; None when it is not one."""
        if len(frames) < _REQUEST_FRAMES - 1 or frames[0] != _ZAP_VERSION:
            return None
        request_id, mechanism = frames[1], frames[5]
        key = frames[6] if len(frames) == _REQUEST_FRAMES else b""
        user = z85.encode(key).decode() if len(key) == 32 else ""
        if mechanism == b"CURVE" and user in self._allowed:
            return [_ZAP_VERSION, request_id, b"200", b"OK", user.encode(), b""]
        self.refused += 1
        return [_ZAP_VERSION, request_id, b"400", b"key not on the list", b"", b""]


def server_keys(path: Path) -> tuple[bytes, bytes]:
    """Return (public, secret) from the file, made now if there is none.

    Raises ConfigError when others can read it, or when it does not hold a key pair.
    """
    if not path.exists():
        public, secret = zmq.curve_keypair()
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(b"public " + public + b"\nsecret " + secret + b"\n")
        return public, secret
    if stat.S_IMODE(path.stat().st_mode) & 0o077:
        raise ConfigError(
            "others can read the server's secret key",
            value=str(path),
            limit="mode 600",
            action=f"chmod 600 {path}, or delete it to have a new one made",
        )
    words = path.read_bytes().split()
    if len(words) != 4 or words[0] != b"public" or words[2] != b"secret" or len(words[3]) != 40:
        raise ConfigError(
            "the file does not hold the server's key pair",
            value=str(path),
            action="delete it to have a new one made",
        )
    return words[1], words[3]
