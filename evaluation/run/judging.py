"""What the product says of a case of a bank, and of what that depends. Nothing here opens a key."""

from __future__ import annotations

import functools
import hashlib
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec

import evaluation.run
from evaluation.checkout import source_digest
from evaluation.errors import BankError
from evaluation.run.manifest import ROLES, BankRun, Case, Manifest
from evaluation.score.answers import Cause as ScoredCause
from evaluation.score.first_step import ScoredVerdict, scored
from sim_device.plant import load_parameters
from smad.checkup.files import read_file
from smad.checkup.judge import commissioned, judge_runs
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.paired.good import GoodRuns
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import CHECK_UP, QUIET
from smad.errors import SmadError
from smad.runlog.bounds import Together


@dataclass(frozen=True)
class Judged:
    """What became of one case: a verdict as JSON has it, or why there is none; processor time."""

    case: str
    verdict: dict[str, Any] | None = None
    error: str = ""
    cpu_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Check:
    """A check of a bank: how its cases are judged, and what was worked out for several of them.

    `params` and `variant` are those of the plant. Of each bench the first `repeats` good recordings
    count, None: all. A case of `left_out` is judged once more without these entries of the library:
    cause and entries by case.
    """

    folder: Path
    manifest: Manifest
    params: str = "A"
    variant: str = "extended"
    repeats: int | None = None
    left_out: Mapping[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)

    @functools.cached_property
    def plant(self) -> SmaPlant:
        """The model that the bank is compared with."""
        return SmaPlant(load_parameters(self.params), self.variant)

    def plant_without(self, entries: Sequence[str]) -> SmaPlant:
        """The same without some entries of its library."""
        names = tuple(e.name for e in self.plant.effects if e.name not in entries)
        return replace(self.plant, only=names)

    @functools.cached_property
    def _digests(self) -> dict[str, str]:
        return {}

    @functools.cached_property
    def _references(self) -> dict[str, GoodRuns]:
        return {}

    @property
    def how(self) -> dict[str, Any]:
        """How every case is judged, as the verdict file tells it."""
        return {"params": self.params, "variant": self.variant, "repeats": self.repeats}

    def made_of(self, case: Case) -> str:
        """SHA-256 of all that a verdict depends on: runs, code, model, question.

        A whole bank takes seconds. The Python interpreter and the processor, which may turn a last
        digit, do not count. Raises BankError for a run file that is missing.
        """
        files = [(r.file, r.role, self._digest(case, r.file)) for x in ROLES for r in case.of(x)]
        left_out = self.left_out.get(case.id)
        inputs = (
            case.question,
            files,
            source_digest(evaluation.run),
            self.plant.version,
            self.how,
            left_out,
        )
        return hashlib.sha256(msgspec.json.encode(inputs, order="deterministic")).hexdigest()

    def _digest(self, case: Case, file: str) -> str:
        if file not in self._digests:
            try:
                with (self.folder / file).open("rb") as opened:
                    self._digests[file] = hashlib.file_digest(opened, "sha256").hexdigest()
            except OSError as error:
                raise BankError(
                    f"{case.id}: run file {file} cannot be read ({error.strerror}): restore it, "
                    "or leave the case out with --only"
                ) from None
        return self._digests[file]

    def runs(self, case: Case, *roles: str) -> dict[str, list[GapRun]]:
        """The runs of a case by role. Raises BankError, naming the file, for one of no use."""
        names = [] if case.question == CHECK_UP else [r.name for r in case.runs]
        together = Together()

        def read(run: BankRun) -> GapRun:
            try:
                gap_run = read_file(self.folder / run.file, together).run
            except SmadError as error:
                raise BankError(f"{self.folder / run.file} cannot be used: {error}") from error
            return replace(gap_run, name=run.file) if names.count(run.name) > 1 else gap_run

        return {role: [read(run) for run in case.of(role)] for role in roles}

    def reference(self, case: Case) -> GoodRuns:
        """The good bench of a check-up, commissioned once from its repeats."""
        if case.bench not in self._references:
            groups: dict[str, list[GapRun]] = {}
            for run in self.runs(case, "good")["good"]:
                groups.setdefault(run.name, []).append(run)
            used = [group[: self.repeats] for group in groups.values()]
            self._references[case.bench] = commissioned(self.plant, used)
        return self._references[case.bench]


def judge(check: Check, case: Case, made_of: str) -> Judged:
    """The verdict on one case, if it is still of what it was to be `made_of`.

    An error in it becomes part of the answer, and stops nothing else.
    """
    try:
        if check.made_of(case) != made_of:
            raise BankError("code or runs are other than the check began with: start it again")
        return _checked_up(check, case) if case.question == CHECK_UP else _diagnosed(check, case)
    except (SmadError, BankError) as error:
        return Judged(case.id, error=str(error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        return Judged(case.id, error=f"internal error: {type(error).__name__}: {error} ({place})")


def _diagnosed(check: Check, case: Case) -> Judged:
    began = time.process_time()
    runs = check.runs(case, *ROLES)

    def ask(plant: SmaPlant) -> ScoredVerdict:
        good, held_out = runs["good"], runs["hold_out"]
        return scored(diagnose(runs["fit"], plant=plant, good=good, hold_out=held_out))

    verdict = ask(check.plant)
    cpu_s = _since(began)
    return Judged(case.id, _reported(check, case, verdict, ask), cpu_s=cpu_s)


def _checked_up(check: Check, case: Case) -> Judged:
    reference = check.reference(case)
    runs = [(run, run.name) for run in check.runs(case, "fit")["fit"]]

    def ask(plant: SmaPlant) -> ScoredVerdict:
        return scored(judge_runs(plant, reference, runs))

    began = time.process_time()
    verdict = ask(check.plant)
    cpu_s = _since(began)
    return Judged(case.id, _reported(check, case, verdict, ask), cpu_s=cpu_s)


def _since(began: float) -> float:
    return round(time.process_time() - began, 2)


def _reported(
    check: Check, case: Case, verdict: ScoredVerdict, ask: Callable[[SmaPlant], ScoredVerdict]
) -> dict[str, Any]:
    """The verdict as it is kept: without model files, which are long and which nothing scores.

    Where the right entry is to be left out, what is reported without it stands beside.
    """
    record: dict[str, Any] = msgspec.to_builtins(msgspec.structs.replace(verdict, models=[]))
    if case.id in check.left_out and verdict.outcome != QUIET:
        cause, entries = check.left_out[case.id]
        less = ask(check.plant_without(entries))
        first = msgspec.convert(
            msgspec.to_builtins(less.causes[0]) if less.causes else {"place": ""}, ScoredCause
        )
        record["left_out"] = {
            cause: {
                "outcome": less.outcome,
                "places": sorted(first.reported_places),
                "name": first.reported_name,
            }
        }
    return record
