"""The errors a user of smad meets. Each prints as one line and ends a command with its status.

A message has four parts: what went wrong (`cause`), with which `value`, against which `limit`, and
what to do next (`action`). Parts that do not apply are left out, never padded.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_LONGEST_VALUE = 120
REFUSED_STATUS = 3
"""What a command ends with that answered, and whose answer is that the question is refused."""


class SmadError(Exception):
    """Base of every error that smad raises on purpose.

    `exit_status` is what the command line ends with. `value` and `limit` keep their type, so that
    a program can use them; only the message shortens and flattens them.
    """

    exit_status = 1

    def __init__(
        self, cause: str, *, value: Any = None, limit: Any = None, action: str = ""
    ) -> None:
        super().__init__(cause)
        self.cause = cause
        self.value = value
        self.limit = limit
        self.action = action

    @property
    def parts(self) -> dict[str, Any]:
        """All but the cause, for an error that is raised in its place."""
        return {"value": self.value, "limit": self.limit, "action": self.action}

    def __str__(self) -> str:
        parts = [self.cause]
        if self.value is not None:
            parts.append(f"got {_one_line(self.value)}")
        if self.limit is not None:
            parts.append(f"allowed: {_one_line(self.limit)}")
        if self.action:
            parts.append(self.action)
        return _visible("; ".join(" ".join(part.split()) for part in parts))


def _visible(text: str) -> str:
    # A NUL, or an escape sequence in a name that a stranger chose, is not for the terminal.
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _one_line(value: Any) -> str:
    if isinstance(value, float):
        # 3.1660000000000004 is the arithmetic's, not the user's.
        value = float(f"{value:.9g}")
    text = value if isinstance(value, str) else repr(value)
    if len(text) > _LONGEST_VALUE:
        text = text[: _LONGEST_VALUE - 1] + "…"
    return text


def first_line(error: BaseException) -> str:
    """Return the first line of what an error says; the name of its class where it says nothing."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def damaged(kind: type[SmadError], path: Path, error: Exception) -> SmadError:
    """Return what to raise for a file that cannot be read, by the error of its reader."""
    why = getattr(error, "strerror", None) or first_line(error)
    return kind(
        f"cannot read {path}: it is missing, cut short or damaged ({why})",
        action="restore the file",
    )


def unusable_path(error: Exception) -> str:
    """Say that a path given by the user cannot be used; nothing when that is not what happened."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"cannot use {error.filename}: {error.strerror}; check the path, or name another"
    if isinstance(error, ValueError) and "embedded null" in str(error):
        return "a path contains a NUL character; leave it out"
    return ""


def reported(error: Exception) -> str:
    """Write the traceback of an error that is a mistake of ours to a file, and say where it is."""
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile("w", prefix="smad-", suffix=".txt", delete=False) as file:
        file.write("".join(traceback.format_exception(error)))
    return (
        f"internal error: {type(error).__name__}: {error}; this is a mistake in smad, "
        f"please report it with {file.name}"
    )


@contextlib.contextmanager
def refused_by_system(
    kind: type[SmadError], cause: str, *, value: Any = None, limit: Any = None, action: str
) -> Iterator[None]:
    """Raise `kind` in place of an OSError of the block, with the system's reason after `cause`."""
    try:
        yield
    except OSError as error:
        reason = f"{cause}: {error.strerror or error}"
        raise kind(reason, value=value, limit=limit, action=action) from error


class ComputerError(SmadError):
    """This computer has no room, memory or time left for what was asked of it."""


class MissingPartError(SmadError):
    """A part of smad that is installed by an extra is not here."""


class ConfigError(SmadError):
    """A configuration file cannot be read, or holds a key or value that is not allowed."""


class RunLogError(SmadError):
    """A run log cannot be written, read, recovered or exported."""


class LogImportError(RunLogError):
    """A foreign log (CSV) or its mapping file cannot be turned into a run log."""


class PortError(SmadError):
    """The serial port is missing, busy, or not what the configuration says."""


class CommandError(SmadError):
    """A command was refused; nothing was changed."""


class DaemonError(SmadError):
    """The daemon is not there, is there twice, or ended on its own."""
