"""What the servers of pages and viewers share: a socket on this machine, and no noise."""

import logging
import os
import socket

from smad.errors import ConfigError

HOST = "127.0.0.1"


def listen(port: int) -> socket.socket:
    """Return a socket that listens on this machine alone. Port 0: any free one.

    Raises ConfigError.
    """
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        raise ConfigError(
            f"cannot listen on {HOST}: {os.strerror(error.errno or 0)}",
            value=port,
            limit="a free port",
            action="give another with --port, or 0 for any",
        ) from error


def quiet(name: str) -> logging.Logger:
    """Return a log without output: rejected connections are not logged."""
    log = logging.getLogger(name)
    log.addHandler(logging.NullHandler())
    log.propagate = False
    return log
