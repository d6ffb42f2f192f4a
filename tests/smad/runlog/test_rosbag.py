"""A run log as a ROS 2 bag, opened again by a reader that is not ours."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from smad.cli import execute
from smad.runlog.reader import Run, read_run
from smad.runlog.rosbag import JOINT_TOPIC, export_bag, times_ns
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run

from .helpers import HEADER, write_small_run

ROWS = 90


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return read_run(write_small_run(tmp_path_factory.mktemp("run") / "run.mcap", ROWS))


@pytest.fixture(scope="module")
def bag(run: Run) -> Path:
    return export_bag(run, run.path.with_suffix(".rosbag2"))


def messages(bag: Path, topic: str) -> list[tuple[int, object]]:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([bag], default_typestore=store) as reader:
        wanted = [c for c in reader.connections if c.topic == topic]
        return [(t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages(wanted)]


def test_a_bag_is_opened_by_rosbags_with_a_topic_for_each_channel(bag: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([bag], default_typestore=store) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
    assert kinds == {
        JOINT_TOPIC: "sensor_msgs/msg/JointState",
        "/smad/rtd_x_degC": "sensor_msgs/msg/Temperature",
        "/smad/force_N": "geometry_msgs/msg/WrenchStamped",
        "/smad/i_cmd_x_A": "std_msgs/msg/Float64",
        "/smad/duty_y": "std_msgs/msg/Float64",
        "/smad/tick": "std_msgs/msg/Int64",
        "/smad/mode": "std_msgs/msg/Int64",
        "/smad/faults": "std_msgs/msg/Int64",
        "/smad/events": "rcl_interfaces/msg/Log",
    }


def test_the_file_in_the_bag_is_an_mcap_file_of_the_profile_of_ros_2(bag: Path) -> None:
    (path,) = bag.glob("*.mcap")
    with path.open("rb") as file:
        assert make_reader(file).get_header().profile == "ros2"


def test_values_and_times_are_those_of_the_samples(run: Run, bag: Path) -> None:
    stamps = times_ns(run)
    shown = messages(bag, "/smad/rtd_x_degC")
    assert [t for t, _ in shown] == stamps.tolist()
    assert [m.temperature for _, m in shown] == run.columns["rtd_x_degC"].tolist()
    first = shown[0][1].header.stamp
    assert first.sec * 10**9 + first.nanosec == stamps[0] == round(1.79e9) * 10**9


def test_the_displacement_is_a_joint_in_metres_with_the_force_as_its_effort(
    run: Run, bag: Path
) -> None:
    at_mm, force = run.columns["displacement_mm"], run.columns["force_N"]
    rows = np.flatnonzero(np.isfinite(at_mm))
    shown = messages(bag, JOINT_TOPIC)
    assert [m.position[0] for _, m in shown] == (at_mm[rows] * 1e-3).tolist()
    efforts = [list(m.effort) for _, m in shown]
    assert efforts == [[f] if np.isfinite(f) else [] for f in force[rows]]


def test_a_sample_that_was_not_measured_is_no_message(run: Run, bag: Path) -> None:
    force = run.columns["force_N"]
    shown = messages(bag, "/smad/force_N")
    assert len(shown) == np.isfinite(force).sum() < ROWS
    assert {m.wrench.force.x for _, m in shown} == {1.25}


def test_events_are_log_messages_with_their_severity(bag: Path) -> None:
    shown = [m for _, m in messages(bag, "/smad/events")]
    assert [(m.name, m.msg, m.level) for m in shown] == [
        ("smad.arm", "armed", 20),
        ("smad.fault", "too hot", 40),
    ]


def test_times_go_on_when_the_board_restarts(tmp_path: Path) -> None:
    clock = [(5.0, 100.0), (5.1, 100.1), (0.0, 103.0), (0.1, 103.1)]
    rows = [Row(t_s=t, host_time_s=h, rtd_x_degC=20.0) for t, h in clock]
    after = Event(t_s=3.0, host_time_s=106.0, kind="note", text="")
    write_run(tmp_path / "a.mcap", HEADER, [*rows, after])
    run = read_run(tmp_path / "a.mcap")
    stamps = times_ns(run)
    np.testing.assert_allclose(stamps * 1e-9, [100.0, 100.1, 103.0, 103.1], rtol=0, atol=1e-6)
    (when, _), *_ = messages(export_bag(run, tmp_path / "bag"), "/smad/events")
    assert when * 1e-9 == pytest.approx(106.0)


def test_a_torn_log_becomes_a_bag_of_what_is_readable(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = write_small_run(tmp_path / "whole.mcap", 400)
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole.read_bytes()[:-600])
    assert execute(["log", "export", str(torn), "--to", "rosbag2"]) == 0
    assert "note: " in capfd.readouterr().out
    assert len(messages(tmp_path / "torn.rosbag2", "/smad/rtd_x_degC")) == len(read_run(torn))


def test_a_folder_that_is_there_is_replaced_only_if_asked_and_only_a_bag(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log, out = str(write_small_run(tmp_path / "a.mcap", 10)), tmp_path / "bag"
    ask = ["log", "export", log, "--to", "rosbag2", "-o", str(out)]
    out.mkdir()
    (out / "mine.txt").touch()
    assert execute(ask) == 1
    assert "is there already; use --overwrite" in capfd.readouterr().err
    assert execute([*ask, "--overwrite"]) == 1
    assert "is not a bag, and is not replaced by one" in capfd.readouterr().err
    (out / "mine.txt").unlink()
    out.rmdir()
    assert execute(ask) == 0
    assert execute([*ask, "--overwrite"]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["bag.mcap", "metadata.yaml"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mcap", "bag"]


def test_a_log_cut_before_its_first_sample_is_told_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = write_small_run(tmp_path / "a.mcap", 50)
    whole.write_bytes(whole.read_bytes()[:40])
    assert execute(["log", "export", str(whole), "--to", "rosbag2"]) == 1
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "a.rosbag2").exists()
