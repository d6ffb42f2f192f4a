"""The supply of the heaters through a relay that falls when the daemon's heartbeat ends.

The board's watchdog needs a board that works; this one needs only a computer and a relay that is
off by itself. It closes the relay once, when a person starts it, and never again.
"""

import contextlib
import http.client
import math
import os
import signal
import subprocess
import time
import urllib.parse
import urllib.request
from collections.abc import Callable, Collection, Sequence
from typing import NoReturn, Protocol

import zmq

from firmware_protocol.enums import BoardState
from smad.api import topic_of
from smad.client import Client
from smad.client.wire import subscribe, telemetry_of
from smad.config import parse_config
from smad.errors import CommandError, SmadError, refused_by_system
from smad.processes.parent import signal_at_parents_end
from smad.progress import Say

SILENT_S = 1.0
"""The supply is cut when no sample came for so long."""
RENEW_S = 0.4
PULSE_DECISECONDS = 15
"""A Tasmota plug switches itself off so many tenths of a second after the last renewal."""
_HTTP_S = 0.4
_AGAIN_S = 0.1
_LAST_TRY_S = PULSE_DECISECONDS / 10 - _HTTP_S - _AGAIN_S
"""A try that begins later may end after the plug has fallen."""
_END_S = 1.0
_POLL_MS = 100
_CUT_IN = (BoardState.FAULT, BoardState.ESTOP)


class RelayError(SmadError):
    """The relay cannot be switched."""


class Relay(Protocol):
    """A relay that is off by default."""

    def renew(self) -> None:
        """Switch on, or keep on, for a short time. Raises RelayError."""

    def cut(self) -> None:
        """Switch off. Raises RelayError."""


class Heartbeat:
    """Says why the supply must be cut, if it must. Pure: times are arguments.

    Each board has a heartbeat of its own, under its topic: one that falls silent, or never sent,
    counts, whatever the others send.
    """

    def __init__(self, topics: Collection[bytes]) -> None:
        self._topics = topics
        self._last_s: dict[bytes, float] = {}
        """The last sample of each topic."""
        self._stopped_in: BoardState | None = None

    @property
    def began(self) -> bool:
        """Whether each board has sent a sample."""
        return self._last_s.keys() >= set(self._topics)

    def beat(self, now_s: float, mode: int | None, topic: bytes) -> None:
        """A sample came, with the state of the board."""
        self._last_s[topic] = now_s
        if mode in _CUT_IN:
            # For good: another axis may be in order.
            self._stopped_in = BoardState(mode)

    def reason(self, now_s: float) -> str:
        """Return why the supply must be cut; empty while it may be on."""
        topic = min(self._topics, key=lambda topic: self._last_s.get(topic, -math.inf))
        silent_s = now_s - self._last_s.get(topic, -math.inf)
        if silent_s >= SILENT_S:
            of_axis = f" of {topic.decode()}" * (len(self._topics) > 1)
            while_s = f" for {silent_s:.1f} s" * math.isfinite(silent_s)
            return f"no sample{of_axis} came from the daemon{while_s}"
        if self._stopped_in is not None:
            return f"the board is in {self._stopped_in.name}"
        return ""


class TasmotaRelay:
    """A plug with Tasmota's firmware: `PulseTime` lets it fall when it is not renewed."""

    def __init__(
        self,
        address: str,
        *,
        clock_s: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._address = address.rstrip("/")
        self._clock_s = clock_s
        self._sleep = sleep
        self._renewed_s = -math.inf

    def renew(self) -> None:
        """Switch on for a second and a half; ask again while it is on. Raises RelayError."""
        while True:
            began_s = self._clock_s()
            try:
                self._ask(f"Backlog PulseTime1 {PULSE_DECISECONDS}; Power1 ON")
            except RelayError:
                # A plug that has fallen must stay off.
                if self._clock_s() - self._renewed_s > _LAST_TRY_S:
                    raise
                self._sleep(_AGAIN_S)
            else:
                self._renewed_s = began_s
                return

    def cut(self) -> None:
        """Switch off. Raises RelayError; the plug then falls by itself."""
        self._ask("Power1 OFF")

    def _ask(self, command: str) -> None:
        query = urllib.parse.urlencode({"cmnd": command})
        try:
            with urllib.request.urlopen(f"{self._address}/cm?{query}", timeout=_HTTP_S) as reply:
                reply.read(4096)
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise RelayError(
                f"the plug does not answer: {error}",
                value=self._address,
                action="check its address; the relay opens by itself",
            ) from None


class HoldingRelay:
    """A command that keeps the relay on while it runs, such as `gpioset` on a GPIO line."""

    def __init__(self, command: Sequence[str]) -> None:
        self._command = tuple(command)
        self._process: subprocess.Popen[bytes] | None = None

    def renew(self) -> None:
        """Begin the command, the first time. Raises RelayError when it has ended."""
        if self._process is None:
            cause, action = f"cannot start {self._command[0]}", "install it, or name another"
            with refused_by_system(RelayError, cause, action=action):
                self._process = subprocess.Popen(
                    self._command,
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,
                    # It must not outlive us: a relay that nobody watches would stay on.
                    preexec_fn=lambda: signal_at_parents_end(signal.SIGKILL),  # noqa: PLW1509 (no thread of Python runs here)
                )
        if (status := self._process.poll()) is not None:
            raise RelayError(
                f"{self._command[0]} ended, and with it the supply", value=f"status {status}"
            )

    def cut(self) -> None:
        """End the command and all that it began, such as what a shell runs; killed in the end."""
        if self._process is None:
            return
        try:
            self._signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_S)
        finally:
            self._signal(signal.SIGKILL)
            self._process.wait()

    def _signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)


def hold(relay: Relay, bench: str, say: Say) -> NoReturn:
    """Renew a relay while samples come from the bench's daemon, and cut it whatever happens.

    Raises CommandError, which says why it had to fall.
    """
    with Client(bench) as client:
        address = client.connection.telemetry
        axes = parse_config(client.config()).by_axis()
    heartbeat = Heartbeat([topic_of(axis).encode() for axis in axes])
    if not address:
        raise CommandError(
            "the daemon publishes no samples",
            value="telemetry.enabled = false",
            action="set it to true, and start the daemon again; the supply is off",
        )
    reason = "this command was ended"
    try:
        reason = _reason_to_cut(relay, address, heartbeat, say)
    finally:
        try:
            relay.cut()
        except RelayError as error:
            if error.cause not in reason:
                error.cause = f"the supply is to be off: {reason}; {error.cause}"
            raise
    raise CommandError(
        f"the supply of the heaters was cut: {reason}",
        action="look at the bench, then give this command again",
    )


def _reason_to_cut(relay: Relay, address: str, heartbeat: Heartbeat, say: Say) -> str:
    """Renew it for as long as it may be on; return why it may not."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = subscribe(context, address, b"", 1000)
    began_s, renewed_s = time.monotonic(), 0.0
    try:
        while True:
            if socket.poll(_POLL_MS):
                with contextlib.suppress(zmq.Again):
                    while True:
                        topic, data = socket.recv_multipart(zmq.NOBLOCK)
                        heartbeat.beat(time.monotonic(), telemetry_of(data).mode, topic)
            now_s = time.monotonic()
            if not heartbeat.began and now_s - began_s < 5.0 * SILENT_S:
                continue
            if reason := heartbeat.reason(now_s):
                return reason
            if now_s - renewed_s >= RENEW_S:
                try:
                    relay.renew()
                except SmadError as error:
                    return str(error)
                if not renewed_s:
                    say("the supply is on")
                renewed_s = now_s
    finally:
        socket.close(linger=0)
        context.destroy(linger=0)
