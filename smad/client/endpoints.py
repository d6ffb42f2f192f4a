"""Where the daemon of a bench is found: its folder, its sockets, its connection file.

The client reads the same names, so they stand in one place. The folder's mode says who may
command: nobody but its owner, unless the administrator opened it to a group.
"""

import contextlib
import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec
from msgspec import Struct

from smad.errors import DaemonError, refused_by_system
from smad.files import replacing

FOLDER_VARIABLE = "SMAD_RUNTIME_DIR"
SYSTEM_FOLDER = Path("/run/smad")
_LONGEST_IPC_PATH = 100


class Connection(Struct, frozen=True, kw_only=True):
    """The connection file: how to reach a running daemon, and which one it is."""

    bench: str
    pid: int
    version: str
    command: str
    stop: str
    telemetry: str
    tcp_command: str = ""
    tcp_stop: str = ""
    server_key: str = ""


class Endpoints:
    """Names of everything a bench keeps in its folder."""

    def __init__(self, folder: Path, bench: str) -> None:
        self.folder = folder
        self.bench = bench
        self.connection_file = folder / f"{bench}.json"
        """The file that tells a client all this."""
        self.crash_file = folder / f"{bench}.crash.txt"
        """Where the daemon leaves the traceback of what it died of."""
        self.lock = folder / f"{bench}.lock"
        """The lock file: one daemon to a bench name."""
        self.server_secret = folder / f"{bench}.key"
        """The CURVE key pair of the server, made when it is first needed."""

    @property
    def command(self) -> str:
        """Address of the command socket."""
        return self._address("command")

    @property
    def stop(self) -> str:
        """Address of the stop channel."""
        return self._address("stop")

    @property
    def telemetry(self) -> str:
        """Address of the telemetry stream."""
        return self._address("telemetry")

    def _address(self, name: str) -> str:
        path = str(self.folder / f"{self.bench}.{name}")
        if len(path.encode()) > _LONGEST_IPC_PATH:
            raise DaemonError(
                "the path of a socket is too long for the system",
                value=path,
                limit=f"{_LONGEST_IPC_PATH} characters",
                action="set daemon.ipc_dir to a shorter folder",
            )
        return f"ipc://{path}"


def default_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder of a daemon that a user starts."""
    if named := environment.get(FOLDER_VARIABLE):
        return Path(named).absolute()
    if runtime := environment.get("XDG_RUNTIME_DIR"):
        return Path(runtime) / "smad"
    return Path(f"/tmp/smad-{os.getuid()}")


def candidate_folders(environment: Mapping[str, str] = os.environ) -> tuple[Path, ...]:
    """Return where a client looks for a daemon, in order: the user's own, then the system's."""
    if environment.get(FOLDER_VARIABLE):
        return (default_folder(environment),)
    shared = Path(f"/tmp/smad-{os.getuid()}")
    folders = dict.fromkeys((default_folder(environment), shared, SYSTEM_FOLDER))
    if shared.exists() and shared.stat().st_uid != os.getuid():
        # Anyone can make a folder of that name in /tmp, and pose as our daemon in it.
        folders.pop(shared)
    return tuple(folders)


def prepare_folder(folder: Path) -> int:
    """Make the folder (mode 700) if need be, and return the umask for the sockets in it.

    Raises DaemonError when the folder cannot be used, or belongs to someone else and is open to
    all: whoever can write there could pose as the daemon.
    """
    action = "set daemon.ipc_dir, or SMAD_RUNTIME_DIR, to a folder you own"
    with refused_by_system(
        DaemonError, f"cannot use the folder {folder} for sockets", action=action
    ):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    mode = stat.S_IMODE(status.st_mode)
    if mode & 0o002 or status.st_uid not in (os.getuid(), 0):
        raise DaemonError(
            f"the folder {folder} is not safe for sockets: others may write there",
            value=f"mode {mode:o}, owner {status.st_uid}",
            limit="a folder of your own, mode 700 or 770",
            action=f"chmod 700 {folder}, or set daemon.ipc_dir",
        )
    return 0o007 if mode & 0o020 else 0o077


def write_anew(path: Path, data: bytes, umask: int) -> None:
    """Write a file in place of what has the name, readable as the folder's sockets are.

    A group may write in the folder: a link that somebody put there is removed, not followed.
    Raises OSError, also when the name is taken again at once.
    """
    path.unlink(missing_ok=True)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    with os.fdopen(os.open(path, flags, 0o600), "wb") as file:
        os.fchmod(file.fileno(), 0o644 & ~umask)
        file.write(data)


def new_key_file(path: Path) -> tuple[bytes, bytes]:
    """Write a new pair of CURVE keys, (public, secret), that only its owner can read; return it.

    Raises OSError, also where the name is taken, or is a link. Of a full disk nothing is left.
    """
    import zmq

    public, secret = zmq.curve_keypair()
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(b"public " + public + b"\nsecret " + secret + b"\n")
    except OSError:
        path.unlink()
        raise
    return public, secret


def write_connection(path: Path, connection: Connection, umask: int) -> None:
    """Write the connection file in one piece. Raises DaemonError when that is not possible."""
    text = msgspec.json.format(msgspec.json.encode(connection), indent=2) + b"\n"
    action = "remove what is in its place, or set daemon.ipc_dir to a folder of your own"
    cause = f"cannot write the connection file {path}"
    with refused_by_system(DaemonError, cause, action=action), replacing(path) as draft:
        write_anew(draft, text, umask)


def read_connection(path: Path) -> Connection | None:
    """Return what the file says, or None when there is no daemon behind it any more."""
    try:
        connection = msgspec.json.decode(path.read_bytes(), type=Connection)
    except (OSError, msgspec.MsgspecError):
        return None
    with contextlib.suppress(PermissionError):
        try:
            os.kill(connection.pid, 0)
        except ProcessLookupError:
            return None
    return connection


def running_benches(folders: Iterable[Path]) -> list[str]:
    """Return the names of the benches whose daemon runs, in the order of their names."""
    files = (path for folder in folders for path in folder.glob("*.json"))
    return sorted({path.stem for path in files if read_connection(path) is not None})
