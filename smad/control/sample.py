"""What the board measured, in SI units, and the time since the first sample."""

import math
from collections.abc import Mapping

import msgspec

from firmware_protocol.enums import BoardState, ValidBit
from firmware_protocol.messages import State
from firmware_protocol.parameters import BY_NAME

LONGEST_STEP_S = 0.1
"""After a longer silence the trajectories go on with the board's time, but the integrals do not
take in an error that was measured once as if it had lasted so long, nor does a current rise or the
stage move so."""
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
    """Time since the first sample, from the board's time without wraps.

    It stands still once where the board's clock goes back or begins anew.
    """

    __slots__ = ("_last_us", "now_us")

    def __init__(self) -> None:
        self._last_us: int | None = None
        self.now_us = 0

    def restart(self) -> None:
        """The board restarted: its next stamp says nothing of the time between."""
        self._last_us = None

    def since_first(self, board_us: int) -> int:
        """Microseconds since the first sample."""
        if self._last_us is not None and board_us > self._last_us:
            self.now_us += board_us - self._last_us
        self._last_us = board_us
        return self.now_us


class Scales:
    """What one count of the encoder and of the force cell is, from the board's parameters.

    `values` is by (axis, number) as the board tells them; a missing one has its default.
    """

    __slots__ = ("N_per_count", "encoder_offset", "force_offset", "m_per_count")

    def __init__(self, values: Mapping[tuple[int, int], int], axis: int = 0) -> None:
        def value(name: str) -> int:
            parameter = BY_NAME[name]
            return values.get(
                (0 if parameter.shared else axis, parameter.number), parameter.default
            )

        self.m_per_count = value("encoder_nm_per_count") * 1e-9
        self.encoder_offset = value("encoder_offset_counts")
        self.N_per_count = value("force_uN_per_count") * 1e-6
        self.force_offset = value("force_offset_counts")


# Arithmetic on IntFlag members builds members; plain ints keep the step short.
_RTD_X, _RTD_Y = int(ValidBit.RTD_X), int(ValidBit.RTD_Y)
_RTD_INLET, _RTD_AMBIENT = int(ValidBit.RTD_INLET), int(ValidBit.RTD_AMBIENT)
_I_X, _I_Y = int(ValidBit.I_X), int(ValidBit.I_Y)
_V_X, _V_Y, _VBUS = int(ValidBit.V_X), int(ValidBit.V_Y), int(ValidBit.VBUS)
_ENCODER, _FORCE = int(ValidBit.ENCODER), int(ValidBit.FORCE)
_DRIVEN = (BoardState.ARMED, BoardState.HOLD)


def sample_of(state: State, t_us: int, scales: Scales, *, armed: bool = True) -> Sample:
    """The sample in SI units; `t_us` is the board's time without wraps.

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
        else INVALID,
        force_N=(state.force_counts - scales.force_offset) * scales.N_per_count
        if valid & _FORCE
        else INVALID,
        rtd_degC=(
            rtd[0] * 0.01 if valid & _RTD_X else INVALID,
            rtd[1] * 0.01 if valid & _RTD_Y else INVALID,
            rtd[2] * 0.01 if valid & _RTD_INLET else INVALID,
            rtd[3] * 0.01 if valid & _RTD_AMBIENT else INVALID,
        ),
        i_meas_A=(
            current[0] * 1e-3 if valid & _I_X else INVALID,
            current[1] * 1e-3 if valid & _I_Y else INVALID,
        ),
        i_applied_A=(state.i_applied_mA[0] * 1e-3, state.i_applied_mA[1] * 1e-3),
        v_V=(
            voltage[0] * 1e-3 if valid & _V_X else INVALID,
            voltage[1] * 1e-3 if valid & _V_Y else INVALID,
        ),
        pump_duty=(state.pump_duty[0] / 255.0, state.pump_duty[1] / 255.0),
        supply_V=state.vbus_mV * 1e-3 if valid & _VBUS else INVALID,
    )
