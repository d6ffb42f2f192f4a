"""Reports refused connections and messages: counted as they come, logged once a second."""

from smad.daemon.command.bench import CommandCounts
from smad.daemon.command.server import CommandServer
from smad.daemon.services import Say

_TEXTS = {
    "keys": "refused {} connections whose key is not on the list",
    "messages": "refused {} messages that are not commands",
    "connections": "{} connections over TCP were opened",
    "ended": "{} connections over TCP ended",
    "handshakes": "closed {} connections over TCP that did not authenticate",
    "shut": "refused new connections over TCP {} times: too many are open",
    "kept_waiting": "refused new connections on this machine {} times: too many are open",
    "displaced": "closed {} silent connections on this machine to accept others",
}


class RejectionLog:
    """Logs counts instead of single events, so that a flood does not fill the log."""

    def __init__(self, server: CommandServer, commands: CommandCounts, say: Say) -> None:
        self._server = server
        self._commands = commands
        self._say = say
        self._reported = dict.fromkeys(_TEXTS, 0)

    def report(self) -> None:
        """Log what was refused since the last call, if anything was."""
        for name, total in self._totals().items():
            count = total - self._reported[name]
            self._reported[name] = total
            if count:
                self._say("warning", _TEXTS[name].format(count), {name: count})

    def _totals(self) -> dict[str, int]:
        server = self._server
        remote, authenticator = server.remote_counts, server.authenticator
        return {
            "keys": 0 if authenticator is None else authenticator.refused,
            "messages": self._commands.malformed + server.dropped_messages,
            "connections": remote.connections,
            "ended": remote.ended,
            "handshakes": remote.bad_handshakes,
            "shut": remote.shut,
            "kept_waiting": sum(listener.kept_waiting for listener in server.listeners),
            "displaced": sum(listener.displaced for listener in server.listeners),
        }
