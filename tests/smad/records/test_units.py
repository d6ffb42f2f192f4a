"""Units that names end with."""

from __future__ import annotations

import numpy as np
import pytest

from smad.errors import LogImportError
from smad.records.units import convert
from smad.units import parted_name, units_for


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("torque_N_m", "torque", "N m"), ("stiffness_N_m", "stiffness", "N/m"),
        ("stiffness_N_m_rad", "stiffness", "N m/rad"), ("motor_K_N_m_A", "motor_K", "N m/A"),
        ("leak_L_min_bar", "leak", "L/(min bar)"), ("flow_L_min", "flow", "L/min"),
        ("gain_mm_V", "gain", "mm/V"), ("damping_N_s_mm", "damping", "N s/mm"),
        ("arm_m_kg", "arm_m", "kg"), ("rod_L_m", "rod_L", "m"), ("power_in_W", "power_in", "W"),
        ("flow_in", "flow_in", ""), ("yaw_psi", "yaw_psi", ""),
        ("angle_rad_rate", "angle_rate", "rad/s"),
        ("supply [PSI]", "supply", "psi"), ("air_hPa", "air", "mbar"),
    ],
)  # fmt: skip
def test_a_name_ends_with_a_unit_or_a_compound_of_units(
    name: str, quantity: str, unit: str
) -> None:
    assert parted_name(name) == (quantity, unit)


@pytest.mark.parametrize(
    ("unit", "to", "factor"),
    [
        ("m3/s", "L/min", 60000.0), ("mL/min", "L/min", 1e-3), ("l/min", "L/min", 1.0),
        ("L/s", "m³/s", 1e-3), ("L/(min bar)", "m3/(s Pa)", 1e-5 / 60000.0),
        ("degC/min", "K/s", 1.0 / 60.0), ("rpm", "rad/s", np.pi / 30.0), ("kJ/kg", "J/kg", 1e3),
        ("N mm", "N m", 1e-3), ("g/cm3", "kg/m3", 1e3), ("degF", "degC", None),
        ("psi", "bar", 0.06894757293), ("mbar", "Pa", 100.0),
    ],
)  # fmt: skip
def test_a_quotient_or_product_of_known_units_is_converted(
    unit: str, to: str, factor: float | None
) -> None:
    (zero, one) = convert(np.array([0.0, 1.0]), unit, to).tolist()
    if factor is None:  # a unit of the table keeps its zero
        assert (zero, one) == pytest.approx((-160.0 / 9.0, -155.0 / 9.0))
    else:
        assert (zero, one) == pytest.approx((0.0, factor))


@pytest.mark.parametrize("unit", ["L", "L/min/bar", "m/s", "furlong/s", ""])
def test_a_unit_of_another_quantity_is_refused_with_those_that_fit(unit: str) -> None:
    with pytest.raises(LogImportError, match=r"allowed: L/min, m3/s, mm3/s; correct the unit"):
        convert(np.ones(1), unit, "L/min")
    assert units_for("L/min") == ["L/min", "m3/s", "mm3/s"]
