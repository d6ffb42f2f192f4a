"""What a program and a command that it begins know of stops goes down, and comes back."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest

from smad.cli import output
from smad.processes.stops import HandedOver, KnownStops, taken_over
from tests.smad.fakedaemon import FakeDaemon

COMMAND = """
import os
from smad.processes.stops import hand_back, taken_over
known, descriptor = taken_over(os.environ)
{last}
"""


def returned(known: int | None, last: str) -> int | None:
    handed = HandedOver(known)
    subprocess.run(
        [sys.executable, "-c", COMMAND.format(last=last)],
        env={**os.environ, **handed.environment},
        pass_fds=(handed.descriptor,),
        check=False,
    )
    handed.close_descriptor()
    first = handed.returned()
    assert handed.returned() == first, "asked once more, it says the same"
    return first


def test_a_command_gets_what_is_known_and_gives_back_what_it_knows() -> None:
    assert returned(7, "hand_back(descriptor, known + 2)") == 9


@pytest.mark.parametrize("last", ["hand_back(descriptor, None)", "os._exit(1)", ""])
def test_of_a_command_that_says_nothing_what_was_known_stays_known(last: str) -> None:
    assert returned(7, last) == 7
    assert returned(None, last) is None


def test_a_command_of_nobody_knows_nothing_and_hands_nothing_on() -> None:
    environment: dict[str, str] = {}
    assert taken_over(environment) == (None, None)
    handed = HandedOver(3)
    environment = handed.environment
    assert taken_over(environment) == (3, handed.descriptor)
    assert environment == {}
    handed.close_descriptor()


def test_a_command_of_a_queue_knows_of_no_stop_but_those_of_the_queue_and_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    daemon = FakeDaemon(tmp_path)
    monkeypatch.setenv("SMAD_RUNTIME_DIR", os.fspath(tmp_path))
    monkeypatch.setattr("smad.experiments.ready.require_ready", lambda *_, **__: None)
    known_stops = KnownStops(5)
    try:
        with click.Context(click.Command("run"), obj=known_stops):
            with output.ready_client("bench") as first:
                assert first.known == 5
                first.as_of(7)
            with output.ready_client("bench") as second:
                assert second.known == 7
    finally:
        daemon.close()
    assert known_stops.latest == 7
