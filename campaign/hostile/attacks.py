"""Attacks of hostile clients on a real daemon that moves a bench, and what each came to."""

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

from campaign.hostile.proxy import Proxy
from campaign.hostile.rig import HostileRig, Scale, hostile_rig
from campaign.rig import PATIENCE_S, POLL_S
from campaign.scripted_client import ScriptedClient
from campaign.soak.run import usage_of
from smad.api import LARGEST_MESSAGE
from smad.client import Client
from smad.client.wire import Keys
from smad.errors import SmadError
from smad.progress import Say
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
    """One way to do harm. `begin` does it and returns what was tried; `message` must be logged."""

    name: str
    begin: Callable[[HostileRig], str]
    message: str


@dataclass(frozen=True)
class Result:
    """What an attack came to. Times in us by the board's clock, or ms by the wall."""

    name: str
    tried: str
    logged: bool
    carried_out: int
    """Commands of the attacker that the daemon carried out."""
    missed: int
    disarmed: str | None
    """What the daemon said last where the bench was disarmed; None while it is armed."""
    age_p99_us: float
    age_max_us: float
    answer_max_ms: float
    rss_growth_MiB: float
    descriptors_left: int

    @property
    def failures(self) -> list[str]:
        """What should not have been, in words; empty when the daemon stood it."""
        tests = {
            "it was not logged": not self.logged,
            "it was carried out": self.carried_out != 0,
            "samples were missed": self.missed != 0,
            f"the bench was disarmed: {self.disarmed}": self.disarmed is not None,
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


def _strangers(rig: HostileRig) -> str:
    words = "whose key is not on the list"
    wait = functools.partial(rig.wait, "strangers are turned away", lambda: rig.journal_says(words))
    return _disarms(rig, zmq.curve_keypair, wait)


def _no_key(rig: HostileRig) -> str:
    return _disarms(rig, lambda: None, lambda: rig.breathe(_BREATH_S))


def _disarms(
    rig: HostileRig, keys: Callable[[], tuple[bytes, bytes] | None], wait: Callable[[], None]
) -> str:
    """Tell the daemon to disarm over many lines with such keys, and wait before they are closed."""
    sockets = [rig.dial(keys()) for _ in range(rig.scale.strangers)]
    said = sum(say(dealer, _DISARM) for dealer in sockets)
    wait()
    for dealer in sockets:
        dealer.close(linger=0)
    return f"{said} disarms over {len(sockets)} lines"


def _replay(rig: HostileRig) -> str:
    """Record what a friend says over TCP; say it again on a new line, and twice on its own."""
    keys = Keys(rig.friend[0], rig.friend[1], rig.connection.server_key)
    stop = rig.connection.tcp_stop
    with Proxy(rig.tcp) as proxy:
        with Client.remote(proxy.address, stop, keys, timeout_s=PATIENCE_S) as friend:
            friend.note(_NOTE)
            # The last message again, within the conversation that it belongs to.
            proxy.repeat_last()
            rig.breathe(POLL_S)
        heard = proxy.heard()
    with socket.create_connection(rig.tcp) as line:
        for piece in heard:
            with contextlib.suppress(OSError):
                line.sendall(piece)
        rig.breathe(_BREATH_S)
    return f"{len(heard)} recorded pieces, the last one twice"


def _malformed(rig: HostileRig) -> str:
    rng = random.Random(1)
    caller = ScriptedClient(rig.connection.command)
    try:
        for _ in range(rig.scale.messages):
            caller.send_raw(rng.choice((_garbage, _cut, _deep))(rng))
            if caller.unanswered > 100:
                caller.drain_one()
        caller.drain_all()
        if caller.unanswered:
            raise SmadError(f"{caller.unanswered} malformed messages were never answered")
    finally:
        caller.close()
    rig.breathe(_BREATH_S)
    return f"{rig.scale.messages} messages"


def _garbage(rng: random.Random) -> bytes:
    return rng.randbytes(rng.randint(1, 300))


def _cut(rng: random.Random) -> bytes:
    whole = msgspec.json.encode({"jsonrpc": "2.0", "id": 1, "method": "current", "params": {}})
    return whole[: rng.randrange(1, len(whole))]


def _deep(rng: random.Random) -> bytes:
    return b"[" * rng.randint(1, LARGEST_MESSAGE)


def _huge(rig: HostileRig) -> str:
    """100 MB in one message: as a client over ipc, and as bytes over TCP."""
    dealer = rig.dial_here()
    dealer.send(bytes(HUGE_BYTES))
    with socket.create_connection(rig.tcp) as line, contextlib.suppress(OSError):
        line.settimeout(1.0)
        line.sendall(_GREETING + bytes(HUGE_BYTES))
    rig.breathe(_BREATH_S)
    # The refusal is lost if the system was still taking the message when the line was closed.
    answers = [dealer.recv()] if dealer.poll(0) else []
    dealer.close(linger=0)
    if any(b'"error"' not in answer for answer in answers):
        raise SmadError("a message of 100 MB was taken for a command")
    return "one over ipc, one over TCP"


def _crowd(rig: HostileRig) -> str:
    """Connections that are opened and say nothing."""
    lines: list[socket.socket] = []
    done = threading.Event()

    def open_all() -> None:
        for _ in range(rig.scale.connections):
            with contextlib.suppress(OSError):
                lines.append(socket.create_connection(rig.tcp, timeout=PATIENCE_S))
        done.set()

    opener = threading.Thread(target=open_all)
    opener.start()
    while not done.is_set():
        rig.breathe(POLL_S)
    rig.breathe(_BREATH_S)
    opener.join()
    for line in lines:
        line.close()
    if len(lines) < rig.scale.connections:
        return f"{len(lines)} of {rig.scale.connections} connections (no more were to be had)"
    return f"{len(lines)} connections"


def _nobody(rig: HostileRig) -> str:
    rig.breathe(5.0)
    return "nothing, for comparison"


ATTACKS: tuple[Attack, ...] = (
    Attack("nobody", _nobody, ""),
    Attack("stranger's key", _strangers, "whose key is not on the list"),
    Attack("no key", _no_key, "connections over TCP ended"),
    Attack("replayed message", _replay, "connections over TCP ended"),
    Attack("malformed message", _malformed, "messages that are not commands"),
    Attack("message of 100 MB", _huge, "connections over TCP ended"),
    Attack("many connections", _crowd, "that did not authenticate"),
)


def run_attacks(scale: Scale, say: Say) -> list[Result]:
    """Run every attack on one daemon, one after the other.

    Raises SmadError when it does not come up, or does not answer its rightful client any more.
    """
    with hostile_rig(scale) as rig:
        # A log that arming begins would end by itself, soon after the last disarm.
        rig.client.start_recording("hostile clients")
        rig.move()
        results = []
        for attack in ATTACKS:
            say(attack.name)
            results.append(_carry_out(rig, attack))
        rig.client.disarm()
        path = Path(rig.client.stop_recording().path)
        logged = [event.text for event in read_run(path).events if event.kind == "command"]
    return [replace(result, carried_out=_too_many(result.name, logged)) for result in results]


def _carry_out(rig: HostileRig, attack: Attack) -> Result:
    rig.client.reset_timing()
    process = rig.daemon.process.pid
    before, usage = rig.client.status(), usage_of(process, 0.0)
    rig.slowest_s = 0.0
    rig.forget_journal()
    tried = attack.begin(rig)
    with contextlib.suppress(SmadError):
        rig.wait("it was logged", lambda: rig.journal_says(attack.message))
    # Lines that nobody speaks on are closed after a while.
    with contextlib.suppress(SmadError):
        rig.wait(
            "descriptors are given back",
            lambda: usage_of(process, 0.0).descriptors <= usage.descriptors,
        )
    rig.breathe(_PERCENTILES_S)
    after, left = rig.client.status(), usage_of(process, 0.0)
    age = after.timing.setpoint_age
    return Result(
        name=attack.name,
        tried=tried,
        logged=rig.journal_says(attack.message),
        carried_out=0,
        missed=after.counts.missed - before.counts.missed,
        disarmed=None if after.motion.armed and not after.motion.fault else rig.daemon.last_line,
        age_p99_us=age.p99_us,
        age_max_us=age.max_us,
        answer_max_ms=rig.slowest_s * 1e3,
        rss_growth_MiB=left.rss_MiB - usage.rss_MiB,
        descriptors_left=left.descriptors - usage.descriptors,
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
    "attack", "tried", "carried out", "logged", "missed", "age p99 ms", "age max ms",
    "slowest answer ms", "memory MiB", "left open", "",
)  # fmt: skip


def table_of(results: Sequence[Result]) -> Table:
    """What each attack came to, as a table."""
    rows = [
        (
            h.name,
            h.tried,
            str(h.carried_out),
            "yes" if h.logged else "NO",
            str(h.missed),
            f"{h.age_p99_us / 1e3:.1f}",
            f"{h.age_max_us / 1e3:.1f}",
            f"{h.answer_max_ms:.0f}",
            f"{h.rss_growth_MiB:+.1f}",
            str(max(h.descriptors_left, 0)),
            "; ".join(h.failures) or "ok",
        )
        for h in results
    ]
    return Table(_HEADER, rows, numeric=frozenset(range(2, 10)) - {3})


def json_of(results: Sequence[Result]) -> str:
    """Everything, as JSON text."""
    rows = [{**dataclasses.asdict(h), "failures": h.failures} for h in results]
    return json.dumps({"smad": VERSION, "attacks": rows}, indent=1) + "\n"
