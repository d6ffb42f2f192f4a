"""Tells of who came over TCP and what was turned away: counted as it comes, told once a second."""

from __future__ import annotations

from smad.daemon.server import CommandServer
from smad.daemon.status import CommandCounts
from smad.daemon.watch import Say

_TEXTS = {
    "keys": "turned away {} connections whose key is not on the list",
    "messages": "refused {} messages that are no command",
    "connections": "{} connections over TCP were opened",
    "ended": "{} connections over TCP ended",
    "handshakes": "ended {} connections over TCP that never said who they are",
    "not_accepted": "could not accept a connection {} times: too many are open",
}


class Unwelcome:
    """A flood must not fill the log either, so `tell` says how many since the last time."""

    def __init__(self, server: CommandServer, commands: CommandCounts, say: Say) -> None:
        self._server = server
        self._commands = commands
        self._say = say
        self._told = dict.fromkeys(_TEXTS, 0)

    def tell(self) -> None:
        """Say what was turned away since the last call, if anything was."""
        for name, total in self._totals().items():
            count = total - self._told[name]
            self._told[name] = total
            if count:
                self._say("warning", _TEXTS[name].format(count), {name: count})

    def _totals(self) -> dict[str, int]:
        counts, doorkeeper = self._server.counts, self._server.doorkeeper
        return {
            "keys": 0 if doorkeeper is None else doorkeeper.refused,
            "messages": self._commands.malformed + counts.dropped_messages,
            "connections": counts.connections,
            "ended": counts.ended,
            "handshakes": counts.bad_handshakes,
            "not_accepted": counts.not_accepted,
        }
