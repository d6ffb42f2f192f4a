"""The demo on a busy machine: the log's words are told, and only the wall clock's part is lost."""

from pathlib import Path

import msgspec
import pytest

from smad import api
from smad.client import Client, Refused, Stopped
from smad.demo.job import measured, naming_cause, run_cycle
from tests.smad.cli.test_commands import STATUS
from tests.smad.fakedaemon import MOTION, FakeDaemon, fake_daemon

SILENT = "the board sent nothing for 513 ms"


def silent_board(daemon: FakeDaemon) -> None:
    """Arms, and is gone when its motion is asked for."""
    events = (api.Entry(0.0, "SAFE → ARMED"), api.Entry(1.0, SILENT), api.Entry(2.0, "recording"))
    daemon.answers["status"] = msgspec.structs.replace(STATUS, events=events)
    gone = msgspec.structs.replace(MOTION, armed=False, mode="UNKNOWN")

    def motion(request: dict[str, object]) -> api.Motion:
        return gone if any(one["method"] == "move" for one in daemon.asked) else MOTION

    daemon.answers["motion"] = motion
    daemon.answers["record.start"] = api.RecorderStatus(recording=True, path="/a.mcap")


def test_an_end_that_the_daemon_knows_is_told_in_its_words(tmp_path: Path) -> None:
    with fake_daemon(tmp_path) as daemon, Client(folder=tmp_path) as client:
        silent_board(daemon)
        with pytest.raises(Stopped, match=SILENT), naming_cause(client):
            run_cycle(client, lambda text: None)


def test_a_demo_that_cannot_record_does_not_blame_a_busy_machine(tmp_path: Path) -> None:
    with fake_daemon(tmp_path) as daemon, Client(folder=tmp_path) as client:
        silent_board(daemon)
        with pytest.raises(Refused) as told, naming_cause(client):
            raise Refused("no folder", reason=api.Reason.RECORDER, action="name another")
    assert told.value.action == "name another"


def test_a_stretch_that_the_machine_was_too_busy_for_is_not_measured_and_says_why(
    tmp_path: Path,
) -> None:
    with fake_daemon(tmp_path) as daemon, Client(folder=tmp_path) as client:
        silent_board(daemon)
        assert measured(client, 1.0, lambda text: None) == SILENT
