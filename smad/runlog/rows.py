"""A sample and what came of it as a row of the run log. Pure."""

import math
from collections.abc import Sequence

from firmware_protocol.enums import SetpointFlag
from firmware_protocol.messages import Setpoint, State
from smad.config.axes import DEGREES_PER_MM
from smad.control.sample import Sample
from smad.runlog.schema import Row

_NAN = math.nan
_OLDEST_AGE_us = 0xFFFF


# Plain ints: arithmetic on IntFlag members builds members.
_DRAIN_X, _DRAIN_Y = int(SetpointFlag.DRAIN_X), int(SetpointFlag.DRAIN_Y)
_STAGE = int(SetpointFlag.STAGE)


def millimetres(metres: float) -> float:
    """Return a length in mm, rounded to nanometres: 0.148 and not 0.14800000000000002."""
    return round(metres * 1e3, 6)


def _digits(readings: Sequence[float]) -> list[float]:
    """Return readings as the board measured them: 1.648 and not 1.6480000000000001."""
    return [round(reading, 6) for reading in readings]


def row_of(
    sample: Sample,
    state: State,
    setpoint: Setpoint | None,
    *,
    host_time_s: float,
    reference_m: float,
    reference_degC: float,
    pump_starts: tuple[int, int],
    degrees_per_mm: float = DEGREES_PER_MM,
) -> Row:
    """Return the sample as a row of the run log. nan stands for what was not measured."""
    displacement_mm = millimetres(sample.displacement_m)
    i_cmd = (_NAN, _NAN) if setpoint is None else setpoint.i_mA
    age_us = state.sp_age_us
    rtd = _digits(sample.rtd_degC)
    i_applied, i_meas = _digits(sample.i_applied_A), _digits(sample.i_meas_A)
    v_x, v_y, supply, force = _digits((*sample.v_V, sample.supply_V, sample.force_N))
    return Row(
        t_s=sample.t_us / 1e6,
        host_time_s=host_time_s,
        tick=sample.tick,
        i_cmd_x_A=i_cmd[0] / 1e3,
        i_cmd_y_A=i_cmd[1] / 1e3,
        i_applied_x_A=i_applied[0],
        i_applied_y_A=i_applied[1],
        i_meas_x_A=i_meas[0],
        i_meas_y_A=i_meas[1],
        v_x_V=v_x,
        v_y_V=v_y,
        duty_x=sample.pump_duty[0],
        duty_y=sample.pump_duty[1],
        pump_starts_x=pump_starts[0],
        pump_starts_y=pump_starts[1],
        drain_x=None if setpoint is None else setpoint.flags & _DRAIN_X,
        drain_y=None if setpoint is None else (setpoint.flags & _DRAIN_Y) >> 1,
        rtd_x_degC=rtd[0],
        rtd_y_degC=rtd[1],
        rtd_inlet_degC=rtd[2],
        rtd_ambient_degC=rtd[3],
        displacement_mm=displacement_mm,
        angle_deg=round(displacement_mm * degrees_per_mm, 6),
        force_N=force,
        supply_V=supply,
        stage_mm=setpoint.stage_um / 1e3
        if setpoint is not None and setpoint.flags & _STAGE
        else None,
        reference_mm=millimetres(reference_m),
        reference_degC=reference_degC,
        mode=state.mode,
        limiter=state.limiter,
        faults=state.faults,
        warnings=state.warnings,
        valid=state.valid,
        setpoint_age_ms=_NAN if age_us == _OLDEST_AGE_us else age_us / 1e3,
    )
