"""What goes wrong in a night, and how it is judged."""

import asyncio
import os
from pathlib import Path

import pytest

from campaign.command import execute
from campaign.night.daemon import BoardInLoop
from campaign.night.draws import TROUBLES, Trouble, troubles
from campaign.night.report import (
    WEEK_H,
    Look,
    Met,
    NightResult,
    facts,
    late,
    rerun,
    slope_of,
    troubles_table,
    unmet,
    week_table,
)
from campaign.night.run import faults_of_logs
from firmware_protocol import messages as wire
from firmware_protocol.enums import BoardState
from firmware_protocol.supervisor import ArmRequested, Link
from sim_device.bench import SimulatedBench
from smad.errors import PortError
from smad.runlog.header import RunHeader
from smad.runlog.writer import write_run


def test_every_kind_of_trouble_comes_before_any_comes_again_and_in_order() -> None:
    drawn = troubles(5, 3600.0, 2 * len(TROUBLES))
    first = [trouble.kind for trouble in drawn[: len(TROUBLES)]]
    assert sorted(first) == sorted(TROUBLES)
    times = [trouble.at_s for trouble in drawn]
    assert times == sorted(times)
    assert 360.0 <= times[0] <= times[-1] <= 3240.0
    assert troubles(5, 3600.0, 3) == troubles(5, 3600.0, 3) != troubles(6, 3600.0, 3)


def test_a_word_is_late_only_where_the_queue_paused() -> None:
    found = NightResult(1)
    found.met = [
        Met(1.0, "stop", 1, "moves", "stopped", 0.5, paused=True),
        Met(2.0, "kill item", 2, "moves", "killed", 6.5, paused=True),
        Met(3.0, "kill daemon", 3, "moves", paused=True),
        Met(4.0, "kill hooks", 4, "moves"),
    ]
    assert late(found) == [
        "kill item at 2 s: word after 6.5 s",
        "kill daemon at 3 s: no word",
    ]
    assert troubles_table(found).rows[3] == ("0.00", "kill hooks", "moves", "went on", "", "")


def test_a_night_whose_queue_ends_before_it_or_whose_troubles_do_not_come_shows_less() -> None:
    assert unmet(3600.1, 3600.0, []) == []
    assert unmet(900.0, 3600.0, [Trouble(1800.0, "stop")]) == [
        "the queue held no more items after 900 s of 3600 s",
        "stop at 1800 s met no item",
    ]


def test_a_run_log_that_cannot_be_read_is_a_fault_of_the_night(tmp_path: Path) -> None:
    write_run(tmp_path / "whole.mcap", RunHeader(name="whole", started_unix_s=0.0), ())
    assert faults_of_logs(tmp_path) == []
    (tmp_path / "lost.mcap").write_bytes(b"nothing of a run")
    (fault,) = faults_of_logs(tmp_path)
    assert fault.startswith("lost.mcap: ")
    assert "is not a run log" in fault


def test_the_slope_is_that_of_the_longest_life_without_its_beginning() -> None:
    filling = [Look(0.0, 1, 50.0), Look(0.1, 1, 80.0), Look(0.2, 1, 100.0)]
    steady = [Look(0.1 * n, 1, 100.0 + 0.2 * n) for n in range(3, 20)]
    other = [Look(2.0 + 0.1 * n, 2, 7.0) for n in range(5)]
    slope = slope_of([*filling, *steady, *other])
    assert slope is not None
    assert slope.per_h == pytest.approx(2.0, rel=1e-6)
    assert slope.amount == pytest.approx(103.8)
    assert slope_of(other) is None
    found = NightResult(1, looks={"memory": [*filling, *steady], "short": other})
    rows = week_table(found).rows
    assert rows[0][-1] == f"{103.8 + 2.0 * WEEK_H:.0f}"
    assert rows[1][2] == "too short"


def test_an_item_that_began_twice_is_found_and_one_whose_number_it_begins_with_is_not() -> None:
    begun = "item 1 begins: a\nitem 11 begins: b\nitem 2 begins: c\nitem 2 begins: c"
    assert rerun(begun, [1, 2, 11]) == {2: 2}


def test_the_facts_are_in_a_line() -> None:
    found = NightResult(3, board_h=8.0, wall_h=1.0, cycles=50)
    found.states.update(["done", "done", "interrupted"])
    assert "8.0 times real time" in facts(found)
    assert "items: 2 done, 1 interrupted" in facts(found)


def test_a_folder_with_something_in_it_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine").touch()
    assert execute(["night", "--folder", str(tmp_path)]) == 1
    assert "not empty" in capsys.readouterr().err


async def test_a_board_in_the_loop_waits_for_its_host_and_goes_on_once_it_has_spoken() -> None:
    bench = SimulatedBench(rate_hz=100, seed=1)
    board = BoardInLoop(bench, speed=50.0)
    transport = board.open()
    os.write(transport.fileno(), b"\0")
    began_us = bench.now_us
    while bench.now_us == began_us:
        await asyncio.sleep(0)
    assert os.read(transport.fileno(), 4096)
    transport.close()


def test_a_board_in_the_loop_sees_its_hosts_answer_also_after_its_clock_has_wrapped() -> None:
    bench = SimulatedBench(rate_hz=100, seed=1, clock_start_us=2**32 - 200_000)
    board = BoardInLoop(bench, speed=50.0)
    bench.arm()
    for _ in range(40):
        state = bench.step_typed(None)
        assert board.wants_setpoint
        answer = wire.Setpoint(0, state.t_us, (500, 0), (0, 0), 0, 100)
        bench.board.apply_setpoint(answer, 1, 0, bench.board.now_us)
        assert not board.wants_setpoint
    assert state.t_us < 2**31


def test_a_board_in_the_loop_gives_its_host_the_time_of_a_bench_to_confirm_an_arming() -> None:
    bench = SimulatedBench(rate_hz=100, seed=1)
    board = BoardInLoop(bench, speed=50.0)
    bench.arm()
    assert board.period_s == pytest.approx(0.01 / 50.0)
    bench.disarm()
    while bench.board.state is not BoardState.SAFE:
        bench.step_typed(None)
    bench.board.command(ArmRequested(Link(), bench.board.commands.new_token()), bench.board.now_us)
    paces = []
    for _ in range(300):
        bench.step_typed(None)
        paces.append(board.period_s)
    assert paces == pytest.approx([0.01] * 200 + [0.01 / 50.0] * 100)


async def test_a_board_that_is_unplugged_cannot_be_opened_until_it_is_plugged_in() -> None:
    bench = SimulatedBench(rate_hz=100, seed=1)
    board = BoardInLoop(bench, speed=50.0)
    board.inject("unplug@0:seconds=0.05")
    bench.step()
    with pytest.raises(PortError):
        board.open()
    for _ in range(6):
        bench.step()
    board.open().close()
