"""SIGHUP: the list of keys that may command over TCP is read anew, and nothing else."""

import os
from collections.abc import Callable
from typing import Any

import msgspec

from smad.config import Config
from smad.daemon.command.auth import KeyAuthenticator
from smad.errors import ConfigError

_TERMINAL = "/dev/tty"


def reread_keys(
    running: Config, authenticator: KeyAuthenticator | None, reread: Callable[[], Config] | None
) -> str:
    """Take over the list of keys from the configuration file; return what came of it, in words.

    A file that is refused changes nothing. `running` is the configuration since the start.
    """
    if reread is None:
        return "SIGHUP: started without a configuration file, so there is nothing to read anew"
    try:
        new_config = reread()
    except ConfigError as error:
        return f"SIGHUP: the list of keys stays as it was: {error}"
    same = _without_keys(running) == _without_keys(new_config)
    waiting = "" if same else "; what else has changed waits for a restart"
    if authenticator is None:
        return f"SIGHUP: commands over TCP are off, so there is no list of keys{waiting}"
    if not new_config.daemon.tcp.enabled:
        return f"SIGHUP: the list of keys stays as it was: TCP is off in the file{waiting}"
    new, gone = authenticator.allow(new_config.daemon.tcp.allowed_keys)
    count = len(new_config.daemon.tcp.allowed_keys)
    return f"SIGHUP: read the list of keys anew, {count} in all, {new} new, {gone} gone{waiting}"


def has_terminal() -> bool:
    """Return whether the process was started from a terminal, which sends SIGHUP as it closes."""
    try:
        os.close(os.open(_TERMINAL, os.O_RDONLY | os.O_NOCTTY | os.O_CLOEXEC))
    except OSError:
        return False
    return True


def _without_keys(config: Config) -> dict[str, Any]:
    plain: dict[str, Any] = msgspec.to_builtins(config)
    del plain["daemon"]["tcp"]["allowed_keys"]
    return plain
