"""The bench behind a port. Pacing is tested on a clock of its own; a few tests use a real tty."""

import os
import random
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState, Fault
from firmware_protocol.events import (
    Connected,
    FailureReason,
    HostState,
    RequestDone,
    RequestFailed,
    StateReceived,
)
from firmware_protocol.host import HostSession
from firmware_protocol.supervisor import (
    ArmConfirmed,
    ArmRequested,
    Disarmed,
    FaultCleared,
    Link,
)
from sim_device.bench import SimulatedBench
from sim_device.errors import PortError
from sim_device.faults import injection
from sim_device.ports import PENDING_MOST, PortCounts, PtyPort, SocketPort, socket_from_descriptor
from sim_device.pty import Server, Servers

DEADLINE_S = 120.0


class FakeClock:
    """Seconds that pass only when told."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class FakePort:
    """A port whose client is the test; nothing comes unless put in."""

    name = "fake"

    def __init__(self) -> None:
        self.counts = PortCounts()
        self.out = bytearray()
        self.open = True

    def fileno(self) -> int | None:
        return None

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        self.out += data

    def close(self) -> None:
        self.open = False


class Stage:
    """A server on a fake clock; waiting moves the clock, or answers as a host would."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **options: object) -> None:
        self.clock = FakeClock()
        self.bench = SimulatedBench(seed=1)
        self.ports: list[FakePort] = []
        self.server = Server(self.bench, self._make_port, clock=self.clock, **options)  # type: ignore[arg-type]
        monkeypatch.setattr(self.server, "_listen", self._listen)
        self.samples_at_s: list[float] = []
        self.host: Callable[[], None] = lambda: None
        self.thinks_s = 0.0

    def _make_port(self) -> FakePort:
        self.ports.append(FakePort())
        return self.ports[-1]

    def _listen(self, seconds: float) -> None:
        self.clock.now_s += max(0.0, min(seconds, 0.1))
        self.host()

    def turn_until(self, samples: int) -> None:
        while self.server.stats.samples < samples:
            before = self.server.stats.samples
            self.server.turn()
            if self.server.stats.samples > before:
                self.samples_at_s.append(self.clock.now_s - 100.0)

    def answer(self) -> None:
        """Answer the last STATE, as a host that runs."""
        board = self.bench.board
        board.apply_setpoint(
            wire.Setpoint(0, board.now_us, (500, 0), (0, 0), 0, 100), 1, 0, board.now_us
        )


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_samples_fall_on_an_absolute_grid(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    stage = Stage(monkeypatch, speed=speed)
    stage.turn_until(200)
    expected = [n * 0.01 / speed for n in range(200)]
    assert stage.samples_at_s == pytest.approx(expected, abs=1e-9)
    assert stage.server.stats.grid_restarts == 0


def test_a_short_delay_is_caught_up_and_a_long_one_starts_a_new_grid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch)
    stage.turn_until(10)
    stage.clock.now_s += 0.03
    stage.turn_until(30)
    assert stage.samples_at_s[29] == pytest.approx(0.29)
    stage.clock.now_s += 2.0
    stage.turn_until(40)
    assert stage.server.stats.grid_restarts == 1
    gaps = [b - a for a, b in zip(stage.samples_at_s[31:], stage.samples_at_s[32:], strict=False)]
    assert gaps == pytest.approx([0.01] * len(gaps))


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e9])
def test_an_absurd_speed_is_refused(speed: float) -> None:
    with pytest.raises(PortError, match="speed"):
        Server(SimulatedBench(), FakePort, speed=speed)


def test_paced_by_host_the_board_waits_for_the_answer_once_armed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True)
    stage.turn_until(20)
    stage.bench.arm()
    stage.turn_until(21)
    board_us = stage.bench.now_us
    calls = [0]

    def slow_host() -> None:
        calls[0] += 1
        stage.clock.now_s += 0.3
        if calls[0] % 3 == 0:
            stage.answer()

    stage.host = slow_host
    stage.turn_until(41)
    assert stage.bench.now_us == board_us + 20 * 10_000
    assert stage.bench.board.state is BoardState.ARMED
    assert stage.bench.board.sp_age_us == 0
    assert stage.server.stats.host_timeouts == 0
    assert calls[0] >= 60


def test_paced_by_host_a_silent_host_is_left_behind_and_the_board_stops_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True, host_timeout_s=1.5)
    stage.turn_until(20)
    stage.bench.arm()
    stage.host = stage.answer
    stage.turn_until(60)
    stage.host = lambda: None
    silent_since_s = stage.clock.now_s
    while stage.bench.board.state is not BoardState.FAULT:
        stage.server.turn()
        assert stage.clock.now_s < silent_since_s + 3.0
    assert stage.server.stats.host_timeouts == 1
    assert stage.clock.now_s - silent_since_s >= 1.5


def test_paced_by_host_a_host_that_comes_back_is_waited_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=1.0, paced_by_host=True, host_timeout_s=0.2)
    stage.turn_until(10)
    stage.bench.arm()
    stage.turn_until(20)
    assert stage.server.stats.host_timeouts == 1
    stage.host = stage.answer
    stage.turn_until(30)
    stage.host = lambda: None
    stage.turn_until(32)
    assert stage.server.stats.host_timeouts == 2


def test_paced_by_host_an_arming_that_is_granted_waits_to_be_confirmed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True, host_timeout_s=2.0)
    stage.turn_until(20)
    board = stage.bench.board
    life_us = board.supervisor.limits.token_us
    granted_us, granted_s = board.now_us, stage.clock.now_s
    assert board.command(ArmRequested(Link(), 7), board.now_us).accepted
    while stage.clock.now_s < granted_s + 1.5:
        stage.server.turn()
    assert board.now_us - granted_us == life_us // 2
    assert board.command(ArmConfirmed(Link(), 7), board.now_us).accepted
    assert board.command(Disarmed(), board.now_us).accepted
    stage.turn_until(200)
    assert board.command(ArmRequested(Link(), 8), board.now_us).accepted
    granted_us = board.now_us
    while board.now_us - granted_us < life_us:
        stage.server.turn()
    assert stage.server.stats.host_timeouts == 1


def test_a_host_that_was_left_behind_is_waited_for_once_it_arms_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True, host_timeout_s=2.0)
    stage.turn_until(20)
    board, server = stage.bench.board, stage.server
    assert board.command(ArmRequested(Link(), 7), board.now_us).accepted
    while not server.stats.host_timeouts:
        server.turn()
    for silences in (1, 2):
        # Its first setpoint is half a second late, ten seconds of board time.
        late_s = stage.clock.now_s + 0.5
        stage.bench.arm()
        stage.host = lambda late_s=late_s: stage.answer() if stage.clock.now_s >= late_s else None  # type: ignore[misc]
        stage.turn_until(server.stats.samples + 50)
        assert board.state is BoardState.ARMED
        assert server.stats.host_timeouts == silences
        stage.host = lambda: None
        while board.state is not BoardState.FAULT:
            server.turn()
        while not board.command(
            FaultCleared(Fault(board.outputs.first_fault)), board.now_us
        ).accepted:
            server.turn()
        stage.turn_until(server.stats.samples + 20)


def test_a_board_at_its_own_pace_does_not_blame_its_host_for_what_the_computer_delivers_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=1.0)
    stage.host = stage.answer
    stage.turn_until(10)
    stage.bench.arm()
    stage.turn_until(100)
    modes: set[BoardState] = set()
    for late_s in (0.04, 0.12, 0.2):
        due_s = stage.clock.now_s + late_s
        # The kernel's worker gets no core: nothing comes, and then all of it.
        stage.host = lambda due_s=due_s: stage.answer() if stage.clock.now_s >= due_s else None  # type: ignore[misc]
        for _ in range(100):
            stage.server.turn()
            modes.add(stage.bench.board.last_mode)
    assert modes == {BoardState.ARMED}
    assert stage.server.stats.host_waits == 2
    assert stage.server.stats.host_timeouts == 0


def test_a_board_at_its_own_pace_leaves_a_silent_host_behind_and_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch, speed=1.0)
    stage.host = stage.answer
    stage.turn_until(10)
    stage.bench.arm()
    stage.turn_until(100)
    stage.host = lambda: None
    silent_s, silent_us = stage.clock.now_s, stage.bench.now_us
    while stage.bench.board.state is not BoardState.FAULT:
        stage.server.turn()
        assert stage.clock.now_s < silent_s + 2.0
    # By the board's clock as by that of any board: 0.1 s until HOLD, and 0.5 s in it.
    assert stage.bench.now_us - silent_us == pytest.approx(620_000, abs=20_000)
    assert stage.server.stats.host_timeouts == 1


def dawdling_run(monkeypatch: pytest.MonkeyPatch, seed: int) -> list[wire.State]:
    """Return what a host sees that answers over bytes, each time after another pause."""
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True)
    host, rng = HostSession(nonce=3), random.Random(seed)
    host.connect(0)
    states: list[wire.State] = []
    skipped = [0]

    def think() -> None:
        port = stage.ports[0]
        for event in host.receive(bytes(port.out), int(stage.clock.now_s * 1e6)):
            if isinstance(event, StateReceived):
                states.append(event.state)
                i_mA = 500 + event.state.force_counts % 97
                host.send_setpoint(wire.Setpoint(0, event.state.t_us, (i_mA, 0), (0, 0), 0, 100))
        port.out.clear()
        armed = stage.bench.board.state is BoardState.ARMED
        stage.clock.now_s += rng.random() * 0.02 * armed
        skipped[0] = (skipped[0] + 1) % 3 if rng.random() < 0.5 else 0
        if not armed or skipped[0] == 0:
            stage.bench.receive(host.data_to_send(), stage.server._bench_time_us())
            port.out += stage.bench.data_to_send()

    stage.host = think
    stage.turn_until(30)
    stage.bench.arm()
    stage.turn_until(400)
    return states


def test_paced_by_host_the_samples_do_not_depend_on_how_long_the_host_thinks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    runs = [dawdling_run(monkeypatch, seed) for seed in (1, 2)]
    by_time = [{state.t_us: state for state in run} for run in runs]
    common = sorted(by_time[0].keys() & by_time[1].keys())[40:]
    assert len(common) > 300
    for t_us in common:
        one, two = by_time[0][t_us], by_time[1][t_us]
        assert msgspec.structs.replace(one, sp_seq=0) == msgspec.structs.replace(two, sp_seq=0)
        assert one.sp_age_us == 0


def test_not_armed_the_board_never_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch, speed=20.0, paced_by_host=True)
    stage.turn_until(500)
    assert stage.samples_at_s[-1] == pytest.approx(499 * 0.01 / 20.0)


def test_an_unplugged_port_is_closed_and_another_one_opened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stage = Stage(monkeypatch)
    stage.bench.faults.add(injection("unplug", 0.5, seconds=0.5))
    stage.turn_until(75)
    assert len(stage.ports) == 1
    assert not stage.ports[0].open
    stage.turn_until(120)
    assert len(stage.ports) == 2
    assert len(stage.ports[1].out) > 0


# Ports


def test_a_full_socket_costs_whole_pieces_and_no_half_ones() -> None:
    ours, theirs = socket.socketpair()
    port = SocketPort(ours)
    piece = b"x" * 1023 + b"\0"
    for _ in range(2000):
        port.write(piece)
    assert port.counts.short_writes > 0
    assert port.counts.dropped > 0
    theirs.setblocking(False)
    got = bytearray()
    for _ in range(50):
        try:
            while True:
                got += theirs.recv(65_536)
        except BlockingIOError:
            port.write(b"")
    assert set(bytes(got).split(b"\0")) == {b"x" * 1023, b""}
    assert len(port._outlet._pending) <= PENDING_MOST
    port.close()
    theirs.close()


def test_a_socket_whose_other_end_went_away_is_quiet() -> None:
    ours, theirs = socket.socketpair()
    port = SocketPort(ours)
    theirs.close()
    assert port.read() == b""
    assert port.fileno() is None
    port.write(b"anything")
    port.close()


def test_a_descriptor_that_is_no_socket_is_refused() -> None:
    with open(os.devnull) as file:
        number = os.dup(file.fileno())
    with pytest.raises(PortError, match=f"descriptor {number} is not an open socket"):
        socket_from_descriptor(number)
    os.close(number)


def test_a_tty_is_raw_and_its_symlink_comes_and_goes(tmp_path: Path) -> None:
    link = tmp_path / "ttyBench"
    port = PtyPort(link)
    assert os.readlink(link) == port.name
    client = os.open(link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    flags = termios.tcgetattr(client)[3]
    assert not flags & (termios.ECHO | termios.ICANON)
    os.close(client)
    port.close()
    assert not link.is_symlink()


def test_a_tty_that_comes_back_may_have_another_name_and_the_symlink_follows(
    tmp_path: Path,
) -> None:
    link = tmp_path / "bench"
    bench = SimulatedBench(faults=[injection("unplug", 0.05, seconds=0.1, renamed=1)])
    server = Server(bench, lambda: PtyPort(link), speed=100.0)
    before = os.readlink(link)
    while bench.now_us < 100_000:
        server.turn()
    assert server.port is None
    while bench.now_us < 300_000:
        server.turn()
    assert os.readlink(link) != before
    server.close()
    assert not link.is_symlink()


def test_a_symlink_over_a_file_or_into_nowhere_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("keep me")
    with pytest.raises(PortError, match="is not a symlink"):
        PtyPort(file)
    assert file.read_text() == "keep me"
    with pytest.raises(PortError, match="cannot make the symlink"):
        PtyPort(tmp_path / "no" / "such" / "folder")


def test_a_tty_without_a_client_takes_nothing_and_a_late_client_finds_nothing_old() -> None:
    port = PtyPort()
    assert port.fileno() is None
    port.write(b"before anybody came\0")
    client = os.open(port.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.fileno() is not None
    port.write(b"now\0")
    assert wait_for(lambda: read_some(client)) == b"now\0"
    port.write(b"never read\0")
    os.close(client)
    assert port.fileno() is None
    again = os.open(port.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.fileno() is not None
    port.write(b"fresh\0")
    assert wait_for(lambda: read_some(again)) == b"fresh\0"
    os.close(again)
    port.close()


def read_some(fd: int) -> bytes:
    try:
        return os.read(fd, 4096)
    except BlockingIOError:
        return b""


def wait_for(found: Callable[[], object]) -> object:
    """Return the first true result; the wait is bounded, and ends as soon as there is one."""
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        result = found()
        if result:
            return result
        time.sleep(0.005)
    raise AssertionError("nothing came")


# The program


@contextmanager
def running(*options: str, **popen: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run `smad sim`; give the process and the port's name."""
    process = subprocess.Popen(
        [sys.executable, "-m", "smad", "sim", "--for", "280", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **popen,
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        if not said.startswith("ready: "):
            raise AssertionError(process.communicate()[1])
        yield process, said.removeprefix("ready: ").strip()
    finally:
        process.kill()
        process.communicate()


class Client:
    """A host session on a descriptor, by the wall clock."""

    def __init__(self, fd: int, nonce: int = 1) -> None:
        self.fd = fd
        # A board that the machine holds up is not given up.
        self.host = HostSession(nonce=nonce, patience=100)
        self.host.connect(self.now_us())
        self.states: list[wire.State] = []
        self.events: list[object] = []
        self.current_mA = 0

    @staticmethod
    def now_us() -> int:
        return time.monotonic_ns() // 1000

    def turn(self) -> None:
        out = self.host.data_to_send()
        while out:
            try:
                out = out[os.write(self.fd, out) :]
            except BlockingIOError:
                time.sleep(0.001)
        events = self.host.receive(read_some(self.fd), self.now_us())
        for event in events + self.host.tick(self.now_us()):
            self.events.append(event)
            if isinstance(event, StateReceived):
                self.states.append(event.state)
                if event.state.mode in (BoardState.ARMED, BoardState.HOLD):
                    self.host.send_setpoint(
                        wire.Setpoint(0, event.state.t_us, (self.current_mA, 0), (0, 0), 0, 100)
                    )

    def until(self, done: Callable[[], object]) -> object:
        def once() -> object:
            self.turn()
            return done()

        return wait_for(once)

    def ask(self, message: wire.Message) -> wire.Message:
        for _ in range(3):
            number = self.host.request(message, self.now_us())
            done = self.until(lambda number=number: self.answer(number))
            if isinstance(done, RequestDone):
                return done.reply
            # A board that the machine holds up is asked once more; a refusal is an answer.
            assert isinstance(done, RequestFailed)
            assert done.reason is FailureReason.TIMEOUT, done
        raise AssertionError("the board never answered")

    def answer(self, number: int) -> RequestDone | RequestFailed | None:
        ends = (e for e in self.events if isinstance(e, RequestDone | RequestFailed))
        return next((e for e in ends if e.id == number), None)

    def arm(self) -> None:
        self.until(lambda: any(isinstance(e, Connected) for e in self.events))
        self.until(lambda: self.states and self.states[-1].mode is BoardState.SAFE)
        assert self.host.board is not None
        token = self.ask(wire.ArmRequest(0, self.host.board.param_crc))
        assert isinstance(token, wire.ArmToken)
        self.ask(wire.ArmConfirm(0, token.token))


@contextmanager
def opened(name: str, nonce: int = 1) -> Iterator[Client]:
    fd = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield Client(fd, nonce)
    finally:
        os.close(fd)


def test_a_host_arms_over_a_real_tty_vanishes_and_comes_back(tmp_path: Path) -> None:
    link = tmp_path / "bench"
    with running("--speed", "5", "--paced-by-host", "--symlink", str(link)) as (process, name):
        assert link.resolve() == Path(name)
        with opened(str(link)) as client:
            client.arm()
            client.current_mA = 1000
            client.until(lambda: client.states[-1].i_applied_mA == (1000, 0))
            assert client.host.state is HostState.RUNNING
            assert client.states[-1].sp_age_us == 0
        with opened(str(link), nonce=2) as client:
            client.until(lambda: any(isinstance(e, Connected) for e in client.events))
            client.until(lambda: len(client.states) > 20)
            assert client.states[-1].mode is not BoardState.ARMED
            assert client.states[-1].i_applied_mA == (0, 0)
            assert client.host.state in (HostState.MONITOR, HostState.FAULTED)
        process.send_signal(signal.SIGTERM)
        assert process.wait(DEADLINE_S) == 0
        assert not link.is_symlink()


def test_garbage_a_second_opener_and_a_reader_that_never_reads_leave_it_running() -> None:
    with running("--speed", "10") as (process, name):
        deaf = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        junk = os.urandom(4096)
        sent = 0
        end = time.monotonic() + DEADLINE_S
        while sent < 300_000 and time.monotonic() < end:
            try:
                sent += os.write(deaf, junk)
            except BlockingIOError:
                time.sleep(0.001)
        assert sent >= 300_000
        os.close(deaf)
        with opened(name) as client:
            client.until(lambda: any(isinstance(e, Connected) for e in client.events))
            client.until(lambda: len(client.states) > 10)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(DEADLINE_S) == 0


def test_the_program_serves_one_end_of_a_socket_pair() -> None:
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    number = theirs.fileno()
    with running(
        "--transport", f"fd:{number}", "--speed", "10", "--paced-by-host", pass_fds=(number,)
    ):
        theirs.close()
        client = Client(ours.fileno())
        client.arm()
        client.until(lambda: client.states[-1].mode is BoardState.ARMED)
    ours.close()


def test_the_server_ends_when_told_from_another_thread() -> None:
    ours, theirs = socket.socketpair()
    server = Server(SimulatedBench(), lambda: SocketPort(ours), speed=50.0)
    timer = threading.Thread(target=lambda: (wait_for(lambda: server.stats.samples), server.stop()))
    timer.start()
    stats = server.run(DEADLINE_S)
    timer.join()
    server.close()
    theirs.close()
    assert stats.samples > 0


def test_boards_in_lockstep_take_no_sample_ahead_of_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = FakeClock()
    rates_hz = (250, 100, 100)
    servers = [
        Server(SimulatedBench(rate_hz=rate_hz), FakePort, speed=50.0, clock=clock)
        for rate_hz in rates_hz
    ]
    group = Servers(servers, lockstep=True, clock=clock)

    def passing(*_: object) -> tuple[list[int], list[int], list[int]]:
        clock.now_s += 0.0003
        return [], [], []

    monkeypatch.setattr("select.select", passing)
    apart_us = []
    for _ in range(2000):
        group.turn()
        times_us = [server.bench.now_us for server in servers]
        apart_us.append(max(times_us) - min(times_us))
    assert max(apart_us) <= 10_000
    assert min(times_us) > 500_000
    assert servers[0].stats.samples > 2 * servers[1].stats.samples
