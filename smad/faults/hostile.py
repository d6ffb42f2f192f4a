"""Clients that mean harm, against a real daemon that moves a bench: refused, told, undisturbed."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import random
import socket
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import zmq

from smad.api import LARGEST_MESSAGE
from smad.client import Client
from smad.client.wire import Keys
from smad.errors import SmadError
from smad.faults.caller import Caller
from smad.faults.fort import PATIENCE_S, POLL_S, Fort, Scale, fort_of
from smad.faults.proxy import Proxy
from smad.faults.soak.run import usage_of
from smad.report.page import Table
from smad.runlog.reader import read_run
from smad.version import VERSION

HUGE_BYTES = 100_000_000
_BREATH_S = 2.2
"""Longer than ZeroMQ waits for a greeting, and than the daemon takes to tell."""
_PERCENTILES_S = 1.2
"""Longer than the status takes to have new ones."""

_GREETING = bytes.fromhex("ff00000000000000017f")
_NOTE = "said once"


@dataclass(frozen=True)
class Attack:
    """One way to do harm. `begin` does it and returns what was tried; the words must be told."""

    name: str
    begin: Callable[[Fort], str]
    told: str


@dataclass(frozen=True)
class Held:
    """What an attack came to. Times in us by the board's clock, or ms by the wall."""

    name: str
    tried: str
    told: bool
    carried_out: int
    """Commands of the attacker that the daemon carried out."""
    missed: int
    still_armed: bool
    age_p99_us: float
    age_max_us: float
    answer_max_ms: float
    rss_growth_MiB: float
    descriptors_left: int

    @property
    def failures(self) -> list[str]:
        """What should not have been, in words; empty when the daemon stood it."""
        tests = {
            "it was not told": not self.told,
            "it was carried out": self.carried_out != 0,
            "samples were missed": self.missed != 0,
            "the bench was disarmed": not self.still_armed,
            "memory grew": self.rss_growth_MiB > _RSS_MOST_MIB,
            "descriptors stayed open": self.descriptors_left > 0,
        }
        return [text for text, failed in tests.items() if failed]


_RSS_MOST_MIB = 64.0
"""Ten thousand connections at once leave buffers behind; a message of 100 MB taken in would not."""


_DISARM = b'{"jsonrpc":"2.0","id":1,"method":"disarm"}'


def say(dealer: zmq.Socket[bytes], message: bytes) -> bool:
    """Send, unless the line was refused already: that leaves nothing to send to, for ever."""
    try:
        dealer.send(message, flags=zmq.DONTWAIT)
    except zmq.Again:
        return False
    return True


def _strangers(fort: Fort) -> str:
    words = "whose key is not on the list"
    wait = functools.partial(fort.wait, "strangers are turned away", lambda: fort.told(words))
    return _disarms(fort, zmq.curve_keypair, wait)


def _no_key(fort: Fort) -> str:
    return _disarms(fort, lambda: None, lambda: fort.breathe(_BREATH_S))


def _disarms(
    fort: Fort, keys: Callable[[], tuple[bytes, bytes] | None], wait: Callable[[], None]
) -> str:
    """Tell the daemon to disarm over many lines with such keys, and wait before they are closed."""
    sockets = [fort.dial(keys()) for _ in range(fort.scale.strangers)]
    said = sum(say(dealer, _DISARM) for dealer in sockets)
    wait()
    for dealer in sockets:
        dealer.close(linger=0)
    return f"{said} disarms over {len(sockets)} lines"


def _replay(fort: Fort) -> str:
    """Record what a friend says over TCP; say it again on a new line, and twice on its own."""
    keys = Keys(fort.friend[0], fort.friend[1], fort.connection.server_key)
    stop = fort.connection.tcp_stop
    with Proxy(fort.tcp) as proxy:
        with Client.remote(proxy.address, stop, keys, timeout_s=PATIENCE_S) as friend:
            friend.note(_NOTE)
            # The last message again, within the conversation that it belongs to.
            proxy.repeat_last()
            fort.breathe(POLL_S)
        heard = proxy.heard()
    with socket.create_connection(fort.tcp) as line:
        for piece in heard:
            with contextlib.suppress(OSError):
                line.sendall(piece)
        fort.breathe(_BREATH_S)
    return f"{len(heard)} recorded pieces, the last one twice"


def _malformed(fort: Fort) -> str:
    rng = random.Random(1)
    caller = Caller(fort.connection.command)
    try:
        for _ in range(fort.scale.messages):
            caller.send_raw(rng.choice((_garbage, _cut, _deep))(rng))
            if caller.unanswered > 100:
                caller.drain_one()
        caller.drain_all()
        if caller.unanswered:
            raise SmadError(f"{caller.unanswered} malformed messages were never answered")
    finally:
        caller.close()
    fort.breathe(_BREATH_S)
    return f"{fort.scale.messages} messages"


def _garbage(rng: random.Random) -> bytes:
    return rng.randbytes(rng.randint(1, 300))


def _cut(rng: random.Random) -> bytes:
    whole = msgspec.json.encode({"jsonrpc": "2.0", "id": 1, "method": "current", "params": {}})
    return whole[: rng.randrange(1, len(whole))]


def _deep(rng: random.Random) -> bytes:
    return b"[" * rng.randint(1, LARGEST_MESSAGE)


def _huge(fort: Fort) -> str:
    """100 MB in one message: as a client over ipc, and as bytes over TCP."""
    dealer = fort.dial_here()
    dealer.send(bytes(HUGE_BYTES))
    with socket.create_connection(fort.tcp) as line, contextlib.suppress(OSError):
        line.settimeout(1.0)
        line.sendall(_GREETING + bytes(HUGE_BYTES))
    fort.breathe(_BREATH_S)
    # The refusal is lost if the system was still taking the message when the line was closed.
    answers = [dealer.recv()] if dealer.poll(0) else []
    dealer.close(linger=0)
    if any(b'"error"' not in answer for answer in answers):
        raise SmadError("a message of 100 MB was taken for a command")
    return "one over ipc, one over TCP"


def _crowd(fort: Fort) -> str:
    """Connections that are opened and say nothing."""
    lines: list[socket.socket] = []
    done = threading.Event()

    def open_all() -> None:
        for _ in range(fort.scale.connections):
            with contextlib.suppress(OSError):
                lines.append(socket.create_connection(fort.tcp, timeout=PATIENCE_S))
        done.set()

    opener = threading.Thread(target=open_all)
    opener.start()
    while not done.is_set():
        fort.breathe(POLL_S)
    fort.breathe(_BREATH_S)
    opener.join()
    for line in lines:
        line.close()
    if len(lines) < fort.scale.connections:
        return f"{len(lines)} of {fort.scale.connections} connections (no more were to be had)"
    return f"{len(lines)} connections"


def _nobody(fort: Fort) -> str:
    fort.breathe(5.0)
    return "nothing, for comparison"


ATTACKS: tuple[Attack, ...] = (
    Attack("nobody", _nobody, ""),
    Attack("stranger's key", _strangers, "whose key is not on the list"),
    Attack("no key", _no_key, "connections over TCP ended"),
    Attack("replayed message", _replay, "connections over TCP ended"),
    Attack("malformed message", _malformed, "messages that are no command"),
    Attack("message of 100 MB", _huge, "connections over TCP ended"),
    Attack("many connections", _crowd, "that never said who they are"),
)


def run_attacks(scale: Scale, say: Callable[[str], None]) -> list[Held]:
    """Run every attack on one daemon, one after the other.

    Raises SmadError when it does not come up, or does not answer its rightful client any more.
    """
    with fort_of(scale) as fort:
        # A log that arming begins would end by itself, soon after the last disarm.
        fort.client.start_recording("hostile clients")
        fort.move()
        held = []
        for attack in ATTACKS:
            say(attack.name)
            held.append(_stood(fort, attack))
        fort.client.disarm()
        path = Path(fort.client.stop_recording().path)
        logged = [event.text for event in read_run(path).events if event.kind == "command"]
    return [replace(one, carried_out=_too_many(one.name, logged)) for one in held]


def _stood(fort: Fort, attack: Attack) -> Held:
    fort.client.reset_timing()
    process = fort.daemon.process.pid
    before, held = fort.client.status(), usage_of(process, 0.0)
    fort.slowest_s = 0.0
    fort.listen_anew()
    tried = attack.begin(fort)
    with contextlib.suppress(SmadError):
        fort.wait("it was told", lambda: fort.told(attack.told))
    # Lines that nobody speaks on are closed after a while.
    with contextlib.suppress(SmadError):
        fort.wait(
            "descriptors are given back",
            lambda: usage_of(process, 0.0).descriptors <= held.descriptors,
        )
    fort.breathe(_PERCENTILES_S)
    after, left = fort.client.status(), usage_of(process, 0.0)
    age = after.timing.setpoint_age
    return Held(
        name=attack.name,
        tried=tried,
        told=fort.told(attack.told),
        carried_out=0,
        missed=after.counts.missed - before.counts.missed,
        still_armed=after.motion.armed and after.motion.fault is None,
        age_p99_us=age.p99_us,
        age_max_us=age.max_us,
        answer_max_ms=fort.slowest_s * 1e3,
        rss_growth_MiB=left.rss_MiB - held.rss_MiB,
        descriptors_left=left.descriptors - held.descriptors,
    )


_OURS = {"arm": 1, "move": 1, "disarm": 1, "record.note": 1}
_TRIED = {
    "stranger's key": ("disarm",),
    "no key": ("disarm",),
    "replayed message": ("record.note",),
    "malformed message": ("current",),
}


def _too_many(name: str, logged: Sequence[str]) -> int:
    """How often a command that an attack tried is in the log beyond our own."""
    return sum(logged.count(method) - _OURS.get(method, 0) for method in _TRIED.get(name, ()))


_HEADER = (
    "attack", "tried", "carried out", "told", "missed", "age p99 ms", "age max ms",
    "slowest answer ms", "memory MiB", "left open", "",
)  # fmt: skip


def table_of(held: Sequence[Held]) -> Table:
    """What each attack came to, as a table."""
    rows = [
        (
            h.name, h.tried, str(h.carried_out), "yes" if h.told else "NO", str(h.missed),
            f"{h.age_p99_us / 1e3:.1f}", f"{h.age_max_us / 1e3:.1f}", f"{h.answer_max_ms:.0f}",
            f"{h.rss_growth_MiB:+.1f}", str(max(h.descriptors_left, 0)),
            "; ".join(h.failures) or "ok",
        )
        for h in held
    ]  # fmt: skip
    return Table(_HEADER, rows, numeric=frozenset(range(2, 10)) - {3})


def json_of(held: Sequence[Held]) -> str:
    """Everything, as JSON text."""
    rows = [{**dataclasses.asdict(h), "failures": h.failures} for h in held]
    return json.dumps({"smad": VERSION, "attacks": rows}, indent=1) + "\n"
