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
from smad.experiments.live import LiveDriver
from smad.processes.stops import HandedOver


class _Rival(Struct, frozen=True):
    kind: str
    probability: float


class _Cause(Struct, frozen=True):
    rivals: list[_Rival] = []


class _Verdict(Struct, frozen=True):
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


def judged_by_command(
    words: Sequence[str], bench: str, number: int, stops: int | None = None
) -> tuple[Judgement, int | None]:
    """Play `smad gap checkup --quick` with these words as a queue does, after `number` cycles.

    It knows of the `stops` up to that generation; returned beside the judgement is the last one
    that it knows of in the end. Raises SmadError when it fails.
    """
    handed = HandedOver(stops)
    with tempfile.TemporaryDirectory(prefix="smad-") as scratch:
        verdict = Path(scratch) / "verdict.json"
        program = (sys.executable, "-m", "smad.cli.queue_child", str(os.getpid()), bench)
        arguments = ("gap", "checkup", "--quick", f"--json={verdict}", *words)
        try:
            done = subprocess.run(
                [*program, *arguments],
                capture_output=True,
                text=True,
                check=False,
                env={**os.environ, "SMAD_BENCH": bench, **handed.environment},
                pass_fds=(handed.descriptor,),
            )
        finally:
            handed.close_descriptor()
        if done.returncode:
            lines = done.stderr.strip().splitlines() or ["it said nothing"]
            after = counted(number, "cycle")
            raise SmadError(
                f"the check-up after {after} failed: {lines[-1].removeprefix('smad: ')}",
                action="look at the bench; --go-on continues",
            )
        return judgement_of(verdict.read_bytes()), handed.returned()


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
        client = driver.client if isinstance(driver, LiveDriver) else None
        known = None if client is None else client.known
        judgement, known = judged_by_command(words, bench, number, known)
        if client is not None:
            # The check-up's own disarms are known; a stop by somebody else is not.
            client.as_of(known)
        return judgement

    return check
