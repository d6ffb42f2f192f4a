"""The daemon process against a simulated device over a real pseudo-terminal: what should work."""

import itertools
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
import zmq

from firmware_protocol.enums import BoardState
from smad.api import AddNote, GetStatus
from smad.client import Client
from smad.client.wire import Conversation, connect, new_identity, subscribe
from smad.control.commands import Step
from smad.control.metrics import tracking_r2
from smad.demo import figures
from smad.demo.job import run_cycle
from smad.runlog.reader import read_run
from smad.view.terminal.tables import print_table
from tests.hil.conftest import EVERY_DEVICE, LEASE_S, PATIENCE_S, Hil, arm


def missed_when_armed(client: Client) -> int:
    """Arm; return the samples lost before: a board that is not armed does not wait for its host."""
    arm(client)
    return client.status().counts.missed


@EVERY_DEVICE
def test_the_demos_cycle_is_followed_recorded_and_ended(hil: Hil) -> None:
    daemon = hil.ready_daemon(hil.device().port)
    done = run_cycle(hil.client(), print)
    assert daemon.end() == 0
    run = read_run(Path(done.path))
    rows = figures.table(run, done.status, done.status)
    print_table(figures.beside({hil.kind: rows}))
    assert not run.cut_short
    assert done.status.counts.setpoints_dropped == 0
    # A board that is not armed does not wait for its host, which a busy machine may hold up.
    armed = run.columns["mode"] == BoardState.ARMED
    assert np.diff(run.columns["t_s"][armed]) == pytest.approx(0.01, abs=1e-6)
    assert [name for name, value in rows if value == "never"] == [], "a step that did not settle"
    _, reference, displacement = figures.sinusoid(run)
    assert tracking_r2(reference, displacement) > 0.5


def test_a_paced_run_gives_the_same_samples_every_time(hil: Hil) -> None:
    columns = []
    for _ in range(2):
        device = hil.device("--speed", "20", "--paced-by-host", "--seed", "5")
        daemon = hil.ready_daemon(device.port)
        with Client(folder=hil.folder, timeout_s=PATIENCE_S, lease_s=LEASE_S) as client:
            arm(client)
            with client.record("same") as recorder:
                client.move(Step(displacement_mm=4.0, duration_s=8.0))
                client.wait_until_done()
            client.disarm()
        daemon.end()
        device.kill()
        run = read_run(Path(recorder.path))
        moving = run.columns["reference_mm"] == 4.0
        columns.append(run.columns["displacement_mm"][moving][:600])
    first, second = columns
    assert len(first) == len(second) == 600
    # The samples at which arming and moving begin differ, so the noise does; the motion does not.
    assert first == pytest.approx(second, abs=0.1)


def test_a_flood_of_commands_and_a_dead_viewer_cost_no_sample(hil: Hil) -> None:
    hil.ready_daemon(hil.device().port)
    client = hil.client()
    missed = missed_when_armed(client)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    viewer = subscribe(context, client.connection.telemetry, b"smad", queue=1)
    flooder = connect(context, client.connection.command, None, new_identity())
    flooder.setsockopt(zmq.SNDHWM, 0)
    flooder.setsockopt(zmq.RCVHWM, 0)
    stop = threading.Event()
    sent = 0

    def flood() -> None:
        nonlocal sent
        conversation = Conversation()
        while not stop.is_set():
            flooder.send(conversation.request(GetStatus())[1])
            flooder.send(b"\xff rubbish")
            flooder.send(conversation.request(AddNote(text="x"))[1])
            sent += 3
            if sent % 300 == 0:
                while flooder.poll(0):
                    flooder.recv()

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        client.move(Step(displacement_mm=5.0, duration_s=20.0))
        client.wait_until_done()
    finally:
        stop.set()
        thread.join()
    status = client.status()
    viewer.close(linger=0)
    flooder.close(linger=0)
    context.destroy(linger=0)
    assert sent > 1000
    assert status.counts.refused > 100
    assert status.counts.missed == missed
    assert status.counts.setpoints_dropped == 0


@EVERY_DEVICE
def test_telemetry_numbers_every_sample_and_carries_board_paced_time(hil: Hil) -> None:
    hil.ready_daemon(hil.device("--speed", "1").port)
    client = hil.client()
    stream = client.telemetry(timeout_s=PATIENCE_S)
    samples = [next(stream) for _ in range(200)]
    numbers = [sample.sequence for sample in samples]
    assert numbers == list(range(numbers[0], numbers[0] + 200))
    steps_s = sorted(b.timestamp - a.timestamp for a, b in itertools.pairwise(samples))
    # A stamp is steered to the host's clock by at most a tenth of a step; none goes back.
    assert steps_s[0] > 0.0089
    assert 0.0089 < steps_s[len(steps_s) // 2] < 0.0111


def test_500_hz_runs_over_a_pseudo_terminal_without_a_missed_sample(hil: Hil) -> None:
    hil.ready_daemon(
        hil.device("--rate", "500", "--speed", "3", "--paced-by-host").port, "--rate", "500"
    )
    client = hil.client()
    missed = missed_when_armed(client)
    client.move(Step(displacement_mm=3.0, duration_s=4.0))
    client.wait_until_done()
    assert client.status().counts.missed == missed


def test_systemd_is_told_when_the_daemon_is_ready_alive_and_ending(hil: Hil) -> None:
    address = str(hil.folder / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(address)
        systemd.settimeout(PATIENCE_S)
        daemon = hil.daemon(
            hil.device().port,
            environment={"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "300000"},
        )
        told = [systemd.recv(500)]
        while b"READY=1" not in told[-1]:
            told.append(systemd.recv(500))
        while systemd.recv(500) != b"WATCHDOG=1":
            pass
        daemon.process.terminate()
        while not systemd.recv(500).startswith(b"STOPPING=1"):
            pass
