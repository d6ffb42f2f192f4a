"""Oracle O2: how much of the gap the right entry of the library removes, fitted as well as it can.

It needs the key, so that it comes after the verdicts are frozen. It is the one module here, beside
the tests, that uses the product; no module that makes a bank reaches it.
"""

import dataclasses
import functools
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec

from smad.errors import SmadError
from smad.gap import diagnose
from smad.gap.check.bank import open_bank, read_case, require_files
from smad.gap.check.case import How, Part, Task
from smad.gap.check.key import file_digest, read_key
from smad.gap.check.names import canonical
from smad.gap.check.openings import SEALED, Ledger, checkout
from smad.gap.check.running import Order, Progress, check, pool
from smad.gap.check.score import detected, matched, of_kind
from smad.gap.check.verdicts import (
    CaseVerdict,
    VerdictFile,
    read_verdict_file,
    read_verdicts,
    write_verdicts,
)
from smad.gap.records import Diagnosis
from tests.withheld.errors import WithheldError


def entries(library: list[str], name: str) -> tuple[str, ...]:
    """The entries of a library that are one cause of the list; none when it lacks the cause."""
    return tuple(e for e in library if canonical(e) == name)


def shrink_of(found: Diagnosis) -> float | None:
    """Largest held-out shrink of a fitted model with effects; None when none was fitted."""
    before = found.verdict.gap_refit
    gaps = [f.gap for f in found.fitted if f.names]
    return 1.0 - min(gaps) / before if gaps and before > 0.0 else None


def judge_entry(task: Task, wanted: dict[str, tuple[str, ...]]) -> Part:
    """The case with nothing but the right entry in the library, as a part of a check."""
    began = time.perf_counter()
    how = dataclasses.replace(task.how, effects=wanted[task.case.id])
    try:
        runs = read_case(task.bank, task.case)
        with ThreadPoolExecutor(max_workers=1) as one:
            found = diagnose(
                runs.fit,
                plant=how.plant(),
                good=runs.good,
                hold_out=runs.hold_out,
                settings=how.settings_used(),
                executor=one,
            )
    except SmadError as error:
        return Part(task.case.id, time.perf_counter() - began, error=str(error))
    verdict = CaseVerdict(outcome="effect", shrink_best_entry=shrink_of(found))
    return Part(task.case.id, time.perf_counter() - began, verdict)


def merged(file: VerdictFile, oracle: VerdictFile) -> VerdictFile:
    """The verdicts with `shrink_best_entry` of the oracle's."""
    verdicts = {
        case: msgspec.structs.replace(v, shrink_best_entry=oracle.verdicts[case].shrink_best_entry)
        if case in oracle.verdicts
        else v
        for case, v in file.verdicts.items()
    }
    return msgspec.structs.replace(file, verdicts=verdicts)


def _tell(progress: Progress) -> None:
    part = progress.part
    said = part.error if part.verdict is None else f"{part.verdict.shrink_best_entry}"
    left = f"{progress.left_s / 60.0:.0f} min left"
    print(f"{part.case}  {said}  [{progress.done}/{progress.total}, {left}]", file=sys.stderr)


def run(verdicts: Path, key: Path, bank: Path, out: Path, *, jobs: int) -> None:
    """Fit the right entry of every detected single effect; write the verdicts with its shrink.

    Raises WithheldError when the three files do not belong together, or when verdicts on the
    sealed bank have not been scored, and thereby logged, before.
    """
    try:
        _run(verdicts, key, bank, out, jobs)
    except SmadError as error:
        raise WithheldError(str(error)) from error


def _run(verdicts: Path, key: Path, folder: Path, out: Path, jobs: int) -> None:
    file = read_verdict_file(verdicts)
    truth, key_sha256 = read_key(key)
    if truth.bank == SEALED:
        ledger = Ledger.of(checkout())
        ledger.require_sealed(key_sha256)
        ledger.require_entered(file_digest(verdicts))
    how = msgspec.convert(file.tool["how"], How)
    library = [e.name for e in how.plant().effects]
    pairs = of_kind(matched(read_verdicts(verdicts), truth, key_sha256), "single")
    wanted = {
        p.case: found
        for p in pairs
        if detected(p.said)
        and p.said.shrink is not None
        and (found := entries(library, p.truth.effects[0].name))
    }
    opened = open_bank(folder)
    if opened.manifest.key_sha256 != key_sha256:
        raise WithheldError(f"{folder} belongs to another key than {key}: bring the bank's own key")
    cases = [c for c in opened.manifest.cases if c.id in wanted]
    require_files(opened, cases)
    order = Order(opened, cases, how, out.with_name(out.name + ".parts"))
    work = functools.partial(judge_entry, wanted=wanted)
    oracle = check(order, lambda: pool(jobs), jobs=jobs, report=_tell, work=work)
    write_verdicts(out, merged(file, oracle))
    print(f"{len(oracle.verdicts)} of {len(cases)} cases fitted: {out}")
