"""One case of a bank, from its files to its verdict: what a worker process does."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
import time
import traceback
from importlib.metadata import version
from pathlib import Path

import msgspec

import sim_device.plant
import smad.control
import smad.diagnosis
from firmware_protocol.nearest import instead
from smad.diagnosis.bank.bank import Bank, Case, read_case
from smad.diagnosis.bank.errors import CheckError
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.verdict import Verdict
from smad.errors import SmadError


@dataclasses.dataclass(frozen=True)
class How:
    """How every case of a check is diagnosed. `effects` are the ones that may be named, or all."""

    params: str = "A"
    variant: str = "extended"
    effects: tuple[str, ...] | None = None

    def plant(self) -> SmaPlant:
        """The plant model that the bank is compared with."""
        from sim_device.plant import load_parameters

        return SmaPlant(load_parameters(self.params), self.variant)

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


class Part(msgspec.Struct, frozen=True, omit_defaults=True):
    """What became of one case: a verdict, or the error that prevented one.

    `runs_sha256` is of its run files before it was diagnosed, `cpu_s` its processor time.
    """

    case: str
    seconds: float
    verdict: Verdict | None = None
    error: str = ""
    runs_sha256: str = ""
    cpu_s: float = 0.0


@functools.cache
def source_digest() -> str:
    """SHA-256 over the code that a verdict depends on, and the versions of what it calculates with.

    That is the diagnosis, the plant, and the controller of the simulated experiments.
    """
    h = hashlib.sha256()
    for name in ("numpy", "scipy"):
        h.update(f"{name} {version(name)}\0".encode())
    for package in (smad.diagnosis, sim_device.plant, smad.control):
        folder = Path(package.__file__ or "").parent
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
            h.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return h.hexdigest()


def judge(task: Task) -> Part:
    """The verdict on one case. An error in it becomes part of the answer, and stops nothing else.

    Runs in a process of its own, with one thread: two cases then use two cores.
    """
    case, how, began, cpu = task.case.id, task.how, time.perf_counter(), time.process_time()
    if source_digest() != task.source:
        other = "the worker has other code than the check began with: start the check again"
        return Part(case, 0.0, error=other)
    try:
        runs = read_case(task.bank, task.case)
        found = diagnose(
            runs.fit,
            plant=how.plant(),
            good=runs.good,
            hold_out=runs.hold_out,
            candidates=how.effects,
        )
    except SmadError as error:
        return Part(case, time.perf_counter() - began, error=str(error))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = f"internal error: {type(error).__name__}: {error}"
        place = f"{os.path.basename(where.filename)}:{where.lineno}"
        return Part(case, time.perf_counter() - began, error=f"{text} ({place})")
    spent = round(time.process_time() - cpu, 2)
    return Part(case, time.perf_counter() - began, found.verdict, cpu_s=spent)


def case_path(folder: Path, case: str) -> Path:
    """The file of a case in a folder of parts."""
    return folder / f"{case}.json"
