"""How each axis's line to its board is opened: a serial port of its own, or a socket inherited."""

import os
import socket
from collections.abc import Mapping

from smad.config import Config
from smad.daemon.link.port import Opener, PortFinder, SocketTransport, Transport, open_serial
from smad.errors import ConfigError


def serial_openers(config: Config) -> Mapping[str, Opener]:
    """Return what opens the port of each axis. Raises ConfigError where it is none, or shared."""
    openers: dict[str, Opener] = {}
    axis_of: dict[str, str] = {}
    for name, axis_config in config.by_axis().items():
        port = axis_config.link.port
        if not port:
            raise ConfigError(
                f"no port is named{f' for the axis {name}' if name else ''}",
                limit="port in its [[axes]]"
                if name
                else "--port DEVICE, or link.port in the configuration",
                action="look in /dev/serial/by-id, or try smad start --sim",
            )
        real = os.path.realpath(port)
        if real in axis_of:
            raise ConfigError(
                f"the axes {axis_of[real]} and {name} are on one port",
                value=f"{port} is {real}",
                limit="one axis a port, as a board drives one",
                action="give each axis the port of its own board",
            )
        axis_of[real] = name
        openers[name] = _serial_opener(port, axis_config.link.baud)
    return openers


def _serial_opener(port: str, baud: int) -> Opener:
    finder = PortFinder(port)

    def open_port() -> Transport:
        path = finder.find()
        transport = open_serial(path, baud)
        finder.remember(path)
        return transport

    return open_port


def socket_openers(config: Config, descriptors: str) -> Mapping[str, Opener]:
    """Return what opens inherited sockets: their numbers with commas between, by axis."""

    def opener(number: int) -> Opener:
        return lambda: SocketTransport(socket.socket(fileno=number))

    return {
        name: opener(int(number))
        for name, number in zip(config.by_axis(), descriptors.split(","), strict=True)
    }
