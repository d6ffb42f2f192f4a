"""A fault of one axis stops all of three, and nothing of them is heated afterwards."""

import asyncio

import pytest

from campaign.faults.catalogue import ROWS
from tests.campaign.three_axes import rows, run_case

QUICK = ("reboot", "sensor_open", "unplug")


@pytest.mark.parametrize("name", QUICK)
def test_an_injection_on_one_axis_stops_all_three(name: str) -> None:
    found = asyncio.run(run_case(ROWS[name], 1))
    assert found.wrongs == ()
    assert found.stopped


@pytest.mark.campaign
@pytest.mark.parametrize("row", rows(), ids=lambda row: row.name)
def test_every_injection_on_one_axis_is_answered_on_all_three(row: object) -> None:
    found = asyncio.run(run_case(row, 1))  # type: ignore[arg-type]
    assert found.wrongs == ()
