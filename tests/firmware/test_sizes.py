"""A sample takes the Mega no longer than it has, in every state."""

from firmware import sizes
from firmware_protocol.enums import BoardState
from tests.firmware.conftest import needs


def test_a_sample_with_everything_takes_at_most_3_3_ms_in_every_state() -> None:
    needs("avr")
    table = sizes.cycles()
    assert {BoardState.SAFE, BoardState.ARMED, BoardState.HOLD, BoardState.FAULT} <= set(table)
    assert len(table[BoardState.ARMED]) > 300
    assert {state.name: max(taken) for state, taken in table.items() if max(taken) > 52_800} == {}


def test_the_images_fit_their_chips() -> None:
    needs("mega")
    flash, ram = sizes.sizes("mega")
    assert flash < 128 * 1024, "flash beyond 128 kB needs far calls everywhere"
    assert ram < 6 * 1024, "the stack needs the rest of 8 kB"
