"""Oracle O2: how much of the gap the right entry of the library removes at its best fit."""

import dataclasses
import functools
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap.check.case import Part, Task, diagnosed
from smad.gap.check.key import file_digest
from smad.gap.check.score import detected, of_kind
from smad.gap.check.verdicts import CaseVerdict, write_verdicts
from smad.gap.records import Diagnosis
from tests.withheld.errors import WithheldError
from tests.withheld.second_pass import entries, opened, part_of, parts_beside, through


def shrink_of(found: Diagnosis) -> float | None:
    """Largest held-out shrink of a fitted model with effects; None when none was fitted."""
    before = found.verdict.gap_refit
    gaps = [f.gap for f in found.fitted if f.names]
    return 1.0 - min(gaps) / before if gaps and before > 0.0 else None


def judge_entry(task: Task, wanted: dict[str, tuple[str, ...]]) -> Part:
    """The case with nothing but the right entry in the library."""

    def say() -> CaseVerdict:
        found = diagnosed(task, dataclasses.replace(task.how, effects=wanted[task.case.id]))
        return CaseVerdict(outcome="effect", shrink_best_entry=shrink_of(found))

    return part_of(task, say)


def run(verdicts: Path, key: Path, bank: Path, out: Path, *, jobs: int) -> None:
    """Fit the right entry of every detected single effect; write the verdicts with its shrink.

    Raises WithheldError as `second_pass.opened`.
    """
    try:
        frozen = opened(verdicts, key, bank)
        library = frozen.how.library()
        wanted = {
            p.case: found
            for p in of_kind(frozen.pairs, "single")
            if detected(p.said)
            and p.said.shrink is not None
            and (found := entries(library, p.truth.effects[0].name))
        }
        work = functools.partial(judge_entry, wanted=wanted)
        parts = parts_beside(out, file_digest(verdicts), "best-entry")
        oracle = through(frozen, list(wanted), parts, work, jobs)
        after = dict(frozen.file.verdicts)
        for case, said in oracle.items():
            after[case] = msgspec.structs.replace(
                after[case], shrink_best_entry=said.shrink_best_entry
            )
        write_verdicts(out, msgspec.structs.replace(frozen.file, verdicts=after))
    except SmadError as error:
        raise WithheldError(str(error)) from error
    print(f"{len(oracle)} of {len(wanted)} cases fitted: {out}")
