"""Files that a person names: checked before the work, and written whole or not at all."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from smad.errors import CommandError, SmadError, refused_by_system


def require_writable(output: Path) -> None:
    """Raise CommandError unless a file of that name can be written; nothing is made for it."""
    folder = output.parent
    if not folder.is_dir():
        raise CommandError(
            f"{output} cannot be written: there is no folder {folder}",
            action="make the folder, or name another file",
        )
    if output.is_dir():
        raise CommandError(f"{output} cannot be written: it is a folder", action="name a file")
    target = output if output.exists() else folder
    if not os.access(target, os.W_OK):
        raise CommandError(
            f"{output} cannot be written: no permission to write {target}",
            action="name another file",
        )


MOST_BYTES = 100_000_000


def read_whole(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """Return what is in a file. Raises OSError also for one that has no end, as a device."""
    with path.open("rb") as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        why = f"it is too large: longer than {most_bytes // 1_000_000} MB"
        raise OSError(errno.EINVAL, why, str(path))
    return data


@contextlib.contextmanager
def replacing(path: Path, *, durable: bool = False) -> Iterator[Path]:
    """Yield a path beside `path` to write to; it replaces `path` once the block has ended.

    After an error it is removed and `path` stays as it was. What is no file (a pipe, a terminal) is
    written as it is. `durable`: it is on the disk whole before `path` goes. Raises OSError.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield partial
        if durable:
            _to_disk(partial)
        os.replace(partial, path)
        if durable:
            _name_to_disk(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _name_to_disk(path: Path) -> None:
    # Some file systems refuse that of a folder, and the file is written.
    with contextlib.suppress(OSError):
        _to_disk(path.parent)


@contextlib.contextmanager
def named_output(
    path: Path,
    kind: type[SmadError] = CommandError,
    cause: str = "",
    action: str = "",
    *,
    value: str | None = None,
    make_folder: bool = False,
) -> Iterator[Path]:
    """As `replacing`, for a file that a person named. Raises `kind` where the system refuses."""
    has_folder = make_folder or path.parent.is_dir()
    action = action or ("make room, or name another" if has_folder else "make its folder")
    with refused_by_system(kind, cause or f"cannot write {path}", value=value, action=action):
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            yield partial


def write_named(path: Path, data: bytes | str) -> None:
    """As `write_whole`, for a file that a person named. Raises CommandError."""
    with named_output(path) as partial:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)


def write_whole(path: Path, data: bytes | str) -> None:
    """Write a file whole or not at all, text as UTF-8. Raises OSError."""
    with replacing(path) as partial:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)


def append_lines(path: Path, data: bytes, head: bytes = b"") -> None:
    """Add lines to a file; they are on the disk when this returns. Raises OSError.

    `head` goes before the first line. A last line that was cut, by a full disk or a loss of power,
    is removed.
    """
    before = path.read_bytes() if path.exists() else b""
    whole = before.rfind(b"\n") + 1
    with path.open("ab") as file:
        if whole < len(before):
            file.truncate(whole)
        file.write(data if whole else head + data)
    _to_disk(path)
    if not whole:
        _name_to_disk(path)


def display_path(path: str | Path) -> str:
    """A path as a person here reads it: from this folder on where it is below it, else whole."""
    try:
        return str(Path(path).relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)
