"""A stop stops: nothing that was asked for before it is carried out, and nothing overtakes it."""

import asyncio
import dataclasses
import time
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zmq.asyncio

from campaign.virtual import Refused, result_of
from firmware_protocol.enums import BoardState
from firmware_protocol.events import DisarmRequested
from firmware_protocol.messages import Done, State
from sim_device.bench import SimulatedBench
from sim_device.faults import injection
from smad import api
from smad.client.endpoints import Endpoints
from smad.client.wire import connect
from smad.config import LimitsConfig
from smad.daemon.arming import Phase
from smad.daemon.command.lease import Caller
from smad.daemon.sockets.listener import bytes_unread
from tests.smad.daemon.rig import Rig, rig_in

INPUTS = {
    "t_s": [0.0],
    "end_s": 9.0,
    "i_x_A": [1.0],
    "i_y_A": [0.0],
    "pump_x_duty": [0.0],
    "pump_y_duty": [0.0],
}
STEP = {"kind": "step", "displacement_mm": 5.0, "duration_s": 10.0}
HOT = (BoardState.ARMED, BoardState.HOLD)


async def test_a_stop_right_after_a_reconnection_ends_an_arming_that_waits(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        rig.pull_the_plug()
        await rig.run(10)
        rig.plug_in()
        while rig.axis.watch.ident is None:
            await rig.run(1)
            await asyncio.sleep(0.001)
        arming = rig.begin("arm")
        await rig.run(2)
        await rig.ask("disarm", client=b"other")
        with pytest.raises(Refused, match="stopped") as refused:
            result_of(await rig.run_until(arming))
        assert refused.value.reason == "stopped"
        await rig.run_for(3.0)
        assert rig.bench.board.state is BoardState.SAFE


@pytest.mark.filterwarnings("error:coroutine:RuntimeWarning")
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
async def test_whoever_waits_for_the_board_when_the_daemon_ends_is_told(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        waiting = rig.begin("arm")
        await rig.daemon.close()
        with pytest.raises(Refused, match="the daemon ended before the board had answered"):
            result_of(await rig.wait_for(waiting))


@pytest.mark.parametrize("turns", range(14))
async def test_a_stop_at_any_moment_of_an_arming_leaves_it_not_armed(
    tmp_path: Path, turns: int
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        arming = rig.begin("arm")
        for _ in range(turns):
            await asyncio.sleep(0)
            await rig.run(turns % 2)
        motion = await rig.ask("disarm", client=b"other")
        assert not motion["armed"]
        assert motion["mode"] not in ("ARMED", "HOLD")
        assert rig.bench.board.state not in HOT
        reply = await rig.run_until(arming)
        await rig.run_for(1.0)
        assert rig.bench.board.state not in HOT
        assert max(rig.bench.board.outputs.applied_mA) == 0
        if b"error" in reply:
            with pytest.raises(Refused):
                result_of(reply)


async def test_until_the_board_confirms_a_stop_nothing_that_moves_it_is_taken(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        stopping = rig.begin("disarm")
        for method, params in (
            ("current", {"i_x_A": 1.0}),
            ("inputs", INPUTS),
            ("move", {"trajectories": [STEP]}),
            ("heat", {"spring": "x", "temperature_degC": 50.0}),
            ("tune", {"kp_A_per_mm": 3.0}),
            ("arm", {}),
        ):
            asked = rig.begin(method, b"other", **params)
            assert asked.done(), "it is refused at once, not after the board has answered"
            with pytest.raises(Refused, match="being stopped") as refused:
                result_of(asked.result())
            assert refused.value.reason == "stopped"
        assert result_of(await rig.run_until(stopping))["running"] == "idle"


async def test_a_stop_that_the_board_has_not_confirmed_keeps_control_from_changing_hands(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        stopping = rig.begin("disarm")
        with pytest.raises(Refused, match="being stopped"):
            result_of(rig.begin("control.take", b"other", name="Bob").result())
        await rig.run_until(stopping)
        assert (await rig.ask("control.take", client=b"other", name="Bob"))["yours"]


async def test_what_was_asked_before_a_stop_is_refused_after_somebody_armed_again(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        before = {"generation": (await rig.ask("arm"))["generation"]}
        await rig.ask("move", members=before, trajectories=[STEP])
        await rig.ask("disarm", client=b"other")
        await rig.run_until(_safe(rig))
        after = {"generation": (await rig.ask("arm", client=b"other"))["generation"]}
        for method, params in (
            ("move", {"trajectories": [STEP], "queue": True}),
            ("current", {"i_x_A": 1.0}),
            ("inputs", INPUTS),
            ("tune", {"kp_A_per_mm": 3.0}),
        ):
            with pytest.raises(Refused, match=r"issued \(disarm of a client\)"):
                await rig.ask(method, members=before, **params)
        assert (await rig.ask("motion"))["running"] == "idle"
        await rig.ask("move", client=b"other", members=after, trajectories=[STEP])


async def _time(rig: Rig, until_s: float) -> None:
    while rig.bench.now_us < until_s * 1e6:
        await asyncio.sleep(0)


async def _safe(rig: Rig) -> None:
    while rig.axis.watch.mode is not BoardState.SAFE:
        await asyncio.sleep(0)


@pytest.mark.parametrize("minutes", [1, 40, 70])
async def test_a_board_found_armed_long_after_its_last_stop_is_told_to_disarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, minutes: int
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        await rig.ask("disarm")
        stop, samples = rig.axis.stop, list[State]()
        take = stop.on_sample

        def keep(state: State) -> None:
            samples.append(state)
            take(state)

        with monkeypatch.context() as kept:
            kept.setattr(stop, "on_sample", keep)
            while not samples or samples[-1].mode is not BoardState.SAFE:
                await rig.sample()
        # The board's clock wraps every 71.6 min, and what is half of that away looks earlier.
        t_us = (samples[-1].t_us + minutes * 60_000_000) % 2**32
        generation = rig.daemon.stops.generation
        stop.on_sample(msgspec.structs.replace(samples[-1], t_us=t_us, mode=BoardState.ARMED))
        await rig.run(1)
        assert any("found armed by somebody else" in line for line in rig.heard)
        assert rig.daemon.stops.generation == generation + 1


async def test_while_the_reply_to_a_stop_waits_arming_is_refused_as_stopped(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        with rig.daemon.stops.reply_open(), pytest.raises(Refused) as refused:
            await rig.ask("arm")
        assert refused.value.reason == "stopped"
        await rig.ask("arm")


async def test_a_board_that_may_still_take_a_late_confirmation_is_not_known_to_be_off(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stop, machine = rig.axis.stop, rig.daemon.stops.arming
        rig.daemon.stops.begin_arming([stop], machine.generation)
        machine.ask()
        machine.granted(stop.label)
        stop.arming()
        machine.confirm()
        # On its way when the line goes, ARM_CONFIRM is good for two seconds.
        rig.pull_the_plug()
        await rig.run_for(1.5)
        stop.tick()
        assert not stop.off
        await rig.run_for(1.5)
        stop.tick()
        assert stop.off


async def test_a_disarm_overtakes_what_others_ask_of_the_board(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        others = [rig.begin("clear", b"other %d" % (n % 6), fault=1) for n in range(60)]
        stopping = rig.begin("disarm")
        await rig.run(3)
        assert rig.bench.board.state not in HOT
        await rig.run(2)
        assert stopping.done()
        assert sum(other.done() for other in others) < 10
        for other in others:
            with pytest.raises(Refused):
                result_of(await rig.run_until(other))


async def test_many_stops_at_once_are_one_request_to_the_board_and_all_are_answered(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        stops = [rig.begin("disarm", b"%d" % n) for n in range(50)]
        await rig.run(3)
        assert all(not result_of(stop.result())["armed"] for stop in stops)


async def test_a_disarm_replies_with_the_state_that_it_led_to(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        motion = await rig.ask("disarm")
        assert (motion["armed"], motion["mode"]) == (False, rig.bench.board.state.name)
        assert (await rig.ask("estop"))["mode"] == "ESTOP"


async def test_an_arm_replies_with_the_state_that_it_led_to(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        motion = result_of(await rig.run_until(rig.begin("arm")))
        assert (motion["armed"], motion["mode"]) == (True, "ARMED")


def without_watchdog(bench: SimulatedBench) -> None:
    """Let the board hold for ever when no setpoint comes."""
    supervisor = bench.board.supervisor
    supervisor.set_limits(dataclasses.replace(supervisor.limits, hold_us=60_000_000))


async def test_a_stop_that_the_board_does_not_carry_out_says_so_and_is_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with monkeypatch.context() as broken:
            broken.setitem(rig.bench.board.commands._actions, DisarmRequested, lambda *_: None)
            without_watchdog(rig.bench)
            with pytest.raises(Refused, match="has not confirmed that it stopped") as refused:
                await rig.ask("disarm")
            assert refused.value.reason == "no_reply"
            assert refused.value.data["value"] == "it is in HOLD"
            with pytest.raises(Refused, match="being stopped"):
                await rig.ask("current", i_x_A=1.0)
        await rig.run_for(3.0)
        assert rig.bench.board.state not in HOT
        assert (await rig.ask("disarm"))["armed"] is False


async def test_a_board_that_does_not_confirm_gets_no_setpoints_although_ticks_are_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        monkeypatch.setattr(rig.axis.stop, "tick", lambda: None)
        monkeypatch.setitem(rig.bench.board.commands._actions, DisarmRequested, lambda *_: None)
        stopping = rig.begin("disarm")
        await rig.run_for(0.3)
        sent = rig.axis.control.counts.setpoints
        await rig.run_for(0.5)
        assert rig.axis.control.counts.setpoints == sent
        assert rig.bench.board.state is not BoardState.ARMED
        assert result_of(await rig.run_until(stopping))["armed"] is False


async def test_the_answer_to_a_stop_before_an_arming_says_nothing_of_the_stop_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        answer = asyncio.get_running_loop().create_future()
        stop = rig.axis.stop
        with monkeypatch.context() as late:
            late.setattr(stop._requests, "ask", lambda _: answer)
            stopping = rig.begin("disarm")
            await asyncio.sleep(0)
        stop.arming()
        answer.set_result(Done(0, 0))
        await asyncio.sleep(0)
        assert stop.phase is Phase.STOPPING
        assert result_of(await rig.run_until(stopping))["armed"] is False


async def test_a_stop_that_the_board_cannot_hear_ends_with_the_boards_own(tmp_path: Path) -> None:
    deaf = injection("lost_way", 3.0, way=0, lasts=1.3)
    async with rig_in(tmp_path, SimulatedBench(seed=1, faults=[deaf])) as rig:
        await rig.arm()
        await rig.run_until(_time(rig, 3.01))
        assert (await rig.ask("disarm"))["mode"] == "FAULT"


async def test_a_limit_of_the_host_that_latches_ends_what_was_asked_before(tmp_path: Path) -> None:
    async with rig_in(tmp_path, limits=LimitsConfig(on_time_max_s=10.0)) as rig:
        await rig.connected()
        armed = await rig.ask("arm")
        await rig.run_for(10.5)
        assert (await rig.ask("motion"))["generation"] > armed["generation"]
        await rig.ask("clear")
        await rig.run_until(_safe(rig))
        await rig.ask("arm", client=b"other")
        with pytest.raises(Refused, match="ARMED_TOO_LONG"):
            await rig.ask("current", members={"generation": armed["generation"]}, i_x_A=1.0)


async def test_a_lost_link_and_a_board_that_restarts_end_what_was_asked_before(
    tmp_path: Path,
) -> None:
    reboot = injection("reboot", 5.0)
    async with rig_in(tmp_path, SimulatedBench(seed=1, faults=[reboot])) as rig:
        await rig.run_for(2.0)
        generation = (await rig.ask("arm"))["generation"]
        rig.pull_the_plug()
        await rig.run(3)
        assert (lost := rig.daemon.stops.generation) > generation
        rig.plug_in()
        while rig.axis.watch.mode is None:
            await rig.run(1)
            await asyncio.sleep(0.001)
        assert rig.bench.now_us < 5_000_000
        await rig.run_for(4.0)
        assert rig.daemon.stops.generation > lost


def until_the_kernel_has(rig: Rig, *sizes: int) -> None:
    """Wait for ZeroMQ's own thread to write so much to each channel; our loop must not read it."""
    for listener, size in zip(rig.daemon.server.listeners, sizes, strict=True):
        (connection,) = listener
        while bytes_unread(connection._line) < size:
            time.sleep(0.001)


async def test_what_waited_unread_when_the_stop_came_is_refused_however_late_it_is_read(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        endpoints = Endpoints(tmp_path, "bench")
        rig.daemon.server.serve_ipc(endpoints, 0o077)
        context = zmq.asyncio.Context()
        eager = connect(context, endpoints.command, None, b"eager")
        stopper = connect(context, endpoints.stop, None, b"stopper")
        try:
            await eager.send(b'{"jsonrpc":"2.0","id":0,"method":"motion"}')
            await rig.run_until(eager.recv())
            await stopper.send(b'{"jsonrpc":"2.0","id":0,"method":"disarm"}')
            await rig.run_until(stopper.recv())
            # All of it is in the kernel before the daemon looks again; the stop is served first.
            asked = [b'{"jsonrpc":"2.0","id":%d,"method":"motion"}' % n for n in range(20)]
            asked.append(b'{"jsonrpc":"2.0","id":20,"method":"arm"}')
            stop = b'{"jsonrpc":"2.0","id":1,"method":"disarm"}'
            for message in asked:
                await eager.send(message)
            await stopper.send(stop)
            until_the_kernel_has(rig, len(stop) + 2, sum(len(one) + 2 for one in asked))
            assert not result_of(await rig.run_until(stopper.recv()))["armed"]
            replies = [await rig.run_until(eager.recv()) for _ in range(21)]
            with pytest.raises(Refused, match="stop") as refused:
                result_of(replies[-1])
            assert refused.value.reason == "stopped"
            await rig.run_for(1.0)
            assert rig.bench.board.state is BoardState.SAFE
            await eager.send(b'{"jsonrpc":"2.0","id":21,"method":"arm"}')
            assert result_of(await rig.run_until(eager.recv()))["armed"]
        finally:
            context.destroy(linger=0)


async def test_a_fault_of_the_board_ends_what_was_asked_before(tmp_path: Path) -> None:
    deaf = injection("lost_way", 4.0, way=0, lasts=1.5)
    async with rig_in(tmp_path, SimulatedBench(seed=1, faults=[deaf])) as rig:
        await rig.run_for(2.0)
        before = {"generation": (await rig.ask("arm"))["generation"]}
        await rig.ask("current", members=before, i_x_A=0.1)
        await rig.run_until(_time(rig, 6.0))
        motion = await rig.ask("motion")
        assert (motion["mode"], motion["running"]) == ("FAULT", "idle")
        await rig.ask("clear")
        await rig.run_until(_safe(rig))
        await rig.ask("arm", client=b"other")
        with pytest.raises(Refused, match="went into FAULT"):
            await rig.ask("current", members=before, i_x_A=0.1)


async def test_a_stop_is_not_refused_because_of_what_it_does_not_need(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        for odd in (None, 5, [], {"a": 1}, "wrong"):
            assert not (await rig.ask("disarm", members={"lease": odd, "generation": odd}))["armed"]


class _Lapsed:
    """Ada took a lease of half a second, armed, sends 1 A and says no more."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig

    async def begin(self) -> dict[str, Any]:
        rig = self.rig
        await rig.run_for(2.0)
        taken = await rig.ask("control.take", client=b"ada", name="Ada", lease_s=0.5)
        ada = {"lease": taken["lease"]}
        await rig.ask("arm", client=b"ada", members=ada)
        await rig.ask("current", client=b"ada", members=ada, i_x_A=1.0)
        # Housekeeping looks at leases too; here nobody does but who asks.
        assert rig.daemon._housekeeping is not None
        rig.daemon._housekeeping.cancel()
        await rig.run_for(0.45)
        return ada


async def test_a_lease_that_lapsed_disarms_also_when_somebody_takes_control_first(
    tmp_path: Path,
) -> None:
    async with rig_in(tmp_path) as rig:
        await _Lapsed(rig).begin()
        assert rig.bench.board.state is BoardState.ARMED
        with pytest.raises(Refused, match="Ada has exclusive control"):
            await rig.ask("control.take", client=b"bob", name="Bob")
        await rig.run_for(0.1)
        with pytest.raises(Refused, match="Ada had exclusive control and sent nothing"):
            result_of(rig.begin("control.take", b"bob", name="Bob").result())
        await rig.run(3)
        assert rig.bench.board.state not in HOT
        assert (await rig.ask("control.take", client=b"bob", name="Bob"))["holder"] == "Bob"
        assert not (await rig.ask("motion"))["armed"]


async def test_a_lease_that_lapsed_is_not_its_holders_any_more(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        ada = await _Lapsed(rig).begin()
        await rig.run_for(0.1)
        with pytest.raises(Refused, match="your exclusive control has ended"):
            await rig.ask("current", client=b"ada", members=ada, i_x_A=1.0)
        await rig.run(3)
        assert rig.bench.board.state not in HOT


async def test_the_name_of_a_socket_seen_before_does_not_hold_its_lease(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        await rig.ask("control.take", client=b"ada", name="Ada")
        with pytest.raises(Refused, match="Ada has exclusive control"):
            await rig.ask("arm", client=b"ada")


async def test_control_of_a_bench_that_another_client_armed_is_refused(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.arm()
        with pytest.raises(Refused, match="armed by another client") as refused:
            await rig.ask("control.take", client=b"bob", name="Bob")
        assert refused.value.reason == "armed"
        await rig.ask("disarm", client=b"bob")
        assert (await rig.ask("control.take", client=b"bob", name="Bob"))["yours"]


async def test_two_who_arm_at_once_are_one_arming_and_one_refusal(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        first, second = rig.begin("arm", b"ada"), rig.begin("arm", b"bob")
        with pytest.raises(Refused, match="being armed already"):
            result_of(await rig.run_until(second))
        assert result_of(await rig.run_until(first))["armed"]
        await rig.ask("disarm")
        await rig.run_until(_safe(rig))
        assert (await rig.ask("arm", client=b"bob"))["armed"]


async def test_an_arming_that_is_never_begun_keeps_nobody_out(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        dropped = rig.daemon.service.arm(api.Arm(), Caller(b"ada"))
        assert isinstance(dropped, Coroutine)
        dropped.close()
        assert (await rig.ask("arm", client=b"bob"))["armed"]


async def test_who_loses_control_while_arming_does_not_arm(tmp_path: Path) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        arming = rig.begin("arm", b"ada")
        # Nobody had control and nothing is armed yet: Bob may take it.
        assert result_of(rig.begin("control.take", b"bob", name="Bob").result())["yours"]
        with pytest.raises(Refused, match="Bob has exclusive control"):
            result_of(await rig.run_until(arming))
        await rig.run_for(3.0)
        assert rig.bench.board.state is BoardState.SAFE
