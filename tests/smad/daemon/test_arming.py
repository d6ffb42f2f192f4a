"""No refusal leaves an axis armed: what is not known to be off is off, axis by axis."""

from __future__ import annotations

import random
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from campaign.virtual import Refused, result_of
from firmware_protocol import messages as wire
from firmware_protocol.enums import Fault
from sim_device.faults import injection
from smad.config import DaemonConfig
from tests.smad.daemon.axes import NAMES, axes_in, lines
from tests.smad.daemon.rig import Rig
from tests.smad.daemon.tap import Tap, TappedLine, tapped
from tests.smad.daemon.test_axes import STEP, all_safe, hot, silent_for

MOST_US = 25_000
"""For so long a board may be armed after the reply to a stop, a refusal, or a lapse."""


def taps_of(rig: Rig) -> dict[str, Tap]:
    return {name: line.tap for name, line in rig.lines.items() if isinstance(line, TappedLine)}


@asynccontextmanager
async def tapped_axes(folder: Path, **sections: Any) -> AsyncIterator[tuple[Rig, dict[str, Tap]]]:
    """A started bench of three axes with a tap on each line, its boards ready to be armed."""
    boards = {name: tapped(line) for name, line in lines().items()}
    async with axes_in(folder, boards, **sections) as rig:
        await rig.connected()
        yield rig, taps_of(rig)


async def stayed_off(rig: Rig, told_us: int, names: Sequence[str] = NAMES) -> None:
    """Let three seconds pass; nothing was armed in them."""
    await rig.run_for(3.0)
    taps = taps_of(rig)
    longest = {name: taps[name].armed_after(told_us, rig.now_us()) for name in names}
    assert max(longest.values()) <= MOST_US, longest


def of(kind: type[wire.Message]) -> Any:
    return lambda message: isinstance(message, kind)


def answers_to(kind: type[wire.Message]) -> Any:
    number = kind.info.number
    return lambda message: isinstance(message, wire.Done) and message.request_type == number


@pytest.mark.parametrize("own", [(), NAMES])
@pytest.mark.parametrize("after_ms", [0, 10, 20, 40])
async def test_a_board_that_faults_right_after_it_was_armed_leaves_none_armed(
    tmp_path: Path, own: Sequence[str], after_ms: int
) -> None:
    async with tapped_axes(tmp_path, own=own) as (rig, taps):
        bench = rig.lines["yaw-1"].bench

        def fault_once_confirmed(message: wire.Message) -> bool:
            if isinstance(message, wire.ArmConfirm):
                at_s = bench.now_us * 1e-6 + after_ms * 1e-3
                bench.faults.add(injection("sensor_open", at_s))
                # Its answer is late: the fault comes first.
                taps["yaw-1"].to_host = answers_to(wire.ArmConfirm)
            return False

        taps["yaw-1"].to_board = fault_once_confirmed
        with pytest.raises(Refused):
            await rig.ask("arm")
        await stayed_off(rig, rig.now_us())


@pytest.mark.parametrize("names", [NAMES, ("yaw-1",)])
@pytest.mark.parametrize("own", [(), NAMES])
async def test_lost_answers_to_the_confirmation_leave_no_axis_armed(
    tmp_path: Path, own: Sequence[str], names: Sequence[str]
) -> None:
    async with tapped_axes(tmp_path, own=own) as (rig, taps):
        taps["yaw-1"].to_host = answers_to(wire.ArmConfirm)
        with pytest.raises(Refused) as refused:
            await rig.ask("arm", members={"axis": list(names)})
        assert refused.value.reason == "no_reply"
        await stayed_off(rig, rig.now_us())


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("seed", range(4))
async def test_an_arming_on_a_bad_line_is_whole_or_leaves_no_axis_armed(
    tmp_path: Path, share: float, seed: int
) -> None:
    async with tapped_axes(tmp_path) as (rig, taps):
        rng = random.Random(f"{share} {seed}")
        for tap in taps.values():
            tap.to_board = tap.to_host = lambda _: rng.random() < share
        try:
            motion = await rig.ask("arm")
        except Refused:
            await stayed_off(rig, rig.now_us())
        else:
            assert motion["armed"]


async def test_the_lease_of_a_refused_arming_lives_until_its_axes_are_off(tmp_path: Path) -> None:
    async with tapped_axes(tmp_path) as (rig, taps):
        lease = (await rig.ask("control.take", name="Ada", lease_s=30.0))["lease"]
        taps["yaw-1"].to_host = answers_to(wire.ArmConfirm)
        arming = rig.begin("arm", members={"lease": lease})
        while not arming.done():
            await rig.run(1)
            if hot(rig):
                assert (await rig.ask_still("status"))["control"]["holder"] == "Ada"
        assert hot(rig) == []


async def test_the_dead_man_watches_each_axis_for_the_client_that_armed_it(tmp_path: Path) -> None:
    daemon = DaemonConfig(ipc_dir=str(tmp_path), dead_man_lease_s=1.0)
    async with tapped_axes(tmp_path, daemon=daemon) as (rig, _):
        await rig.ask("arm", b"ada", members={"axis": "yaw-1"})
        await rig.ask("arm", b"bob", members={"axis": "pitch-1"})
        for _ in range(5):
            await silent_for(rig, 0.3)
            await rig.ask("motion", b"bob")
        assert "yaw-1" not in hot(rig), "Ada has been silent for longer than she may"


async def test_control_of_a_bench_is_not_taken_over_by_arming_another_axis(tmp_path: Path) -> None:
    async with tapped_axes(tmp_path) as (rig, _):
        await rig.ask("arm", b"ada", members={"axis": "yaw-1"})
        await rig.ask("arm", b"bob", members={"axis": "pitch-1"})
        for client in (b"ada", b"bob", b"eve"):
            with pytest.raises(Refused, match="armed by another client"):
                await rig.ask("control.take", client, name="X")


@pytest.mark.parametrize("own", [(), NAMES])
async def test_a_stop_that_is_open_on_one_axis_refuses_arming_on_every_axis(
    tmp_path: Path, own: Sequence[str]
) -> None:
    async with tapped_axes(tmp_path, own=own) as (rig, taps):
        await rig.ask("arm", members={"axis": "yaw-1"})
        taps["yaw-1"].to_board = of(wire.Disarm)
        stopping = rig.begin("disarm", b"other")
        while not stopping.done():
            for name in ("pitch-1", "pitch-2"):
                with pytest.raises(Refused, match="being stopped"):
                    result_of(rig.begin("arm", members={"axis": name}).result())
            await rig.run(1)
        assert hot(rig) == []
        await stayed_off(rig, rig.now_us())


async def test_a_generation_of_an_earlier_daemon_arms_nothing(tmp_path: Path) -> None:
    boards = {name: tapped(line) for name, line in lines().items()}
    async with axes_in(tmp_path, boards, nonce=7) as rig:
        await rig.connected()
        before = {"generation": (await rig.ask("arm"))["generation"]}
        # Killed: it disarms nothing.
    async with axes_in(tmp_path, boards, nonce=8) as rig:
        await rig.connected()
        await rig.ask("disarm", b"a person")
        await rig.run_until(all_safe(rig))
        for method, params in (("arm", {}), ("together", {"moves": {"yaw-1": [STEP]}})):
            with pytest.raises(Refused, match="stopped after this command was issued") as refused:
                await rig.ask(method, members=before, **params)
            assert refused.value.reason == "stopped"
        assert hot(rig) == []
        assert (await rig.ask("motion"))["generation"] < 2**53, "a page reads it exactly"


async def test_a_board_that_confirms_no_stop_is_left_to_its_own_watchdog(tmp_path: Path) -> None:
    async with tapped_axes(tmp_path) as (rig, taps):
        await rig.ask("arm")
        taps["yaw-1"].to_board = of(wire.Disarm)
        motion = await rig.ask("disarm")
        assert motion["axes"]["yaw-1"]["mode"] == "FAULT"
        assert motion["axes"]["yaw-1"]["fault"]["name"] == Fault.SETPOINT_LOST.name
        await stayed_off(rig, rig.now_us())
