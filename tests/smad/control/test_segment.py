"""Degrees of the MINIR-II segment as a unit of displacement."""

from __future__ import annotations

import pytest

from sim_device.plant import load_parameters
from smad.config.axes import DEGREES_PER_MM, millimetres


def test_25_degrees_are_4_mm() -> None:
    assert millimetres(25.0) == 4.0
    assert millimetres(-25.0) == -4.0


@pytest.mark.parametrize("name", ["A", "B", "conserving"])
def test_commands_and_parameter_files_have_one_gain(name: str) -> None:
    parameters = load_parameters(name)
    assert parameters["robot_gain"] == pytest.approx(DEGREES_PER_MM * 1e3)
