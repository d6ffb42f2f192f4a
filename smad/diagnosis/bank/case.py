"""One case of a bank, from its files to its verdict: what a worker process does."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import time
import traceback
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

import msgspec

import sim_device.plant
import smad.control
import smad.gap
from firmware_protocol.nearest import instead
from smad.diagnosis.bank.answer import answer
from smad.diagnosis.bank.bank import Bank, Case, read_case
from smad.diagnosis.bank.errors import CheckError
from smad.diagnosis.bank.verdicts import CaseVerdict
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.errors import SmadError
from smad.gap.diagnose import diagnose
from smad.gap.records import Diagnosis, Outcome
from smad.gap.settings import Settings


@dataclasses.dataclass(frozen=True)
class How:
    """How every case of a check is diagnosed. `effects` are the ones that may be named, or all."""

    params: str = "A"
    variant: str = "extended"
    settings: Settings = dataclasses.field(default_factory=Settings)
    leave_out: bool = False
    effects: tuple[str, ...] | None = None

    def plant(self) -> SmaPlant:
        """The plant model that the bank is compared with."""
        from sim_device.plant import load_parameters

        return SmaPlant(load_parameters(self.params), self.variant)

    def library(self) -> list[str]:
        """Names of the effects that may be named."""
        known = [e.name for e in self.plant().effects]
        return [n for n in known if self.effects is None or n in self.effects]

    def require(self) -> None:
        """Raises CheckError when an effect is asked for that smad does not have."""
        library = [e.name for e in self.plant().effects]
        foreign = [n for n in self.effects or () if n not in library]
        if foreign:
            raise CheckError(
                "the library has no such effect",
                value=foreign[0],
                action=instead(foreign[0], library, "smad gap effects lists them"),
            )


@dataclasses.dataclass(frozen=True)
class Task:
    """One case for a worker. `source` is the code that the check began with."""

    bank: Bank
    case: Case
    how: How
    source: str
    keep: Path | None = None


class Part(msgspec.Struct, frozen=True, omit_defaults=True):
    """What became of one case: a verdict, or the error that prevented one.

    `runs_sha256` is of its run files before it was diagnosed, `kept_sha256` of the whole diagnosis
    that was written beside it, if that was asked for.
    """

    case: str
    seconds: float
    verdict: CaseVerdict | None = None
    error: str = ""
    note: str = ""
    runs_sha256: str = ""
    kept_sha256: str = ""


@functools.cache
def source_digest() -> str:
    """SHA-256 over the code that a verdict depends on, and the versions of what it calculates with.

    That is the diagnosis, the plant, and the controller of the simulated experiments.
    """
    h = hashlib.sha256()
    for name in ("numpy", "scipy"):
        h.update(f"{name} {version(name)}\0".encode())
    for package in (smad.gap, sim_device.plant, smad.control):
        folder = Path(package.__file__ or "").parent
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
            h.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return h.hexdigest()


def diagnosed(
    task: Task, how: How, more: Sequence[GapRun] = (), *, leave_out: bool = False
) -> Diagnosis:
    """The diagnosis of a case with one thread; `more` are further runs to fit on."""
    runs = read_case(task.bank, task.case)
    with ThreadPoolExecutor(max_workers=1) as one:
        return diagnose(
            [*runs.fit, *more],
            plant=how.plant(),
            good=runs.good,
            hold_out=runs.hold_out,
            settings=how.settings,
            candidates=how.effects,
            leave_out=leave_out,
            executor=one,
        )


def judge(task: Task) -> Part:
    """The verdict on one case. An error in it becomes part of the answer, and stops nothing else.

    Runs in a process of its own, with one thread: two cases then use two cores.
    """
    case, how, began = task.case.id, task.how, time.perf_counter()
    if source_digest() != task.source:
        other = "the worker has other code than the check began with: start the check again"
        return Part(case, 0.0, error=other)
    try:
        found = diagnosed(task, how, leave_out=how.leave_out)
        verdict = answer(found)
    except SmadError as error:
        return Part(case, time.perf_counter() - began, error=str(error))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"internal error: {type(error).__name__}: {error}"
        place = f"{os.path.basename(where.filename)}:{where.lineno}"
        return Part(case, time.perf_counter() - began, error=f"{text} ({place})")
    kept = ""
    if task.keep is not None:
        whole = found.to_json()
        case_path(task.keep, case).write_bytes(whole)
        kept = hashlib.sha256(whole).hexdigest()
    note = found.verdict.text if found.verdict.outcome is Outcome.REFUSED else ""
    return Part(case, time.perf_counter() - began, verdict, note=note, kept_sha256=kept)


def case_path(folder: Path, case: str) -> Path:
    """The file of a case in a folder of parts, or of whole diagnoses."""
    return folder / f"{case}.json"
