"""Units that a parameter file may use, and how each becomes SI."""

from __future__ import annotations

from dataclasses import dataclass

ZERO_C = 273.15
"""0 °C in K."""


@dataclass(frozen=True)
class Unit:
    """A unit as written in a file: `si = value * scale + offset`, in the unit named `si`."""

    si: str
    scale: float
    offset: float = 0.0

    def to_si(self, value: float) -> float:
        return value * self.scale + self.offset

    def from_si(self, value: float) -> float:
        return (value - self.offset) / self.scale


UNITS: dict[str, Unit] = {
    "1": Unit("1", 1.0),
    "m": Unit("m", 1.0),
    "mm": Unit("m", 1e-3),
    "um": Unit("m", 1e-6),
    "N": Unit("N", 1.0),
    "mN": Unit("N", 1e-3),
    "N/m": Unit("N/m", 1.0),
    "Pa": Unit("Pa", 1.0),
    "MPa": Unit("Pa", 1e6),
    "GPa": Unit("Pa", 1e9),
    "Pa/K": Unit("Pa/K", 1.0),
    "MPa/K": Unit("Pa/K", 1e6),
    "K": Unit("K", 1.0),
    "degC": Unit("K", 1.0, ZERO_C),
    "K difference": Unit("K difference", 1.0),
    "kg/m3": Unit("kg/m3", 1.0),
    "W/(m K)": Unit("W/(m K)", 1.0),
    "J/(kg K)": Unit("J/(kg K)", 1.0),
    "J/kg": Unit("J/kg", 1.0),
    "Ohm": Unit("Ohm", 1.0),
    "Ohm m": Unit("Ohm m", 1.0),
    "uOhm m": Unit("Ohm m", 1e-6),
    "1/K": Unit("1/K", 1.0),
    "m2/s": Unit("m2/s", 1.0),
    "m3/s": Unit("m3/s", 1.0),
    "mm3/s": Unit("m3/s", 1e-9),
    "A": Unit("A", 1.0),
    "mA": Unit("A", 1e-3),
    "V": Unit("V", 1.0),
    "mV": Unit("V", 1e-3),
    "s": Unit("s", 1.0),
    "deg/mm": Unit("deg/m", 1e3),
    "deg/m": Unit("deg/m", 1.0),
}
