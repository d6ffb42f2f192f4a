"""Diagnosing the cases of a bank in any order, resumable, past failed cases."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path

import msgspec

import smad
from smad.diagnosis.bank.bank import Bank, Case, used
from smad.diagnosis.bank.case import How, Part, Task, case_path, judge, source_digest
from smad.diagnosis.bank.verdicts import VerdictFile

Work = Callable[[Task], Part]
_MEMORY = "its worker process ended, as it does when memory runs out: use fewer --jobs"


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far a check is, after one more case."""

    part: Part
    done: int
    total: int
    left_s: float


@dataclasses.dataclass(frozen=True)
class Order:
    """A check that was asked for: the cases of a bank, how, and where parts are kept."""

    bank: Bank
    cases: Sequence[Case]
    how: How
    parts: Path

    @functools.cached_property
    def folder(self) -> Path:
        """Where parts of just this bank, code and way of diagnosing are kept.

        A parameter file counts by what it says, not by its name alone. The Python interpreter and
        the processor, which may turn a last digit, do not count.
        """
        said = {
            "manifest": self.bank.digest,
            "key": self.bank.manifest.key_sha256,
            "version": version("smad"),
            "source": source_digest(),
            "how": dataclasses.asdict(self.how),
            "plant": self.how.plant().version,
        }
        digest = hashlib.sha256(msgspec.json.encode(said, order="deterministic")).hexdigest()
        return self.parts / digest[:16]

    @functools.cached_property
    def runs_sha256(self) -> dict[str, str]:
        """Case → SHA-256 of its run files, as they were when first asked for.

        A whole bank takes seconds: SHA-256 of a gigabyte is half a second of calculation.
        """
        runs = {c.id: [_digest(self.bank.folder / r.file) for r in used(c)] for c in self.cases}
        return {c: hashlib.sha256(" ".join(d).encode()).hexdigest() for c, d in runs.items()}

    def finished(self) -> dict[str, Part]:
        """The parts of earlier checks that still hold, by case: those of these run files."""
        found = {case.id: _read_part(self.folder, case.id) for case in self.cases}
        return {c: p for c, p in found.items() if p is not None and self._holds(c, p)}

    def _holds(self, case: str, part: Part) -> bool:
        return part.runs_sha256 == self.runs_sha256[case]


def _digest(path: Path) -> str:
    """SHA-256 of a file; of one that is not there, a word that no file has."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return "absent"


def apart(work: Work, task: Task) -> Part:
    """A case in a process of its own, whose end costs this case only.

    It is a fresh interpreter, since a fork would copy threads' locks.
    """
    with ProcessPoolExecutor(1, get_context("spawn"), initializer=_leave_interrupts) as worker:
        try:
            return worker.submit(work, task).result()
        except BrokenExecutor:
            return Part(task.case.id, 0.0, error=_MEMORY)
        except Exception as error:
            return Part(task.case.id, 0.0, error=f"{type(error).__name__}: {error}")


def _leave_interrupts() -> None:
    """A worker's first act: interrupts are the parent's. It ends with a parent that is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end_with_the_parent() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_the_parent, daemon=True).start()


def check(
    order: Order,
    *,
    jobs: int,
    report: Callable[[Progress], None] = lambda progress: None,
    clock_s: Callable[[], float] = time.monotonic,
    work: Work = judge,
) -> VerdictFile:
    """The verdicts on all cases of the order; cases with a part from an earlier run are not redone.

    `jobs` cases are worked on at a time, each apart. A case that fails is named in the notes, and
    tried again by the next check. An interruption loses only the cases under way.
    """
    order.folder.mkdir(parents=True, exist_ok=True)
    parts = order.finished()
    todo = [c for c in order.cases if c.id not in parts]
    began_s = clock_s()
    for finished, part in enumerate(_worked(order, todo, jobs, functools.partial(apart, work)), 1):
        parts[part.case] = part
        if part.verdict is not None:
            whole = msgspec.structs.replace(part, runs_sha256=order.runs_sha256[part.case])
            _write_part(order.folder, whole)
        rest = len(todo) - finished
        left_s = rest * (clock_s() - began_s) / finished
        report(Progress(part, len(parts), len(order.cases), left_s))
    manifest, found = order.bank.manifest, [parts[c.id] for c in order.cases]
    return VerdictFile(
        format="smad-verdicts-2",
        bank=manifest.bank,
        key_sha256=manifest.key_sha256,
        verdicts={p.case: p.verdict for p in found if p.verdict is not None},
        tool={
            "name": "smad",
            "version": version("smad"),
            "commit": commit(),
            "source_sha256": source_digest(),
            "how": dataclasses.asdict(order.how),
            "cpu_s": {p.case: p.cpu_s for p in found},
        },
        notes={p.case: p.error for p in found if p.error},
    )


def _worked(order: Order, todo: Sequence[Case], jobs: int, work: Work) -> Iterator[Part]:
    """Parts as they come. Whatever ends this early ends the cases under way."""
    before = set(active_children())
    with ThreadPoolExecutor(jobs) as threads:
        tasks = [Task(order.bank, case, order.how, source_digest()) for case in todo]
        try:
            for future in as_completed([threads.submit(work, task) for task in tasks]):
                yield future.result()
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in set(active_children()) - before:
                process.terminate()
            raise


def _read_part(folder: Path, case: str) -> Part | None:
    """The finished part of a case; None when there is none, or only half of one."""
    try:
        return msgspec.json.decode(case_path(folder, case).read_bytes(), type=Part)
    except (OSError, msgspec.DecodeError):
        return None


def _write_part(folder: Path, part: Part) -> None:
    path = case_path(folder, part.case)
    partial = path.with_suffix(".part")
    partial.write_bytes(msgspec.json.encode(part))
    partial.replace(path)


def commit() -> str:
    """Commit of the checkout that smad runs from, with "+" when files have been changed since.

    Empty where smad was installed without its repository.
    """
    root = str(Path(smad.__file__).resolve().parents[1])
    words = ("git", "-C", root, "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+")
    try:
        said = subprocess.run(words, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return said.stdout.strip()
