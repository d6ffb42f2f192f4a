"""The electronics between sensors and chip, both ways: units to raw codes, and codes to units.

`encode` is what the parts on the wiring page do to a measurement; `decode` is what the firmware's
conversions make of the codes, in the same whole numbers, written a second time so that the two
can be compared. One code of the converters is 4.9 mA, 14.7 mV, 19.5 mV and about 3.4 cC.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

from firmware_protocol.supervisor import Measurements, RTD_INVALID_cC
from sim_device.hardware import Hardware, RTD_RAIL_HIGH_cC, RTD_RAIL_LOW_cC

ADC_CODES = 1024
CURRENT_FULL_mA = 5000
SPRING_FULL_mV = 15_000
SUPPLY_FULL_mV = 20_000

RTD_FULL = 32_768
RTD_REFERENCE_ohm = 430.0
RTD_R0_ohm = 100.0
RTD_TABLE_STEP = 256
RTD_FAULT = 1
_A, _B, _C = 3.9083e-3, -5.775e-7, -4.183e-12

BRIDGE_MOST = 8_388_607
PULSE_RPM_us = 30_000_000
"""Two pulses a revolution: rpm times the time between two of them."""

INPUT_LEAK = 1
INPUT_ENCODER_ALARM = 2


@dataclass(frozen=True, slots=True)
class Codes:
    """What the chip reads. `analog`: i_x, i_y, v_x, v_y, supply."""

    analog: tuple[int, int, int, int, int]
    rtd: tuple[int, int, int, int]
    bridge: int
    encoder: int
    tacho_us: tuple[int, int]
    inputs: int


def encode(m: Measurements, hardware: Hardware) -> Codes:
    """Return the codes of a measurement; what is beyond a converter's range is at its end."""
    analog = (
        _analog(m.i_mA[0], CURRENT_FULL_mA),
        _analog(m.i_mA[1], CURRENT_FULL_mA),
        _analog(m.v_mV[0], SPRING_FULL_mV),
        _analog(m.v_mV[1], SPRING_FULL_mV),
        _analog(m.vbus_mV, SUPPLY_FULL_mV),
    )
    r = m.rtd_cC
    bridge = BRIDGE_MOST if m.force_invalid else hardware.force_counts
    alarm = INPUT_ENCODER_ALARM if m.encoder_invalid else 0
    return Codes(
        analog=analog,
        rtd=(rtd_register(r[0]), rtd_register(r[1]), rtd_register(r[2]), rtd_register(r[3])),
        bridge=max(-BRIDGE_MOST - 1, min(BRIDGE_MOST, bridge)),
        encoder=hardware.encoder_counts,
        tacho_us=(_pulse_us(m.pump_rpm[0]), _pulse_us(m.pump_rpm[1])),
        inputs=(INPUT_LEAK if m.leak else 0) | alarm,
    )


def decode(codes: Codes, m: Measurements) -> None:
    """Put into `m`, in place, what the firmware reads from the codes."""
    a = codes.analog
    for k in (0, 1):
        m.i_mA[k] = (a[k] * CURRENT_FULL_mA + ADC_CODES // 2) // ADC_CODES
        m.v_mV[k] = (a[2 + k] * SPRING_FULL_mV + ADC_CODES // 2) // ADC_CODES
        m.pump_rpm[k] = _rpm(codes.tacho_us[k])
    m.vbus_mV = (a[4] * SUPPLY_FULL_mV + ADC_CODES // 2) // ADC_CODES
    for j, register in enumerate(codes.rtd):
        m.rtd_cC[j] = rtd_cC(register)
    m.leak = int(codes.inputs & INPUT_LEAK != 0)
    m.encoder_invalid = int(codes.inputs & INPUT_ENCODER_ALARM != 0)
    m.force_invalid = int(not -BRIDGE_MOST - 1 < codes.bridge < BRIDGE_MOST)


def resistance_ohm(t_degC: float) -> float:
    """Return the resistance of a Pt100: Callendar and Van Dusen's equation, IEC 60751."""
    tail = _C * (t_degC - 100.0) * t_degC**3 if t_degC < 0 else 0.0
    return RTD_R0_ohm * (1.0 + _A * t_degC + _B * t_degC**2 + tail)


def rtd_register(t_cC: int) -> int:
    """Return the register of an RTD converter for a reading of the simulated sensor."""
    if t_cC == RTD_INVALID_cC:
        return RTD_FAULT
    if t_cC >= RTD_RAIL_HIGH_cC:
        return (RTD_FULL - 1) << 1
    if t_cC <= RTD_RAIL_LOW_cC:
        return 0
    code = round(resistance_ohm(t_cC / 100.0) / RTD_REFERENCE_ohm * RTD_FULL)
    return max(1, min(RTD_FULL - 1, code)) << 1


def rtd_cC(register: int) -> int:
    """Return what the firmware reads from an RTD register."""
    code = register >> 1
    if code == RTD_FULL - 1:
        return RTD_RAIL_HIGH_cC
    if register & RTD_FAULT:
        return RTD_INVALID_cC
    if code == 0:
        return RTD_RAIL_LOW_cC
    index, part = divmod(code, RTD_TABLE_STEP)
    table = rtd_table()
    if index >= len(table) - 1:
        return RTD_RAIL_HIGH_cC
    low, high = table[index], table[index + 1]
    return low + ((high - low) * part + RTD_TABLE_STEP // 2) // RTD_TABLE_STEP


@functools.cache
def rtd_table() -> tuple[int, ...]:
    """Return the temperature in cC of each 256th code, to the first at the end of 16 bits."""
    entries: list[int] = []
    while not entries or entries[-1] < RTD_RAIL_HIGH_cC:
        wanted_ohm = len(entries) * RTD_TABLE_STEP / RTD_FULL * RTD_REFERENCE_ohm
        low, high = -250.0, 900.0
        for _ in range(60):
            middle = (low + high) / 2.0
            low, high = (middle, high) if resistance_ohm(middle) < wanted_ohm else (low, middle)
        entries.append(max(RTD_RAIL_LOW_cC, min(RTD_RAIL_HIGH_cC, round(low * 100.0))))
    return tuple(entries)


def _analog(value: int, full: int) -> int:
    return max(0, min(ADC_CODES - 1, round(value * ADC_CODES / full)))


def _rpm(period_us: int) -> int:
    return min(PULSE_RPM_us // 2 // max(period_us // 2, 1), 0xFFFF) if period_us else 0


def _pulse_us(rpm: int) -> int:
    return round(PULSE_RPM_us / rpm) if rpm > 0 else 0
