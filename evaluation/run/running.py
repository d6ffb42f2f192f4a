"""A bank judged: worker processes, and a verdict file that a later call goes on from.

Cases of one bench share its commissioning and a process; any other case has one of its own. When a
process ends, as it does when memory runs out, the case it was at is named and the next one begins
another.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from importlib.metadata import version
from multiprocessing import active_children, get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import msgspec

import evaluation.run
from evaluation.checkout import source_digest
from evaluation.errors import BankError
from evaluation.names import canonical
from evaluation.run.judging import Check, Judged, judge
from evaluation.run.manifest import Case, read_manifest
from evaluation.score.openings import refuse_sealed
from smad.diagnosis.spring_pair import SmaPlant
from smad.files import write_whole
from smad.processes.parent import end_with

_MEMORY = "its worker process ended, as it does when memory runs out: use fewer --jobs"
_TOLD = 5
Task = tuple[Case, str]
"""A case, and what its verdict is to be made of."""
Work = Callable[[Check, Case, str], Judged]


class VerdictFile(msgspec.Struct, kw_only=True, omit_defaults=True):
    """A verdict file. `notes` says of a case why it has no verdict.

    `made_of` has for each verdict the SHA-256 of all that it depends on (`Check.made_of`).
    """

    format: Literal["smad-verdicts-3"] = "smad-verdicts-3"
    bank: str
    key_sha256: str
    verdicts: dict[str, Any] = {}
    tool: dict[str, Any] = {}
    notes: dict[str, str] = {}
    made_of: dict[str, str] = {}

    def keep(self, judged: Judged, made_of: str) -> None:
        """Enter what became of a case."""
        if judged.verdict is None:
            self.notes[judged.case] = judged.error
            return
        self.verdicts[judged.case] = judged.verdict
        self.made_of[judged.case] = made_of
        self.tool["cpu_s"][judged.case] = judged.cpu_s

    def write(self, path: Path) -> None:
        """Write it as indented JSON; a reader never sees half of one."""
        write_whole(path, msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n")


def run(
    bank: Path,
    out: Path,
    *,
    benches: Sequence[str] = (),
    only: Sequence[str] = (),
    repeats: int | None = None,
    key: Path | None = None,
    jobs: int = 1,
    params: str = "A",
    variant: str = "extended",
) -> None:
    """Judge the cases of a bank (of some benches, or only some) that the file `out` lacks.

    With the key's folder, cases of single effects are judged once more without their entry.
    Raises BankError for a sealed key, for a manifest that is not sound, and at the end where a case
    has no verdict.
    """
    manifest = read_manifest(bank)
    _require_known(only, [c.id for c in manifest.cases])
    _require_known(benches, list(manifest.benches))
    cases = [
        c
        for c in manifest.cases
        if c.id in (only or (c.id,)) and c.bench in (benches or (c.bench,))
    ]
    check = Check(folder=bank, manifest=manifest, params=params, variant=variant, repeats=repeats)
    if key is not None:
        refuse_sealed(key)
        check = replace(check, left_out=single_entries(key, check.plant))
    file = answered(check, cases, begun(check, out), out, jobs=jobs)
    without = [c.id for c in cases if c.id not in file.verdicts]
    print(f"{len(cases) - len(without)} of {len(cases)} cases judged: {out}")
    if without:
        reasons = "; ".join(f"{case}: {file.notes[case]}" for case in without[:_TOLD])
        more = f"; and {len(without) - _TOLD} more" if len(without) > _TOLD else ""
        raise BankError(f"without verdict: {reasons}{more}; the same command tries them again")


def _require_known(names: Sequence[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise BankError(f"the bank has no {name}: it has {known[0]} … {known[-1]}")


def single_entries(key: Path, plant: SmaPlant) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Cases with one listed effect: its cause, and every entry of the library for that."""
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    causes = {
        case: canonical(entry["effects"][0]["name"])
        for case, entry in entries.items()
        if entry["kind"] == "single"
    }
    return {
        case: (cause, tuple(e.name for e in plant.effects if canonical(e.name) == cause))
        for case, cause in causes.items()
    }


def begun(check: Check, path: Path) -> VerdictFile:
    """The verdict file of a check as it stands: with the verdicts of `path` that still hold.

    Those of cases that are not taken this time stay in it.
    """
    old = VerdictFile(bank="", key_sha256="")
    with contextlib.suppress(OSError, msgspec.DecodeError):
        old = msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    hold = []
    for case in check.manifest.cases:
        with contextlib.suppress(BankError):
            if case.id in old.verdicts and old.made_of.get(case.id) == check.made_of(case):
                hold.append(case.id)
    return VerdictFile(
        bank=check.manifest.bank,
        key_sha256=check.manifest.key_sha256,
        verdicts={c: old.verdicts[c] for c in hold},
        tool={
            "name": "smad",
            "version": version("smad"),
            "source_sha256": source_digest(evaluation.run),
            "how": check.how,
            "cpu_s": {c: old.tool["cpu_s"][c] for c in hold},
        },
        made_of={c: old.made_of[c] for c in hold},
    )


def answered(
    check: Check,
    cases: Sequence[Case],
    file: VerdictFile,
    path: Path,
    *,
    jobs: int = 1,
    work: Work = judge,
) -> VerdictFile:
    """Judge the cases that a verdict file lacks, `jobs` at a time, and return the whole file.

    It is written to `path` after each case: an interruption loses only those under way. A case that
    fails is named in the notes.
    """
    todo = [(c, check.made_of(c)) for c in cases if c.id not in file.verdicts]
    made_of = {case.id: digest for case, digest in todo}
    groups: dict[str, list[Task]] = {}
    for case, digest in todo:
        groups.setdefault(case.bench or case.id, []).append((case, digest))
    say = _Progress(len(cases), len(todo))
    lock = threading.Lock()

    def carried_out(group: list[Task]) -> None:
        for judged in apart(work, check, group):
            with lock:
                file.keep(judged, made_of[judged.case])
                file.write(path)
                say(judged)

    with ThreadPoolExecutor(jobs) as threads:
        tasks = [threads.submit(carried_out, group) for group in groups.values()]
        try:
            for task in as_completed(tasks):
                task.result()
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                process.terminate()
            raise
    order = (c.id for c in check.manifest.cases)
    file.verdicts = {c: file.verdicts[c] for c in order if c in file.verdicts}
    file.write(path)
    return file


class _Progress:
    """Tells what became of each case, and about how long the others take."""

    def __init__(self, total: int, todo: int) -> None:
        self._total, self._todo, self._left = total, todo, todo
        self._began_s = time.monotonic()

    def __call__(self, judged: Judged) -> None:
        self._left -= 1
        answer = f"failed: {judged.error}" if judged.verdict is None else judged.verdict["headline"]
        spent_min = (time.monotonic() - self._began_s) / 60.0
        left_min = self._left * spent_min / (self._todo - self._left)
        done = f"[{self._total - self._left}/{self._total}, {left_min:.0f} min left]"
        print(f"{judged.case}  {answer}  {judged.cpu_s:.0f} s  {done}", flush=True)


def apart(work: Work, check: Check, group: Sequence[Task]) -> Iterator[Judged]:
    """What becomes of each case of a group, judged in a process of its own.

    It is a fresh interpreter, since a fork would copy threads' locks; interrupts are its parent's.
    """
    lacking, spawn = list(group), get_context("spawn")
    while lacking:
        receiver, sender = spawn.Pipe(duplex=False)
        arguments = os.getpid(), work, check, lacking, sender
        worker = spawn.Process(target=_judge_all, args=arguments, daemon=True)
        worker.start()
        sender.close()
        with contextlib.suppress(EOFError):
            while lacking:
                judged = receiver.recv()
                del lacking[0]
                yield judged
        worker.join()
        if worker.exitcode == -signal.SIGTERM:
            return  # The check is interrupted.
        if lacking:
            yield Judged(lacking.pop(0)[0].id, error=_MEMORY)


def _judge_all(
    parent: int, work: Work, check: Check, group: Sequence[Task], to: Connection
) -> None:
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for case, made_of in group:
        to.send(work(check, case, made_of))
