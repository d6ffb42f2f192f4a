"""The boards that `--firmware` names."""

import pytest

from firmware_protocol.events import Connected
from smad.config import Config
from smad.processes.boards import BOARDS, build
from tests.firmware.conftest import needs
from tests.sim_device.loop import Loop


@pytest.mark.parametrize("name", BOARDS)
def test_a_board_of_the_table_says_the_speed_of_the_table(name: str) -> None:
    if BOARDS[name].has_store:
        needs(name)
    bench = build(Config(), rate_hz=100, seed=0, firmware=name)
    try:
        loop = Loop(bench).connected()
        (connected,) = loop.of(Connected)
        assert isinstance(connected, Connected)
        said = connected.ident.baud
        assert said == BOARDS[name].baud, f"set the baud of {name!r} in BOARDS to {said}"
    finally:
        bench.close()
