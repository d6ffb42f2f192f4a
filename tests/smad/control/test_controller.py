"""The controller: modes, hand-over between them, limits, board time."""

import math

import msgspec
import pytest

from smad.config import ControlConfig, CoolingConfig, LimitsConfig
from smad.control.commands import (
    DriveCurrent,
    Follow,
    Hold,
    HoldTemperature,
    Idle,
    ModeCommand,
    MoveStage,
    Ramp,
    Sine,
    Step,
    Tune,
)
from smad.control.controller import Controller
from smad.control.inforce import tune_of
from smad.control.limits import HostLimit
from smad.control.setpoint import Output
from smad.errors import CommandError

from .helpers import drive, sample

STEP_UP = Follow(trajectories=(Step(displacement_mm=5.0, duration_s=60.0),))
STEP_DOWN = Follow(trajectories=(Step(displacement_mm=-5.0, duration_s=60.0),))
PROPORTIONAL = ControlConfig(cooling=CoolingConfig(mode="proportional"))


def started(*commands: ModeCommand, config: ControlConfig | None = None) -> Controller:
    controller = Controller(config or ControlConfig())
    controller.step(sample(0))
    for command in commands:
        controller.command(command)
    return controller


def test_idle_drives_nothing() -> None:
    assert drive(started(), range(1, 4)) == [Output()] * 3


@pytest.mark.parametrize(("command", "pulling"), [(STEP_UP, 0), (STEP_DOWN, 1)])
def test_the_spring_that_has_to_pull_is_heated_and_the_other_cooled(
    command: Follow, pulling: int
) -> None:
    output = drive(started(command, config=PROPORTIONAL), range(1, 4))[-1]
    assert output.i_A[pulling] == 4.0
    assert output.i_A[1 - pulling] == 0.0
    assert output.pump_duty[1 - pulling] == 1.0
    assert output.pump_duty[pulling] == 0.0


def test_current_never_exceeds_the_limit_and_is_never_negative() -> None:
    controller = started(
        Follow(trajectories=(Sine(amplitude_mm=12.0, period_s=5.0, cycles=4),)),
        config=ControlConfig(current_limit_A=2.5),
    )
    outputs = drive(controller, range(1, 2000), lambda k: 0.012 * math.sin(k))
    currents = [i for output in outputs for i in output.i_A]
    assert max(currents) == 2.5
    assert min(currents) == 0.0
    assert all(0.0 in output.i_A for output in outputs)


def test_a_following_controller_reports_its_reference_and_when_it_is_done() -> None:
    controller = started(Follow(trajectories=(Ramp(displacement_mm=1.0, rate_mm_per_s=1.0),)))
    drive(controller, range(1, 51))
    assert controller.reference_m == pytest.approx(0.0005, abs=1e-5)
    assert (controller.mode, controller.done) == ("displacement", False)
    drive(controller, range(51, 110))
    assert controller.done


def test_displacement_takes_over_from_plain_current_without_a_bump() -> None:
    controller = started(DriveCurrent(i_x_A=1.5))
    before = drive(controller, range(1, 20), lambda k: 0.003)[-1]
    controller.command(Follow(trajectories=(Hold(duration_s=5.0),)))
    after = controller.step(sample(20, displacement_m=0.003))
    assert controller.reference_m == 0.003
    assert after.i_A == pytest.approx(before.i_A, abs=1e-3)


def test_temperature_takes_over_from_displacement_without_a_bump() -> None:
    controller = started(STEP_UP)
    before = drive(controller, range(1, 20), lambda k: 0.0049)[-1]
    controller.command(HoldTemperature(spring="x", temperature_degC=26.0))
    after = controller.step(sample(20, displacement_m=0.0049))
    assert 0.5 < before.i_A[0] < 4.0
    assert after.i_A == pytest.approx(before.i_A, abs=0.01)


def test_a_temperature_is_held_with_current_below_and_water_above() -> None:
    controller = started(HoldTemperature(spring="y", temperature_degC=50.0))
    cold = drive(controller, range(1, 30))[-1]
    assert cold.i_A == (0.0, 4.0)
    assert cold.pump_duty == (0.0, 0.0)
    hot = controller.step(sample(30, rtd_degC=(25.0, 58.0, 27.0, 27.0)))
    assert hot.i_A == (0.0, 0.0)
    assert hot.pump_duty == (0.0, 1.0)
    assert controller.target_degC == 50.0


def test_a_temperature_ramp_starts_at_the_spring_and_is_done_after_the_hold() -> None:
    controller = started(
        HoldTemperature(spring="x", temperature_degC=30.0, rate_K_per_s=5.0, duration_s=0.5)
    )
    drive(controller, range(1, 51))
    assert controller.target_degC == pytest.approx(27.5)
    drive(controller, range(51, 120))
    assert (controller.target_degC, controller.done) == (30.0, False)
    drive(controller, range(120, 160))
    assert (controller.mode, controller.done) == ("temperature", True)


def test_plain_current_ends_after_its_time() -> None:
    controller = started(DriveCurrent(i_x_A=1.0, pump_y_duty=0.5, duration_s=0.1))
    outputs = drive(controller, range(1, 15))
    assert outputs[0] == Output((1.0, 0.0), (0.0, 0.5))
    assert outputs[-1] == Output()
    assert (controller.mode, controller.done) == ("idle", True)


@pytest.mark.parametrize(
    ("stop", "rtd_degC", "ends"),
    [
        ({"stop_above_degC": 48.85}, 48.84, False),
        ({"stop_above_degC": 48.85}, 48.85, True),
        ({"stop_below_degC": 30.0}, 30.01, False),
        ({"stop_below_degC": 30.0}, 30.0, True),
    ],
)
def test_plain_current_ends_at_a_temperature(
    stop: dict[str, float], rtd_degC: float, ends: bool
) -> None:
    controller = started(DriveCurrent(i_y_A=1.0, stop_spring="y", **stop))
    controller.step(sample(1, rtd_degC=(40.0, rtd_degC, 27.0, 27.0)))
    assert controller.done is ends


def test_the_stage_moves_beside_a_temperature_hold() -> None:
    controller = started(
        HoldTemperature(spring="x", temperature_degC=60.0),
        MoveStage(stage_mm=20.0, rate_mm_per_s=10.0),
    )
    outputs = drive(controller, range(1, 101))
    assert outputs[-1].stage_m == pytest.approx(0.010)
    assert outputs[-1].i_A[0] == 4.0
    assert drive(controller, range(101, 220))[-1].stage_m == 0.020


@pytest.mark.parametrize(
    ("seen_m", "first_m"), [(0.030, 0.0301), (-0.002, 0.0001), (math.nan, 0.0001)]
)
def test_a_stage_that_was_never_moved_sets_out_from_where_it_is_measured(
    seen_m: float, first_m: float
) -> None:
    controller = Controller(ControlConfig())
    controller.step(sample(0, displacement_m=seen_m))
    controller.command(MoveStage(stage_mm=50.0, rate_mm_per_s=10.0))
    assert controller.step(sample(1)).stage_m == pytest.approx(first_m)


def test_after_a_silence_the_stage_does_not_catch_up_at_once() -> None:
    controller = started(MoveStage(stage_mm=50.0, rate_mm_per_s=100.0))
    before, after = drive(controller, [1, 60])
    assert (before.stage_m, after.stage_m) == pytest.approx((0.001, 0.011))


def test_a_bench_that_never_moved_its_stage_is_not_asked_to() -> None:
    assert drive(started(STEP_UP), range(1, 5))[-1].stage_m is None


def test_a_stage_that_was_moved_in_an_earlier_arming_lifts_no_limit_of_displacement() -> None:
    heating = DriveCurrent(i_x_A=1.0)
    controller = started(MoveStage(stage_mm=5.0, rate_mm_per_s=50.0), heating)
    assert drive(controller, range(1, 20), lambda k: 0.05)[-1].i_A[0] == 1.0
    controller.step(sample(20, armed=False))
    controller.step(sample(21))
    controller.command(heating)
    (output,) = drive(controller, [22], lambda k: 0.05)
    assert output.i_A[0] == 0.0
    assert output.stage_m == 0.005
    assert controller.limiting is HostLimit.DISPLACEMENT


def test_a_stage_on_its_way_stops_with_the_arming() -> None:
    controller = started(MoveStage(stage_mm=20.0, rate_mm_per_s=10.0))
    (*_, before) = drive(controller, range(1, 51))
    controller.step(sample(51, armed=False))
    (*_, after) = drive(controller, range(52, 100))
    assert after.stage_m == before.stage_m == pytest.approx(0.005)


def test_leaving_armed_ends_the_mode_and_arming_again_moves_nothing() -> None:
    controller = started(STEP_UP)
    assert drive(controller, range(1, 5))[-1].i_A[0] > 0.0
    assert controller.step(sample(5, armed=False)) == Output()
    assert controller.step(sample(6)) == Output()
    assert controller.mode == "idle"


def test_tuning_changes_gains_and_cooling_while_it_runs() -> None:
    controller = started(STEP_UP, Tune(kp_A_per_mm=0.1, ki_A_per_mm_s=0.0, cooling="off"))
    output = drive(controller, range(1, 5))[-1]
    assert output.i_A[0] == pytest.approx(0.5)
    assert output.pump_duty == (0.0, 0.0)


@pytest.mark.parametrize("kp_A_per_mm", [7.0, 14.0, 56.0])
def test_a_gain_that_changes_while_it_follows_leaves_the_current_as_it_is(
    kp_A_per_mm: float,
) -> None:
    controller = started(STEP_UP)
    before = drive(controller, range(1, 20), lambda k: 0.0049)[-1]
    controller.command(Tune(kp_A_per_mm=kp_A_per_mm))
    after = controller.step(sample(20, displacement_m=0.0049))
    assert 2.0 < before.i_A[0] < 4.0
    assert after.i_A == pytest.approx(before.i_A, abs=0.03)


def test_a_gain_that_changes_nothing_yet_leaves_the_integral_as_it_is() -> None:
    controller = started(STEP_UP)
    drive(controller, range(1, 20), lambda k: 0.0)
    controller.command(Tune(kp_A_per_mm=14.0))
    assert drive(controller, [20, 21], lambda k: 0.0049)[-1].i_A[0] == pytest.approx(1.4, abs=0.1)


def test_tuning_cannot_raise_the_current_above_the_configured_limit() -> None:
    controller = started(
        STEP_UP, Tune(current_limit_A=3.0), config=ControlConfig(current_limit_A=2.0)
    )
    assert drive(controller, range(1, 5))[-1].i_A[0] == 2.0


def test_the_gains_in_force_are_told_within_the_configured_limit_of_current() -> None:
    config = ControlConfig(kp_A_per_mm=0.35, current_limit_A=2.0)
    controller = started(config=config)
    controller.command(Tune(kp_A_per_mm=7.0, current_limit_A=3.0))
    controller.command(Tune(cooling="off"))
    expected = msgspec.structs.replace(tune_of(config), kp_A_per_mm=7.0, cooling="off")
    assert controller.gains == expected


def test_the_water_is_drained_from_the_spring_that_heats_when_asked() -> None:
    controller = started(STEP_UP, Tune(drain_before_heating=True))
    assert drive(controller, range(1, 5))[-1].drain == (True, False)


def test_a_refused_command_leaves_the_mode_running() -> None:
    controller = started(STEP_UP)
    for bad in (
        DriveCurrent(i_x_A=4.5),
        HoldTemperature(spring="x", temperature_degC=110.0),
        Follow(trajectories=(Step(displacement_mm=30.0, duration_s=1.0),)),
        Follow(trajectories=()),
    ):
        with pytest.raises(CommandError):
            controller.command(bad)
    assert controller.mode == "displacement"
    assert drive(controller, range(1, 5))[-1].i_A[0] == 4.0


def test_idle_stops_everything_at_the_next_sample() -> None:
    controller = started(STEP_UP)
    drive(controller, range(1, 5))
    controller.command(Idle())
    assert controller.step(sample(5)) == Output()


def test_the_trajectory_keeps_board_time_through_missed_samples() -> None:
    controller = started(Follow(trajectories=(Ramp(displacement_mm=5.0, rate_mm_per_s=1.0),)))
    drive(controller, [1, 2, 3, 50, 51, 100])
    assert controller.reference_m == pytest.approx(0.001, abs=1e-6)


def test_a_sample_that_comes_twice_changes_nothing() -> None:
    controller = started(STEP_UP)
    first = controller.step(sample(1))
    assert controller.step(sample(1, displacement_m=0.004)) is first


def test_without_a_displacement_nothing_is_heated() -> None:
    assert drive(started(STEP_UP), range(1, 5), lambda k: math.nan)[-1] == Output()


@pytest.mark.parametrize("field", ["i_x_A", "i_y_A"])
def test_a_current_above_the_configured_limit_is_refused(field: str) -> None:
    controller = Controller(ControlConfig(current_limit_A=1.5), LimitsConfig())
    controller.command(DriveCurrent(**{field: 1.5}))
    said = rf"spring {field[2].upper()} .*got 2 A; allowed: up to 1.5 A"
    with pytest.raises(CommandError, match=said):
        controller.command(DriveCurrent(**{field: 2.0}))


def test_a_hot_spring_gets_less_current_and_above_the_limit_none() -> None:
    controller = Controller(ControlConfig(), LimitsConfig(temperature_max_degC=70.0))
    controller.step(sample(0))
    controller.command(STEP_UP)
    drive(controller, range(1, 5))

    def current_at(k: int, degC: float) -> float:
        return controller.step(sample(k, rtd_degC=(degC, 25.0, 27.0, 27.0))).i_A[0]

    assert current_at(20, 67.9) == 4.0
    assert current_at(40, 69.0) == pytest.approx(2.0)
    assert controller.limiting == HostLimit.TEMPERATURE_X
    assert current_at(60, 70.0) == 0.0


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"force_N": 10.1}, HostLimit.FORCE),
        ({"displacement_m": 0.0151}, HostLimit.DISPLACEMENT),
        ({"rtd_degC": (math.nan, 25.0, 27.0, 27.0)}, HostLimit.SENSOR_X),
    ],
)
def test_a_broken_limit_cuts_the_current(changes: dict[str, object], limit: HostLimit) -> None:
    controller = started(DriveCurrent(i_x_A=1.0))
    assert controller.step(sample(1, **changes)).i_A == (0.0, 0.0)
    assert controller.limiting == limit
    assert controller.step(sample(2)).i_A == (1.0, 0.0)


def test_a_spring_may_pull_back_from_beyond_the_displacement_limit() -> None:
    controller = started(DriveCurrent(i_y_A=1.0))
    assert controller.step(sample(1, displacement_m=0.016)).i_A == (0.0, 1.0)


def test_a_temperature_that_jumps_is_a_broken_sensor_until_the_next_arming() -> None:
    controller = started(DriveCurrent(i_x_A=1.0))
    drive(controller, range(1, 20))
    drive(controller, range(20, 40), rtd_degC=(75.0, 25.0, 27.0, 27.0))
    assert controller.limiting == HostLimit.SENSOR_X
    assert drive(controller, range(40, 60))[-1].i_A == (0.0, 0.0)
    controller.step(sample(60, armed=False))
    controller.step(sample(61))
    controller.command(DriveCurrent(i_x_A=1.0))
    assert drive(controller, range(62, 70))[-1].i_A == (1.0, 0.0)


@pytest.mark.parametrize(
    ("change_K", "breaks"), [(2.4, False), (3.1, True), (-9.9, False), (-12.1, True)]
)
def test_a_temperature_may_fall_four_times_as_fast_as_it_may_rise(
    change_K: float, breaks: bool
) -> None:
    controller = started(DriveCurrent(i_x_A=1.0))
    drive(controller, range(1, 20), rtd_degC=(60.0, 25.0, 27.0, 27.0))
    drive(controller, range(20, 40), rtd_degC=(60.0 + change_K, 25.0, 27.0, 27.0))
    assert (controller.limiting == HostLimit.SENSOR_X) is breaks
    if controller.trip is not None:
        assert controller.trip.measured / controller.trip.allowed > 1.0


def test_the_on_time_of_one_arming_is_bounded() -> None:
    controller = Controller(ControlConfig(), LimitsConfig(on_time_max_s=1.0))
    controller.step(sample(0))
    controller.command(DriveCurrent(i_x_A=1.0))
    outputs = drive(controller, range(1, 150))
    assert outputs[95].i_A == (1.0, 0.0)
    assert outputs[-1].i_A == (0.0, 0.0)
    assert controller.limiting == HostLimit.ON_TIME
    controller.step(sample(150, armed=False))
    controller.step(sample(151))
    controller.command(DriveCurrent(i_x_A=1.0))
    assert drive(controller, range(152, 248))[-1].i_A == (1.0, 0.0)


def test_limits_count_all_of_a_silence_but_the_current_rises_for_a_tenth_of_a_second() -> None:
    limits = LimitsConfig(on_time_max_s=2.0, current_rate_max_A_per_s=1.0)
    controller = Controller(ControlConfig(), limits)
    controller.step(sample(0, rtd_degC=(75.0, 25.0, 27.0, 27.0)))
    controller.command(DriveCurrent(i_x_A=1.0))
    drive(controller, range(1, 11), rtd_degC=(75.0, 25.0, 27.0, 27.0))
    # Water took 30 K in half a second, as it may; the sensor is not broken.
    (output,) = drive(controller, [60], rtd_degC=(45.0, 25.0, 27.0, 27.0))
    assert controller.trip is None
    assert output.i_A[0] == pytest.approx(0.2)
    drive(controller, [260])
    assert controller.limiting == HostLimit.ON_TIME


def test_the_current_rises_no_faster_than_allowed_and_falls_at_once() -> None:
    controller = Controller(ControlConfig(), LimitsConfig(current_rate_max_A_per_s=100.0))
    controller.step(sample(0))
    controller.command(DriveCurrent(i_x_A=3.0))
    rising = [output.i_A[0] for output in drive(controller, range(1, 5))]
    assert rising == pytest.approx([1.0, 2.0, 3.0, 3.0])
    controller.command(Idle())
    assert controller.step(sample(5)).i_A == (0.0, 0.0)


def test_a_limit_that_stays_ends_the_motion_and_says_which_it_was() -> None:
    controller = started(STEP_UP)
    drive(controller, range(1, 20))
    assert controller.trip is None
    drive(controller, range(20, 40), rtd_degC=(75.0, 25.0, 27.0, 27.0))
    trip = controller.trip
    assert trip is not None
    assert (trip.limit, trip.rtd_degC) == (HostLimit.SENSOR_X, 75.0)
    assert trip.measured > trip.allowed > 0.0
    assert controller.mode == "idle"
    controller.command(DriveCurrent(i_x_A=1.0, pump_x_duty=1.0))
    last = drive(controller, range(40, 60))[-1]
    assert (last.i_A, last.pump_duty) == ((0.0, 0.0), (0.0, 0.0))
    controller.step(sample(60, armed=False))
    controller.step(sample(61))
    assert controller.trip is None


def test_a_sensor_that_jumps_on_a_spring_that_is_not_heated_ends_nothing() -> None:
    controller = started(DriveCurrent(i_x_A=1.0))
    drive(controller, range(1, 20))
    outputs = drive(controller, range(20, 40), rtd_degC=(25.0, 75.0, 27.0, 27.0))
    assert controller.trip is None
    assert outputs[-1].i_A == (1.0, 0.0)
