"""From the wire's whole numbers to the controller's SI units and the run log's row. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmware_protocol.enums import BoardState, SetpointFlag, ValidBit
from firmware_protocol.messages import Setpoint, State
from firmware_protocol.parameters import BY_NAME
from smad.control.sample import Sample
from smad.runlog.schema import Row

DEGREES_PER_MM = 6.25
"""A MINIR-II segment turns ±25° for ±4 mm."""

_NAN = math.nan
_DRIVEN = (BoardState.ARMED, BoardState.HOLD)
_OLDEST_AGE_us = 0xFFFF


class Scales:
    """What one count of the encoder and of the force cell is, from the board's parameters."""

    def __init__(self, values: Mapping[tuple[int, int], int], axis: int) -> None:
        def value(name: str) -> int:
            parameter = BY_NAME[name]
            return values.get(
                (0 if parameter.shared else axis, parameter.number), parameter.default
            )

        self.m_per_count = value("encoder_nm_per_count") * 1e-9
        self.encoder_offset = value("encoder_offset_counts")
        self.N_per_count = value("force_uN_per_count") * 1e-6
        self.force_offset = value("force_offset_counts")


def sample_of(state: State, t_us: int, scales: Scales, *, armed: bool) -> Sample:
    """Return the sample in SI units; `t_us` is the board's time without wraps.

    `armed` says whether it was armed by us: a board that somebody else armed is not ours to drive.
    A reading that the board marks invalid becomes nan.
    """
    valid = state.valid
    current, voltage, rtd = state.i_meas_mA, state.v_mV, state.rtd_cC
    return Sample(
        t_us=t_us,
        tick=state.tick,
        armed=armed and state.mode in _DRIVEN,
        displacement_m=(state.encoder_counts - scales.encoder_offset) * scales.m_per_count
        if valid & _ENCODER
        else _NAN,
        force_N=(state.force_counts - scales.force_offset) * scales.N_per_count
        if valid & _FORCE
        else _NAN,
        rtd_degC=(
            rtd[0] * 0.01 if valid & _RTD_X else _NAN,
            rtd[1] * 0.01 if valid & _RTD_Y else _NAN,
            rtd[2] * 0.01 if valid & _RTD_INLET else _NAN,
            rtd[3] * 0.01 if valid & _RTD_AMBIENT else _NAN,
        ),
        i_meas_A=(
            current[0] * 1e-3 if valid & _I_X else _NAN,
            current[1] * 1e-3 if valid & _I_Y else _NAN,
        ),
        i_applied_A=(state.i_applied_mA[0] * 1e-3, state.i_applied_mA[1] * 1e-3),
        v_V=(
            voltage[0] * 1e-3 if valid & _V_X else _NAN,
            voltage[1] * 1e-3 if valid & _V_Y else _NAN,
        ),
        pump_duty=(state.pump_duty[0] / 255.0, state.pump_duty[1] / 255.0),
        supply_V=state.vbus_mV * 1e-3 if valid & _VBUS else _NAN,
    )


# Arithmetic on IntFlag members builds members; plain ints keep the step short.
_RTD_X, _RTD_Y = int(ValidBit.RTD_X), int(ValidBit.RTD_Y)
_RTD_INLET, _RTD_AMBIENT = int(ValidBit.RTD_INLET), int(ValidBit.RTD_AMBIENT)
_I_X, _I_Y = int(ValidBit.I_X), int(ValidBit.I_Y)
_V_X, _V_Y, _VBUS = int(ValidBit.V_X), int(ValidBit.V_Y), int(ValidBit.VBUS)
_ENCODER, _FORCE = int(ValidBit.ENCODER), int(ValidBit.FORCE)
_DRAIN_X, _DRAIN_Y = int(SetpointFlag.DRAIN_X), int(SetpointFlag.DRAIN_Y)
_STAGE = int(SetpointFlag.STAGE)


def row_of(
    sample: Sample,
    state: State,
    setpoint: Setpoint | None,
    *,
    host_time_s: float,
    reference_m: float,
    reference_degC: float,
) -> Row:
    """Return the sample as a row of the run log. nan stands for what was not measured."""
    displacement_mm = sample.displacement_m * 1e3
    i_cmd = (_NAN, _NAN) if setpoint is None else setpoint.i_mA
    age_us = state.sp_age_us
    rtd = sample.rtd_degC
    return Row(
        t_s=sample.t_us * 1e-6,
        host_time_s=host_time_s,
        tick=sample.tick,
        i_cmd_x_A=i_cmd[0] * 1e-3,
        i_cmd_y_A=i_cmd[1] * 1e-3,
        i_applied_x_A=sample.i_applied_A[0],
        i_applied_y_A=sample.i_applied_A[1],
        i_meas_x_A=sample.i_meas_A[0],
        i_meas_y_A=sample.i_meas_A[1],
        v_x_V=sample.v_V[0],
        v_y_V=sample.v_V[1],
        duty_x=sample.pump_duty[0],
        duty_y=sample.pump_duty[1],
        drain_x=None if setpoint is None else setpoint.flags & _DRAIN_X,
        drain_y=None if setpoint is None else (setpoint.flags & _DRAIN_Y) >> 1,
        rtd_x_degC=rtd[0],
        rtd_y_degC=rtd[1],
        rtd_inlet_degC=rtd[2],
        rtd_ambient_degC=rtd[3],
        displacement_mm=displacement_mm,
        angle_deg=displacement_mm * DEGREES_PER_MM,
        force_N=sample.force_N,
        supply_V=sample.supply_V,
        stage_mm=setpoint.stage_um * 1e-3
        if setpoint is not None and setpoint.flags & _STAGE
        else None,
        reference_mm=reference_m * 1e3,
        reference_degC=reference_degC,
        mode=state.mode,
        limiter=state.limiter,
        faults=state.faults,
        warnings=state.warnings,
        valid=state.valid,
        setpoint_age_ms=_NAN if age_us == _OLDEST_AGE_us else age_us * 1e-3,
    )
