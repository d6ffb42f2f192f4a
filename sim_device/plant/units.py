"""Units, and how each becomes the base unit of its quantity: the one table of conversions.

Parameter files, records of other programs and the command line read it.
"""

import math
from dataclasses import dataclass

ZERO_C = 273.15
"""0 °C in K."""


@dataclass(frozen=True)
class Unit:
    """A unit as it is written: value in the base unit `si` = value · `scale` + `offset`."""

    si: str
    scale: float
    offset: float = 0.0

    @property
    def quantity(self) -> str:
        """What it measures; empty for a compound that has no name here."""
        return _QUANTITIES.get(self.si, "")

    def to_si(self, value: float) -> float:
        return value * self.scale + self.offset

    def from_si(self, value: float) -> float:
        return (value - self.offset) / self.scale


_QUANTITIES = {
    "s": "time",
    "K": "temperature",
    "m": "length",
    "kg": "mass",
    "N": "force",
    "A": "current",
    "W": "power",
    "V": "voltage",
    "deg": "angle",
    "m/s": "speed",
    "deg/s": "rate of turning",
    "N m": "torque",
    "Pa": "pressure",
    "1": "ratio",
}

UNITS: dict[str, Unit] = {
    "1": Unit("1", 1.0),
    "pct": Unit("1", 1e-2),
    "s": Unit("s", 1.0),
    "ms": Unit("s", 1e-3),
    "us": Unit("s", 1e-6),
    "ns": Unit("s", 1e-9),
    "min": Unit("s", 60.0),
    "h": Unit("s", 3600.0),
    "Hz": Unit("Hz", 1.0),
    "mHz": Unit("Hz", 1e-3),
    "K": Unit("K", 1.0),
    "degC": Unit("K", 1.0, ZERO_C),
    "degF": Unit("K", 5.0 / 9.0, ZERO_C - 32.0 * 5.0 / 9.0),
    "cC": Unit("K", 0.01, ZERO_C),
    "K difference": Unit("K difference", 1.0),
    "K/s": Unit("K/s", 1.0),
    "m": Unit("m", 1.0),
    "cm": Unit("m", 1e-2),
    "mm": Unit("m", 1e-3),
    "um": Unit("m", 1e-6),
    "in": Unit("m", 25.4e-3),
    "kg": Unit("kg", 1.0),
    "g": Unit("kg", 1e-3),
    "kg/m3": Unit("kg/m3", 1.0),
    "N": Unit("N", 1.0),
    "mN": Unit("N", 1e-3),
    "kN": Unit("N", 1e3),
    "gf": Unit("N", 9.80665e-3),
    "kgf": Unit("N", 9.80665),
    "lbf": Unit("N", 4.4482216152605),
    "N/m": Unit("N/m", 1.0),
    "N m": Unit("N m", 1.0),
    "mN m": Unit("N m", 1e-3),
    "Pa": Unit("Pa", 1.0),
    "kPa": Unit("Pa", 1e3),
    "MPa": Unit("Pa", 1e6),
    "GPa": Unit("Pa", 1e9),
    "bar": Unit("Pa", 1e5),
    "mbar": Unit("Pa", 1e2),
    "psi": Unit("Pa", 6894.757293168361),
    "Pa/K": Unit("Pa/K", 1.0),
    "MPa/K": Unit("Pa/K", 1e6),
    "A": Unit("A", 1.0),
    "mA": Unit("A", 1e-3),
    "uA": Unit("A", 1e-6),
    "V": Unit("V", 1.0),
    "mV": Unit("V", 1e-3),
    "uV": Unit("V", 1e-6),
    "Ohm": Unit("Ohm", 1.0),
    "Ohm m": Unit("Ohm m", 1.0),
    "uOhm m": Unit("Ohm m", 1e-6),
    "1/K": Unit("1/K", 1.0),
    "W": Unit("W", 1.0),
    "mW": Unit("W", 1e-3),
    "kW": Unit("W", 1e3),
    "W/(m K)": Unit("W/(m K)", 1.0),
    "J/(kg K)": Unit("J/(kg K)", 1.0),
    "J/kg": Unit("J/kg", 1.0),
    "m/s": Unit("m/s", 1.0),
    "cm/s": Unit("m/s", 1e-2),
    "mm/s": Unit("m/s", 1e-3),
    "m2/s": Unit("m2/s", 1.0),
    "m3/s": Unit("m3/s", 1.0),
    "mm3/s": Unit("m3/s", 1e-9),
    "deg": Unit("deg", 1.0),
    "rad": Unit("deg", math.degrees(1.0)),
    "rev": Unit("deg", 360.0),
    "deg/s": Unit("deg/s", 1.0),
    "rad/s": Unit("deg/s", math.degrees(1.0)),
    "rpm": Unit("deg/s", 6.0),
    "deg/mm": Unit("deg/m", 1e3),
    "deg/m": Unit("deg/m", 1.0),
}
