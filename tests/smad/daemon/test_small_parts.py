"""The daemon's small parts: lease, dead man, budget, histogram, rates, journal, and so on."""

import ast
import asyncio
import io
import random
import signal
import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from firmware_protocol.enums import BoardState, ErrorCode
from firmware_protocol.events import HostEvent, TimeSynced
from firmware_protocol.messages import NO_FIELD, Error
from firmware_protocol.rates import USUAL_BAUDS, USUAL_RATES_HZ
from smad import daemon
from smad.config import Config, with_changes, without_realtime
from smad.control.limits import HostLimit, Trip
from smad.daemon.command.lease import DeadMan, Lease
from smad.daemon.command.server import TimeBudget
from smad.daemon.errors import Refusal
from smad.daemon.histogram import Histogram
from smad.daemon.hoststop import HostStop, fault_of_trip
from smad.daemon.journal import Journal
from smad.daemon.lifecycle import part_of, run
from smad.daemon.link.port import SocketTransport
from smad.daemon.link.requests import refusal
from smad.daemon.link.wirerate import check_rate
from smad.daemon.notify import Notifier
from smad.daemon.process import Options
from smad.errors import ConfigError

SECOND = 1_000_000


def names_in(source: str) -> set[str]:
    """The names that a module uses: one that is imported only, or an annotation only, is not."""
    tree = list(ast.walk(ast.parse(source)))
    said = [getattr(n, field, None) for n in tree for field in ("annotation", "returns")]
    annotations = {id(n) for kind in said if kind is not None for n in ast.walk(kind)}
    return {n.id for n in tree if isinstance(n, ast.Name) and id(n) not in annotations}


def test_every_event_of_a_session_is_taken_by_the_daemon() -> None:
    """But TimeSynced: the session itself computes with it."""
    assert names_in("from a import A, B\ndef f(x: B) -> B:\n    return x is A") == {"x", "A"}
    modules = Path(daemon.__file__).parent.rglob("*.py")
    used = {name for file in modules for name in names_in(file.read_text())}
    events = {e for e in HostEvent.__subclasses__() if e.__module__ == HostEvent.__module__}
    dropped = {event.__name__ for event in events - {TimeSynced}} - used
    assert not dropped, "give them a case in smad/daemon/link/watch.py"


def test_ctrl_c_before_the_board_has_answered_is_no_death_of_a_part(tmp_path: Path) -> None:
    ours, boards = socket.socketpair()

    def opened() -> SocketTransport:
        signal.raise_signal(signal.SIGINT)
        return SocketTransport(ours)

    config = with_changes(without_realtime(Config()), daemon={"ipc_dir": str(tmp_path / "d")})
    ended = run(config, {"": opened}, Options())
    boards.close()
    assert (ended.status, ended.line) == (
        0,
        "ended by SIGINT: the board is not connected; its own watchdog ends heating",
    )


@pytest.mark.parametrize(
    ("rtd_degC", "name"),
    [(200.0, "SENSOR_OPEN"), (80.0, "SENSOR_IMPLAUSIBLE"), (-40.0, "SENSOR_SHORT")],
)
def test_a_sensor_that_stops_the_host_is_named_by_what_it_read(rtd_degC: float, name: str) -> None:
    fault = fault_of_trip(Trip(HostLimit.SENSOR_Y, 900.0, 50.0, rtd_degC))
    assert (fault.name, fault.channel, fault.unit) == (name, "SPRING_Y", "K/s")


def test_a_stop_of_the_host_stands_until_it_is_cleared_and_the_next_one_is_another() -> None:
    controller: Any = SimpleNamespace(trip=None)
    stop = HostStop(controller)
    for _ in range(2):
        controller.trip = Trip(HostLimit.ON_TIME, 2.1, 2.0)
        assert stop.fault is not None
        stop.clear()
        assert stop.fault is None


def _lease() -> Lease:
    return Lease(iter(["first", "second"]).__next__)


def test_a_lease_keeps_others_out_until_it_ends() -> None:
    lease = _lease()
    lease.take("", "Ada", 5 * SECOND, 0)
    with pytest.raises(Refusal, match=r"Ada has exclusive control; got 4\.0 s left"):
        lease.check("", 1 * SECOND)
    with pytest.raises(Refusal, match=r"Ada has exclusive control"):
        lease.check("guess", 1 * SECOND)
    lease.check("first", 1 * SECOND)
    lease.check("", 6 * SECOND)


def test_a_lease_that_ended_is_not_a_strangers_right_to_command() -> None:
    lease = _lease()
    lease.take("", "Ada", 5 * SECOND, 0)
    with pytest.raises(Refusal, match="your exclusive control has ended"):
        lease.check("first", 6 * SECOND)
    assert lease.take("first", "Ada", 5 * SECOND, 6 * SECOND).secret == "second"


def test_whatever_the_holder_says_renews_its_lease_and_what_others_say_does_not() -> None:
    lease = _lease()
    secret = lease.take("", "Ada", 5 * SECOND, 0).secret
    lease.heard("", 3 * SECOND)
    lease.heard(secret, 4 * SECOND)
    lease.heard("guess", 5 * SECOND)
    assert lease.holder(8 * SECOND) is not None
    assert lease.holder(9 * SECOND) is None
    assert lease.take(secret, "Ada", 5 * SECOND, 8 * SECOND).secret == secret
    assert lease.holder(13 * SECOND) is None


def test_a_lease_that_lapses_is_told_once_and_one_that_is_given_back_never() -> None:
    lease = _lease()
    lease.take("", "Ada", 5 * SECOND, 0)
    assert lease.lapsed(4 * SECOND) is None
    gone = lease.lapsed(5 * SECOND)
    assert gone is not None
    assert gone.name == "Ada"
    assert lease.lapsed(6 * SECOND) is None
    lease.take("", "Bob", 5 * SECOND, 6 * SECOND)
    lease.release("second", 7 * SECOND)
    assert lease.lapsed(60 * SECOND) is None


def test_only_the_holder_can_give_control_back() -> None:
    lease = _lease()
    lease.take("", "Ada", 5 * SECOND, 0)
    assert not lease.release("", 0)
    assert not lease.release("guess", 0)
    assert lease.release("first", 0)
    lease.take("", "Bob", 5 * SECOND, 0)


def test_the_dead_man_hears_only_the_client_that_armed() -> None:
    dead_man = DeadMan(2 * SECOND)
    dead_man.watch(["pitch"], b"ada", 0)
    dead_man.heard(b"bob", 2 * SECOND)
    assert dead_man.expired(3 * SECOND)
    dead_man.heard(b"ada", 3 * SECOND)
    assert not dead_man.expired(4 * SECOND)


def test_the_dead_man_watches_each_axis_until_that_is_not_armed_any_more() -> None:
    dead_man = DeadMan(2 * SECOND)
    dead_man.watch(["pitch"], b"ada", 0)
    dead_man.watch(["yaw"], b"bob", 0)
    assert (dead_man.armed_by("pitch"), dead_man.armed_by("yaw")) == (b"ada", b"bob")
    dead_man.heard(b"bob", 2 * SECOND)
    assert dead_man.expired(3 * SECOND), "Ada is silent, whatever Bob says"
    dead_man.forget(["pitch"])
    assert not dead_man.expired(3 * SECOND)
    assert dead_man.armed_by("pitch") is None


def test_without_patience_the_dead_man_never_expires() -> None:
    dead_man = DeadMan(0)
    dead_man.watch([""], b"ada", 0)
    assert not dead_man.expired(10**15)


def test_a_budget_holds_the_whole_loop_to_its_share_once_a_burst_is_used_up() -> None:
    budget = TimeBudget(0.5, burst_ns=1000, most_ns=1_000_000)
    now_ns = worked_ns = 0
    budget.look(now_ns, worked_ns)
    delays = []
    for _ in range(2000):
        # A command, and as much again that the loop does for it before and after.
        now_ns += 200
        worked_ns += 200
        budget.look(now_ns, worked_ns)
        delays.append(budget.delay_ns())
        now_ns += delays[-1]
    assert delays[:9] == [0] * 9
    assert worked_ns / now_ns == pytest.approx(0.5, abs=0.01)


def test_a_loop_that_needs_more_than_the_share_still_serves_commands() -> None:
    budget = TimeBudget(0.5, burst_ns=1000, most_ns=5000)
    budget.look(0, 0)
    budget.look(1_000_000, 1_000_000)
    assert 0 < budget.delay_ns() <= 5001
    budget.look(1_005_002, 1_000_000)
    assert budget.delay_ns() == 0


@pytest.mark.parametrize("fraction", [0.5, 0.99, 0.999])
def test_percentiles_are_right_within_a_bucket(fraction: float) -> None:
    rng = random.Random(1)
    values = [int(rng.lognormvariate(10.0, 1.0)) for _ in range(20_000)]
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    exact = sorted(values)[int(fraction * len(values))]
    assert histogram.percentile_ns(fraction) == pytest.approx(exact, rel=0.03)


def test_extreme_durations_are_counted_at_the_ends() -> None:
    histogram = Histogram()
    for value in (-5, 0, 31, 32, 10**15):
        histogram.add(value)
    assert histogram.count == 5
    assert histogram.percentile_ns(0.2) == 0.0
    assert histogram.percentile_ns(0.6) == 31.0
    histogram.clear()
    assert histogram.percentiles().count == 0


def test_a_hundred_hertz_fits_115200_baud_and_250_does_not() -> None:
    check_rate(100, 115_200)
    with pytest.raises(ConfigError, match=r"250 samples a second do not fit 115200 baud") as error:
        check_rate(250, 115_200)
    assert error.value.action == (
        "set link.baud = 230400 for 250 Hz, or link.rate_hz = 100 at 115200 baud"
    )


@pytest.mark.parametrize("rate_hz", USUAL_RATES_HZ)
def test_the_pair_that_a_refusal_names_fits(rate_hz: int) -> None:
    for baud in USUAL_BAUDS:
        try:
            assert check_rate(rate_hz, baud) <= 0.7
        except ConfigError as error:
            named = int(error.action.split("link.baud = ")[1].split()[0])
            check_rate(rate_hz, named)


def test_a_refusal_because_of_the_boards_state_names_the_states() -> None:
    error = Error(
        request_type=1,
        request_seq=1,
        code=ErrorCode.WRONG_STATE,
        field=NO_FIELD,
        value=BoardState.ARMED,
        limit=BoardState.FAULT,
    )
    assert "got ARMED; allowed: FAULT" in str(refusal(error))


def test_the_journal_prints_in_order_and_keeps_the_last_lines() -> None:
    stream = io.StringIO()
    journal = Journal(stream, wall_clock=lambda: 5.0)
    for number in range(60):
        journal.say(f"line {number}")
    journal.close()
    assert stream.getvalue().splitlines()[0] == "smad: line 0"
    assert len(stream.getvalue().splitlines()) == 60
    assert journal.recent[-1].text == "line 59"
    assert len(journal.recent) == 50


def test_systemd_hears_ready_and_the_watchdog_a_few_times_an_interval(tmp_path: Path) -> None:
    address = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(address)
        systemd.setblocking(False)
        notifier = Notifier({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "3000000"})
        notifier.ready("all well")
        assert systemd.recv(200) == b"READY=1\nSTATUS=all well"
        for now_us in range(0, 9 * SECOND, 10_000):
            notifier.alive(now_us)
        fed = 0
        while True:
            try:
                assert systemd.recv(200) == b"WATCHDOG=1"
            except BlockingIOError:
                break
            fed += 1
        assert fed == 9


def test_without_systemd_nothing_is_sent() -> None:
    notifier = Notifier({})
    notifier.ready("x")
    notifier.alive(1)
    assert notifier.watchdog_us == 0


async def test_a_call_of_the_loop_that_dies_is_named_by_its_function() -> None:
    told: list[str] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _, details: told.append(part_of(details)))

    def serve_a_command() -> None:
        raise OSError("the socket is gone")

    loop.call_soon(serve_a_command)
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert [name.rsplit(".", 1)[-1] for name in told] == ["serve_a_command"]
