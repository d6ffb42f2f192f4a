"""Every number on the wire that stands for a word: states, faults, limiters, codes and bits.

`BoardState`, `Fault`, `Warning`, `Limiter`, `Channel` and `ErrorCode` are plain numbers.
Faults and warnings also travel as masks: the bit of a member is `1 << member`
(`mask_of`, `members_of`). `SetpointFlag`, `ValidBit` and `Capability` are bits already.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

_Member = TypeVar("_Member", bound=enum.IntEnum)


class BoardState(enum.IntEnum):
    """The board's state machine. Its transitions are the supervisor's table."""

    BOOT = 0
    SAFE = 1
    ARMED = 2
    HOLD = 3
    COOL = 4
    FAULT = 5
    ESTOP = 6


class Fault(enum.IntEnum):
    """What the board stops for. `FAULTS` gives the unit of the measured value and the meaning."""

    OVER_TEMPERATURE = 1
    SENSOR_OPEN = 2
    SENSOR_SHORT = 3
    SENSOR_RAIL = 4
    SENSOR_STUCK = 5
    SENSOR_IMPLAUSIBLE = 6
    NOT_HEATING = 7
    RUNAWAY_CURRENT = 8
    RUNAWAY_TEMPERATURE = 9
    MODEL_RESIDUAL = 10
    RESISTANCE_OUT_OF_BAND = 11
    RESISTANCE_RTD_DISAGREE = 12
    CURRENT_ERROR = 13
    I2T = 14
    ON_TIME = 15
    PUMP_DRY = 16
    PUMP_STALLED = 17
    PUMP_NO_COOLING = 18
    LEAK = 19
    LOOP_OVERRUN = 20
    BROWN_OUT = 21
    PARAMETER_CRC = 22
    SETPOINT_LOST = 23
    FORCE_LIMIT = 24
    TRAVEL_LIMIT = 25
    HOST_REQUEST = 26
    SELF_TEST = 27


@dataclass(frozen=True)
class FaultInfo:
    """Unit of a fault's measured value and limit, and what it means."""

    unit: str
    meaning: str


FAULTS: dict[Fault, FaultInfo] = {
    Fault.OVER_TEMPERATURE: FaultInfo("cC", "a temperature is over its limit"),
    Fault.SENSOR_OPEN: FaultInfo("cC", "a sensor reads as an open circuit"),
    Fault.SENSOR_SHORT: FaultInfo("cC", "a sensor reads as a short circuit"),
    Fault.SENSOR_RAIL: FaultInfo("counts", "a sensor sits at the end of its range"),
    Fault.SENSOR_STUCK: FaultInfo("ms", "a reading has not changed by one step while heating"),
    Fault.SENSOR_IMPLAUSIBLE: FaultInfo("cC/s", "a reading changes faster than is possible"),
    Fault.NOT_HEATING: FaultInfo("mJ", "energy went in and the temperature did not rise"),
    Fault.RUNAWAY_CURRENT: FaultInfo("mA", "current flows at a setpoint of zero"),
    Fault.RUNAWAY_TEMPERATURE: FaultInfo("cC", "the temperature rises although heating is off"),
    Fault.MODEL_RESIDUAL: FaultInfo("cC", "temperature and thermal model disagree"),
    Fault.RESISTANCE_OUT_OF_BAND: FaultInfo("mΩ", "a spring's resistance is out of its band"),
    Fault.RESISTANCE_RTD_DISAGREE: FaultInfo("cC", "resistance and RTD disagree on temperature"),
    Fault.CURRENT_ERROR: FaultInfo("mA", "measured and applied current differ"),
    Fault.I2T: FaultInfo("mA²s/1000", "heat put into a wire is over its limit"),
    Fault.ON_TIME: FaultInfo("ms", "armed for longer than one arming allows"),
    Fault.PUMP_DRY: FaultInfo("rpm", "a pump runs without water"),
    Fault.PUMP_STALLED: FaultInfo("rpm", "a pump is driven and does not turn"),
    Fault.PUMP_NO_COOLING: FaultInfo("cC", "a pump runs and the spring does not cool"),
    Fault.LEAK: FaultInfo("", "the leak input is active"),
    Fault.LOOP_OVERRUN: FaultInfo("us", "the board's loop took longer than its period"),
    Fault.BROWN_OUT: FaultInfo("mV", "the supply is under its limit"),
    Fault.PARAMETER_CRC: FaultInfo("", "the stored parameters are damaged"),
    Fault.SETPOINT_LOST: FaultInfo("ms", "no fresh setpoint came while in HOLD"),
    Fault.FORCE_LIMIT: FaultInfo("mN", "the tendon force is over its limit"),
    Fault.TRAVEL_LIMIT: FaultInfo("um", "the displacement is over its limit"),
    Fault.HOST_REQUEST: FaultInfo("", "the host asked for a fault"),
    Fault.SELF_TEST: FaultInfo("", "the self-test at boot failed"),
}


class Warning(enum.IntEnum):
    """What the board reports without stopping."""

    TEMPERATURE_HIGH = 1
    CURRENT_LIMITED = 2
    SUPPLY_LOW = 3
    PUMP_WEAK = 4
    FORCE_HIGH = 5
    TRAVEL_HIGH = 6
    SETPOINT_STALE = 7
    SETPOINT_MISSED = 8
    LOOP_LATE = 9
    LINK_ERRORS = 10
    SENSOR_NOISY = 11
    ON_TIME_NEAR = 12
    I2T_NEAR = 13
    MODEL_RESIDUAL_HIGH = 14
    RESISTANCE_DRIFT = 15


class Limiter(enum.IntEnum):
    """What holds the applied current below the setpoint; the strongest one if several do."""

    NONE = 0
    CURRENT = 1
    TEMPERATURE = 2
    I2T = 3
    SLEW = 4
    SUPPLY = 5
    FORCE = 6
    TRAVEL = 7
    PUMP = 8
    HOLD = 9
    GATE_OFF = 10


class Channel(enum.IntEnum):
    """Where a fault was seen."""

    NONE = 0
    SPRING_X = 1
    SPRING_Y = 2
    RTD_X = 3
    RTD_Y = 4
    RTD_INLET = 5
    RTD_AMBIENT = 6
    ENCODER = 7
    FORCE = 8
    SUPPLY = 9
    PUMP_X = 10
    PUMP_Y = 11
    LEAK = 12
    LOOP = 13
    LINK = 14
    PARAMETERS = 15


class ErrorCode(enum.IntEnum):
    """Why the board refused something."""

    UNKNOWN_TYPE = 1
    BAD_PAYLOAD = 2
    WRONG_SESSION = 3
    MAJOR_DIFFERS = 4
    SCHEMA_DIFFERS = 5
    PARAMETERS_DIFFER = 6
    NO_SUCH_AXIS = 7
    OUT_OF_RANGE = 8
    UNKNOWN_PARAMETER = 9
    UNKNOWN_FAULT = 10
    NOT_SAFE = 11
    NOT_ARMED = 12
    WRONG_STATE = 13
    TOKEN_INVALID = 14
    TOKEN_EXPIRED = 15
    SENSOR_INVALID = 16
    NOT_COLD = 17
    CURRENT_FLOWING = 18
    FAULT_ACTIVE = 19
    CLOCK_NOT_LOCKED = 20
    RATE_TOO_HIGH = 21
    SAVE_FAILED = 22


class ResetCause(enum.IntEnum):
    """Why the board started."""

    UNKNOWN = 0
    POWER_ON = 1
    PIN = 2
    SOFTWARE = 3
    WATCHDOG = 4
    BROWN_OUT = 5


class SetpointFlag(enum.IntFlag):
    """Switches that travel with a setpoint. STAGE: `stage_um` is meant."""

    DRAIN_X = 1
    DRAIN_Y = 2
    STAGE = 4


class ValidBit(enum.IntFlag):
    """Which readings of a STATE are valid."""

    I_X = 1 << 0
    I_Y = 1 << 1
    V_X = 1 << 2
    V_Y = 1 << 3
    RTD_X = 1 << 4
    RTD_Y = 1 << 5
    RTD_INLET = 1 << 6
    RTD_AMBIENT = 1 << 7
    ENCODER = 1 << 8
    FORCE = 1 << 9
    VBUS = 1 << 10
    SETPOINT = 1 << 11


class Capability(enum.IntFlag):
    """What a board has."""

    ENCODER = 1 << 0
    FORCE_SENSOR = 1 << 1
    VOLTAGE_SENSE = 1 << 2
    RTD_INLET = 1 << 3
    RTD_AMBIENT = 1 << 4
    DRAIN = 1 << 5
    STAGE = 1 << 6
    LEAK_SENSOR = 1 << 7
    PUMP_TACHO = 1 << 8
    PARAMETER_STORE = 1 << 9


def mask_of(members: Iterable[enum.IntEnum]) -> int:
    """Return the mask with the bit of each member set."""
    mask = 0
    for member in members:
        mask |= 1 << member
    return mask


def members_of(kind: type[_Member], mask: int) -> tuple[_Member, ...]:
    """Return the members of `kind` whose bit is set in `mask`; unknown bits are left out."""
    return tuple(member for member in kind if mask >> member & 1)
