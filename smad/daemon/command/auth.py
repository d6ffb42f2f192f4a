"""Who may command over TCP: CURVE keys, and the list of those let in (ZAP, RFC 27). Pure.

The server's key pair is made once and kept in a file that only its owner can read.
"""

import os
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path

import zmq
from zmq.utils import z85

from smad.client.endpoints import new_key_file
from smad.config.curve_key import is_curve_key
from smad.errors import ConfigError

ZAP_ADDRESS = "inproc://zeromq.zap.01"
_ZAP_VERSION = b"1.0"
_REQUEST_FRAMES = 7
_LONGEST_FILE_BYTES = 1000


class KeyAuthenticator:
    """Answers ZeroMQ's question whether a key may connect. Counts those turned away."""

    def __init__(self, allowed_keys: Iterable[str]) -> None:
        self._allowed = frozenset(allowed_keys)
        self.refused = 0

    def allow(self, keys: Iterable[str]) -> tuple[int, int]:
        """Let in these keys from now on, and no others; return how many are new, how many gone."""
        before, self._allowed = self._allowed, frozenset(keys)
        return len(self._allowed - before), len(before - self._allowed)

    def knows(self, user: str) -> bool:
        """Return whether the user of a connection, let in earlier, is on the list still."""
        if user in self._allowed:
            return True
        self.refused += 1
        return False

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


def server_keys(path: Path, *, follow: bool = False) -> tuple[bytes, bytes]:
    """Return (public, secret) from the file, made now if there is none.

    `follow`: the file may be a link (somebody named it; in a folder that a group may write to, a
    link is somebody else's). Raises ConfigError when others can read it or it is not ours, when it
    does not hold a key pair, and when it can neither be read nor made.
    """
    try:
        if not os.path.lexists(path):
            return new_key_file(path)
        data = _read(path, follow=follow)
    except OSError as error:
        raise ConfigError(
            f"the server's key file cannot be used: {error.strerror}",
            value=_path_in_words(path),
            limit="a file, or a name in a folder where one can be made",
            action="correct daemon.tcp.secret_key_file, or remove what has that name",
        ) from error
    words = data.split()
    if not _is_pair(words):
        raise ConfigError(
            "the file does not hold the server's key pair",
            value=str(path),
            limit="public KEY secret KEY, each 40 characters of Z85, and belonging together",
            action="delete it to have a new one made",
        )
    return words[1], words[3]


def _read(path: Path, *, follow: bool) -> bytes:
    # A pipe would be waited for.
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | (0 if follow else os.O_NOFOLLOW)
    with open(os.open(path, flags), "rb") as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, "it is not a file")
        if stat.S_IMODE(status.st_mode) & 0o077:
            raise ConfigError(
                "others can read the server's secret key",
                value=f"{path}, mode {stat.S_IMODE(status.st_mode):o}",
                limit="mode 600",
                action=f"chmod 600 {path}, or delete it to have a new one made",
            )
        if status.st_uid not in (os.geteuid(), 0):
            raise ConfigError(
                "the server's key file belongs to somebody else",
                value=f"{path}, owner {status.st_uid}",
                limit=f"owner {os.geteuid()}",
                action="delete it to have a new one made",
            )
        return file.read(_LONGEST_FILE_BYTES)


def _is_pair(words: list[bytes]) -> bool:
    if len(words) != 4 or words[0] != b"public" or words[2] != b"secret":
        return False
    if not all(is_curve_key(words[n].decode("ascii", "replace")) for n in (1, 3)):
        return False
    return zmq.curve_public(words[3]) == words[1]


def _path_in_words(path: Path) -> str:
    return f"{path} → {os.readlink(path)}" if path.is_symlink() else str(path)
