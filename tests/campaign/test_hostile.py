"""Hostile clients against a real daemon: a small run whole, and what counts as harm."""

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest
import zmq

from campaign.command import execute
from campaign.hostile import attacks
from campaign.hostile.attacks import ATTACKS, Result, json_of, run_attacks, table_of
from campaign.hostile.rig import Scale
from smad.view.terminal.tables import in_full

STOOD = Result(
    name="stranger's key",
    tried="20 disarms",
    logged=True,
    carried_out=0,
    missed=0,
    disarmed=None,
    age_p99_us=900.0,
    age_max_us=2000.0,
    answer_max_ms=5.0,
    rss_growth_MiB=0.5,
    descriptors_left=0,
)


def test_a_daemon_in_motion_stands_every_attack() -> None:
    # Paced by its host, so that a busy machine cannot pass for an attack that succeeded.
    results = run_attacks(Scale(strangers=5, messages=500, connections=300, speed=8.0), print)
    assert [result.name for result in results] == [attack.name for attack in ATTACKS]
    assert {result.name: result.failures for result in results if result.failures} == {}


def test_an_attack_does_not_wait_on_a_line_that_was_refused() -> None:
    """A server with keys drops a client without; a send that waits for it would wait for ever."""
    public, secret = zmq.curve_keypair()
    with zmq.Context() as context, context.socket(zmq.ROUTER) as server:
        server.curve_server, server.curve_publickey, server.curve_secretkey = True, public, secret
        port = server.bind_to_random_port("tcp://127.0.0.1")
        with context.socket(zmq.DEALER) as dealer:
            dealer.linger = 0
            dealer.connect(f"tcp://127.0.0.1:{port}")
            given_up = time.monotonic() + 60.0
            while attacks.say(dealer, b"{}"):
                assert time.monotonic() < given_up
                time.sleep(0.01)


@pytest.mark.parametrize(
    ("harmed", "says"),
    [
        (replace(STOOD, logged=False), "it was not logged"),
        (replace(STOOD, carried_out=1), "it was carried out"),
        (replace(STOOD, missed=1), "samples were missed"),
        (replace(STOOD, disarmed="HOLD"), "the bench was disarmed: HOLD"),
        (replace(STOOD, rss_growth_MiB=95.0), "memory grew"),
        (replace(STOOD, descriptors_left=1), "descriptors stayed open"),
    ],
)
def test_each_kind_of_harm_is_named(harmed: Result, says: str) -> None:
    assert STOOD.failures == []
    assert harmed.failures == [says]
    table = table_of([harmed])
    assert says in in_full(table.header, table.rows, table.numeric)
    assert says in json_of([harmed])


@pytest.mark.parametrize(
    ("result", "status", "says"),
    [
        (STOOD, 0, "the daemon stood every attack"),
        (replace(STOOD, missed=1), 1, "an attack did harm"),
    ],
)
def test_the_command_ends_with_what_came_of_it(
    result: Result,
    status: int,
    says: str,
    *,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    asked: list[Scale] = []

    def pretend(scale: Scale, say: object) -> list[Result]:
        asked.append(scale)
        return [result]

    monkeypatch.setattr(attacks, "run_attacks", pretend)
    file = tmp_path / "hostile.json"
    words = ["--connections", "7", "--messages", "9", "--json", str(file)]
    assert execute(["hostile", *words]) == status
    assert says in capsys.readouterr().out
    assert (asked[0].connections, asked[0].messages, asked[0].speed) == (7, 9, None)
    assert json.loads(file.read_text())["attacks"][0]["failures"] == result.failures
