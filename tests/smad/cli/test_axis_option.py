"""`--axis` makes a command one for that axis; stops have none; the status has a line an axis."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from smad import api
from smad.cli import execute
from smad.client import Client
from smad.control.commands import Samples, Step
from smad.view.terminal.axis_lines import axis_lines, number
from tests.smad.fakedaemon import MOTION, FakeDaemon, fake_daemon

STEP = Step(displacement_mm=1.0, duration_s=1.0)


@pytest.fixture
def daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDaemon]:
    monkeypatch.setenv("SMAD_RUNTIME_DIR", str(tmp_path))
    with fake_daemon(tmp_path) as daemon:
        daemon.answers |= dict.fromkeys(
            ("motion", "move", "idle", "arm", "disarm", "together"), MOTION
        )
        yield daemon


@pytest.mark.parametrize(
    ("words", "method", "axis"),
    [
        ("move step 1 --for 1 --no-wait --axis pitch-1", "move", "pitch-1"),
        ("arm --axis yaw-1", "arm", "yaw-1"),
        ("idle", "idle", None),
        ("disarm", "disarm", None),
    ],
)
def test_a_command_carries_the_axis_that_is_named(
    daemon: FakeDaemon, words: str, method: str, axis: str | None
) -> None:
    assert execute(words.split()) == 0
    asked = next(request for request in daemon.asked if request["method"] == method)
    assert asked.get("axis") == axis


def test_a_stop_cannot_be_for_one_axis(daemon: FakeDaemon) -> None:
    assert execute(["disarm", "--axis", "pitch-1"]) == 2
    assert not daemon.asked


def test_an_axis_of_a_client_names_itself_and_a_mapping_begins_together(
    daemon: FakeDaemon, tmp_path: Path
) -> None:
    long = Samples(t_s=tuple(0.1 * k for k in range(300)), displacement_mm=(0.0,) * 300)
    with Client(folder=tmp_path, timeout_s=30.0, lease_s=None) as bench:
        bench["yaw-1"].move(STEP)
        bench.arm("pitch-1", "yaw-1")
        bench.move({"pitch-1": STEP, "yaw-1": [STEP, STEP], "pitch-2": long})
        bench.disarm()
    asked = [(one["method"], one.get("axis")) for one in daemon.asked]
    assert asked == [
        ("move", "yaw-1"),
        ("arm", ["pitch-1", "yaw-1"]),
        ("together", None),
        ("move", "pitch-2"),
        ("disarm", None),
    ]
    moves = daemon.asked[2]["params"]["moves"]
    assert [len(moves[axis]) for axis in ("pitch-1", "yaw-1", "pitch-2")] == [1, 2, 1]
    assert daemon.asked[3]["params"]["queue"], "the rest of a long one follows"


def test_the_status_of_several_axes_is_a_line_each() -> None:
    motion = msgspec.structs.replace(MOTION, running="displacement", done=False)
    link = api.LinkStatus(
        port="",
        baud=0,
        rate_hz=250,
        state="running",
        notes=(),
        bytes_in=0,
        bytes_out=0,
        short_writes=0,
        losses=0,
        frames={},
        board_stats={},
    )
    counts = api.Counts(
        samples=9,
        missed=2,
        skipped=0,
        setpoints=0,
        setpoints_dropped=0,
        commands=0,
        refused=0,
        telemetry_dropped=0,
        setpoints_refused=0,
    )
    none = api.Percentiles()
    timing = api.Timing(
        own_share=none, setpoint_age=none, jitter=none, round_trip_us=None, collections=0
    )
    axis = api.AxisStatus(
        link=link,
        board=None,
        motion=motion,
        limiter="none",
        faults=(),
        warnings=(),
        sample=None,
        counts=counts,
        timing=timing,
    )
    away = msgspec.structs.replace(axis, link=msgspec.structs.replace(link, state="sync"))
    lines = list(axis_lines({"pitch-1": axis, "yaw-1": away}, none))
    assert lines == [
        "pitch-1 ARMED   no readings yet; displacement, under way; 250 Hz, 2 missed",
        "yaw-1   sync    no readings yet; displacement, under way; 250 Hz, 2 missed",
    ]


def test_a_reading_of_nearly_zero_has_no_sign() -> None:
    assert (number(-0.001, 2), number(-0.01, 2), number(None, 2)) == ("0.00", "-0.01", "–")
