"""A stop of one is a stop of all, and nothing arms after it but a person; axes side by side."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from campaign.virtual import Line, Refused, result_of
from firmware_protocol.enums import BoardState, Channel, Fault
from firmware_protocol.events import DisarmRequested
from firmware_protocol.supervisor import machine
from firmware_protocol.supervisor.states import Trigger
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad.config import AxisConfig, DaemonConfig, LimitsConfig
from smad.daemon.arming import Phase
from tests.smad.daemon.axes import NAMES, axes_in, lines
from tests.smad.daemon.rig import Rig, rig_in
from tests.smad.daemon.test_stops import without_watchdog

HOT = (BoardState.ARMED, BoardState.HOLD)
STEP = {"kind": "step", "displacement_mm": 2.0, "duration_s": 5.0}
SHORT = {**STEP, "duration_s": 1.0}


def hot(rig: Rig) -> list[str]:
    return [name for name, line in rig.lines.items() if line.bench.board.state in HOT]


async def armed(rig: Rig) -> Any:
    await rig.run_for(2.5)
    return await rig.ask("arm")


async def all_safe(rig: Rig) -> None:
    while any(axis.watch.mode is not BoardState.SAFE for axis in rig.daemon.axes.values()):
        await asyncio.sleep(0)


async def silent_for(rig: Rig, seconds: float) -> None:
    """Let board time pass, and the wall time that the daemon's housekeeping goes by."""
    until_us = rig.now_us() + round(seconds * 1e6)
    while rig.now_us() < until_us:
        await rig.run(10)
        await asyncio.sleep(0.025)


async def move_all(rig: Rig, **asked: Any) -> Any:
    return await rig.ask("together", moves={name: [STEP] for name in rig.lines}, **asked)


@pytest.mark.parametrize("method", ["disarm", "estop"])
@pytest.mark.parametrize("axis", [None, "yaw-1", "no such axis", 7])
async def test_a_clients_stop_is_for_all_axes_whichever_it_names(
    tmp_path: Path, method: str, axis: Any
) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        await move_all(rig)
        await rig.run_for(0.5)
        assert hot(rig) == list(NAMES)
        motion = await rig.ask(method, client=b"other", members={"axis": axis})
        assert hot(rig) == []
        assert not motion["armed"]
        assert all(not one["armed"] for one in motion["axes"].values())
        await rig.run_for(1.0)
        assert all(max(line.bench.board.outputs.applied_mA) == 0 for line in rig.lines.values())


@pytest.mark.parametrize("turns", range(0, 40, 3))
async def test_a_stop_at_any_moment_of_an_arming_leaves_no_axis_armed(
    tmp_path: Path, turns: int
) -> None:
    async with axes_in(tmp_path) as rig:
        await rig.connected()
        arming = rig.begin("arm")
        for _ in range(turns):
            await asyncio.sleep(0)
            await rig.run(turns % 2)
        motion = await rig.ask("disarm", client=b"other")
        assert not motion["armed"]
        assert hot(rig) == []
        await rig.run_until(arming)
        await rig.run_for(1.0)
        assert hot(rig) == []


async def test_after_a_stop_nothing_arms_but_a_person(tmp_path: Path) -> None:
    async with axes_in(tmp_path) as rig:
        before = {"generation": (await armed(rig))["generation"]}
        await rig.ask("disarm", client=b"other")
        await rig.run_until(all_safe(rig))
        for axis in (None, "pitch-1", ["yaw-1", "pitch-2"]):
            with pytest.raises(Refused, match=r"issued \(disarm of a client\)") as refused:
                await rig.ask("arm", members={**before, "axis": axis})
            assert refused.value.reason == "stopped"
        await rig.run_for(1.0)
        assert hot(rig) == []
        await rig.ask("arm")
        assert hot(rig) == list(NAMES)


async def test_until_every_board_confirms_a_stop_no_axis_is_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        actions = rig.lines["pitch-2"].bench.board.commands._actions
        with monkeypatch.context() as broken:
            broken.setitem(actions, DisarmRequested, lambda *_: None)
            without_watchdog(rig.lines["pitch-2"].bench)
            with pytest.raises(Refused, match="pitch-2: the board has not confirmed") as refused:
                await rig.ask("disarm")
            assert refused.value.reason == "no_reply"
            assert hot(rig) == ["pitch-2"]
            for members in ({}, {"axis": ["pitch-1", "pitch-2"]}):
                with pytest.raises(Refused, match="being stopped"):
                    await rig.ask("arm", members=members)
            with pytest.raises(Refused, match="being stopped"):
                await move_all(rig)
        await rig.run_for(3.0)
        assert hot(rig) == []


@pytest.mark.parametrize("fault", ["sensor_open", "reboot", "unplug"])
async def test_what_fails_on_one_axis_stops_all(tmp_path: Path, fault: str) -> None:
    boards = lines(faults={"yaw-1": [injection(fault, 4.0)]})
    async with axes_in(tmp_path, boards) as rig:
        began = await armed(rig)
        await move_all(rig)
        await rig.run_for(3.0)
        assert hot(rig) == []
        motion = await rig.ask("motion")
        assert motion["generation"] > began["generation"]
        assert "yaw-1" in motion["axes"]["pitch-1"]["ended"]


async def test_what_fails_on_an_axis_of_its_own_leaves_the_others_and_their_lease(
    tmp_path: Path,
) -> None:
    boards = lines(faults={"yaw-1": [injection("sensor_open", 4.0)]})
    async with axes_in(tmp_path, boards, own=["yaw-1"]) as rig:
        await rig.run_for(2.5)
        lease = (await rig.ask("control.take", name="Ada", lease_s=3.0))["lease"]
        began = await rig.ask("arm", members={"lease": lease})
        members = {"lease": lease, "generation": began["generation"]}
        await move_all(rig, members=members)
        await rig.run_for(1.6)
        assert hot(rig) == ["pitch-1", "pitch-2"]
        await rig.ask("move", members={**members, "axis": "pitch-1"}, trajectories=[STEP])
        with pytest.raises(Refused, match="stopped after this command was issued") as refused:
            await move_all(rig, members=members)
        assert refused.value.reason == "stopped"
        with pytest.raises(Refused, match="stopped after"):
            await rig.ask("arm", members={**members, "axis": "yaw-1"})
        await silent_for(rig, 3.5)
        assert hot(rig) == [], "whoever armed fell silent, and none is heated without it"


async def test_an_arming_that_an_axis_of_its_own_ends_waits_for_no_axis_that_stays_armed(
    tmp_path: Path,
) -> None:
    async with axes_in(tmp_path, lines(("a", "b", "c")), own=["a"]) as rig:
        await rig.connected()
        await rig.ask("arm", members={"axis": ["c"]})
        arming = rig.begin("arm", members={"axis": ["b"]})
        while rig.daemon.axes["b"].stop.phase is not Phase.CONFIRMED:
            await rig.sample()
        board = rig.lines["a"].bench.board
        memory = board.supervisor.memory
        machine.latch(memory, int(Fault.LEAK), int(Channel.BOARD), int(Trigger.FAULT_RAISED))
        board._report_fault()
        failed_us = rig.now_us()
        with pytest.raises(Refused) as refused:
            result_of(await rig.run_until(arming))
        assert rig.now_us() - failed_us < 1_000_000
        assert "cut the power" not in str(refused.value)
        assert hot(rig) == ["c"]


async def test_a_limit_of_the_host_on_one_axis_stops_all(tmp_path: Path) -> None:
    async with axes_in(tmp_path, limits=LimitsConfig(on_time_max_s=3.0)) as rig:
        await rig.connected()
        await rig.ask("arm", members={"axis": "pitch-2"})
        await rig.run_for(1.0)
        await rig.ask("arm", members={"axis": ["pitch-1", "yaw-1"]})
        await rig.run_for(2.2)
        assert hot(rig) == []
        motion = await rig.ask("motion")
        assert motion["axes"]["pitch-2"]["fault"]["name"] == "ARMED_TOO_LONG"
        assert motion["axes"]["yaw-1"]["fault"] is None
        await rig.run_until(all_safe(rig))
        with pytest.raises(Refused, match="pitch-2: a limit of the host"):
            await rig.ask("arm")


async def test_a_lapsed_lease_and_a_lost_client_stop_all(tmp_path: Path) -> None:
    daemon = DaemonConfig(ipc_dir=str(tmp_path), dead_man_lease_s=1.0)
    async with axes_in(tmp_path, daemon=daemon) as rig:
        await rig.connected()
        lease = (await rig.ask("control.take", name="Ada", lease_s=0.5))["lease"]
        await rig.ask("arm", members={"lease": lease})
        await silent_for(rig, 0.7)
        assert hot(rig) == []
        await rig.run_until(all_safe(rig))
        await rig.ask("arm", members={"axis": "yaw-1"})
        await silent_for(rig, 1.2)
        assert hot(rig) == []


async def test_a_board_whose_part_of_a_stop_raises_keeps_no_other_from_being_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)

        def explode(*_: object, **__: object) -> bool:
            raise RuntimeError("injected")

        monkeypatch.setattr(rig.daemon.axes["pitch-1"].stop, "end", explode)
        with pytest.raises(Refused, match="injected"):
            await rig.ask("disarm")
        await rig.run(5)
        assert hot(rig) == []


async def test_an_arming_that_one_board_refuses_arms_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with axes_in(tmp_path) as rig:
        await rig.connected()
        commands = rig.lines["pitch-2"].bench.board.commands
        given = commands.new_token
        monkeypatch.setattr(commands, "new_token", lambda: given() ^ 1)
        monkeypatch.setattr(
            rig.daemon.axes["pitch-2"].watch.parameters, "values", {(0, 1): 100, (0, 14): 0}
        )
        with pytest.raises(Refused, match="pitch-2: the board's parameters are not those"):
            await rig.ask("arm")
        await rig.run_for(0.5)
        assert hot(rig) == []


async def test_named_axes_are_armed_alone_and_the_others_are_refused_a_motion(
    tmp_path: Path,
) -> None:
    async with axes_in(tmp_path) as rig:
        await rig.connected()
        motion = await rig.ask("arm", members={"axis": ["pitch-1", "pitch-2"]})
        assert list(motion["axes"]) == hot(rig) == ["pitch-1", "pitch-2"]
        with pytest.raises(Refused, match="yaw-1: the bench is not armed"):
            await move_all(rig)
        assert (await rig.ask("motion"))["running"] == "idle", "nothing of the group began"
        with pytest.raises(Refused, match="there is no axis of this name; got roll"):
            await rig.ask("move", members={"axis": "roll"}, trajectories=[STEP])
        with pytest.raises(Refused, match="this command is for one axis"):
            await rig.ask("move", trajectories=[STEP])


async def test_swapped_cables_and_a_board_without_a_name_are_refused_before_arming(
    tmp_path: Path,
) -> None:
    boards = lines()
    boards["pitch-1"], boards["yaw-1"] = boards["yaw-1"], boards["pitch-1"]
    boards["pitch-2"] = Line(SimulatedBench(seed=5))
    async with axes_in(tmp_path, boards) as rig:
        await rig.connected()
        with pytest.raises(Refused) as refused:
            await rig.ask("arm")
        told = str(refused.value)
        for name in ("pitch-1", "yaw-1"):
            assert f"{name}: the board belongs to another axis" in told
        assert "pitch-2: the board stores no name" in told
        known = (await rig.ask("status"))["axes"]
        assert known["yaw-1"]["obstacle"].startswith("the board belongs to another axis; got pitch")
        assert refused.value.reason == "disagreement"
        assert hot(rig) == []


async def test_a_group_begins_at_one_instant_and_its_skew_is_below_a_sample(
    tmp_path: Path,
) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        await move_all(rig)
        await rig.run(12)
        skew = (await rig.ask("status"))["skew"]
        assert skew["count"] == 1
        assert 0.0 < skew["max_us"] <= 10_000
        assert "pitch-1, yaw-1, pitch-2 began within" in _told(rig, "began within")


def _told(rig: Rig, words: str) -> str:
    return next((text for text in rig.heard if words in text), "")


async def test_a_group_of_which_one_is_out_of_reach_begins_none(tmp_path: Path) -> None:
    far = {**STEP, "displacement_mm": 20.0}
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        with pytest.raises(Refused, match=r"yaw-1: .* takes the reference to 20 mm"):
            await rig.ask("together", moves={"pitch-1": [STEP], "yaw-1": [far]})
        assert (await rig.ask("motion"))["running"] == "idle"


async def test_the_angle_of_a_joint_takes_the_coupling_of_its_tendon_into_account(
    tmp_path: Path,
) -> None:
    axes = (AxisConfig(name="pitch-1"), AxisConfig(name="yaw-1", coupling=(0.5, 1.0)))
    async with rig_in(tmp_path, lines(NAMES[:2]), axes=axes) as rig:
        await armed(rig)
        await rig.ask("together", moves={"pitch-1": [STEP]})
        await rig.run_for(3.0)
        parts = (await rig.ask("status"))["axes"]
        pitch, yaw = (parts[name]["sample"] for name in NAMES[:2])
        assert pitch["displacement_mm"] > 0.5
        assert pitch["angle_deg"] == pytest.approx(6.25 * pitch["displacement_mm"])
        across_mm = yaw["displacement_mm"] - 0.5 * pitch["displacement_mm"]
        assert yaw["angle_deg"] == pytest.approx(6.25 * across_mm, abs=0.05)


async def test_a_queued_group_waits_for_its_slowest_and_a_stop_forgets_it(tmp_path: Path) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        await rig.ask("together", moves={"pitch-1": [SHORT], "yaw-1": [STEP]})
        both = {"pitch-1": [SHORT], "yaw-1": [SHORT]}
        await rig.ask("together", moves=both, queue=True)
        await rig.run_for(3.0)
        motion = await rig.ask("motion", members={"axis": "pitch-1"})
        assert not motion["done"], "it waits for the other"
        assert rig.daemon.groups.skew.percentiles().count == 1
        await rig.run_for(2.5)
        assert rig.daemon.groups.skew.percentiles().count == 2
        await rig.run_for(1.5)
        assert (await rig.ask("motion"))["done"]
        await rig.ask("together", moves={"pitch-1": [STEP]})
        await rig.ask("together", moves=both, queue=True)
        await rig.ask("disarm")
        assert not any(rig.daemon.groups.wait_for(name) for name in NAMES)


async def test_groups_that_wait_begin_one_after_the_other(tmp_path: Path) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        both = {"pitch-1": [SHORT], "yaw-1": [SHORT]}
        for queue in (False, True, True):
            await rig.ask("together", moves=both, queue=queue)
        await rig.run_for(5.0)
        assert rig.daemon.groups.skew.percentiles().count == 3


async def test_no_more_groups_wait_than_can_be_looked_at_with_every_sample(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("smad.daemon.together.MOST_WAITING", 2)
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        both = {"pitch-1": [SHORT], "yaw-1": [SHORT]}
        for queue in (False, True, True):
            await rig.ask("together", moves=both, queue=queue)
        with pytest.raises(Refused, match=r"too many motions .* got 2; allowed: 2"):
            await rig.ask("together", moves=both, queue=True)


async def test_an_axis_that_vanishes_and_comes_back_is_not_armed_by_itself(tmp_path: Path) -> None:
    boards = lines()
    async with axes_in(tmp_path, boards) as rig:
        await armed(rig)
        await move_all(rig)
        boards["pitch-2"].pull_the_plug()
        await rig.run_for(1.0)
        assert [name for name in hot(rig) if name != "pitch-2"] == []
        with pytest.raises(Refused, match="pitch-2: the board is not connected"):
            await rig.ask("arm")
        boards["pitch-2"].plugged = True
        while rig.daemon.axes["pitch-2"].watch.mode is None:
            await rig.run(1)
            await asyncio.sleep(0.001)
        await rig.run_for(5.0)
        assert hot(rig) == []
        await rig.ask("clear")
        await rig.run_until(all_safe(rig))
        await rig.ask("arm")
        assert hot(rig) == list(NAMES)


async def test_a_fault_that_cannot_be_cleared_yet_keeps_no_other_axis_from_being_cleared(
    tmp_path: Path,
) -> None:
    # The leak of the first two goes on, that of the last is dry by then.
    boards = lines(
        faults={
            name: [injection("leak", 2.0, lasts=lasts_s)]
            for name, lasts_s in zip(NAMES, (6.0, 6.0, 0.1), strict=True)
        }
    )
    async with axes_in(tmp_path, boards) as rig:
        await rig.run_for(3.0)
        with pytest.raises(Refused, match=r"pitch-1: .*; yaw-1: "):
            await rig.ask("clear")
        await rig.run(6)
        states = [line.bench.board.state for line in rig.lines.values()]
        assert states == [BoardState.FAULT, BoardState.FAULT, BoardState.SAFE]
        await rig.run_for(6.0)
        await rig.ask("clear")
        await rig.run_until(all_safe(rig))


async def test_a_missing_board_is_left_out_only_where_that_is_asked_for(tmp_path: Path) -> None:
    from smad.errors import PortError

    boards = lines()
    boards["yaw-1"].plugged = False
    with pytest.raises(PortError, match="no such port"):
        async with axes_in(tmp_path, boards):
            pass
    boards = lines()
    boards["yaw-1"].plugged = False
    async with axes_in(tmp_path, boards, without_missing=True) as rig:
        await rig.run_for(2.5)
        with pytest.raises(Refused, match="yaw-1: the board is not connected"):
            await rig.ask("arm")
        await rig.ask("arm", members={"axis": ["pitch-1", "pitch-2"]})
        assert not (await rig.ask("disarm"))["armed"]
        assert hot(rig) == []


async def test_a_slow_or_silent_board_keeps_no_other_waiting(tmp_path: Path) -> None:
    boards = lines(
        rates_hz={"pitch-1": 250, "yaw-1": 100, "pitch-2": 250},
        faults={"yaw-1": [injection("hang", 3.5, seconds=0.09)]},
    )
    async with axes_in(tmp_path, boards, own=NAMES) as rig:
        await rig.run_for(2.5)
        await rig.ask("arm", members={"axis": ["pitch-1", "pitch-2"]})
        await rig.run_for(2.0)
        for name in ("pitch-1", "pitch-2"):
            axis = rig.daemon.axes[name]
            assert axis.session.stats.missed_states == 0
            assert axis.control.counts.samples > 4.4 * 250


async def test_status_and_parameters_are_told_by_axis(tmp_path: Path) -> None:
    async with axes_in(tmp_path) as rig:
        await rig.connected()
        status = await rig.ask("status")
        assert list(status["axes"]) == list(NAMES)
        own = await rig.ask("status", members={"axis": "yaw-1"})
        assert "axes" not in own
        assert own["board"]["uid"] == status["axes"]["yaw-1"]["board"]["uid"]
        await rig.ask(
            "params.set", members={"axis": "yaw-1"}, name="encoder_offset_counts", value=100
        )
        read = await rig.ask(
            "params.get", members={"axis": "pitch-1"}, name="encoder_offset_counts"
        )
        assert read["value"] == 0
        with pytest.raises(Refused, match="this command is for one axis"):
            await rig.ask("params.set", name="encoder_offset_counts", value=1)


async def test_the_end_of_the_daemon_disarms_every_axis(tmp_path: Path) -> None:
    async with axes_in(tmp_path) as rig:
        await armed(rig)
        told = await rig.run_until(rig.daemon.disarm())
        assert hot(rig) == []
        assert told == "disarmed, the board cools by itself"


async def test_the_reply_to_a_bench_of_one_axis_names_no_axes(tmp_path: Path) -> None:
    from tests.smad.daemon.rig import rig_in

    async with rig_in(tmp_path) as rig:
        await rig.connected()
        assert "axes" not in await rig.ask("motion")
        assert not {"axes", "skew"} & (await rig.ask("status")).keys()
        with pytest.raises(Refused, match="none: a bench of one axis"):
            await rig.ask("motion", members={"axis": "pitch-1"})
        assert result_of(await rig.run_until(rig.begin("arm")))["armed"]
