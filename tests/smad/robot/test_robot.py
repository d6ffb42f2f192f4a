"""Joint angles to travels of tendons and back, and circles of the segments on a bench."""

from pathlib import Path

import numpy as np
import pytest

from smad.api import Percentiles
from smad.config import AxisConfig, Config, SegmentConfig, parse_config
from smad.control.commands import Samples
from smad.errors import CommandError, ConfigError
from smad.experiments.circles import TOGETHER, page_of, table, trackings
from smad.robot import Robot, circle, sine, step, waypoints
from smad.runlog.header import RunHeader
from smad.runlog.reader import read_axes
from smad.runlog.schema import Event, Row
from smad.runlog.writer import write_run

FOUR = ("pitch-1", "yaw-1", "pitch-2", "yaw-2")


def robot(**changed: object) -> Robot:
    axes = tuple(AxisConfig(name=name) for name in FOUR)
    return Robot.of(Config(axes=axes, **changed))  # type: ignore[arg-type]


def test_25_degrees_of_the_end_segment_are_4_mm() -> None:
    moves = robot().moves({"segment-2": step((25.0, -12.5), duration_s=1.0)})
    assert list(moves) == ["pitch-2", "yaw-2"]
    assert moves["pitch-2"].displacement_mm[-1] == pytest.approx(4.0)
    assert moves["yaw-2"].displacement_mm[-1] == pytest.approx(-2.0)


def test_angles_come_back_from_the_tendons_with_gains_signs_and_coupling() -> None:
    text = "".join(f'[[axes]]\nname = "{name}"\n' for name in FOUR[:2])
    text += (
        '[[axes]]\nname = "pitch-2"\ncoupling = [0.3, 0.0, 1.0, 0.0]\n[[axes]]\nname = "yaw-2"\n'
    )
    text += '[[segments]]\nname = "base"\npitch = "pitch-1"\nyaw = "yaw-1"\npitch_sign = -1\n'
    text += '[[segments]]\nname = "tip"\npitch = "pitch-2"\nyaw = "yaw-2"\ngain_deg_per_mm = 5.0\n'
    made = Robot.of(parse_config(text))
    moves = made.moves(
        {"base": sine((10.0, 5.0), period_s=4.0, cycles=1)},
        standing_deg={"pitch-2": 8.0, "yaw-2": 3.0},
    )
    assert list(moves) == ["pitch-1", "yaw-1", "pitch-2"], "the tendon of the tip is led along"
    mm = {name: np.array(moves[name].displacement_mm) for name in moves}
    mm["yaw-2"] = np.full_like(mm["yaw-1"], 3.0 / 5.0)
    angles = made.angles_deg(mm)
    t_s = np.array(moves["yaw-1"].t_s)
    np.testing.assert_allclose(angles["base"][0], 10.0 * np.sin(np.pi * t_s / 2.0), atol=1e-9)
    np.testing.assert_allclose(angles["tip"][0], 8.0, atol=1e-9)
    np.testing.assert_allclose(angles["tip"][1], 3.0, atol=1e-9)


def test_a_circle_begins_and_ends_straight_and_keeps_its_radius_between() -> None:
    made = circle(15.0, period_s=10.0, cycles=2, approach_s=2.0)
    radius = np.hypot(made.pitch_deg, made.yaw_deg)
    assert (radius[0], radius[-1]) == (0.0, 0.0)
    turning = (made.t_s >= 2.0) & (made.t_s <= 22.0)
    np.testing.assert_allclose(radius[turning], 15.0, atol=1e-9)
    assert radius.max() <= 15.0 + 1e-9
    assert np.abs(np.diff(made.pitch_deg)).max() < 1.5, "no jump"


def test_segments_that_move_together_have_one_set_of_times() -> None:
    moves = robot().moves(
        {
            "segment-1": circle(10.0, period_s=5.0),
            "segment-2": step((5.0, 0.0), duration_s=3.0),
        }
    )
    assert list(moves) == list(FOUR)
    assert len({move.t_s for move in moves.values()}) == 1
    assert moves["pitch-2"].displacement_mm[-1] == pytest.approx(0.8), "it stays at its last"


def test_what_is_out_of_reach_or_unknown_is_refused() -> None:
    with pytest.raises(CommandError, match=r"segment-1: yaw reaches 26°; allowed: ±25°"):
        robot().moves({"segment-1": step((0.0, 26.0), duration_s=1.0)})
    with pytest.raises(CommandError, match=r"no segment of this name; got tip"):
        robot().moves({"tip": step((0.0, 1.0), duration_s=1.0)})


@pytest.mark.parametrize(
    ("segments", "said"),
    [
        ((SegmentConfig(name="a", pitch="pitch-1", yaw="roll"),), "two axes of its own; got roll"),
        ((SegmentConfig(name="a", pitch="yaw-1", yaw="yaw-1"),), "two axes of its own; got yaw-1"),
    ],
)
def test_a_segment_without_its_axes_is_refused(
    segments: tuple[SegmentConfig, ...], said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        robot(segments=segments)


def test_a_coupling_that_does_not_fit_or_has_no_inverse_is_refused() -> None:
    for row, said in (((1.0,), "needs one number for each axis"), ((0.0, 1.0), "has no inverse")):
        axes = (AxisConfig(name="pitch-1", coupling=row), AxisConfig(name="yaw-1"))
        with pytest.raises(ConfigError, match=said):
            Robot.of(Config(axes=axes))
    with pytest.raises(ConfigError, match="there is no segment"):
        Robot.of(Config())


def test_the_angles_of_the_run_log_respect_the_coupling_as_the_robot_does() -> None:
    axes = tuple(
        AxisConfig(name=n, coupling=row)
        for n, row in zip(FOUR, ((), (), (0.3, 0.0, 1.0, 0.1), ()), strict=True)
    )
    segments = (
        SegmentConfig(name="base", pitch="pitch-1", yaw="yaw-1", pitch_sign=-1),
        SegmentConfig(name="tip", pitch="pitch-2", yaw="yaw-2", gain_deg_per_mm=5.0),
    )
    config = Config(axes=axes, segments=segments)
    mm = {"pitch-1": 1.0, "yaw-1": -0.5, "pitch-2": 2.0, "yaw-2": 0.7}
    made = Robot.of(config).angles_deg({n: np.array([x]) for n, x in mm.items()})
    turned = {n: sum(k * mm[o] for o, k in row.items()) for n, row in config.turns().items()}
    for name, one in (("base", segments[0]), ("tip", segments[1])):
        told = (turned[one.pitch], turned[one.yaw])
        assert told == pytest.approx([float(a[0]) for a in made[name]])
    assert config.turns()["yaw-2"] == {"yaw-2": 5.0}
    assert Config().turns() == {"": {"": 6.25}}


def test_waypoints_are_read_from_a_csv_and_mistakes_named(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_text("t_s,pitch_deg,yaw_deg\n3,0,0\n4,5,-2\n")
    read = waypoints(path)
    assert (read.t_s.tolist(), read.yaw_deg.tolist()) == ([0.0, 1.0], [0.0, -2.0])
    for text, said in (
        ("t_s,pitch_deg\n0,1\n", "a column is missing: yaw_deg"),
        ("t_s,pitch_deg,yaw_deg\n0,1,nan\n", "line 2: yaw_deg is not a number; got nan"),
        ("t_s,pitch_deg,yaw_deg\n1,0,0\n1,0,0\n", "do not rise"),
    ):
        path.write_text(text)
        with pytest.raises(CommandError, match=said):
            waypoints(path)


def test_the_tracking_of_a_log_is_the_distance_of_the_tip_from_its_circle(tmp_path: Path) -> None:
    begun_s, path = 1_700_000_000.0, tmp_path / "six.mcap"
    wanted = robot().moves({"segment-1": circle(10.0, period_s=4.0)})
    still = Samples(t_s=(0.0, 8.0), displacement_mm=(0.0, 0.0))
    rows: list[tuple[Row, str, float]] = []
    for axis in FOUR:
        move = wanted.get(axis, still)
        for k in range(800):
            mm = float(np.interp(k * 0.01, move.t_s, move.displacement_mm))
            off_mm = 0.16 if axis == "yaw-1" else 0.0
            at_s = begun_s + k * 0.01
            row = Row(t_s=k * 0.01, host_time_s=at_s, reference_mm=mm, displacement_mm=mm + off_mm)
            rows.append((row, axis, at_s))
    marks = [
        Event(host_time_s=begun_s + t, kind="note", text=text)
        for t, text in (
            (0.0, "circle of segment-1"),
            (4.0, "circle of together"),
            (8.0, "circles end"),
        )
    ]
    write_run(path, RunHeader(axes=FOUR), [*marks, *rows])
    found = list(trackings(read_axes(path), robot()))
    assert [(t.segment, t.phase) for t in found] == [
        ("segment-1", "segment-1"),
        ("segment-1", TOGETHER),
        ("segment-2", TOGETHER),
    ]
    assert found[0].rms_deg == pytest.approx(1.0)
    assert found[2].most_deg == pytest.approx(0.0, abs=1e-9)
    assert [row[2] for row in table(found).rows] == ["1.00", "1.00", "0.00"]
    sections = page_of(path, robot(), Percentiles()).sections
    assert "segment-2, together" in [section.title for section in sections]
