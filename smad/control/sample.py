"""What the board measured, in SI units and with board time unwrapped."""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec

from firmware_protocol.enums import BoardState, ValidBit
from firmware_protocol.messages import State

INVALID = math.nan
"""Stands for a measurement that the board marks as invalid."""


class Sample(msgspec.Struct, frozen=True, gc=False):
    """One sample of one axis. Pairs are (spring X, spring Y); nan marks an invalid measurement.

    `t_us` is board time without wraps, in microseconds since the first sample. `armed` says that
    the board applies setpoints, or would apply a fresh one (ARMED and HOLD).
    """

    t_us: int
    tick: int
    armed: bool
    displacement_m: float
    force_N: float
    rtd_degC: tuple[float, float, float, float]
    """Spring X, spring Y, water inlet, ambient."""
    i_meas_A: tuple[float, float] = (0.0, 0.0)
    i_applied_A: tuple[float, float] = (0.0, 0.0)
    v_V: tuple[float, float] = (0.0, 0.0)
    pump_duty: tuple[float, float] = (0.0, 0.0)
    supply_V: float = 0.0


class BoardTime:
    """Unwraps the board's 32-bit microseconds. A clock that jumps back stands still once."""

    __slots__ = ("_last_raw_us", "jumps", "now_us")

    def __init__(self) -> None:
        self._last_raw_us: int | None = None
        self.now_us = 0
        self.jumps = 0

    def unwrap(self, raw_us: int) -> int:
        """Microseconds since the first sample."""
        if self._last_raw_us is not None:
            step_us = (raw_us - self._last_raw_us) & 0xFFFF_FFFF
            if step_us < 0x8000_0000:
                self.now_us += step_us
            else:
                self.jumps += 1
        self._last_raw_us = raw_us
        return self.now_us


@dataclass(frozen=True, slots=True)
class Scales:
    """The board's parameters that turn counts into SI units."""

    encoder_nm_per_count: int
    encoder_offset_counts: int
    force_uN_per_count: int
    force_offset_counts: int


_DRIVABLE = (BoardState.ARMED, BoardState.HOLD)
_RTD_BITS = (ValidBit.RTD_X, ValidBit.RTD_Y, ValidBit.RTD_INLET, ValidBit.RTD_AMBIENT)
_ALL_VALID = sum(bit.value for bit in ValidBit) & ~ValidBit.SETPOINT.value
_I_X, _I_Y = ValidBit.I_X.value, ValidBit.I_Y.value
_V_X, _V_Y = ValidBit.V_X.value, ValidBit.V_Y.value
_ENCODER, _FORCE = ValidBit.ENCODER.value, ValidBit.FORCE.value
_VBUS = ValidBit.VBUS.value


class SampleReader:
    """Turns STATE messages of one axis into samples. A new session needs a new reader."""

    __slots__ = ("_metre_per_count", "_newton_per_count", "_scales", "time")

    def __init__(self, scales: Scales) -> None:
        self._scales = scales
        self._metre_per_count = scales.encoder_nm_per_count * 1e-9
        self._newton_per_count = scales.force_uN_per_count * 1e-6
        self.time = BoardTime()

    def read(self, state: State) -> Sample:
        """The sample that `state` reports."""
        valid = state.valid
        rtd = state.rtd_cC
        i_meas, v = state.i_meas_mA, state.v_mV
        sample = Sample(
            self.time.unwrap(state.t_us),
            state.tick,
            state.mode in _DRIVABLE,
            (state.encoder_counts - self._scales.encoder_offset_counts) * self._metre_per_count,
            (state.force_counts - self._scales.force_offset_counts) * self._newton_per_count,
            (rtd[0] * 0.01, rtd[1] * 0.01, rtd[2] * 0.01, rtd[3] * 0.01),
            (i_meas[0] * 1e-3, i_meas[1] * 1e-3),
            (state.i_applied_mA[0] * 1e-3, state.i_applied_mA[1] * 1e-3),
            (v[0] * 1e-3, v[1] * 1e-3),
            (state.pump_duty[0] / 255.0, state.pump_duty[1] / 255.0),
            state.vbus_mV * 1e-3,
        )
        return sample if valid & _ALL_VALID == _ALL_VALID else _without_invalid(sample, valid)


def _without_invalid(sample: Sample, valid: int) -> Sample:
    rtd = tuple(
        value if valid & bit else INVALID
        for value, bit in zip(sample.rtd_degC, _RTD_BITS, strict=True)
    )
    return msgspec.structs.replace(
        sample,
        displacement_m=sample.displacement_m if valid & _ENCODER else INVALID,
        force_N=sample.force_N if valid & _FORCE else INVALID,
        rtd_degC=rtd,
        i_meas_A=_pair(sample.i_meas_A, valid, _I_X, _I_Y),
        v_V=_pair(sample.v_V, valid, _V_X, _V_Y),
        supply_V=sample.supply_V if valid & _VBUS else INVALID,
    )


def _pair(values: tuple[float, float], valid: int, x: int, y: int) -> tuple[float, float]:
    return values[0] if valid & x else INVALID, values[1] if valid & y else INVALID
