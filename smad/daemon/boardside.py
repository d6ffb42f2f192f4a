"""The daemon's side of the board: what commands act on and the status tells of."""

from __future__ import annotations

from dataclasses import dataclass

from smad.daemon.control import ControlTask
from smad.daemon.hoststop import HostStop
from smad.daemon.link.link import Link
from smad.daemon.link.requests import BoardRequests
from smad.daemon.link.watch import BoardWatch
from smad.daemon.stops import Stops


@dataclass(frozen=True)
class BoardSide:
    """The port, the control task on it, requests, what is known of the board, and the stops."""

    link: Link
    control: ControlTask
    requests: BoardRequests
    watch: BoardWatch
    stops: Stops
    host_stop: HostStop
