"""The table of programs that arm, phases in which they are stopped, and stops."""

from __future__ import annotations

import asyncio
import functools
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

import smad.checkup.check
import smad.checkup.investigation
import smad.client
from sim_device.plant.models import built_in
from smad.checkup.investigation import Investigation
from smad.checkup.programme import shipped
from smad.checkup.store import Baseline
from smad.cli import root
from smad.control.commands import DriveCurrent, Hold
from smad.control.plan import Do, Pause, Plan
from smad.demo import job
from smad.errors import SmadError
from smad.experiments.driver import log_path
from smad.experiments.repeating import RecordedInputs
from smad.experiments.virtual import VirtualDriver

STOPS = ("disarm", "estop", "lapse", "link loss", "board fault")


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


async def _awaited() -> None:
    async with smad.client.AsyncClient() as bench:
        for _ in range(2):
            async with bench.armed():
                await bench.idle()
                for _ in range(5):
                    await bench.motion()
                async with bench.record("a run"):
                    await bench.move(Hold(duration_s=1.0))
                    await bench.wait_until_done()
                    await bench.idle()


def _async_notebook(folder: Path) -> str:
    """As `_notebook`, with the client for asyncio."""
    try:
        asyncio.run(_awaited())
    except SmadError as error:
        return str(error)
    return ""


def _moved(folder: Path) -> str:
    """Two commands, as a person types them; the second one only after the first."""
    return _cli("arm")(folder) or _cli("move", "sine", "1", "20")(folder)


@functools.cache
def _recorded() -> bytes:
    plan = Plan("recorded", (Do(DriveCurrent(i_x_A=1.0)), Pause(5.0)))
    with tempfile.TemporaryDirectory() as folder:
        VirtualDriver(built_in("A"), folder=Path(folder)).run(plan)
        return log_path(Path(folder), plan).read_bytes()


def _repeat(*more: str) -> Callable[[Path], str]:
    def program(folder: Path) -> str:
        (folder / "recorded.mcap").write_bytes(_recorded())
        return _cli("run", "repeat", "recorded.mcap", "--other-bench", *more)(folder)

    return program


def _judged(*arguments: object, **options: object) -> None:
    raise SmadError("judged as far as it goes")


def _against_a_baseline(*words: str) -> Callable[[Path], str]:
    """A command that plays a run of a baseline again, which was recorded in virtual time."""

    def program(folder: Path) -> str:
        programme = shipped().quick()
        name = programme.runs[0].name
        good = folder / "baseline" / "good-1"
        good.mkdir(parents=True)
        (good / f"{name}.mcap").write_bytes(_recorded())
        reference = SimpleNamespace(runs=[SimpleNamespace(name=name)], names={name})
        baseline = Baseline("bench", programme.digest, reference)  # type: ignore[arg-type]
        with pytest.MonkeyPatch.context() as patch:
            for room in (smad.checkup.check, smad.checkup.investigation):
                patch.setattr(room, "load", lambda folder, plant: baseline)
            patch.setattr(RecordedInputs, "require_bench", lambda self, uid, bench: None)
            # A run that tripped is judged as far as it goes; there is nothing to judge it by here.
            patch.setattr(smad.checkup.check, "judge_runs", _judged)
            patch.setattr(Investigation, "_judged", _judged)
            return _cli(*words)(folder)

    return program


_PLAYS = ("before arming", "arming", "warm-up", "recording")
PROGRAMS: dict[str, tuple[Callable[[Path], str], tuple[str, ...]]] = {
    "Client.armed()": (
        _notebook,
        ("arming", "warm-up", "recording", "last phase", "between runs"),
    ),
    "AsyncClient.armed()": (
        _async_notebook,
        ("arming", "warm-up", "recording", "last phase", "between runs"),
    ),
    "smad arm, smad move": (_moved, ("arming", "moving")),
    "smad run repeat": (_repeat(), ("before arming", "arming", "warm-up")),
    "smad run repeat --as-is": (_repeat("--as-is"), ("before arming", "arming", "recording")),
    "smad gap checkup": (_against_a_baseline("gap", "checkup", "--baseline", "baseline"), _PLAYS),
    "smad gap investigate": (
        _against_a_baseline("gap", "investigate", "--baseline", "baseline"),
        _PLAYS,
    ),
    "smad demo": (_demo, ("before arming", "arming", "recording")),
    "smad run resistance": (
        _cli("run", "resistance"),
        _PLAYS,
    ),
    "smad tune": (_cli("tune", "--yes"), _PLAYS),
    "smad gap next --run": (
        _cli("gap", "next", "--run", "one side"),
        _PLAYS,
    ),
    "smad gap commission": (
        _cli("gap", "commission", "--baseline", "baseline", "--quick"),
        _PLAYS,
    ),
}
_LASTING = ("smad arm, smad move",)
"""Armed by a command that takes no lease: none lapses."""
CASES = [
    (program, phase, stop)
    for program, (_, phases) in PROGRAMS.items()
    for phase in phases
    for stop in STOPS
    # What is not armed has no lease that a frozen program could let lapse to any effect.
    if not (stop == "lapse" and phase in ("before arming", "arming", "between runs"))
    if not (stop == "lapse" and program in _LASTING)
]
