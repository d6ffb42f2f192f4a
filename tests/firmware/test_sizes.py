"""A sample takes the chips no longer than they have, in every state."""

import pytest

from firmware import sizes
from firmware.instructions import RecordedBench, replay
from firmware_protocol.enums import BoardState
from sim_device.errors import BenchError
from sim_device.firmware.build import build
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


def test_the_supervisor_alone_fits_10_kB_of_a_cortex_m4() -> None:
    needs("cortex-m")
    assert sizes.supervisor_bytes() <= 10_000


def test_500_hz_leave_a_cortex_m4_time_in_every_state() -> None:
    needs("qemu")
    table, period = sizes.instructions()
    assert {BoardState.SAFE, BoardState.ARMED, BoardState.HOLD, BoardState.FAULT} <= set(table)
    assert len(table[BoardState.ARMED]) > 1500
    assert sizes.m4_ms(period) < sizes.M4_LIMIT_ms


def test_a_cortex_m4_that_answers_otherwise_is_no_measurement() -> None:
    needs("qemu")
    bench = RecordedBench(build("host"))
    try:
        for _ in range(20):
            bench.step()
        steps = replay(build("qemu"), bench.board)
        assert [step.state.mode for step in steps if step.state][-1] is BoardState.SAFE
        bench.board.answers[-1] = bench.board.answers[-1]._replace(gate=1)
        with pytest.raises(BenchError, match="differ"):
            replay(build("qemu"), bench.board)
    finally:
        bench.close()
