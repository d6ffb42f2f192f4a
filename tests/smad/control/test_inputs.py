"""Recorded inputs played again: tick by tick, within limits, ended when the bench departs."""

import math
from typing import Any

import msgspec
import pytest

from smad.config import ControlConfig, RepeatConfig
from smad.control.commands import LONGEST_INPUTS, DriveCurrent, FollowInputs, Tune
from smad.control.controller import Controller
from smad.control.pieces import rows_in_pieces
from smad.errors import CommandError

from .helpers import drive, sample

TICK_S = 0.01


def rows(count: int = 4, **changes: Any) -> FollowInputs:
    """So many rows at 100 Hz, each with a current of its own."""
    whole = FollowInputs(
        t_s=tuple(TICK_S * k for k in range(count)),
        end_s=TICK_S * count,
        i_x_A=tuple(0.01 * (k % 300) for k in range(count)),
        i_y_A=(0.0,) * count,
        pump_x_duty=(0.0,) * count,
        pump_y_duty=(0.5,) * count,
    )
    return msgspec.structs.replace(whole, **changes)


def started(*commands: FollowInputs, config: ControlConfig | None = None) -> Controller:
    controller = Controller(config or ControlConfig())
    controller.step(sample(0))
    for command in commands:
        controller.command(command)
    return controller


def test_each_sample_gets_its_row_and_afterwards_nothing_flows() -> None:
    controller = started(rows(4))
    outputs = drive(controller, range(1, 7))
    assert [o.i_A[0] for o in outputs] == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.0, 0.0])
    assert [o.pump_duty[1] for o in outputs] == [0.5] * 4 + [0.0] * 2
    assert (controller.mode, controller.done, controller.departure) == ("idle", True, None)


def test_jitter_and_a_lost_sample_move_no_other_row() -> None:
    controller = started(rows(8))
    times_us = [10_000, 20_300, 29_800, 50_100, 60_000]
    outputs = [controller.step(msgspec.structs.replace(sample(), t_us=t)) for t in times_us]
    assert [o.i_A[0] for o in outputs] == pytest.approx([0.0, 0.01, 0.02, 0.04, 0.05])


def test_a_long_run_is_cut_into_pieces_that_play_as_one() -> None:
    whole = rows(2 * LONGEST_INPUTS + 7, displacement_mm=(0.0,) * (2 * LONGEST_INPUTS + 7))
    pieces = rows_in_pieces(whole)
    assert [len(p.t_s) for p in pieces] == [LONGEST_INPUTS, LONGEST_INPUTS, 7]
    assert [p.queue for p in pieces] == [False, True, True]
    outputs = drive(started(*pieces), range(1, len(whole.t_s) + 1))
    assert [o.i_A[0] for o in outputs] == pytest.approx(list(whole.i_x_A))


@pytest.mark.parametrize(
    ("reading", "changes"),
    [
        ("displacement_mm", {"displacement_m": 0.005}),
        ("rtd_y_degC", {"rtd_degC": (25.0, 40.0, 27.0, 27.0)}),
        ("force_N", {"force_N": 3.5}),
    ],
)
def test_a_reading_that_leaves_the_recorded_one_ends_the_motion_after_a_while(
    reading: str, changes: dict[str, Any]
) -> None:
    recorded = {"displacement_mm": 0.0, "rtd_y_degC": 25.0, "force_N": 1.24}[reading]
    controller = started(
        rows(200, i_x_A=(1.0,) * 200, **{reading: (recorded,) * 200}),
        config=ControlConfig(repeat=RepeatConfig(for_s=0.2)),
    )
    outputs = [controller.step(sample(k, **changes)) for k in range(1, 50)]
    flowing = sum(o.i_A[0] > 0.0 for o in outputs)
    assert 19 <= flowing <= 21
    assert controller.done
    departure = controller.departure
    assert departure is not None
    assert departure.reading == reading
    assert "control.repeat allows" in departure.in_words()
    controller.command(Tune(kp_A_per_mm=1.0))
    assert controller.departure is departure, "tuning is no motion"
    controller.command(DriveCurrent(i_x_A=1.0))
    assert controller.departure is None


def test_what_was_not_recorded_and_a_lost_reading_are_no_departure() -> None:
    controller = started(rows(100, displacement_mm=(None,) * 100, force_N=(1.24,) * 100))
    drive(controller, range(1, 90), lambda k: 0.009, force_N=math.nan)
    assert controller.mode == "inputs"


def test_a_short_departure_is_allowed() -> None:
    controller = started(rows(100, displacement_mm=(0.0,) * 100))
    drive(controller, range(1, 90), lambda k: 0.009 if k % 40 else 0.0)
    assert controller.mode == "inputs"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (
            rows(4, i_x_A=(0.0, 3.0, 0.0, 0.0)),
            "in spring X is above the host's limit at 0.01 s",
        ),
        (rows(4, i_y_A=(0.0,)), "i_y_A and t_s differ in length"),
        (rows(4, force_N=(1.0,)), "force_N and t_s differ in length"),
        (rows(4, end_s=0.02), "t_s must increase"),
        (rows(4, t_s=(0.0, 0.02, 0.01, 0.03)), "t_s must increase"),
        (rows(4, t_s=(0.5, 0.6, 0.7, 0.8), end_s=0.9), "do not go on where those before end"),
        (rows(4, i_x_A=(0.0, math.nan, 0.0, 0.0)), "not valid"),
        (rows(4, i_x_A=(0.0, 4.5, 0.0, 0.0)), "not valid"),
        (rows(LONGEST_INPUTS + 1), "not valid"),
        (rows(4, queue=True), "no inputs to go on from"),
    ],
)
def test_rows_that_cannot_be_played_are_refused_and_change_nothing(
    command: FollowInputs, said: str
) -> None:
    controller = started(config=ControlConfig(current_limit_A=2.0))
    with pytest.raises(CommandError, match=said):
        controller.command(command)
    assert controller.mode == "idle"


def test_rows_do_not_go_on_after_the_bench_was_disarmed_between() -> None:
    first, second, *_ = rows_in_pieces(rows(LONGEST_INPUTS + 5))
    controller = started(first)
    controller.step(sample(1))
    controller.step(sample(2, armed=False))
    with pytest.raises(CommandError, match="no inputs to go on from"):
        controller.command(second)
    assert drive(controller, range(3, 6))[-1].i_A == (0.0, 0.0)
