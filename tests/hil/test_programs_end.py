"""Programs whose daemon was killed, and programs that end in the middle of a recording."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from msgspec import Struct

from smad.api import BY_PARAMS
from smad.client import NoAnswer, Refused
from smad.client.endpoints import FOLDER_VARIABLE
from smad.control.commands import Step
from smad.runlog.reader import read_run
from tests.hil.conftest import PATIENCE_S, Hil, arm, wait_for

STEP = Step(displacement_mm=5.0, duration_s=3000.0)
LEASE_S = 3.0


def test_a_program_between_two_runs_arms_nothing_after_its_daemon_was_killed_and_started_again(
    hil: Hil,
) -> None:
    device = hil.device()
    killed = hil.ready_daemon(device.port)
    program = hil.client()
    arm(program)
    program.move(STEP)
    program.disarm()
    os.kill(killed.process.pid, signal.SIGKILL)
    killed.process.wait()
    hil.ready_daemon(device.port)
    person = hil.client()
    wait_for(person, lambda status: status.link.state == "monitor")
    # As many stops as the program knew of, and more.
    for _ in range(3):
        person.disarm()
    deadline = time.monotonic() + PATIENCE_S
    refusal = ""
    while not refusal:
        assert time.monotonic() < deadline
        try:
            program.arm()
        except NoAnswer:
            # Its socket has not found the new daemon yet.
            continue
        except Refused as refused:
            refusal = str(refused)
    assert "the bench was stopped after this command was issued" in refusal
    assert not person.motion().armed
    with pytest.raises(Refused):
        program.move(STEP)
    # A person starts it anew.
    program.as_of(None)
    arm(program)
    assert person.motion().armed


RECORDING = f"""
import sys, time
from smad.client import Client
client = Client(lease_s={LEASE_S})
with client.record("first") as status:
    client.arm()
    print(status.path, flush=True)
    time.sleep(600)
"""


def recording(hil: Hil) -> tuple[subprocess.Popen[str], Path]:
    """A program that has armed and records, and its run log.

    One that the machine keeps from renewing its lease is stopped before it says so: then another.
    """
    for _ in range(3):
        program = subprocess.Popen(
            [sys.executable, "-c", RECORDING],
            env={**os.environ, FOLDER_VARIABLE: str(hil.folder)},
            stdout=subprocess.PIPE,
            text=True,
        )
        assert program.stdout is not None
        if path := program.stdout.readline().strip():
            return program, Path(path)
        program.communicate()
    pytest.fail("no program came to record; what they said is above")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_recording_ends_with_the_program_that_ends_inside_it(hil: Hil, number: int) -> None:
    hil.ready_daemon(hil.device().port)
    watcher = hil.client()
    arm(watcher)
    watcher.disarm()
    wait_for(watcher, lambda status: status.motion.mode == "SAFE")
    program, path = recording(hil)
    assert watcher.status().recorder.recording
    program.send_signal(number)
    program.communicate()
    wait_for(watcher, lambda status: not status.recorder.recording)
    # It did not disarm; it is missed.
    wait_for(watcher, lambda status: not status.motion.armed and not status.control.holder)
    assert len(read_run(path)) > 0
    with hil.client().record("second") as second:
        assert "second" in second.path


@pytest.mark.parametrize("moment", ["record.start", "record.stop"])
def test_ctrl_c_while_a_recording_begins_or_ends_leaves_none_open(
    hil: Hil, moment: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hil.ready_daemon(hil.device().port)
    client = hil.client()
    call = client._call
    pressed: list[str] = []

    def interrupted(params: Struct, *arguments: Any, **options: Any) -> Any:
        reply = call(params, *arguments, **options)
        if BY_PARAMS[type(params)].name == moment and not pressed:
            pressed.append(moment)
            raise KeyboardInterrupt
        return reply

    monkeypatch.setattr(client, "_call", interrupted)
    with pytest.raises(KeyboardInterrupt), client.record("first"):
        pass
    assert pressed
    assert not client.status().recorder.recording
    with client.record("second") as second:
        assert "second" in second.path
