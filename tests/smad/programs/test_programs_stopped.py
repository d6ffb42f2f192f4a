"""Every program that arms, stopped in every phase in every way: nothing is armed afterwards."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import pytest

import smad.client
from campaign import virtual
from smad.client import NotInControl, Refused, Stopped
from smad.control.commands import DriveCurrent, Hold
from smad.demo import job
from smad.experiments import replayer
from smad.runlog.reader import read_run
from smad.runlog.schema import CUT
from tests.smad.daemon.rig import rig_in
from tests.smad.programs.stage import Stage, set_up
from tests.smad.programs.table import CASES, PROGRAMS

WARM_DEGC = 31.0
"""Strokes before a run go so far only, since they are not what is stopped here."""
SAID = {
    "disarm": "stopped by disarm of a client",
    "estop": "stopped by estop of a client",
    "lapse": "stopped by a lapsed lease",
    "link loss": "stopped by loss of the link",
    "board fault": "stopped by the board, which went into FAULT",
}


@pytest.mark.parametrize(("name", "phase", "stop"), CASES)
async def test_a_stop_ends_the_program_and_nothing_is_armed_afterwards(
    name: str, phase: str, stop: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stage = Stage(rig, phase, stop)
        set_up(stage, monkeypatch)
        monkeypatch.setattr(job, "ARM_DEADLINE_S", 0.1)
        monkeypatch.setattr(replayer, "STROKE_DEGC", WARM_DEGC)
        program = PROGRAMS[name][0]
        said = await stage.play(program, tmp_path)
        assert stage.stopped, f"{name} never came to {phase}: {said}"
        assert said, f"{name} ended as if nothing had been"
        await rig.run_for(1.0)
        motion: Any = await rig.ask("motion")
        assert not motion["armed"], motion
        armings = rig.said.count("→ ARMED")
        assert armings == ARMINGS[phase], rig.said
        if phase == "recording":
            await rig.wait_for(rig.daemon.recorder.stop())
            (path,) = (tmp_path / "runs").glob("*.mcap")
            texts = [event.text for event in read_run(path).events]
            if stop != "board fault":
                assert any(t.startswith(CUT) and SAID[stop] in t for t in texts), texts


async def test_who_armed_and_met_a_fault_gives_control_back_and_cannot_heat_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stage = Stage(rig, "moving", "board fault")
        set_up(stage, monkeypatch)
        said: list[str] = []

        def program() -> None:
            bench = smad.client.Client()
            bench.arm()
            bench.move(Hold(duration_s=20.0))
            with pytest.raises(Stopped):
                bench.wait_until_done()
            said.append(bench.status().control.holder)
            for again in (bench.arm, lambda: bench.current(DriveCurrent(i_x_A=1.0))):
                with pytest.raises(Refused):
                    again()
            said.append(bench.status().control.holder)

        await stage.play(program)
        assert stage.stopped
        assert said == ["", ""]
        assert rig.said.count("→ ARMED") == 1


class Overtaken(Stage):
    """Somebody else arms while the program is frozen, once its lease has lapsed."""

    async def _stop(self) -> None:
        await super()._stop()
        for _ in range(60):
            with contextlib.suppress(virtual.Refused):
                await self.rig.ask("arm", b"somebody else")
                return
            await self.rig.run_for(0.5)


@pytest.mark.parametrize(
    ("name", "phase"), [case[:2] for case in CASES if case[1:] == ("recording", "lapse")]
)
async def test_a_program_that_wakes_up_after_its_lease_does_not_stop_who_came_after_it(
    name: str, phase: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stage = Overtaken(rig, phase, "lapse")
        set_up(stage, monkeypatch)
        monkeypatch.setattr(replayer, "STROKE_DEGC", WARM_DEGC)
        assert await stage.play(PROGRAMS[name][0], tmp_path)
        assert stage.stopped
        assert rig.said.count("→ ARMED") == 2, rig.said
        assert (await rig.ask("motion"))["armed"], rig.said


async def test_a_client_whose_lease_has_lapsed_disarms_what_it_arms_after_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stage = Stage(rig, "moving", "lapse")
        set_up(stage, monkeypatch)

        def program() -> None:
            bench = smad.client.Client(lease_s=None)
            with contextlib.suppress(NotInControl), bench.in_control("Ada", 2.0):
                bench.arm()
                bench.move(Hold(duration_s=20.0))
                with pytest.raises(Stopped):
                    bench.wait_until_done()
                bench.idle()
            bench.as_of(None)
            with pytest.raises(ZeroDivisionError), bench.armed():
                raise ZeroDivisionError

        await stage.play(program)
        assert rig.said.count("→ ARMED") == 2, rig.said
        assert not (await rig.ask("motion"))["armed"]


async def test_who_was_stopped_does_not_stop_the_next_one_as_its_own_block_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        stage = Stage(rig, "moving", "disarm")
        set_up(stage, monkeypatch)

        def program() -> None:
            with smad.client.Client() as bench, bench.armed():
                bench.move(Hold(duration_s=20.0))
                try:
                    bench.wait_until_done()
                finally:
                    # As slow as the disk that closes a run log.
                    stage.do(rig.run_for(1.0))
                    stage.do(rig.ask("arm", b"somebody else"))

        with pytest.raises(Stopped):
            await stage.play(program)
        assert (await rig.ask("motion"))["armed"]


ARMINGS = {
    "before arming": 0,
    "arming": 0,
    "warm-up": 1,
    "recording": 1,
    "last phase": 1,
    "moving": 1,
    "between runs": 1,
}


@pytest.mark.parametrize("lease_s", [0.0, 3600.0])
@pytest.mark.parametrize("name", PROGRAMS)
async def test_a_program_that_is_refused_does_not_stop_whoever_uses_the_bench(
    name: str, lease_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    async with rig_in(tmp_path) as rig:
        await rig.connected()
        other: dict[str, Any] = {"client": b"somebody else"}
        if lease_s:
            taken = await rig.ask("control.take", name="somebody", lease_s=lease_s, **other)
            other["members"] = {"lease": taken["lease"]}
        await rig.ask("arm", **other)
        stage = Stage(rig, "never", "")
        set_up(stage, monkeypatch)
        monkeypatch.setattr(job, "ARM_DEADLINE_S", 0.1)
        assert await stage.play(PROGRAMS[name][0], tmp_path)
        motion: Any = await rig.ask("motion")
        assert motion["armed"], motion
