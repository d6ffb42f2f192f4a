"""A check-up after so many cycles, as a command of its own, and what its JSON says."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from smad.counted import counted
from smad.errors import SmadError
from smad.experiments.endurance.run import BlockDriver, Judgement
from smad.experiments.leased import LeasedDriver


class _Rival(Struct, frozen=True):
    kind: str
    probability: float


class _Cause(Struct, frozen=True):
    rivals: list[_Rival] = []


class _Verdict(Struct, frozen=True):
    outcome: str
    headline: str
    causes: list[_Cause] = []


def judgement_of(data: bytes) -> Judgement:
    """Return headline and probability that an effect or a law has come.

    Of causes it is that of the surest; of a cause without a table of rivals, 1. Raises
    msgspec.MsgspecError.
    """
    verdict = msgspec.json.decode(data, type=_Verdict)
    sure = [
        sum(r.probability for r in cause.rivals if r.kind in ("effect", "law"))
        if cause.rivals
        else 1.0
        for cause in verdict.causes
    ]
    return Judgement(verdict.headline, min(1.0, max(sure, default=0.0)))


def judged_by_command(words: Sequence[str], bench: str, number: int) -> Judgement:
    """Play `smad gap checkup --quick` with these words as a queue does, after `number` cycles.

    Raises SmadError when it fails.
    """
    with tempfile.TemporaryDirectory(prefix="smad-") as scratch:
        verdict = Path(scratch) / "verdict.json"
        program = (sys.executable, "-m", "smad.cli.queue_child", str(os.getpid()), bench)
        arguments = ("gap", "checkup", "--quick", f"--json={verdict}", *words)
        environment = {**os.environ, "SMAD_BENCH": bench}
        done = subprocess.run(
            [*program, *arguments], capture_output=True, text=True, check=False, env=environment
        )
        if done.returncode:
            lines = done.stderr.strip().splitlines() or ["it said nothing"]
            after = counted(number, "cycle")
            raise SmadError(
                f"the check-up after {after} failed: {lines[-1].removeprefix('smad: ')}",
                action="look at the bench; --go-on continues",
            )
        return judgement_of(verdict.read_bytes())


def checker(
    baseline: Path,
    folder: Path,
    driver: BlockDriver,
    bench: str,
    simulated: tuple[int, Sequence[str]] | None,
) -> Callable[[int], Judgement]:
    """What plays the check-up after so many cycles, between blocks of a driver.

    Its runs go into `folder`. `simulated`: seed and effects of a simulated bench; None: it is the
    bench of that name.
    """

    def check(number: int) -> Judgement:
        words = [f"--baseline={baseline}", f"--out={folder / f'checkup-{number:07d}'}"]
        if simulated is not None:
            seed, effects = simulated
            words += ["--sim", f"--seed={seed + number}", *(f"--effect={text}" for text in effects)]
        judgement = judged_by_command(words, bench, number)
        if isinstance(driver, LeasedDriver):
            # The check-up's own disarms were orderly: it says so by its status.
            driver.client.as_of(driver.client.motion().generation)
        return judgement

    return check
