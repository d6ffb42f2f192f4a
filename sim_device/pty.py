"""The simulated bench behind a port, paced by the wall clock.

Samples fall on an absolute grid of wall time, `speed` times as fast as board time. A bench that
was kept from running for longer than a few samples starts a new grid instead of hurrying after
the old one: board time then went slower for a while, which no host can tell from a busy board.

Bench and host share a computer, and bytes reach the host by a worker of the kernel that has no more
priority than a browser. So a board that heats does not take a late delivery for a silent host: once
the last sample answered is ANSWERED_WITHIN_US old, it takes no other until an answer came, or until
ANSWER_WAIT_S of wall time went by. A real board does not wait.

With `paced_by_host` the board, once armed, waits for the setpoint that answers its last STATE
before it takes the next sample. Every setpoint is then applied at the time of the sample it
was computed from, however busy the machine is and however fast the bench runs; a closed loop over
the port gives the same samples as one in lockstep. The wait is bounded by wall time: a host that
is silent for `host_timeout_s` is left behind, and the board goes on by itself at `speed` until a
setpoint comes, so that it still notices and stops. In the same way the Python board waits for an
arming that it has granted to be confirmed, before the token is too old. Otherwise an unarmed board
never waits.
"""

from __future__ import annotations

import functools
import select
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from types import FrameType

from firmware_protocol.enums import BoardState
from sim_device.bench import SimulatedBench
from sim_device.board import WRAP
from sim_device.errors import PortError
from sim_device.ports import Port, PortCounts, PtyPort, socket_from_descriptor

ANSWERED_WITHIN_US = 50_000
"""Half of the time after which a board without a fresh setpoint goes to HOLD."""
ANSWER_WAIT_S = 0.25
"""Twice what the kernel's worker was late on two cores with nine busy threads."""
LATE_MOST_S = 0.05
LATE_MOST_PERIODS = 5
WAIT_MOST_S = 0.1
"""Longest wait at a time, so that a signal is noticed."""
HOST_TIMEOUT_S = 2.0
"""So long a board that is paced by its host waits for a setpoint before it goes on alone."""
HEATING = (BoardState.ARMED, BoardState.HOLD)
_NONE_LEFT_US = -2
"""No time of a setpoint."""


@dataclass(slots=True)
class ServeStats:
    """How a run went."""

    samples: int = 0
    grid_restarts: int = 0
    """Times the machine kept the bench from running for longer than a few samples."""
    host_waits: int = 0
    """Times the board took no sample because the host's answers were overdue (at its own pace)."""
    host_timeouts: int = 0
    """Times the host was waited for in vain."""


def in_words(stats: ServeStats, counts: PortCounts) -> str:
    """How a run went, in one line."""
    return (
        f"ended after {stats.samples} samples; {counts.bytes_in} bytes in, "
        f"{counts.bytes_out} out, {counts.dropped} writes dropped; "
        f"fell behind the clock {stats.grid_restarts} times, "
        f"waited for the host {stats.host_waits} times, {stats.host_timeouts} without an answer"
    )


class Server:
    """Runs a bench behind a port.

    `make_port` opens a port; it is called again when an unplugged one comes back. `clock` is a
    monotonic clock in s.
    """

    def __init__(
        self,
        bench: SimulatedBench,
        make_port: Callable[[], Port],
        *,
        speed: float = 1.0,
        paced_by_host: bool = False,
        host_timeout_s: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.0 < speed <= 1000.0:
            raise PortError(f"speed {speed:g} is refused: give a factor above 0 and up to 1000")
        self.bench = bench
        self.stats = ServeStats()
        self.port: Port | None = make_port()
        self.stopping = False
        self._make_port = make_port
        self._speed = speed
        self._paced_by_host = paced_by_host
        usual_s = HOST_TIMEOUT_S if paced_by_host else ANSWER_WAIT_S
        self._host_timeout_s = usual_s if host_timeout_s is None else host_timeout_s
        self._answered_within_us = 0 if paced_by_host else ANSWERED_WITHIN_US
        self._waiting = False
        self._clock = clock
        self._left_behind_at_us = _NONE_LEFT_US
        self._left_behind_token = 0
        self._old_port: Port | None = None
        self._sampled_s = clock()
        self._due_s = self._sampled_s
        bench.on_unplug = self._unplug
        bench.on_plug = self._plug

    def run(self, max_seconds: float | None = None) -> ServeStats:
        """Run until `stop`, or for so many seconds of wall time."""
        end_s = None if max_seconds is None else self._clock() + max_seconds
        self._due_s = self._clock()
        while not self.stopping and (end_s is None or self._clock() < end_s):
            self.turn()
        return self.stats

    def stop(self) -> None:
        """End `run` soon."""
        self.stopping = True

    def close(self) -> None:
        """Give up the port."""
        for port in (self.port, self._old_port):
            if port is not None:
                port.close()
        self.port = self._old_port = None

    def wait_s(self) -> float:
        """Return how long there is nothing to do but to listen, in s."""
        due_s = self._sampled_s + self._host_timeout_s if self._waits_for_host() else self._due_s
        return max(due_s - self._clock(), 0.0)

    def turn(self, most_s: float = WAIT_MOST_S, *, hold: bool = False) -> None:
        """Wait for bytes or for the next sample, whichever comes first, and do it.

        At most `most_s` at a time. With `hold` no sample is taken, though one may be due.
        """
        now_s = self._clock()
        if self._waits_for_host():
            self.stats.host_waits += not self._waiting
            self._waiting = True
            self._listen(min(most_s, self._sampled_s + self._host_timeout_s - now_s))
            if self._waits_for_host() and self._clock() >= self._sampled_s + self._host_timeout_s:
                if self._waits_to_be_armed():
                    self._left_behind_token = self.bench.board.outputs.token
                else:
                    self._left_behind_at_us = self.bench.board.sp_ref_us
                self.stats.host_timeouts += 1
        elif hold or now_s < self._due_s:
            self._listen(most_s if hold else min(most_s, self._due_s - now_s))
        else:
            self._listen(0.0)
            self._sample()

    def _waits_for_host(self) -> bool:
        """Return whether the board first wants an answer: to a sample, or to an arming token."""
        board = self.bench.board
        return self._waits_to_be_armed() or (
            board.last_mode in HEATING
            and board.state in HEATING
            and (board.now_us - board.sp_ref_us) % WRAP > self._answered_within_us
            and board.sp_ref_us != self._left_behind_at_us
        )

    def _waits_to_be_armed(self) -> bool:
        """Return whether a token of arming that was given to a host that paces has lived for half
        of its time."""
        board = self.bench.board
        s = board.outputs
        return (
            self._paced_by_host
            and s.token_valid > 0
            and 2 * (board.now_us - s.token_us) >= board.supervisor.limits.token_us
            and s.token != self._left_behind_token
        )

    def _sample(self) -> None:
        """Take one sample and set the time of the next."""
        self._waiting = False
        now_s = self._clock()
        period_s = self.bench.period_us * 1e-6 / self._speed
        out = self.bench.step()
        if self.port is not None and out:
            self.port.write(out)
        self.stats.samples += 1
        if self.bench.board.state not in HEATING:
            # Armed once more, it waits for its host again.
            self._left_behind_at_us = _NONE_LEFT_US
        self._sampled_s = now_s
        self._due_s += period_s
        if now_s - self._due_s > max(LATE_MOST_S, LATE_MOST_PERIODS * period_s):
            self._due_s = now_s + period_s
            self.stats.grid_restarts += 1

    def _listen(self, seconds: float) -> None:
        """Wait for bytes for at most so long, pass them on, and send what they are answered."""
        seconds = min(max(seconds, 0.0), WAIT_MOST_S)
        port = self.port
        fd = None if port is None else port.fileno()
        if port is None or fd is None:
            time.sleep(seconds)
            return
        readable, _, _ = select.select([fd], [], [], seconds)
        if not readable:
            return
        data = port.read()
        if not data:
            return
        self.bench.receive(data, self._bench_time_us())
        out = self.bench.data_to_send()
        if out:
            port.write(out)

    def _bench_time_us(self) -> int:
        """Return where bench time is now, between the last sample and the next."""
        bench = self.bench
        if self._paced_by_host:
            return bench.now_us
        passed_us = int((self._clock() - self._sampled_s) * self._speed * 1e6)
        return bench.now_us + min(max(passed_us, 0), bench.period_us - 1)

    def _unplug(self, renamed: bool) -> None:
        if renamed:
            self._old_port, self.port = self.port, None
        else:
            self.close()

    def _plug(self) -> None:
        self.port = self._make_port()
        # Only now: had it been closed before, the new one could have got the same name.
        if self._old_port is not None:
            self._old_port.close()
            self._old_port = None


class Servers:
    """Boards of several axes, each behind a port of its own, in one process.

    With `lockstep` none takes a sample while another is behind it in time: then all of them, and
    whoever answers each sample, live on one virtual time.
    """

    def __init__(
        self,
        servers: Sequence[Server],
        *,
        lockstep: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.servers = servers
        self.stopping = False
        self._lockstep = lockstep
        self._clock = clock

    def run(self, max_seconds: float | None = None) -> None:
        """Run until `stop`, or for so many seconds of wall time."""
        end_s = None if max_seconds is None else self._clock() + max_seconds
        while not self.stopping and (end_s is None or self._clock() < end_s):
            self.turn()

    def stop(self) -> None:
        """End `run` soon."""
        self.stopping = True

    def close(self) -> None:
        """Give up the ports."""
        for server in self.servers:
            server.close()

    def turn(self) -> None:
        """Wait for bytes of any board or for the next sample of any, and do what is to be done."""
        least_us = min(server.bench.now_us for server in self.servers)
        ahead = [self._lockstep and server.bench.now_us > least_us for server in self.servers]
        waits_s = [s.wait_s() for s, hold in zip(self.servers, ahead, strict=True) if not hold]
        ports = [server.port for server in self.servers if server.port is not None]
        fds = [fd for port in ports if (fd := port.fileno()) is not None]
        select.select(fds, [], [], min(WAIT_MOST_S, *waits_s))
        for server, hold in zip(self.servers, ahead, strict=True):
            server.turn(0.0, hold=hold)


def serve(
    benches: Mapping[str, SimulatedBench],
    *,
    speed: float = 1.0,
    symlink: Path | None = None,
    transport: str = "pty",
    paced_by_host: bool = False,
    host_timeout_s: float | None = None,
    max_seconds: float | None = None,
    on_ready: Callable[[Mapping[str, str]], None] | None = None,
    handle_signals: bool = True,
) -> tuple[ServeStats, PortCounts]:
    """Run benches behind ports until SIGINT, SIGTERM or for `max_seconds`; return the counts.

    `benches` are by axis; a single one has the empty name, several have the `symlink` with a dot
    and their name behind it. transport: "pty", or "fd:N,N" for inherited sockets, one of each.
    `on_ready` gets the names of the ports once a client can open them. `handle_signals` needs the
    main thread. Raises PortError.
    """
    counts = PortCounts()

    def open_port(axis: str) -> Port:
        if transport == "pty":
            return PtyPort(symlink_of(symlink, axis), counts)
        kind, _, listed = transport.partition(":")
        numbers = listed.split(",")
        if kind == "fd" and len(numbers) == len(benches) and all(map(str.isdigit, numbers)):
            number = dict(zip(benches, numbers, strict=True))[axis]
            return socket_from_descriptor(int(number), counts)
        raise PortError(
            f"transport {transport!r} is refused: give pty, or fd:N with a number for each axis"
        )

    with ExitStack() as opened:
        servers: dict[str, Server] = {}
        for axis, bench in benches.items():
            servers[axis] = Server(
                bench,
                functools.partial(open_port, axis),
                speed=speed,
                paced_by_host=paced_by_host,
                host_timeout_s=host_timeout_s,
            )
            opened.callback(servers[axis].close)
        group = Servers(tuple(servers.values()), lockstep=paced_by_host)
        if handle_signals:
            opened.enter_context(_stopped_by_signals(group))
        if on_ready is not None:
            on_ready({axis: s.port.name for axis, s in servers.items() if s.port is not None})
        group.run(max_seconds)
        return _sum(server.stats for server in group.servers), counts


def symlink_of(symlink: Path | None, axis: str) -> Path | None:
    """Return the lasting name of the port of an axis."""
    return symlink.with_name(f"{symlink.name}.{axis}") if symlink is not None and axis else symlink


@contextmanager
def _stopped_by_signals(group: Servers) -> Iterator[None]:
    def on_signal(number: int, frame: FrameType | None) -> None:
        group.stop()

    before = {n: signal.signal(n, on_signal) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _sum(parts: Iterable[ServeStats]) -> ServeStats:
    return ServeStats(*(sum(counts) for counts in zip(*map(astuple, parts), strict=True)))
