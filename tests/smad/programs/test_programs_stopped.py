"""Every program that arms, stopped in every phase in every way: nothing is armed afterwards."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import smad.client
from smad.cli import root
from smad.control.commands import Hold
from smad.demo import job
from smad.errors import SmadError
from smad.runlog.reader import read_run
from smad.runlog.schema import CUT
from tests.smad.daemon.rig import rig_in
from tests.smad.programs.stage import Stage, set_up

STOPS = ("disarm", "estop", "lapse", "link loss", "board fault")
SAID = {
    "disarm": "stopped by disarm of a client",
    "estop": "stopped by estop of a client",
    "lapse": "stopped by a lapsed lease",
    "link loss": "stopped by loss of the link",
    "board fault": "stopped by the board, which went into FAULT",
}


def _cli(*words: str) -> Callable[[Path], str]:
    def program(folder: Path) -> str:
        result = CliRunner().invoke(root, list(words))
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            if not isinstance(result.exception, SmadError):
                raise result.exception
            return str(result.exception) or "failed"
        return result.output if result.exit_code else ""

    return program


def _notebook(folder: Path) -> str:
    """Two motions, each in a block of its own, as a loop in a notebook has them."""
    try:
        with smad.client.Client() as bench:
            for _ in range(2):
                with bench.armed():
                    bench.idle()
                    for _ in range(5):
                        bench.motion()
                    with bench.record("a run"):
                        bench.move(Hold(duration_s=1.0))
                        bench.wait_until_done()
                        bench.idle()
    except SmadError as error:
        return str(error)
    return ""


def _demo(folder: Path) -> str:
    try:
        with smad.client.Client() as bench:
            job.run_cycle(bench, lambda text: None)
    except SmadError as error:
        return str(error)
    return ""


PROGRAMS: dict[str, tuple[Callable[[Path], str], tuple[str, ...]]] = {
    "Client.armed()": (
        _notebook,
        ("arming", "warm-up", "recording", "last phase", "between runs"),
    ),
    "smad demo": (_demo, ("before arming", "arming", "recording")),
    "smad run resistance": (
        _cli("run", "resistance"),
        ("before arming", "arming", "warm-up", "recording"),
    ),
    "smad tune": (_cli("tune"), ("before arming", "arming", "warm-up", "recording")),
    "smad gap next --run": (
        _cli("gap", "next", "--run", "one side"),
        ("before arming", "arming", "warm-up", "recording"),
    ),
    "smad gap commission": (
        _cli("gap", "commission", "--baseline", "baseline", "--quick"),
        ("before arming", "arming", "warm-up", "recording"),
    ),
}
CASES = [
    (program, phase, stop)
    for program, (_, phases) in PROGRAMS.items()
    for phase in phases
    for stop in STOPS
    # What is not armed has no lease that a frozen program could let lapse to any effect.
    if not (stop == "lapse" and phase in ("before arming", "arming", "between runs"))
]


@pytest.mark.parametrize(("name", "phase", "stop"), CASES)
async def test_a_stop_ends_the_program_and_nothing_is_armed_afterwards(
    name: str, phase: str, stop: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    async with rig_in(tmp_path) as rig:
        await rig.run_for(2.0)
        stage = Stage(rig, phase, stop)
        set_up(stage, monkeypatch)
        monkeypatch.setattr(job, "ARM_DEADLINE_S", 0.1)
        program = PROGRAMS[name][0]
        said = await asyncio.get_running_loop().run_in_executor(None, program, tmp_path)
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


ARMINGS = {
    "before arming": 0,
    "arming": 0,
    "warm-up": 1,
    "recording": 1,
    "last phase": 1,
    "between runs": 1,
}
