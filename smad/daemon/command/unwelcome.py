"""Tells of who came and was turned away: counted as it comes, told once a second."""

from __future__ import annotations

from smad.daemon.command.bench import CommandCounts
from smad.daemon.command.server import CommandServer
from smad.daemon.means import Say

_TEXTS = {
    "keys": "turned away {} connections whose key is not on the list",
    "messages": "refused {} messages that are no command",
    "connections": "{} connections over TCP were opened",
    "ended": "{} connections over TCP ended",
    "handshakes": "ended {} connections over TCP that never said who they are",
    "shut": "let nobody in over TCP for a while ({} times): too many connections are open",
    "kept_waiting": "let nobody in on this machine for a while ({} times): too many are connected",
    "displaced": "closed {} silent connections on this machine to let others in",
}


class Unwelcome:
    """A flood must not fill the log either, so `tell` says how many since the last time."""

    def __init__(self, server: CommandServer, commands: CommandCounts, say: Say) -> None:
        self._server = server
        self._commands = commands
        self._say = say
        self._reported = dict.fromkeys(_TEXTS, 0)

    def tell(self) -> None:
        """Say what was turned away since the last call, if anything was."""
        for name, total in self._totals().items():
            count = total - self._reported[name]
            self._reported[name] = total
            if count:
                self._say("warning", _TEXTS[name].format(count), {name: count})

    def _totals(self) -> dict[str, int]:
        server = self._server
        remote, doorkeeper = server.remote_counts, server.doorkeeper
        return {
            "keys": 0 if doorkeeper is None else doorkeeper.refused,
            "messages": self._commands.malformed + server.counts.dropped_messages,
            "connections": remote.connections,
            "ended": remote.ended,
            "handshakes": remote.bad_handshakes,
            "shut": remote.shut,
            "kept_waiting": sum(listener.kept_waiting for listener in server.listeners),
            "displaced": sum(listener.displaced for listener in server.listeners),
        }
