"""The recovery bank as a file of answers that a later call goes on from."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Literal

import msgspec

from evaluation.checkout import source_digest
from evaluation.errors import WithheldError
from evaluation.recovery.cases import QUESTIONS, Case, cases_of
from evaluation.recovery.judging import Answer, answer
from evaluation.recovery.scores import tables
from evaluation.results.record import keep
from smad.diagnosis.spring_pair import SmaPlant
from smad.files import write_whole
from smad.processes.parent import end_with
from smad.report.page import Table
from smad.view.terminal.tables import print_table

Work = Callable[[Case, int], Answer]


class RecoveryFile(msgspec.Struct, kw_only=True):
    """Answers by name of their case; `source_sha256` is that of the product that gave them."""

    format: Literal["smad-recovery-1"] = "smad-recovery-1"
    seed: int
    source_sha256: str
    answers: dict[str, Answer] = {}

    def write(self, path: Path) -> None:
        """Write it as JSON; a reader never sees half of one."""
        write_whole(path, msgspec.json.encode(self) + b"\n")


def read(path: Path) -> RecoveryFile:
    """A file of answers. Raises WithheldError for what is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=RecoveryFile)
    except (OSError, msgspec.DecodeError) as error:
        raise WithheldError(
            f"{path} is not a file of recovery answers ({error}): give one that `recover` wrote"
        ) from None


def run(
    path: Path,
    *,
    seed: int = 1,
    only: Sequence[str] = (),
    count: int | None = None,
    jobs: int = 1,
    result_path: Path | None = None,
    title: str = "",
    note: str = "",
) -> dict[str, Table]:
    """Answer the cases that the file `path` lacks, and print the scores of all that were asked for.

    `only` are questions, all of them if empty; `count` cases of each. Answers of other code, or of
    another seed, are made anew. With `result_path` the tables are kept as a result there. Raises
    WithheldError for a question that there is not.
    """
    for question in only:
        if question not in QUESTIONS:
            raise WithheldError(f"no question {question!r}: ask {', '.join(QUESTIONS)}")
    if count is not None and count < 1:
        raise WithheldError(f"{count} cases of a question are none: give --cases 1 or more")
    cases = cases_of(SmaPlant(), only or QUESTIONS, seed, count)
    file = begun(path, seed)
    with _workers(jobs) as pool:
        answered(file, path, cases, pool)
    by_heading = tables([file.answers[c.name] for c in cases])
    for heading, table in by_heading.items():
        print(heading)
        print_table(table)
        print()
    if result_path is not None:
        command = "python -m evaluation recover"
        keep(result_path, by_heading, title=title, command=command, note=note)
    return by_heading


def begun(path: Path, seed: int) -> RecoveryFile:
    """The file as it stands; empty where it is of other code or of another seed."""
    empty = RecoveryFile(seed=seed, source_sha256=source_digest())
    with contextlib.suppress(WithheldError):
        old = read(path)
        if (old.seed, old.source_sha256) == (seed, empty.source_sha256):
            return old
    return empty


def answered(
    file: RecoveryFile, path: Path, cases: Sequence[Case], pool: Executor, work: Work = answer
) -> None:
    """Answer what is lacking; the file is written after each case. A case that failed is tried
    again.
    """
    done = [a.case for a in file.answers.values() if not a.error]
    # Check-ups of one bench follow each other, since a worker keeps its baseline.
    lacking = sorted((c for c in cases if c not in done), key=lambda c: (c.question, c.bench))
    tasks = [pool.submit(work, case, file.seed) for case in lacking]
    for n, task in enumerate(as_completed(tasks), start=1):
        result = task.result()
        file.answers[result.case.name] = result
        file.write(path)
        text = result.error or (result.verdict.headline if result.verdict else "")
        print(f"{result.case.name}  {text}  {result.cpu_s:.0f} s  [{n}/{len(lacking)}]", flush=True)


@contextlib.contextmanager
def _workers(jobs: int) -> Iterator[Executor]:
    """Processes that end at once when the command is interrupted or killed.

    They are fresh interpreters, since a fork would copy the locks of threads.
    """
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), _begin, (os.getpid(),))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in active_children():
            process.terminate()
        raise


def _begin(parent: int) -> None:
    """End with the parent; an interrupt is for it, since it has the file."""
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
