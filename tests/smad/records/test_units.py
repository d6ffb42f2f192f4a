"""Units that names end with."""

from __future__ import annotations

import pytest

from smad.units import parted_name


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("torque_N_m", "torque", "N m"), ("stiffness_N_m", "stiffness", "N/m"),
        ("stiffness_N_m_rad", "stiffness", "N m/rad"), ("motor_K_N_m_A", "motor_K", "N m/A"),
        ("leak_L_min_bar", "leak", "L/(min bar)"), ("flow_L_min", "flow", "L/min"),
        ("gain_mm_V", "gain", "mm/V"), ("damping_N_s_mm", "damping", "N s/mm"),
        ("arm_m_kg", "arm_m", "kg"), ("rod_L_m", "rod_L", "m"), ("power_in_W", "power_in", "W"),
        ("flow_in", "flow_in", ""), ("angle_rad_rate", "angle_rate", "rad/s"),
    ],
)  # fmt: skip
def test_a_name_ends_with_a_unit_or_a_compound_of_units(
    name: str, quantity: str, unit: str
) -> None:
    assert parted_name(name) == (quantity, unit)
