"""Every fault of the campaign that acts through what the chip reads, on the C firmware."""

import pytest

from firmware_protocol.enums import BoardState
from sim_device.faults import FAULT_KINDS, injection
from tests.firmware.conftest import MakeFirmware
from tests.sim_device.loop import Loop
from tests.sim_device.test_faults import AT_S, CASES

READ = [row.name for row in FAULT_KINDS.values() if row.group in ("sensor", "actuator")]
HARMLESS = {"encoder_slip"}
HOT = (BoardState.ARMED, BoardState.HOLD)


@pytest.mark.parametrize("name", [name for name in READ if name not in HARMLESS])
def test_a_fault_is_named_and_the_heat_stays_within_its_budget(
    make_firmware: MakeFirmware, name: str
) -> None:
    parameters, answer = CASES[name]
    fault = injection(name, AT_S, **parameters)
    bench = make_firmware(seed=1, faults=[fault])
    loop = Loop(bench).armed()
    loop.answer = answer  # type: ignore[assignment]
    while bench.now_us < 60e6 and loop.mode in HOT:
        loop.step()
    _, before_J, _ = bench.faults.begun[0]
    heat_J = bench.heater_J - before_J
    assert loop.mode is BoardState.FAULT
    assert loop.reports[0].fault in fault.kind.expects
    assert heat_J <= fault.kind.budget_J
    assert bench.board.outputs.gate == 0
    loop.step(100)
    assert bench.heater_J - before_J == pytest.approx(heat_J, abs=0.2)
