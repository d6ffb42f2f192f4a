"""Every number on the wire that stands for a word: states, faults, limiters, codes and bits.

`SetpointFlag`, `ValidBit` and `Capability` are bits already. Faults and warnings travel both as
numbers and as words with one bit each: `faults_in` and `warnings_in` read those.
"""

from __future__ import annotations

import enum


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
    """What the board stops for; NONE stands for no fault. Numbers never change.

    In the `faults` word of STATE, fault n is bit n - 1 (`fault_bit`). Unit, cause and remedy of
    each are in the supervisor's table.
    """

    NONE = 0
    SELF_TEST = 1
    PARAM_CRC = 2
    BROWN_OUT = 3
    LOOP_OVERRUN = 4
    SETPOINT_LOST = 5
    OVER_TEMPERATURE = 6
    SENSOR_INVALID = 7
    SENSOR_OPEN = 8
    SENSOR_SHORT = 9
    SENSOR_STUCK = 10
    SENSOR_IMPLAUSIBLE = 11
    SENSORS_SWAPPED = 12
    NOT_HEATING = 13
    UNCOMMANDED_CURRENT = 14
    HEATING_WHILE_OFF = 15
    MODEL_RESIDUAL = 16
    RESISTANCE_OUT_OF_BAND = 17
    RESISTANCE_RTD_DISAGREE = 18
    CURRENT_HIGH = 19
    CURRENT_LOW = 20
    WIRE_OPEN = 21
    DRIVER_OPEN = 22
    I2T = 23
    ARMED_TOO_LONG = 24
    PUMP_DRY = 25
    PUMP_STALLED = 26
    PUMP_STUCK_ON = 27
    NO_COOLING = 28
    LEAK = 29
    ESTOP_PRESSED = 30
    OVER_CURRENT = 31


class Warning(enum.IntEnum):
    """What the board reports without stopping; the number is the bit in `warnings` of STATE."""

    SETPOINT_STALE = 0
    RTD_JUMP = 1
    NEAR_TEMPERATURE_LIMIT = 2
    NEAR_I2T_LIMIT = 3
    SUPPLY_LOW = 4
    LOOP_LATE = 5
    COOL_CAP = 6
    SENSOR_INVALID = 7


class Limiter(enum.IntEnum):
    """What holds the applied current below the setpoint; the most severe one if several do."""

    NONE = 0
    SLEW = 1
    MAXIMUM = 2
    I2T = 3
    TEMPERATURE = 4
    GATE = 5


class Channel(enum.IntEnum):
    """Where a fault was seen. The RTDs come first, in the order of STATE.rtd_cC."""

    SPRING_X = 0
    SPRING_Y = 1
    INLET = 2
    AMBIENT = 3
    BOARD = 4
    ENCODER = 5
    FORCE = 6


class ErrorCode(enum.IntEnum):
    """Why the board refused something.

    The codes below 32 are the supervisor's refusals; the others are the session's. UNKNOWN stands
    for a code of a newer board.
    """

    UNKNOWN = 0
    WRONG_STATE = 1
    NO_SESSION = 2
    SCHEMA_DIFFERS = 3
    PARAMETERS_DIFFER = 4
    CLOCK_UNLOCKED = 5
    SENSOR_INVALID = 6
    TOO_HOT = 7
    CURRENT_FLOWING = 8
    FAULT_PRESENT = 9
    SUPPLY_LOW = 10
    TOKEN_WRONG = 11
    TOKEN_EXPIRED = 12
    WRONG_FAULT = 13
    CAUSE_REMAINS = 14
    SETPOINT_STALE = 15
    UNKNOWN_TYPE = 32
    BAD_PAYLOAD = 33
    MAJOR_DIFFERS = 34
    NO_SUCH_AXIS = 35
    OUT_OF_RANGE = 36
    UNKNOWN_PARAMETER = 37
    NO_SUCH_REPORT = 38
    RATE_TOO_HIGH = 39
    SAVE_FAILED = 40


class ParameterKind(enum.IntEnum):
    """Type of a parameter's value."""

    NUMBER = 0
    CHOICE = 1
    SWITCH = 2


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


def fault_bit(fault: Fault) -> int:
    """Return the bit of a fault in the `faults` word of STATE, 0 for NONE."""
    return 1 << (fault - 1) if fault else 0


def faults_in(word: int) -> tuple[Fault, ...]:
    """Return the faults whose bits are set in `word`, lowest number first."""
    return tuple(fault for fault in Fault if word & fault_bit(fault))


def warnings_in(word: int) -> tuple[Warning, ...]:
    """Return the warnings whose bits are set in `word`, unknown bits left out."""
    return tuple(warning for warning in Warning if word >> warning & 1)
