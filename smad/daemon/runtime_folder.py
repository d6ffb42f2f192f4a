"""The daemon's names in its runtime folder, made again when somebody deletes them.

A cleaner of /tmp, or a hand, may remove the folder while the daemon runs. Open connections go on;
without the names nobody new could stop the bench.
"""

import os
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

from smad.client.endpoints import Connection, Endpoints, prepare_folder, write_connection
from smad.daemon.lockfile import LockFile
from smad.daemon.sockets.descriptors import Reserve
from smad.daemon.sockets.listener import Listener
from smad.errors import DaemonError

_Identity = tuple[int, int] | None
"""Device and number of the file that has a name; None: there is none."""


class RuntimeFolder:
    """Lock, sockets and connection file of one bench. All of them must be there by now."""

    def __init__(
        self,
        endpoints: Endpoints,
        connection: Connection,
        lock: LockFile,
        listeners: Iterable[Listener],
        reserve: Reserve = nullcontext,
    ) -> None:
        self._endpoints = endpoints
        self._connection = connection
        self._lock = lock
        self._listeners = {Path(listener.path): listener for listener in listeners if listener.path}
        self._reserve = reserve
        self._trouble = ""
        self._in_place = self._identities()

    def look(self) -> str:
        """Make again what is gone; return what there is to tell, which is mostly nothing."""
        missing = [path for path, identity in self._in_place.items() if _identity(path) != identity]
        if not missing:
            return ""
        with self._reserve():
            before, self._trouble = self._trouble, self._restored(missing)
        if self._trouble:
            return "" if self._trouble == before else self._trouble
        self._in_place = self._identities()
        names = ", ".join(path.name for path in missing)
        return f"somebody removed {names} from {self._endpoints.folder}: made again"

    def _restored(self, missing: list[Path]) -> str:
        try:
            umask = prepare_folder(self._endpoints.folder)
            if self._lock.path in missing:
                self._lock.take_again()
            for path, listener in self._listeners.items():
                if path in missing:
                    listener.listen_again(umask)
            write_connection(self._endpoints.connection_file, self._connection, umask)
        except BlockingIOError:
            return f"another daemon has the name of this bench: {self._lock.holder()}"
        except (DaemonError, OSError) as error:
            return f"the sockets in {self._endpoints.folder} cannot be made again: {error}"
        return ""

    def _identities(self) -> dict[Path, _Identity]:
        paths = (self._lock.path, self._endpoints.connection_file, *self._listeners)
        return {path: _identity(path) for path in paths}


def _identity(path: Path) -> _Identity:
    try:
        status = os.lstat(path)
    except OSError:
        return None
    return status.st_dev, status.st_ino
