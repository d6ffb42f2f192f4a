"""Bags of ROS become run logs: ours come back as they were, others through a mapping."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from smad.cli import execute
from smad.errors import LogImportError
from smad.records.bag_table import open_bag
from smad.records.channels import read_mapping
from smad.records.importer import import_table
from smad.runlog.reader import read_run
from smad.runlog.rosbag import export_bag

from .helpers import write_small_run


def test_a_bag_that_was_exported_comes_back(tmp_path: Path) -> None:
    run = read_run(write_small_run(tmp_path / "run.mcap", 90))
    bag = export_bag(run, tmp_path / "run.rosbag2")
    back = read_run(import_table(bag, tmp_path / "back.mcap").path)
    assert len(back) == len(run)
    for name in ("displacement_mm", "rtd_x_degC", "i_cmd_x_A", "force_N"):
        np.testing.assert_allclose(back.columns[name], run.columns[name], rtol=1e-12)
    assert (back.columns["tick"] == run.columns["tick"]).all()
    since_s = run.columns["t_s"] - run.columns["t_s"][0]
    np.testing.assert_allclose(back.columns["t_s"], since_s, atol=1e-8)


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """Joints at 100 Hz and a thermometer at 10 Hz, in SQLite, as another lab's robot records."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    joint, thermal = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Temperature"
    target = tmp_path / "robot"
    with Writer(target, version=8, storage_plugin=StoragePlugin.SQLITE3) as bag:
        joints = bag.add_connection("/arm/joint_states", joint, typestore=store)
        warmth = bag.add_connection("/arm/motor", thermal, typestore=store)
        for k in range(101):
            when = 10**9 + k * 10**7
            stamp = types["builtin_interfaces/msg/Time"](when // 10**9, when % 10**9)
            header = types["std_msgs/msg/Header"](stamp, "arm")
            place = np.array([0.5, 1e-3 * k])
            none = np.array([])
            message = types[joint](header, ["base", "slide"], place, none, none)
            bag.write(joints, when, store.serialize_cdr(message, joint))
            if k % 10 == 0:
                warm = types[thermal](header, 25.0 + k, 0.0)
                bag.write(warmth, when + 1, store.serialize_cdr(warm, thermal))
    return target


def test_a_bag_of_others_is_read_through_a_mapping(foreign: Path, tmp_path: Path) -> None:
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        '[columns."/arm/joint_states.position[slide]"]\nchannel = "displacement_mm"\n'
        'column_unit = "m"\n'
        '[columns."/arm/motor.temperature"]\nchannel = "rtd_x_degC"\n'
    )
    done = import_table(foreign, tmp_path / "a.mcap", read_mapping(mapping))
    assert done.rows == 101
    assert "/arm/joint_states.position[base]" in done.ignored
    run = read_run(done.path)
    np.testing.assert_allclose(run.columns["displacement_mm"], np.arange(101.0))
    np.testing.assert_allclose(run.columns["t_s"], np.arange(101) * 0.01)
    # The thermometer's message comes after the joints' of the same moment.
    assert np.isnan(run.columns["rtd_x_degC"][0])
    assert run.columns["rtd_x_degC"][[1, 10, 11, 100]].tolist() == [25.0, 25.0, 35.0, 115.0]


def test_a_bag_of_ros_1_is_read_through_a_mapping_too(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    joint = "sensor_msgs/msg/JointState"
    with Ros1Writer(tmp_path / "robot.bag") as bag:
        joints = bag.add_connection("/joint_states", joint, typestore=store)
        for k in range(51):
            when = 10**9 + k * 10**7
            stamp = types["builtin_interfaces/msg/Time"](when // 10**9, when % 10**9)
            header = types["std_msgs/msg/Header"](k, stamp, "arm")
            none = np.array([])
            message = types[joint](header, ["slide"], np.array([1e-3 * k]), none, none)
            bag.write(joints, when, store.serialize_ros1(message, joint))
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        '[columns."/joint_states.position[slide]"]\nchannel = "displacement_mm"\n'
        'column_unit = "m"\n'
    )
    done = import_table(tmp_path / "robot.bag", tmp_path / "a.mcap", read_mapping(mapping))
    run = read_run(done.path)
    np.testing.assert_allclose(run.columns["displacement_mm"], np.arange(51.0))
    np.testing.assert_allclose(run.columns["t_s"], np.arange(51) * 0.01)


def test_without_a_mapping_the_columns_of_a_bag_are_named(foreign: Path, tmp_path: Path) -> None:
    with pytest.raises(LogImportError, match=r"/arm/joint_states.position\[slide\]"):
        import_table(foreign, tmp_path / "a.mcap")


def test_a_damaged_bag_is_refused_in_one_line(
    foreign: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (file,) = foreign.glob("*.db3")
    file.write_bytes(b"no database")
    assert execute(["log", "import", str(foreign)]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert f"cannot read {foreign}" in line


def test_of_topics_with_as_many_messages_the_first_by_name_sets_the_rows(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind, topics = "std_msgs/msg/Float64", ("d", "b", "a", "c")
    with Writer(tmp_path / "robot", version=8, storage_plugin=StoragePlugin.SQLITE3) as bag:
        for late, topic in enumerate(topics):
            connection = bag.add_connection(f"/{topic}", kind, typestore=store)
            for k in range(20):
                raw = store.serialize_cdr(store.types[kind](0.1), kind)
                bag.write(connection, 10**9 + k * 10**7 + late * 10 ** (4 + k % 2), raw)
    names = [f"/{topic}.data" for topic in topics]
    columns = dict(open_bag(tmp_path / "robot").columns(["t_s", *names]))
    # Those of a are late by 0.02 and 0.2 ms in turn.
    np.testing.assert_allclose(np.diff(columns["t_s"])[:2], [0.01018, 0.00982], atol=1e-9)
