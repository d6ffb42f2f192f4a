"""The process campaign: the real daemon on a pseudo-terminal in wall time; the host's faults."""

from __future__ import annotations

import contextlib
import functools
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import zmq

from campaign.faults.breakable_daemon import DAEMON_PARTS, WALL_CLOCK_PART, WRITER_PART
from campaign.faults.catalogue import HOLD_BUDGET_J
from campaign.faults.crowd import crowd
from campaign.faults.lockstep import gate_open_after, states_after
from campaign.faults.oracle import Ending, Expectation, LogFound, Outcome, Then
from campaign.faults.program import GAVE_UP
from campaign.faults.rig import FaultRig, rig_in
from campaign.faults.smalldisk import small_disk
from campaign.faults.trace import HOT
from campaign.rig import PATIENCE_S
from campaign.scripted_client import ScriptedClient
from firmware_protocol.enums import BoardState
from smad.api import Arm, Reason
from smad.client import Client, Refused
from smad.client.renewal import DEFAULT_LEASE_S
from smad.control.commands import DriveCurrent
from smad.daemon.errors import TaskDied
from smad.errors import RunLogError, SmadError
from smad.runlog.reader import read_run

FULL_W = 13.0
"""A little more than a spring takes at 4 A."""

DEATH_BUDGET_J = 20.0
"""A second until the part that breaks is used, and half a second to disarm or to be missed."""

_AFTER_STOP_S = 1.5
_TRIES = 6
_MOST_TRIES = 60
_ARMING_S = 0.02
_STOPPED_FOR_S = 2.0
_CROWDED_S = 2.5
"""Longer than a stranger is let in without saying who it is."""

CROWD = 400
_DAEMON_STAYS = ("ended by SIGTERM",)


@dataclass(frozen=True)
class HostFault:
    """One fault of the process campaign. `begin` breaks; its answer is what was not refused."""

    name: str
    text: str
    begin: Callable[[FaultRig, Client], str]
    then: Then
    faults: tuple[str, ...] = ()
    budget_J: float = HOLD_BUDGET_J
    watch_s: float = 5.0
    after_stop_s: float = _AFTER_STOP_S
    part: str = ""
    program: str = ""
    """The program of `campaign.faults.program` that arms and heats; empty: our own client does."""
    small_disk: bool = False
    descriptors: int | None = None
    """The daemon's limit on open files, if it is an unusual one."""
    log_is_lost: bool = False
    status: int = 0
    words: tuple[str, ...] = _DAEMON_STAYS


def _kill(rig: FaultRig, client: Client) -> str:
    rig.signal(signal.SIGKILL)
    return ""


def _stop_and_go_on(rig: FaultRig, client: Client) -> str:
    rig.signal(signal.SIGSTOP)
    # By the board's clock: a busy computer may keep the bench from running meanwhile.
    until_us = rig.bench.now_us + round(_STOPPED_FOR_S * 1e6)
    rig.wait("the board has gone on alone", lambda: rig.bench.now_us > until_us)
    rig.signal(signal.SIGCONT)
    return ""


def _break_part(rig: FaultRig, client: Client) -> str:
    rig.signal(signal.SIGUSR1)
    return ""


def _device(name: str, **parameters: float) -> Callable[[FaultRig, Client], str]:
    def begin(rig: FaultRig, client: Client) -> str:
        rig.inject(name, **parameters)
        return ""

    return begin


def _disk_full(rig: FaultRig, client: Client) -> str:
    disk = rig.disk
    assert disk is not None
    disk.fill(rig.daemon.process.pid, Path(client.status().recorder.path))
    rig.wait(
        f"the daemon says: {disk.words}",
        lambda: (
            disk.words in client.status().recorder.error
            and any("recording failed" in event.text for event in client.status().events)
        ),
    )
    return ""


def _second_commander(rig: FaultRig, client: Client) -> str:
    client.take_control("first", lease_s=30.0)
    other = Client(folder=rig.folder, timeout_s=PATIENCE_S)
    try:
        other.current(DriveCurrent(i_y_A=4.0))
    except Refused:
        return ""
    else:
        return "a second client commanded a bench that another one holds"
    finally:
        other.close()


def _stop_against_arm(rig: FaultRig, client: Client) -> str:
    """Right after a reconnection: arm, 20 ms later somebody else's disarm. Nothing may be armed."""
    client.disarm()
    rig.wait("it has cooled", lambda: rig.bench.board.state is BoardState.SAFE)
    caller = ScriptedClient(client.connection.command)
    refused: list[str] = []
    try:
        while refused.count(Reason.STOPPED) < _TRIES and len(refused) < _MOST_TRIES:
            losses = client.status().link.losses
            rig.inject("unplug", seconds=0.1)
            again = functools.partial(_again, client, losses)
            rig.wait("it is connected again", again, pause=lambda: time.sleep(0.001))
            board = client.status().board
            if board is None or board.params_agree is not None:
                # Armed at once it would rightly be armed before the stop comes.
                refused.append("nothing was waiting")
                continue
            begun_s = time.monotonic()
            caller.send(Arm())
            time.sleep(_ARMING_S)
            late = time.monotonic() - begun_s > 2.0 * _ARMING_S
            if client.disarm().armed:
                return "a disarm was acknowledged while the bench was armed"
            acknowledged_us = rig.bench.now_us
            answer = caller.next_answer().refused
            if late or answer != Reason.STOPPED:
                # A busy computer sent the stop late: the bench was armed first, and rightly so.
                # What counts from here on is what follows that stop.
                rig.onset_us = acknowledged_us
            refused.append("a stop sent late" if late else answer or "armed before the stop")
    finally:
        caller.close()
    if Reason.STOPPED in refused:
        return ""
    return f"no stop came while the bench was arming ({', '.join(refused)})"


def _again(client: Client, losses: int) -> bool:
    link = client.status().link
    return link.losses > losses and link.state == "monitor"


def _lapsed_takeover(rig: FaultRig, client: Client) -> str:
    """Who holds the bench falls silent; somebody else asks for control all the time."""
    client.take_control("first", lease_s=0.5)
    other = Client(folder=rig.folder, timeout_s=PATIENCE_S)
    deadline_s = time.monotonic() + PATIENCE_S
    try:
        while time.monotonic() < deadline_s:
            try:
                other.take_control("second")
            except Refused:
                continue
            hot = rig.bench.board.state in HOT
            return "control of an armed bench changed hands" if hot else ""
        return "control was never given"
    finally:
        other.close()


def _kill_program(rig: FaultRig, client: Client) -> str:
    (program,) = rig.programs
    program.kill()
    program.wait()
    rig.wait("its lease is over", lambda: not client.status().control.holder)
    return ""


def _disarm_program(rig: FaultRig, client: Client) -> str:
    """Disarm as somebody else; the program goes on to its next runs until it gives up."""
    (program,) = rig.programs
    assert rig.log is not None
    if client.disarm().armed:
        return "a disarm was acknowledged while the bench was armed"
    said, _ = program.communicate(timeout=PATIENCE_S)
    if GAVE_UP not in said:
        return f"the program ended otherwise: {said!r}"
    cut = read_run(rig.log).cut_by
    return "" if "disarm of a client" in cut else f"the log of the run says {cut!r} of what cut it"


def _deaf_subscribers(rig: FaultRig, client: Client) -> str:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    for _ in range(3):
        deaf = context.socket(zmq.SUB)
        deaf.setsockopt(zmq.RCVHWM, 1)
        deaf.setsockopt(zmq.SUBSCRIBE, b"")
        deaf.connect(client.connection.telemetry)
    time.sleep(3.0)
    context.destroy(linger=0)
    return ""


def _stop_in_a_crowd(rig: FaultRig, client: Client) -> str:
    """Have no descriptor left, look whether the bench goes on, and stop it as a new client."""
    with crowd(client.connection, CROWD):
        time.sleep(_CROWDED_S)
        if not client.motion().armed:
            return "a crowd disarmed the bench"
    # Strangers are dropped after two seconds; those of a new crowd still hold what they took.
    with crowd(client.connection, CROWD):
        with Client(folder=rig.folder, timeout_s=PATIENCE_S) as stopper:
            stopper.disarm()
        rig.wait("the stop of a new client arrives", lambda: not client.motion().armed)
    return ""


def _delete_runs(rig: FaultRig, client: Client) -> str:
    shutil.rmtree(rig.runs)
    words = "deleted, moved or replaced"
    rig.wait(
        f"the daemon says: {words}",
        lambda: (
            words in client.status().recorder.error
            and any("recording failed" in event.text for event in client.status().events)
        ),
    )
    rows = client.status().recorder.rows
    time.sleep(_CROWDED_S)
    more = client.status().recorder.rows - rows
    return f"{more} rows were counted that went nowhere" if more else ""


def _disarm_words(part: str) -> str:
    """What the last line must say of the disarm: a dead session cannot hear its confirmation."""
    return "did not confirm the disarm" if part == "session" else "disarmed, the board cools"


_LOST = ("SETPOINT_LOST",)

_ROWS: tuple[HostFault, ...] = (
    HostFault("sigkill", "the daemon is killed while armed", _kill, Then.STOPS, _LOST,
              status=-signal.SIGKILL, words=()),
    HostFault("sigstop", "the daemon is stopped for 2 s while armed", _stop_and_go_on, Then.STOPS,
              _LOST, words=(*_DAEMON_STAYS, "the board has stopped already")),
    HostFault("unplug", "the cable is out for 2 s", _device("unplug", seconds=2.0), Then.STOPS,
              _LOST, after_stop_s=4.0, words=(*_DAEMON_STAYS, "the board has stopped already")),
    HostFault("stall", "nothing passes for 3 s, then all at once", _device("stall", lasts=3.0),
              Then.STOPS, _LOST, after_stop_s=5.0,
              words=(*_DAEMON_STAYS, "the board has stopped already")),
    HostFault("disk_full", "the run log's disk is full", _disk_full, Then.GOES_ON,
              watch_s=2.0, small_disk=True,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    HostFault("deleted_folder", "the folder of the run log is deleted", _delete_runs, Then.GOES_ON,
              watch_s=2.0, log_is_lost=True,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    HostFault("exhausted_descriptors",
              f"{CROWD} strangers over TCP and {CROWD} clients at a limit of 200 open files; "
              "then a new client stops the bench", _stop_in_a_crowd, Then.DISARMS,
              budget_J=FULL_W * 10.0, descriptors=200, words=(*_DAEMON_STAYS, "nothing was armed")),
    HostFault("second_commander", "another client commands a held bench", _second_commander,
              Then.GOES_ON, watch_s=1.0,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    HostFault("stop_against_arm", "after a reconnection, somebody disarms 20 ms after an arm",
              _stop_against_arm, Then.DISARMS, words=(*_DAEMON_STAYS, "nothing was armed")),
    HostFault("lapsed_takeover", "a lease lapses while another client asks for control",
              _lapsed_takeover, Then.DISARMS, budget_J=DEATH_BUDGET_J,
              words=(*_DAEMON_STAYS, "nothing was armed")),
    HostFault("killed_program", "a program that armed is killed", _kill_program, Then.DISARMS,
              budget_J=FULL_W * (DEFAULT_LEASE_S + 1.0), program="heats",
              words=(*_DAEMON_STAYS, "nothing was armed")),
    HostFault("stopped_program", "somebody disarms during the first of a program's three runs",
              _disarm_program, Then.DISARMS, program="plays_on",
              words=(*_DAEMON_STAYS, "nothing was armed")),
    HostFault("deaf_subscribers", "three subscribers never read, then die", _deaf_subscribers,
              Then.GOES_ON, watch_s=1.0,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    HostFault("wall_clock_jump", "the wall clock jumps back by an hour", _break_part, Then.GOES_ON,
              watch_s=2.0, part=WALL_CLOCK_PART,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    HostFault("dies_writer", "the thread of the run log raises", _break_part, Then.GOES_ON,
              watch_s=2.0, part=WRITER_PART,
              words=(*_DAEMON_STAYS, "disarmed, the board cools by itself")),
    *(
        HostFault(f"dies_{part}", f"the daemon's {part} raises", _break_part, Then.DISARMS,
                  budget_J=DEATH_BUDGET_J, part=part, status=TaskDied.exit_status,
                  words=("task died", "RuntimeError: injected", _disarm_words(part)))
        for part in DAEMON_PARTS
    ),
)  # fmt: skip

HOST_FAULTS: dict[str, HostFault] = {row.name: row for row in _ROWS}


def run_host_fault(fault: HostFault, seed: int, *, paced: bool = False) -> Outcome:
    """Run one with a daemon, a bench and a client of its own; a few seconds of wall time.

    `paced`: the armed board waits for its daemon; for faults after which the bench goes on. Raises
    SmadError when the healthy bench could not be brought to heat.
    """
    # Socket paths are short.
    with (
        tempfile.TemporaryDirectory(prefix="smad-fault-") as folder,
        small_disk(Path(folder) / "disk") if fault.small_disk else contextlib.nullcontext() as disk,
        rig_in(Path(folder), seed, fault.part, disk, fault.descriptors, paced=paced) as rig,
    ):
        client = rig.heat_by_program(fault.program) if fault.program else rig.heat()
        rig.onset_us = rig.bench.now_us
        not_refused = _begun(fault, rig, client)
        rig.watch(fault.watch_s, fault.after_stop_s)
        observed_us = rig.bench.now_us
        alive = rig.daemon.process.poll() is None and fault.then is not Then.DISARMS
        running = alive and client.status().motion.armed
        status = rig.daemon.end(signal.SIGTERM)
        rig.stop_bench()
        ending = Ending(status, rig.daemon.last_line, fault.status, fault.words)
        seen = _Seen(rig.onset_us, observed_us, running, not_refused, ending)
        return _outcome(fault, rig, seen)


@dataclass(frozen=True)
class _Seen:
    """What was noted while a fault was tried; times of the bench in us."""

    onset_us: int
    observed_us: int
    running: bool
    not_refused: str
    ending: Ending


def _begun(fault: HostFault, rig: FaultRig, client: Client) -> str:
    try:
        return fault.begin(rig, client)
    except SmadError as error:
        return f"it did not go as it should: {error}"


def _outcome(fault: HostFault, rig: FaultRig, seen: _Seen) -> Outcome:
    onset_us, observed_us = seen.onset_us, seen.observed_us
    trace = rig.bench.trace
    safe_us = trace.safe_at(onset_us)
    if safe_us is not None and safe_us > observed_us:
        # Our own disarm at the end is not what the fault led to.
        safe_us = None
    until_us = observed_us if safe_us is None else safe_us
    first = rig.bench.board.supervisor.first_fault
    watched_s = (until_us - onset_us) * 1e-6
    goes_on = fault.then is Then.GOES_ON
    states = states_after(trace, onset_us)
    return Outcome(
        name=fault.name,
        group="process",
        scene="heating",
        injected=fault.text if rig.disk is None else rig.disk.text,
        expected=Expectation(
            fault.then, fault.faults, FULL_W * watched_s + 1.0 if goes_on else fault.budget_J
        ),
        first_fault="" if first is None else first.fault.name,
        told_fault="",
        safe_after_s=None if safe_us is None else watched_s,
        energy_J=trace.heat_at(until_us) - trace.heat_at(onset_us),
        energy_after_safe_J=0.0 if safe_us is None else trace.heat_J[-1] - trace.heat_at(safe_us),
        hottest_degC=trace.hottest_since(onset_us),
        states=tuple(s for s in states if s[0] * 1e6 + onset_us <= observed_us),
        gate_open_later=safe_us is not None and gate_open_after(trace, safe_us),
        host_running_later=safe_us is not None and seen.running,
        log=None if fault.log_is_lost else _log(rig),
        ending=seen.ending,
        not_refused=seen.not_refused,
    )


def _log(rig: FaultRig) -> LogFound:
    assert rig.log is not None
    try:
        run = read_run(rig.log)
    except RunLogError as error:
        return LogFound(0, rig.flushed_rows, str(error))
    return LogFound(len(run), rig.flushed_rows)
