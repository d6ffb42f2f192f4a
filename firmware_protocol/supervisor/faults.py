"""What each fault means to a person, and what the pumps do while it stands."""

from __future__ import annotations

from dataclasses import dataclass

from firmware_protocol.enums import Fault


@dataclass(frozen=True, slots=True)
class FaultText:
    """What a person should know about a fault."""

    unit: str
    """Unit of the measured value and of the limit in a FAULT report."""
    pumps: bool
    """Whether the pumps may run in FAULT while this fault stands."""
    cause: str
    remedy: str
    clears: bool = True
    """Whether CLEAR_FAULT ends it, and not a power cycle alone."""


FAULT_TEXTS: dict[Fault, FaultText] = {
    Fault.NONE: FaultText("", False, "No fault stands.", "There is nothing to do."),
    Fault.SELF_TEST: FaultText(
        "",
        False,
        "The board failed its self-test.",
        "Power-cycle the board. If it comes back, replace the board.",
    ),
    Fault.PARAM_CRC: FaultText(
        "",
        True,
        "The parameters in the board's memory do not match their checksum.",
        "The compiled limits hold. Set the parameters again, save them, then clear the fault.",
    ),
    Fault.BROWN_OUT: FaultText(
        "mV",
        False,
        "The supply voltage fell below what the driver needs.",
        "Check the power supply, its current limit and its cables. The pumps stay off.",
    ),
    Fault.LOOP_OVERRUN: FaultText(
        "us",
        True,
        "The board's loop took much longer than a sample, so the heater ran unsupervised.",
        "Lower the sample rate, or report this firmware fault with the link statistics.",
    ),
    Fault.SETPOINT_LOST: FaultText(
        "us",
        True,
        "The armed board got no fresh setpoint for over half a second: the daemon stopped, "
        "the cable came loose, or the computer was too busy.",
        "Look into the daemon's log. Then clear the fault and arm again.",
    ),
    Fault.OVER_TEMPERATURE: FaultText(
        "cC",
        True,
        "A spring got hotter than the limit although the current is folded back below it.",
        "Let it cool. Look for a dry tube, a driver that does not follow, or a slow sensor.",
    ),
    Fault.SENSOR_INVALID: FaultText(
        "cC",
        True,
        "A sensor gives no value or the end of its range: converter failed, load cell "
        "overloaded, or encoder signal lost.",
        "The channel of the fault names the sensor. Check its plug and converter, then reset the "
        "board: the converter of an RTD keeps its fault.",
    ),
    Fault.SENSOR_OPEN: FaultText(
        "cC",
        True,
        "A temperature sensor reads full scale: a wire is broken or unplugged.",
        "Check the sensor's plug and cable.",
    ),
    Fault.SENSOR_SHORT: FaultText(
        "cC",
        True,
        "A temperature sensor reads below any possible room: its wires touch.",
        "Check the sensor's cable for a short, and the seals for water.",
    ),
    Fault.SENSOR_STUCK: FaultText(
        "us",
        True,
        "A spring's temperature reading stayed constant for seconds of heating.",
        "Power-cycle the board; if it comes back, check the converter.",
    ),
    Fault.SENSOR_IMPLAUSIBLE: FaultText(
        "cC",
        True,
        "A temperature jumps faster than the spring can change, or is below its surroundings.",
        "Check for a loose contact, a wrong calibration, or another type of sensor.",
    ),
    Fault.SENSORS_SWAPPED: FaultText(
        "cC",
        True,
        "One spring is heated and the other one's sensor warms.",
        "Swap the plugs of the two sensors, or of the two heaters.",
    ),
    Fault.NOT_HEATING: FaultText(
        "mJ",
        True,
        "Energy for several degrees went into a spring, and its sensor shows nothing.",
        "Check that the sensor touches the spring and the spring is in its tube.",
    ),
    Fault.UNCOMMANDED_CURRENT: FaultText(
        "mA",
        True,
        "Current flows without a setpoint: the driver failed short, or the gate is stuck.",
        "Switch off the power. Replace the driver before heating again.",
    ),
    Fault.HEATING_WHILE_OFF: FaultText(
        "cC",
        True,
        "A spring goes on warming long after its current stopped.",
        "Switch off the power. Check current sense, driver, and the sensor's contact.",
    ),
    Fault.MODEL_RESIDUAL: FaultText(
        "cC",
        True,
        "A spring's temperature left the range of all good benches for the energy that went in.",
        "Check the sensor's contact, the water, and the current sense.",
    ),
    Fault.RESISTANCE_OUT_OF_BAND: FaultText(
        "mohm",
        True,
        "Voltage over current is not the resistance of a spring.",
        "Look for a bad contact (high) or touching coils or leads (low).",
    ),
    Fault.RESISTANCE_RTD_DISAGREE: FaultText(
        "permille",
        True,
        "The spring's resistance changed more than its temperature sensor can explain.",
        "Check that the sensor touches the spring; then look for a contact that warms up.",
    ),
    Fault.CURRENT_HIGH: FaultText(
        "mA",
        True,
        "More current flows than the board regulates to: driver shorted, or wrong gain.",
        "Switch off the power. Calibrate or replace the driver.",
    ),
    Fault.CURRENT_LOW: FaultText(
        "mA",
        True,
        "Less current flows than the board regulates to: wrong gain, or weak supply.",
        "Check the supply voltage, then the driver's calibration.",
    ),
    Fault.WIRE_OPEN: FaultText(
        "mV",
        True,
        "Full driver voltage without current: the spring's circuit is open.",
        "Check the spring, its crimps and leads.",
    ),
    Fault.DRIVER_OPEN: FaultText(
        "mA",
        True,
        "The driver gives neither voltage nor current.",
        "Check the driver's supply and fuse. Replace the driver.",
    ),
    Fault.I2T: FaultText(
        "A2s",
        True,
        "The wire carried too much current for too long, although the ceiling was lowered.",
        "The driver ignores its ceiling: calibrate or replace it.",
    ),
    Fault.ARMED_TOO_LONG: FaultText(
        "s",
        True,
        "The bench was armed without a break for longer than the limit.",
        "Disarm, look at the bench, arm again.",
    ),
    Fault.PUMP_DRY: FaultText(
        "rpm",
        False,
        "A pump turns too fast: it runs without water.",
        "Fill the tank, bleed the tube. The pumps stay off.",
    ),
    Fault.PUMP_STALLED: FaultText(
        "rpm",
        False,
        "A driven pump does not turn: blocked, or without supply.",
        "Clean or replace the pump. The pumps stay off.",
    ),
    Fault.PUMP_STUCK_ON: FaultText(
        "rpm",
        True,
        "A pump turns although it is switched off.",
        "Its driver failed short. Unplug the pump, replace the driver.",
    ),
    Fault.NO_COOLING: FaultText(
        "cC",
        True,
        "A pump runs and its hot spring does not cool.",
        "Look for a blocked or pinched tube, or a pump that moves no water.",
    ),
    Fault.LEAK: FaultText(
        "",
        False,
        "The leak sensor is wet.",
        "Switch off the power, dry the bench, find the leak. The pumps stay off.",
    ),
    Fault.ESTOP_PRESSED: FaultText(
        "",
        False,
        "Somebody asked for the emergency stop.",
        "When it is safe again, power-cycle the board.",
        clears=False,
    ),
    Fault.OVER_CURRENT: FaultText(
        "mA",
        True,
        "More current flows than any setpoint may ask for: the driver failed short.",
        "Switch off the power. Replace the driver before heating again.",
    ),
}
"""Every fault of the enumeration."""


def explain(fault: Fault) -> str:
    """Return what caused `fault` and what to do about it, in plain words."""
    text = FAULT_TEXTS[fault]
    return f"{fault.name}: {text.cause} {text.remedy}"
