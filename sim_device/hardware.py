"""The parts between the firmware and the plant: gate, drivers, pumps, converters, and their faults.

`drive` turns what the firmware wants into what the springs get; `measure` turns what the plant
shows into the integers the firmware reads. Every part has a few fields that say how it is broken;
with none set, both are plain scaling. Fault injection (see faults) only ever sets such fields.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from firmware_protocol.supervisor import Measurements, Memory, RTD_INVALID_cC
from sim_device.plant import Drive, Readings

RTD_RAIL_HIGH_cC = 32_767
RTD_RAIL_LOW_cC = -24_200
FORCE_RAIL_counts = 50_000
I16_MOST, U16_MOST, I32_MOST = 0x7FFF, 0xFFFE, 0x7FFF_FFFF
"""Most that a field of STATE can tell: one less than all where that stands for "no reading"."""
PUMP_FULL_rpm = 6000
PUMP_LAG_s = 0.15
DRIVER_DROP_V = 0.5
SUPPLY_MOST_A = 10.0
CONVERTER_NOISE_K = 0.02


@dataclass(slots=True)
class Driver:
    """A current source with its spring's wiring. `mode`: ok, short, open (the FET), or cut (the
    wire)."""

    mode: str = "ok"
    gain: float = 1.0


@dataclass(slots=True)
class Pump:
    """A pump with its tachometer.

    `mode`: ok, dry, stalled, stuck_on, or blocked (turns, moves no water).
    """

    mode: str = "ok"
    rpm: float = 0.0


@dataclass(slots=True)
class Rtd:
    """An RTD with its converter.

    `mode`: ok, open, short, invalid, stuck, detached (lag `value` s, and a sinusoid of `swing_K`
    from end to end and `period_s`), offset (by `value` K), or spikes (`value` K, every `every`-th
    sample).
    """

    mode: str = "ok"
    value: float = 0.0
    every: int = 40
    swing_K: float = 0.0
    period_s: float = 2.0
    phase: float = 0.0
    held_degC: float = math.nan
    count: int = 0
    noise: random.Random = field(default_factory=lambda: random.Random(0))


@dataclass(slots=True)
class Hardware:
    """All parts of one axis, and what is wrong with them."""

    drivers: tuple[Driver, Driver] = field(default_factory=lambda: (Driver(), Driver()))
    pumps: tuple[Pump, Pump] = field(default_factory=lambda: (Pump(), Pump()))
    rtds: tuple[Rtd, Rtd, Rtd, Rtd] = field(default_factory=lambda: (Rtd(), Rtd(), Rtd(), Rtd()))
    rtds_swapped: bool = False
    supply_V: float | None = None
    leak: bool = False
    encoder_slip_counts: int = 0
    encoder_lost: bool = False
    force_saturated: bool = False
    encoder_per_m: float = 1e6
    encoder_offset: float = 0.0
    force_per_N: float = 1e3
    force_offset: float = 0.0
    encoder_counts: int = 0
    force_counts: int = 0
    broken: bool = False
    """Set whenever a fault touches a part; while False the short ways are taken."""
    _inputs: tuple[int, ...] = ()
    _drive: Drive = field(default_factory=Drive)
    _load_ohm: tuple[float, float] = (0.76, 0.76)

    def set_scales(
        self, *, encoder_nm: int, encoder_offset: int, force_uN: int, force_offset: int
    ) -> None:
        """Take over the scales: size of one count, and the count at zero."""
        self.encoder_per_m = 1e9 / (encoder_nm or 1)
        self.encoder_offset = float(encoder_offset)
        self.force_per_N = 1e6 / (force_uN or 1)
        self.force_offset = float(force_offset)

    def drive(self, s: Memory, drain: tuple[bool, bool], stage_m: float) -> Drive:
        """Return what the springs and pumps get for what the firmware wants."""
        a, d = s.applied_mA, s.duty
        inputs = (s.gate, a[0], a[1], d[0], d[1], drain[0], drain[1], int(stage_m * 1e6))
        if inputs == self._inputs and not self.broken:
            return self._drive
        self._inputs = inputs
        if self.broken:
            supply_V = 12.0 if self.supply_V is None else self.supply_V
            i_A = tuple(self._current_A(s, k, supply_V) for k in (0, 1))
            duty = tuple(self._flow_duty(s.duty[k], k) for k in (0, 1))
        else:
            i_A = (a[0] * 1e-3, a[1] * 1e-3) if s.gate else (0.0, 0.0)
            duty = (d[0] / 255.0, d[1] / 255.0)
        self._drive = Drive((i_A[0], i_A[1]), (duty[0], duty[1]), drain, stage_m)
        return self._drive

    def _current_A(self, s: Memory, k: int, supply_V: float) -> float:
        """Current of spring k. The gate sits before the driver and cuts a shorted one too."""
        driver = self.drivers[k]
        if not s.gate or driver.mode in ("open", "cut"):
            return 0.0
        if driver.mode == "short":
            return min(supply_V / self._load_ohm[k], SUPPLY_MOST_A)
        possible_A = max(supply_V - DRIVER_DROP_V, 0.0) / self._load_ohm[k]
        return min(s.applied_mA[k] * 1e-3 * driver.gain, possible_A)

    def _flow_duty(self, duty: int, k: int) -> float:
        """Duty that moves water."""
        mode = self.pumps[k].mode
        if mode == "stuck_on":
            return 1.0
        return duty / 255.0 if mode == "ok" else 0.0

    def spin(self, duty: Sequence[int], dt_s: float) -> None:
        """Advance the speeds of the pumps."""
        for pump, pump_duty in zip(self.pumps, duty, strict=True):
            if pump.mode == "ok" and pump_duty == 0 and pump.rpm < 1.0:
                pump.rpm = 0.0
                continue
            target = PUMP_FULL_rpm * pump_duty / 255.0
            if pump.mode == "dry":
                target *= 1.8
            elif pump.mode == "stalled":
                target = 0.0
            elif pump.mode == "stuck_on":
                target = PUMP_FULL_rpm
            pump.rpm += (target - pump.rpm) * min(1.0, dt_s / PUMP_LAG_s)

    def measure(self, r: Readings, s: Memory, m: Measurements, dt_s: float) -> None:
        """Convert the plant's readings to integers, in place; what is broken shows here.

        However far a reading is, its converter goes no further than STATE can tell.
        """
        m.applied_mA[0], m.applied_mA[1] = s.applied_mA
        m.duty[0], m.duty[1] = s.duty
        i_mA, v_mV, rtd_cC = m.i_mA, m.v_mV, m.rtd_cC
        i, v, t = r.i_A, r.v_V, r.rtd_degC
        i_mA[0] = min(max(round(i[0] * 1e3), -I16_MOST), I16_MOST)
        i_mA[1] = min(max(round(i[1] * 1e3), -I16_MOST), I16_MOST)
        v_mV[0] = min(max(round(v[0] * 1e3), -I16_MOST), U16_MOST)
        v_mV[1] = min(max(round(v[1] * 1e3), -I16_MOST), U16_MOST)
        rtd_cC[0] = min(max(round(t[0] * 100.0), RTD_RAIL_LOW_cC), RTD_RAIL_HIGH_cC)
        rtd_cC[1] = min(max(round(t[1] * 100.0), RTD_RAIL_LOW_cC), RTD_RAIL_HIGH_cC)
        rtd_cC[2] = min(max(round(t[2] * 100.0), RTD_RAIL_LOW_cC), RTD_RAIL_HIGH_cC)
        rtd_cC[3] = min(max(round(t[3] * 100.0), RTD_RAIL_LOW_cC), RTD_RAIL_HIGH_cC)
        m.vbus_mV = _supply_mV(r.supply_V)
        self.encoder_counts = self._unslipped(r)
        self.force_counts = round(r.force_N * self.force_per_N + self.force_offset)
        self.spin(s.duty, dt_s)
        m.pump_rpm[0] = int(self.pumps[0].rpm)
        m.pump_rpm[1] = int(self.pumps[1].rpm)
        if self.broken:
            self._measure_broken(r, s, m, dt_s)

    def encoder_at(self, r: Readings) -> int:
        """Return what the encoder counts at these readings."""
        return self._unslipped(r) + self.encoder_slip_counts

    def _unslipped(self, r: Readings) -> int:
        return round(r.displacement_m * self.encoder_per_m + self.encoder_offset)

    def _measure_broken(self, r: Readings, s: Memory, m: Measurements, dt_s: float) -> None:
        """Spoil the measurements as the broken parts would."""
        if self.supply_V is not None:
            m.vbus_mV = _supply_mV(self.supply_V)
        for k, driver in enumerate(self.drivers):
            if r.i_A[k] > 0.1:
                self._load_ohm = _with(self._load_ohm, k, r.v_V[k] / r.i_A[k])
            if driver.mode == "cut" and s.gate and s.applied_mA[k] > 0:
                m.v_mV[k] = m.vbus_mV - round(DRIVER_DROP_V * 1e3)
        rtd_degC = list(r.rtd_degC)
        if self.rtds_swapped:
            rtd_degC[0], rtd_degC[1] = rtd_degC[1], rtd_degC[0]
        for j, rtd in enumerate(self.rtds):
            m.rtd_cC[j] = _convert(rtd, rtd_degC[j], dt_s)
        m.leak = int(self.leak)
        self.encoder_counts += self.encoder_slip_counts
        m.encoder_invalid = int(self.encoder_lost)
        m.force_invalid = int(self.force_saturated)
        if self.force_saturated:
            self.force_counts = FORCE_RAIL_counts
        self.encoder_counts = _between(self.encoder_counts, -I32_MOST, I32_MOST)
        self.force_counts = _between(self.force_counts, -I32_MOST, I32_MOST)


def _between(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


def _supply_mV(supply_V: float) -> int:
    return _between(round(supply_V * 1e3), 0, U16_MOST)


def _rtd_cC(shown_degC: float) -> int:
    """What a converter gives for a temperature, which goes no further than its rails."""
    return round(min(max(shown_degC * 100.0, RTD_RAIL_LOW_cC), RTD_RAIL_HIGH_cC))


def _with(pair: tuple[float, float], k: int, value: float) -> tuple[float, float]:
    return (value, pair[1]) if k == 0 else (pair[0], value)


def _convert(rtd: Rtd, shown_degC: float, dt_s: float) -> int:
    """Return what the converter of an RTD gives for a true temperature."""
    if math.isnan(rtd.held_degC) or rtd.mode not in ("stuck", "detached"):
        rtd.held_degC = shown_degC
    if rtd.mode == "open":
        return RTD_RAIL_HIGH_cC
    if rtd.mode == "short":
        return RTD_RAIL_LOW_cC
    if rtd.mode == "invalid":
        return RTD_INVALID_cC
    if rtd.mode == "detached":
        rtd.held_degC += (shown_degC - rtd.held_degC) * min(1.0, dt_s / rtd.value)
        rtd.phase += 2.0 * math.pi * dt_s / max(rtd.period_s, 1e-3)
        swing_K = 0.5 * rtd.swing_K * math.sin(rtd.phase)
        # The lag smooths what the plant shows, but not the converter's own noise.
        return _rtd_cC(rtd.held_degC + swing_K + rtd.noise.gauss(0.0, CONVERTER_NOISE_K))
    reading = rtd.held_degC
    if rtd.mode == "offset":
        reading += rtd.value
    elif rtd.mode == "spikes":
        rtd.count += 1
        if rtd.count % rtd.every == 0:
            reading += rtd.value
    return _rtd_cC(reading)
