"""The Python board and the C firmware do the same, sample by sample."""

import pytest

from firmware.compare import compare, main, report
from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import Measurements
from sim_device.firmware.frontend import decode, encode, resistance_ohm, rtd_cC, rtd_register
from sim_device.hardware import Hardware
from tests.firmware.conftest import PORTS, needs


def test_they_agree_over_random_events() -> None:
    needs("host")
    verdict = compare("host", 1500, seed=6)
    assert not verdict.differences, report(verdict)
    assert verdict.total >= 1500
    seen = {BoardState.BOOT, BoardState.SAFE, BoardState.ARMED, BoardState.FAULT}
    assert {state.name for state in seen} <= set(verdict.states)


def test_the_chip_agrees_with_python_sample_by_sample() -> None:
    needs("avr")
    verdict = compare("avr", 600, seed=2)
    assert not verdict.differences, report(verdict)
    assert verdict.total >= 600
    assert {BoardState.ARMED.name, BoardState.FAULT.name} <= set(verdict.states)


@pytest.mark.parametrize("port", PORTS)
def test_a_board_that_differs_is_noticed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], port: str
) -> None:
    needs(port)
    monkeypatch.setattr("sim_device.board.SELF_TEST_SAMPLES", 6)
    assert main(["--events", "50", "--port", port]) == 1
    assert "State.mode: Python 0, C 1" in capsys.readouterr().out


def test_a_converter_gives_the_temperature_of_the_platinum_curve() -> None:
    # IEC 60751, in ohm at 0, 100 and -40 degC.
    assert resistance_ohm(0.0) == 100.0
    assert resistance_ohm(100.0) == pytest.approx(138.5055, abs=1e-4)
    assert resistance_ohm(-40.0) == pytest.approx(84.2707, abs=1e-4)
    for t_cC in range(-3900, 20_000, 37):
        assert rtd_cC(rtd_register(t_cC)) == pytest.approx(t_cC, abs=4)


def test_a_reading_comes_through_the_converters_within_a_code() -> None:
    m = Measurements(
        i_mA=[0, 4000],
        v_mV=[3040, 11_500],
        rtd_cC=[2700, 8123, -32_768, 32_767],
        pump_rpm=[0, 5980],
        vbus_mV=11_900,
        leak=1,
        encoder_invalid=1,
    )
    read = Measurements()
    decode(encode(m, Hardware()), read)
    assert read.i_mA == pytest.approx(m.i_mA, abs=5)
    assert read.v_mV == pytest.approx(m.v_mV, abs=15)
    assert read.rtd_cC == pytest.approx(m.rtd_cC, abs=4)
    assert read.pump_rpm == pytest.approx(m.pump_rpm, abs=4)
    assert read.vbus_mV == pytest.approx(m.vbus_mV, abs=20)
    assert (read.leak, read.encoder_invalid, read.force_invalid) == (1, 1, 0)
