"""What ends, ends with who started it, and what cannot be used is refused at once."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from smad.cli import execute
from smad.client import Client, NoAnswer, NoDaemon
from smad.client.endpoints import Connection, write_connection
from smad.errors import DaemonError
from smad.fmi.errors import FmiError
from smad.fmi.unit_file import _identifier
from smad.processes import daemon as processes
from tests.smad.fakedaemon import FakeDaemon

_CHILD = (
    "import time; from smad.processes.parent import end_with; "
    "end_with({}); print('ready', flush=True); time.sleep(600)"
)
_PARENT = f"""
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {_CHILD!r}.format(os.getpid())])
print(child.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_child_ends_with_a_parent_that_is_killed(number: signal.Signals) -> None:
    parent = subprocess.Popen([sys.executable, "-c", _PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    assert int(parent.stdout.readline()) > 0
    assert parent.stdout.readline() == "ready\n"
    parent.send_signal(number)
    parent.wait()
    # The pipe ends when the last of both has.
    assert parent.stdout.read() == ""
    parent.stdout.close()


def test_a_child_does_not_end_with_the_thread_that_started_it() -> None:
    children: list[subprocess.Popen[str]] = []
    waiting = _CHILD.format(os.getpid()).replace("time.sleep(600)", "input()")

    def begin() -> None:
        child = subprocess.Popen(
            [sys.executable, "-c", waiting],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        children.append(child)
        assert child.stdout is not None
        child.stdout.readline()

    thread = threading.Thread(target=begin)
    thread.start()
    thread.join()
    while Path(f"/proc/self/task/{thread.native_id}").exists():
        pass
    children[0].communicate("\n")
    assert children[0].returncode == 0


_POOL = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from smad.processes.parent import begin_worker, interrupts_held

if __name__ == "__main__":
    begun = {"initializer": begin_worker, "initargs": (os.getpid(),)}
    with ProcessPoolExecutor(1, get_context("spawn"), **begun) as pool:
        with interrupts_held():
            first, asked = pool.submit(os.getpid), pool.submit(time.sleep, 600)
        if "begun" in sys.argv:
            first.result()
        print("ready", flush=True)
        asked.result()
"""


@pytest.mark.parametrize("when", ["begun", "beginning"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_processes_of_a_pool_end_silently_at_ctrl_c_and_with_their_parent(
    number: signal.Signals, when: str, tmp_path: Path
) -> None:
    script = tmp_path / "pool.py"
    script.write_text(_POOL)
    parent = subprocess.Popen(
        [sys.executable, script, when],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert parent.stdout is not None
    assert parent.stdout.readline() == "ready\n"
    # Ctrl-C goes to all processes of a terminal, SIGTERM to the one that is asked to end.
    (os.killpg if number == signal.SIGINT else os.kill)(parent.pid, number)
    out, said = parent.communicate(timeout=60.0)
    assert out == ""
    assert said.count("Traceback") == (number == signal.SIGINT)
    assert parent.returncode == -number


def test_who_asks_a_daemon_that_has_ended_hears_so_at_once(tmp_path: Path) -> None:
    daemon = FakeDaemon(tmp_path)
    client = Client(folder=tmp_path, timeout_s=300.0)
    try:
        daemon.close()
        daemon.endpoints.connection_file.unlink(missing_ok=True)
        with pytest.raises(NoAnswer, match="the daemon has ended"):
            client.motion()
        with pytest.raises(NoAnswer, match="the daemon has ended"):
            client.disarm()
    finally:
        client.close()


def test_a_closed_client_says_that_it_is_closed(tmp_path: Path) -> None:
    daemon = FakeDaemon(tmp_path)
    try:
        with Client(folder=tmp_path) as client:
            samples = client.telemetry()
        for call in (client.motion, client.disarm, lambda: next(samples)):
            with pytest.raises(NoDaemon, match="this client is closed; make another"):
                call()
    finally:
        daemon.close()


def test_a_daemon_that_had_to_be_killed_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_pid = dict.fromkeys(("bench", "version", "command", "stop", "telemetry"), "x")
    write_connection(tmp_path / "draft", Connection(pid=os.getpid(), **at_pid), 0o077)
    ignoring = (
        "import os, signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); "
        f"os.replace({str(tmp_path / 'draft')!r}, {str(tmp_path / 'bench.json')!r}); "
        "time.sleep(600)"
    )
    stubborn = functools.partial(processes.DaemonProcess, program=("-c", ignoring))
    monkeypatch.setattr(processes, "DaemonProcess", stubborn)
    monkeypatch.setattr(processes, "END_DEADLINE_S", 0.05)
    with (
        pytest.raises(DaemonError, match="did not end by itself and was killed"),
        processes.running_daemon([], tmp_path),
    ):
        pass


@pytest.mark.parametrize("name", ["/lib/evil", "../evil", "a/b", "", "a b", "a\n"])
def test_a_unit_whose_library_lies_outside_of_its_archive_is_refused(name: str) -> None:
    with pytest.raises(FmiError, match="not the name of a library"):
        _identifier(Path("unit.fmu"), name)


def test_config_check_refuses_a_coupling_without_an_inverse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "smad.toml"
    axis = '[[axes]]\nname = "{}"\ncoupling = [1.0, 1.0]\n'
    path.write_text(axis.format("pitch") + axis.format("yaw"))
    assert execute(["config", "check", str(path)]) != 0
    assert "has no inverse" in capsys.readouterr().err


def test_a_pipe_as_parameter_file_is_refused_before_anything_is_started(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / "smad.toml"
    path.write_text(f'[plant]\nparameter_file = "{tmp_path / "pipe"}"\n')
    assert execute(["start", "--sim", "--config", str(path)]) != 0
    assert "parameter_file is not a file" in capsys.readouterr().err
    assert execute(["start", "--sim", "--config", os.devnull]) != 0
    assert "has to be a file" in capsys.readouterr().err
