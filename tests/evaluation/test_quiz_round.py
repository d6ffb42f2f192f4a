"""One round of the quiz, unattended: runs through the daemon, then the answer.

The daemon is the real one, on virtual time; at the other end of its wire is the withheld plant.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest

from campaign.virtual import Line
from evaluation.command import main
from evaluation.quiz import mystery as quiz
from evaluation.quiz.wire_board import WireBoard
from smad.api import BY_PARAMS
from smad.control.plan import Do, Pause
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.catalogue import plan_named
from smad.diagnosis.spring_pair.signals import read_gap_run
from tests.smad.daemon.rig import Rig, rig_in

SEED = 5
LONGEST_S = 36.0


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


async def test_a_round_goes_from_the_wire_to_run_logs_and_then_the_answer_opens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    note = tmp_path / "mystery.json"
    session = Session(quiz.begin(SEED, note), tmp_path)
    sealed = json.loads(note.read_text())["sealed_sha256"]
    (good,) = await session.record(("pulses", 3), good=True)
    (run,) = await session.record(("pulses", 3))
    assert good.t_s[-1] - good.t_s[0] > 30.0
    assert run.t_s[-1] - run.t_s[0] > 30.0

    main(["reveal", "--note", str(note)])
    reported = capsys.readouterr().out
    answer = json.loads(reported)
    text = json.dumps(answer, sort_keys=True, ensure_ascii=False)
    assert hashlib.sha256(text.encode()).hexdigest() == sealed
    assert answer["effects"][0]["name"] == "rtd_lag"
