"""The soak: a short one whole, its checks on doctored findings, and its table of commands."""

import json
import random
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.command import execute
from campaign.scripted_client import Acknowledged
from campaign.soak.draws import DRAWN, draw_command
from campaign.soak.found import LOOKING, Stage, StageResult, Usage, not_logged
from campaign.soak.report import checks
from campaign.soak.run import read_back
from smad import api
from smad.control.commands import PIECES, Follow
from smad.runlog.header import RunHeader
from smad.runlog.schema import Event
from smad.runlog.writer import write_run

USAGE = [Usage(10.0 * n, 40.0, 28, 6) for n in range(100)]
GOOD = StageResult(
    stage=Stage(100, 60.0),
    seed=1,
    board_s=60.0,
    samples=6000,
    reconnects=2,
    losses=2,
    armings=1,
    flooded=100,
    flood_answered=100,
    commands=Acknowledged([("arm", {}), ("status", {}), ("idle", {})]),
    faults=["SETPOINT_LOST"],
    usage=USAGE,
    recorded_rows=5900,
    logged_rows=5900,
    logged_gaps=3,
    status=0,
)


def grown(**late: float) -> list[Usage]:
    return [*USAGE[:90], *(replace(usage, **late) for usage in USAGE[90:])]  # type: ignore[arg-type]


DOCTORED = {
    "board time, s": replace(GOOD, board_s=59.0),
    "armings": replace(GOOD, armings=0),
    "samples missed within a connection": replace(GOOD, missed=1),
    "times the armed board waited for the daemon in vain": replace(GOOD, host_timeouts=1),
    "losses of the port": replace(GOOD, losses=3),
    "samples in the run log": replace(GOOD, logged_rows=5899),
    "gaps between logged samples": replace(GOOD, logged_gaps=4),
    "records dropped": replace(GOOD, log_dropped=1),
    "trouble with the run log": replace(GOOD, log_error="it was cut"),
    "acknowledged commands in the run log": replace(GOOD, not_logged=["arm {}"]),
    "commands of the flood answered": replace(GOOD, flood_answered=99),
    "faults of the board without a cause": replace(GOOD, faults=["SETPOINT_LOST", "LEAK"]),
    "memory, MiB, early and late": replace(GOOD, usage=grown(rss_MiB=45.1)),
    "descriptors, early and late": replace(GOOD, usage=grown(descriptors=29)),
    "threads, early and late": replace(GOOD, usage=grown(threads=8)),
    "exit status": replace(GOOD, status=70),
}


def test_a_soak_of_a_minute_and_a_quarter_holds_every_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "soak.json"
    words = ["--seconds", "75", "--every", "20", "--rate", "100", "--json", str(file)]
    status = execute(["soak", *words])
    said = capsys.readouterr().out
    assert status == 0, said
    assert "every check holds" in said
    (stage,) = json.loads(file.read_text())["stages"]
    assert stage["facts"]["reconnects"] >= 3
    assert stage["facts"]["armings"] >= 1
    assert stage["facts"]["acknowledged"]["estop"] == 1
    assert stage["facts"]["flood_answered"] >= 6000
    assert stage["facts"]["telemetry_read"] > 0
    assert all(check["ok"] for check in stage["checks"])


def test_what_is_right_passes_every_check() -> None:
    assert [check.name for check in checks(GOOD) if not check.ok] == []


@pytest.mark.parametrize("name", DOCTORED)
def test_a_doctored_finding_fails_its_check_and_no_other(name: str) -> None:
    assert [check.name for check in checks(DOCTORED[name]) if not check.ok] == [name]


def test_every_check_is_seen_to_fail_above() -> None:
    assert {check.name for check in checks(GOOD)} == set(DOCTORED)


def test_a_command_that_the_log_lacks_or_has_too_early_is_found() -> None:
    acknowledged = [("arm", {}), ("move", {"a": 1}), ("status", {}), ("move", {"a": 2})]
    logged = [("arm", {}), ("other", {}), ("move", {"a": 1}), ("move", {"a": 2})]
    assert not_logged(acknowledged, logged) == []
    assert not_logged(acknowledged, logged[:-1]) == ["move {'a': 2}"]
    assert not_logged(acknowledged, [*logged[3:], *logged[:3]]) == ["move {'a': 2}"]
    # Sent twice, logged once.
    assert not_logged([("arm", {}), ("arm", {})], logged) == ["arm {}"]


def test_every_fault_of_the_log_is_found_also_one_that_no_status_showed(tmp_path: Path) -> None:
    faults = [Event(host_time_s=1.0, kind="fault", text="", data={"name": "LEAK"})] * 2
    write_run(tmp_path / "soak.mcap", RunHeader(), faults)
    found = StageResult(Stage(100, 60.0), 1)
    read_back(found, tmp_path)
    assert (found.log_error, found.faults) == ("", ["LEAK", "LEAK"])


def test_a_soak_draws_every_trajectory() -> None:
    rng = random.Random(1)
    moves = [DRAWN["move"].draw(rng) for _ in range(200)]
    pieces = [p for move in moves if isinstance(move, Follow) for p in move.trajectories]
    assert set(map(type, pieces)) == set(PIECES)


def test_every_method_can_be_drawn_and_what_is_no_command_is_named() -> None:
    assert list(DRAWN) == [method.name for method in api.METHODS]
    assert set(DRAWN) >= LOOKING
    rng = random.Random(1)
    for name, drawn in DRAWN.items():
        assert api.BY_PARAMS[type(drawn.draw(rng))].name == name


def test_the_same_seed_draws_the_same_commands() -> None:
    def some(seed: int) -> list[object]:
        rng = random.Random(seed)
        return [draw_command(rng) for _ in range(200)]

    assert some(1) == some(1)
    assert some(1) != some(2)
