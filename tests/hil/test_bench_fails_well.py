"""The daemon process when things go wrong: refused with one line, disarmed, never re-armed."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from smad.api import Status
from smad.client import Client, NoAnswer, NoDaemon, Refused, Stopped
from smad.client.endpoints import FOLDER_VARIABLE, read_connection
from smad.control.commands import Step
from tests.hil.conftest import EVERY_DEVICE, PATIENCE_S, Hil, arm, wait_for

STEP = Step(displacement_mm=5.0, duration_s=3000.0)
NOT_HEATING = ("SAFE", "COOL", "FAULT")
BUSY = "kept the daemon from running"


def heats(status: Status) -> bool:
    """Current flows; also where resistors are in place of the springs, and nothing moves."""
    return status.sample is not None and (status.sample.i_applied_x_A or 0.0) > 0.3


def drive(client: Client) -> None:
    """Arm and move. The board runs by itself: where the daemon is starved, it stops; then again."""
    armed = False
    while not armed:
        with contextlib.suppress(Refused):
            arm(client)
            client.move(STEP)
        armed = wait_for(client, lambda s: not s.motion.armed or heats(s)).motion.armed


@EVERY_DEVICE
def test_a_device_that_loses_power_comes_back_watched_and_not_armed(hil: Hil) -> None:
    device = hil.device()
    hil.ready_daemon(device.port)
    client = hil.client()
    drive(client)
    device.kill()
    wait_for(client, lambda s: s.link.state in ("disconnected", "sync"))
    with pytest.raises(Stopped, match="stopped by loss of the link"):
        client.wait_until_done()
    device.start()
    status = wait_for(client, lambda s: s.link.state == "monitor" and s.motion.mode == "SAFE")
    assert not status.motion.armed
    assert status.motion.running == "idle"
    # The program that was stopped arms no more; a person starts it anew.
    with pytest.raises(Refused, match="the link was lost"):
        client.arm()
    client.as_of(None)
    arm(client)
    assert client.motion().armed


@EVERY_DEVICE
def test_a_signal_disarms_and_the_last_line_says_so(hil: Hil) -> None:
    ended_by(hil, signal.SIGTERM)


def test_ctrl_c_disarms_and_the_last_line_says_so(hil: Hil) -> None:
    ended_by(hil, signal.SIGINT)


def ended_by(hil: Hil, number: signal.Signals) -> None:
    """End a daemon that heats by a signal; start another and look at the board."""
    device = hil.device()
    daemon = hil.ready_daemon(device.port)
    drive(hil.client())
    assert daemon.end(number) == 0
    assert daemon.last_line == f"smad: ended by {number.name}: disarmed, the board cools by itself"
    hil.ready_daemon(device.port)
    status = wait_for(hil.client(), lambda s: s.motion.mode in NOT_HEATING)
    assert status.motion.mode in ("COOL", "SAFE")
    assert status.motion.fault is None


@EVERY_DEVICE
def test_after_a_daemon_is_killed_the_board_stops_by_itself_and_is_not_armed_again(
    hil: Hil,
) -> None:
    device = hil.device("--speed", "2")
    daemon = hil.ready_daemon(device.port)
    drive(hil.client())
    os.kill(daemon.process.pid, signal.SIGKILL)
    daemon.process.wait()
    with pytest.raises(NoDaemon):
        Client(folder=hil.folder)
    hil.ready_daemon(device.port)
    status = wait_for(hil.client(), lambda s: s.motion.mode in NOT_HEATING)
    assert not status.motion.armed
    with pytest.raises(Refused):
        hil.client().move(STEP)


def refused(hil: Hil, port: object, *arguments: str, bench: str = "bench") -> str:
    """Start a daemon that must not come up; return the one line it ends with."""
    daemon = hil.daemon(port, *arguments, bench=bench)
    assert daemon.process.wait(PATIENCE_S) != 0
    text = daemon.log.read_text()
    assert "Traceback" not in text
    # On a busy machine the daemon that runs may say so in the same file afterwards.
    *_, line = (said for said in text.splitlines() if BUSY not in said)
    return line


def test_a_second_daemon_for_the_same_bench_is_refused(hil: Hil) -> None:
    device = hil.device()
    first = hil.ready_daemon(device.port)
    line = refused(hil, device.port)
    assert f"running already; got process {first.process.pid}" in line
    assert "smad status" in line
    hil.client().status()


def test_a_second_bench_on_the_same_port_is_refused(hil: Hil) -> None:
    device = hil.device()
    first = hil.ready_daemon(device.port)
    line = refused(hil, os.path.realpath(device.port), bench="other")
    assert f"the port is in use by process {first.process.pid}" in line
    assert hil.client().status().link.losses == 0


def test_a_port_that_is_not_there_is_refused(hil: Hil) -> None:
    line = refused(hil, "/dev/no-such-port")
    assert line.startswith("smad: there is no such port; got /dev/no-such-port")
    assert "--sim" in line


def test_no_port_at_all_is_refused_with_what_to_name(hil: Hil) -> None:
    assert "--port DEVICE" in refused(hil, "")


def test_a_silent_port_is_refused_after_a_while(hil: Hil) -> None:
    master, slave = os.openpty()
    try:
        line = refused(hil, os.ttyname(slave))
    finally:
        os.close(slave)
        os.close(master)
    assert "the board does not answer" in line
    assert "powered" in line


def test_another_protocol_version_is_refused_and_both_versions_are_named(hil: Hil) -> None:
    device = hil.device("--speed", "1", "--fault", "major_other@0")
    line = refused(hil, device.port)
    assert "another version of the protocol" in line
    assert "host has 1.0" in line


def test_a_wrong_baud_rate_is_recognised_by_what_arrives(hil: Hil) -> None:
    device = hil.device("--speed", "1", "--fault", "wrong_baud@0")
    line = refused(hil, device.port)
    assert "not our protocol" in line
    assert "link.baud" in line


def test_a_rate_that_does_not_fit_the_baud_rate_is_refused_with_a_pair_that_does(hil: Hil) -> None:
    line = refused(hil, "/dev/null", "--rate", "500", "--baud", "115200")
    assert "500 samples a second do not fit 115200 baud" in line
    assert "at most 70%" in line
    assert "link.rate_hz = 100" in line


def test_a_configuration_with_an_unknown_key_is_refused_with_its_name(hil: Hil) -> None:
    path = hil.folder / "bad.toml"
    path.write_text("[link]\nspeed = 3\n")
    line = refused(hil, "/dev/null", "--config", str(path))
    assert "speed" in line
    assert "bad.toml" in line


def test_nothing_is_left_behind_after_an_orderly_end(hil: Hil) -> None:
    daemon = hil.ready_daemon(hil.device().port)
    assert read_connection(hil.folder / "bench.json") is not None
    assert daemon.end() == 0
    assert not (hil.folder / "bench.json").exists()
    assert daemon.last_line == "smad: ended by SIGINT: nothing was armed"


def test_the_log_of_a_killed_daemon_keeps_its_flushed_rows(hil: Hil) -> None:
    from smad.runlog.reader import read_run

    daemon = hil.ready_daemon(hil.device("--speed", "5").port)
    client = hil.client()
    path = Path(client.start_recording("killed").path)
    flushed = 0

    def enough(_: Status) -> bool:
        nonlocal flushed
        flushed = len(read_run(path)) if path.stat().st_size > 20_000 else 0
        return flushed > 100

    wait_for(client, enough)
    os.kill(daemon.process.pid, signal.SIGKILL)
    daemon.process.wait()
    run = read_run(path)
    assert run.cut_short
    assert len(run) >= flushed


@EVERY_DEVICE
def test_a_stopped_daemon_says_that_it_was_kept_from_running_and_the_board_has_stopped(
    hil: Hil,
) -> None:
    daemon = hil.ready_daemon(hil.device("--speed", "1").port)
    client = hil.client()
    deadline = time.monotonic() + PATIENCE_S
    # A starved board may miss no setpoint in that second, or stop before it begins: then again.
    while (status := client.status()).motion.fault is None or BUSY not in daemon.log.read_text():
        assert time.monotonic() < deadline, (status, daemon.log.read_text())
        if not status.motion.armed:
            client.as_of(None)
            arm(client)
        os.kill(daemon.process.pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.kill(daemon.process.pid, signal.SIGCONT)
        time.sleep(0.2)
    assert status.motion.fault.name == "SETPOINT_LOST"
    assert not status.motion.armed


DYING = """
import sys
from smad.control.controller import Controller
step = Controller.step
def explode(self, sample):
    if sample.armed:
        raise ZeroDivisionError("injected")
    return step(self, sample)
Controller.step = explode
from smad.cli import main
main(sys.argv[1:])
"""


def test_a_dying_control_task_disarms_and_ends_with_status_70_and_the_truth(hil: Hil) -> None:
    device = hil.device("--speed", "2")
    config = hil.write_config(device.port)
    daemon = subprocess.Popen(
        [sys.executable, "-c", DYING, "start", "--config", str(config)],
        env={**os.environ, "SMAD_RUNTIME_DIR": str(hil.folder)},
        stderr=subprocess.PIPE,
        text=True,
    )
    while read_connection(hil.folder / "bench.json") is None:
        assert daemon.poll() is None
        time.sleep(0.02)
    refusal = ""
    # A lease would be given back to a daemon that is gone, and its answer waited for.
    client = hil.client(lease_s=None)
    while not re.search("the daemon (is ending|has ended)", refusal):
        with pytest.raises((Refused, NoAnswer)) as refused:
            client.arm()
        refusal = str(refused.value)
    _, said = daemon.communicate(timeout=PATIENCE_S)
    assert daemon.returncode == 70
    last = said.strip().splitlines()[-1]
    assert last.startswith("smad: the control task died (ZeroDivisionError: injected): disarmed")
    assert "ZeroDivisionError" in (hil.folder / "bench.crash.txt").read_text()
    hil.ready_daemon(device.port)
    status = wait_for(hil.client(), lambda s: s.motion.mode in NOT_HEATING)
    assert not status.motion.armed


def killed_when_it_heats(hil: Hil, client: Client) -> Status:
    """Run an experiment with a lease of a second; kill it once it heats, or has ended by itself."""
    run = subprocess.Popen(
        [sys.executable, "-m", "smad", "run", "fig10-thermal", "--lease", "1"],
        cwd=hil.folder,
        env={**os.environ, FOLDER_VARIABLE: str(hil.folder)},
        stdout=subprocess.DEVNULL,
    )
    try:
        return wait_for(client, lambda s: heats(s) or run.poll() is not None)
    finally:
        run.kill()
        run.wait()


def test_an_experiment_that_is_killed_leaves_a_disarmed_bench_within_its_lease(hil: Hil) -> None:
    hil.ready_daemon(hil.device().port)
    client = hil.client()
    # A program that the machine keeps from renewing its lease is stopped before it heats: again.
    tries = (killed_when_it_heats(hil, client) for _ in range(3))
    status = next(status for status in tries if heats(status))
    assert status.control.holder == "smad run"
    # `armed` is false once DISARM was sent; the board's own word comes with its next sample.
    status = wait_for(client, lambda s: not s.motion.armed and s.motion.mode in NOT_HEATING)
    assert status.motion.running == "idle"
    assert status.motion.fault is None
    assert any(
        "smad run had exclusive control and sent nothing for 1 s; disarming" in event.text
        for event in status.events
    )
    assert status.control.holder == ""
    # Anyone may arm it again, and nobody did.
    arm(client)
    assert client.motion().armed
