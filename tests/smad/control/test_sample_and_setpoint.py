"""The wire on one side, SI on the other."""

import math

import msgspec
import pytest

from firmware_protocol.enums import BoardState, Limiter, SetpointFlag, ValidBit
from firmware_protocol.messages import State
from firmware_protocol.parameters import BY_NAME
from smad.control.sample import BoardTime, Sample, Scales, sample_of
from smad.control.setpoint import Output, setpoint_of

SCALES = Scales(
    {
        (0, BY_NAME[name].number): value
        for name, value in {
            "encoder_nm_per_count": 500,
            "encoder_offset_counts": 100,
            "force_uN_per_count": 2000,
            "force_offset_counts": -50,
        }.items()
    }
)
ALL = sum(bit.value for bit in ValidBit)


def state(**changes: object) -> State:
    base = State(
        axis=0,
        t_us=123_456,
        tick=7,
        mode=BoardState.ARMED,
        limiter=Limiter.NONE,
        faults=0,
        warnings=0,
        i_meas_mA=(1998, 12),
        i_applied_mA=(2000, 15),
        v_mV=(1520, 9),
        pump_duty=(0, 255),
        rtd_cC=(4512, 2690, 2685, 2685),
        encoder_counts=4100,
        force_counts=570,
        vbus_mV=12_000,
        valid=ALL,
        sp_seq=3,
        sp_age_us=800,
    )
    return msgspec.structs.replace(base, **changes)


def read(**changes: object) -> Sample:
    return sample_of(state(**changes), 0, SCALES)


def test_a_state_becomes_si_with_scales_and_offsets() -> None:
    made = read()
    assert made.displacement_m == pytest.approx(0.002)
    assert made.force_N == pytest.approx(1.24)
    assert made.rtd_degC == pytest.approx((45.12, 26.90, 26.85, 26.85))
    assert made.i_meas_A == pytest.approx((1.998, 0.012))
    assert made.i_applied_A == pytest.approx((2.0, 0.015))
    assert made.v_V == pytest.approx((1.52, 0.009))
    assert made.pump_duty == (0.0, 1.0)
    assert made.supply_V == pytest.approx(12.0)
    assert (made.armed, made.tick) == (True, 7)


@pytest.mark.parametrize("bit", [bit for bit in ValidBit if bit is not ValidBit.SETPOINT])
def test_an_invalid_reading_is_nan_and_the_others_stay(bit: ValidBit) -> None:
    good = read()
    made = read(valid=ALL & ~bit)

    def values(one: object) -> list[float]:
        flat = []
        for value in msgspec.structs.astuple(one):
            flat += value if isinstance(value, tuple) else [value]
        return flat

    differing = [(a, b) for a, b in zip(values(good), values(made), strict=True) if a != b]
    assert len(differing) == 1
    assert math.isnan(differing[0][1])


@pytest.mark.parametrize(
    ("mode", "armed"),
    [(mode, mode in (BoardState.ARMED, BoardState.HOLD)) for mode in BoardState],
)
def test_only_a_board_that_would_apply_setpoints_counts_as_armed(
    mode: BoardState, armed: bool
) -> None:
    assert read(mode=mode).armed is armed


def test_a_board_that_somebody_else_armed_is_not_ours_to_drive() -> None:
    assert not sample_of(state(), 0, SCALES, armed=False).armed


def test_time_begins_with_the_first_sample_and_stands_still_when_the_boards_goes_back() -> None:
    time = BoardTime()
    assert [time.since_first(t) for t in (1_000_000, 1_010_000, 500, 10_500)] == [
        0,
        10_000,
        10_000,
        20_000,
    ]


def test_an_output_becomes_the_nearest_setpoint() -> None:
    made = setpoint_of(
        Output((1.2344, 0.0), (0.0, 0.5), (True, False), 0.0123456), t_ref_us=99, ttl_ms=80
    )
    assert made.i_mA == (1234, 0)
    assert made.pump_duty == (0, 128)
    assert made.flags == SetpointFlag.DRAIN_X | SetpointFlag.STAGE
    assert (made.stage_um, made.t_ref_us, made.ttl_ms) == (12_346, 99, 80)


def test_without_a_stage_the_setpoint_does_not_mean_one() -> None:
    assert setpoint_of(Output(), t_ref_us=0).flags == 0


@pytest.mark.parametrize("before_us", [5_000_000, 3_000_000_000])
def test_board_time_goes_on_from_where_it_was_after_a_restart(before_us: int) -> None:
    time = BoardTime()
    time.since_first(before_us - 10_000)
    assert time.since_first(before_us) == 10_000
    time.restart()
    assert time.since_first(50_000) == 10_000
    assert time.since_first(60_000) == 20_000
