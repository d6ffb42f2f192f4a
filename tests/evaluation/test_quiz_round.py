"""One round of the quiz, unattended: runs through the daemon, a verdict, one more run, the answer.

The daemon is the real one, on virtual time; at the other end of its wire is the withheld plant.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest
from smad.gap import Diagnosis, Settings, diagnose
from smad.gap.records import Outcome

from evaluation.command import main
from evaluation.quiz import mystery as quiz
from evaluation.quiz.wire_board import WireBoard
from smad.api import BY_PARAMS
from smad.control.plan import Do, Pause
from smad.diagnosis import diagnose
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.catalogue import plan_named
from smad.diagnosis.spring_pair.signals import read_gap_run
from smad.faults.virtual import Line
from tests.evaluation.quick import quicken
from tests.smad.daemon.rig import Rig, rig_in

SEED = 5
LONGEST_S = 36.0
# The laws belong to it: without them the model leaves more of any bench than the effect does.
LIBRARY = ("rtd_lag", "driver_gain", "flow_shortfall", "cooling_front", "unified_kinetics")
QUICK = Settings(max_effects=1)


class Lent:
    """The quiz's board as the rig wants it: what it answers at once goes out with the next step."""

    def __init__(self, board: WireBoard) -> None:
        self._board = board
        self._answers = b""

    @property
    def now_us(self) -> int:
        return self._board.now_us

    @property
    def period_us(self) -> int:
        return self._board.period_us

    def receive(self, data: bytes) -> None:
        self._answers += self._board.receive(data)

    def step(self) -> bytes:
        answers, self._answers = self._answers, b""
        return answers + self._board.step()


async def _carry_out(rig: Rig, name: str, seed: int) -> None:
    """An experiment of the catalogue through the daemon's commands, cut off after a while."""
    left_s = LONGEST_S
    for action in plan_named(name, seed).actions:
        if isinstance(action, Do):
            method = BY_PARAMS[type(action.command)].name
            await rig.ask(method, **msgspec.to_builtins(action.command))
        elif isinstance(action, Pause):
            await rig.run_for(min(action.seconds, left_s))
            left_s -= action.seconds
        if left_s <= 0.0:
            break


@dataclass
class Session:
    """A bench of the riddle on the daemon's wire; every recording is a run log in `folder`."""

    riddle: quiz.Riddle
    folder: Path

    async def record(self, *wanted: tuple[str, int], good: bool = False) -> list[GapRun]:
        """Record experiments one after the other, each from rest, the same every time."""
        active = () if good else self.riddle.active
        runs = []
        for name, seed in wanted:
            folder = self.folder / f"{'good' if good else 'test'} {name} {seed}"
            folder.mkdir()
            board = Lent(WireBoard(self.riddle.bench, active, 100 + seed))
            lines = {"": Line(board)}  # type: ignore[arg-type]
            async with rig_in(folder, lines) as rig:
                await rig.arm()
                await rig.ask_still("record.start", name=folder.name.replace(" ", "-"))
                await _carry_out(rig, name, seed)
                await rig.ask_still("record.stop")
            (log,) = folder.rglob("*.mcap")
            runs.append(read_gap_run(log))
        return runs


@pytest.fixture
def one_thread() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(max_workers=1) as executor:
        yield executor


async def test_a_round_goes_from_the_wire_to_a_verdict_and_then_the_answer_opens(
    tmp_path: Path,
    one_thread: ThreadPoolExecutor,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    quicken(
        monkeypatch, _LONGER_FITS=1, _LAW_ROUNDS=2, _LAW_ROUNDS_LAST=2, FIT_ITERATIONS=6,
        REFIT_ITERATIONS=4,
    )  # fmt: skip
    note = tmp_path / "mystery.json"
    session = Session(quiz.begin(SEED, note), tmp_path)
    sealed = json.loads(note.read_text())["sealed_sha256"]
    good = await session.record(("pulses", 1), ("stairs", 2), good=True)
    runs = await session.record(("pulses", 3), ("mixed", 4))
    held = await session.record(("sines", 5))

    def ask(tested: list[GapRun], library: tuple[str, ...]) -> Diagnosis:
        return diagnose(
            tested,
            plant=SmaPlant(only=library),
            good=good,
            hold_out=held,
            settings=QUICK,
            executor=one_thread,
        )

    verdict = ask(runs, LIBRARY[:2])
    assert {r.name for r in verdict.runs if r.role == "fit"} == {r.name for r in runs}
    recommended = verdict.experiments[0].name if verdict.experiments else "two rates"
    runs += await session.record((recommended, 6))
    verdict = ask(runs, LIBRARY)
    assert len([r for r in verdict.runs if r.role == "fit"]) == 3
    assert all(r.duration_s > 30.0 for r in verdict.runs)
    assert verdict.verdict.outcome not in (Outcome.REFUSED, Outcome.NO_EXCITATION)
    assert verdict.verdict.gap_raw > 0.0

    main(["reveal", "--note", str(note)])
    told = capsys.readouterr().out
    answer = json.loads(told)
    text = json.dumps(answer, sort_keys=True, ensure_ascii=False)
    assert hashlib.sha256(text.encode()).hexdigest() == sealed
    assert answer["effects"][0]["name"] == "rtd_lag"
    assert verdict.verdict.effects == ["rtd_lag"], verdict.verdict.text
