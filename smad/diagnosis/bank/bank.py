"""Reading a bank: the manifest, which cases to take, and the runs of a case.

The form is described in docs/guide/check-your-own-bank.md. Nothing here opens a key.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

import msgspec
import numpy as np

from smad.diagnosis.bank.errors import BankError
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import CHANNELS, INPUTS, table_run
from smad.errors import RunLogError
from smad.runlog.bounds import Together

FORMAT = "smad-bank-1"
_MOST_MANIFEST_BYTES = 16_000_000
_GOLDEN = 0.6180339887498949
_SEE = "see “The manifest” in smad docs guide/check-your-own-bank"


class BankRun(msgspec.Struct, frozen=True):
    """A run file of a case. `file` is relative to the bank's folder, with forward slashes."""

    file: str
    role: Literal["fit", "hold_out", "good"]
    family: str = ""


class Case(msgspec.Struct, frozen=True):
    """One case. `changed` asks what is new since the good runs, `differs` has none."""

    id: str
    question: Literal["changed", "differs"]
    runs: list[BankRun]


class Manifest(msgspec.Struct, frozen=True):
    """What `manifest.json` says. A bank without a key has an empty `key_sha256`."""

    format: Literal["smad-bank-1"]
    bank: str
    cases: list[Case]
    key_sha256: str = ""


@dataclass(frozen=True)
class Bank:
    """A bank that has been looked over: its folder, its manifest, and the manifest's SHA-256."""

    folder: Path
    manifest: Manifest
    digest: str

    def case(self, name: str) -> Case:
        """The case of this name. Raises BankError when there is none."""
        known = [c.id for c in self.manifest.cases]
        if name in known:
            return self.manifest.cases[known.index(name)]
        raise BankError(
            f"bank {self.manifest.bank} has no such case",
            value=name,
            limit=f"{known[0]} … {known[-1]}, {len(known)} in all",
            action="name cases as the manifest does",
        )


@dataclass(frozen=True)
class CaseRuns:
    """The runs of a case by what they may be used for."""

    fit: list[GapRun]
    hold_out: list[GapRun]
    good: list[GapRun]


def open_bank(folder: Path) -> Bank:
    """The bank in a folder. Raises BankError when its manifest is absent, broken or contradictory.

    Run files are not opened here; `require_files` looks whether they are there.
    """
    path = folder / "manifest.json"
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_MANIFEST_BYTES + 1)
    except OSError as error:
        raise BankError(
            f"{path} cannot be read",
            value=error.strerror or str(error),
            action=f"give the folder that holds a manifest.json; {_SEE}",
        ) from error
    if len(data) > _MOST_MANIFEST_BYTES:
        raise BankError(
            f"{path} is too large",
            value=f"more than {_MOST_MANIFEST_BYTES} bytes",
            limit=f"{_MOST_MANIFEST_BYTES} bytes",
            action="split the bank",
        )
    try:
        manifest = msgspec.json.decode(data, type=Manifest)
    except msgspec.DecodeError as error:
        raise BankError(
            f"{path} is not the manifest of a bank",
            value=str(error),
            limit=FORMAT,
            action=f"correct the manifest; {_SEE}",
        ) from error
    _look_over(path, manifest)
    return Bank(folder, manifest, hashlib.sha256(data).hexdigest())


def _look_over(path: Path, manifest: Manifest) -> None:
    if not manifest.cases:
        raise BankError(f"{path} lists no cases", value=0, limit="at least 1", action=_SEE)
    repeated = [n for n, k in Counter(c.id for c in manifest.cases).items() if k > 1]
    if repeated:
        raise BankError(
            f"{path} has two cases of one name", value=repeated[0], action="rename one of them"
        )
    for case in manifest.cases:
        if not case.id or not case.id.replace("-", "").replace("_", "").isalnum():
            raise BankError(
                f"{path} has a case whose id cannot name a file",
                value=case.id,
                limit="letters, digits, - and _",
                action="rename it",
            )
        if not any(r.role == "fit" for r in case.runs):
            raise BankError(
                f"{path}: {case.id} has no run to fit on",
                value=", ".join(r.role for r in case.runs) or "no runs",
                limit="at least one of role fit",
                action="add a run or take the case out",
            )
        if case.question == "changed" and not any(r.role == "good" for r in case.runs):
            raise BankError(
                f"{path}: {case.id} asks what has changed, but has no known-good run",
                value=", ".join(r.role for r in case.runs),
                limit="at least one of role good",
                action="add a run from before the trouble, or ask what differs",
            )
        for run in case.runs:
            parts = PurePosixPath(run.file)
            if parts.is_absolute() or ".." in parts.parts or not run.file:
                raise BankError(
                    f"{path}: a run file of {case.id} lies outside the bank",
                    value=run.file,
                    limit="a path below the bank's folder",
                    action="put the file into the bank",
                )


def require_files(bank: Bank, cases: Sequence[Case]) -> None:
    """Raises BankError when a run file of these cases is absent: before the work, not after."""
    absent = [
        (c.id, r.file) for c in cases for r in used(c) if not (bank.folder / r.file).is_file()
    ]
    if absent:
        case, file = absent[0]
        more = f" and {len(absent) - 1} other files" if len(absent) > 1 else ""
        raise BankError(
            f"{case}: run file {file}{more} of bank {bank.manifest.bank} is missing",
            value=str(bank.folder / file),
            action="restore it, or leave the case out with --only",
        )


def used(case: Case) -> list[BankRun]:
    """The runs that may be used: a case that asks what *differs* has no good runs."""
    return [r for r in case.runs if r.role != "good" or case.question == "changed"]


def chosen(bank: Bank, *, count: int | None = None, only: Sequence[str] = (), seed: int = 0
           ) -> list[Case]:  # fmt: skip
    """The cases to take, in the manifest's order.

    `only` names them. `count` takes that many, spread evenly over the manifest from a seeded start
    (case i has rank frac(u + i·0.618…), the lowest ranks are taken), so that what a manifest
    groups, by question or by whatever its maker sorted it by, is met in proportion; a larger count
    holds the smaller one. Raises BankError for a name that the bank does not have.
    """
    cases = bank.manifest.cases
    if only:
        wanted = {bank.case(name).id for name in only}
        cases = [c for c in cases if c.id in wanted]
    if count is None or count >= len(cases):
        return list(cases)
    start = np.random.default_rng(seed).random()
    rank = np.mod(start + _GOLDEN * np.arange(len(cases)), 1.0)
    taken = np.sort(np.argsort(rank, kind="stable")[:count])
    return [cases[i] for i in taken]


def read_case(bank: Bank, case: Case) -> CaseRuns:
    """The runs of a case. Raises BankError, naming the file, when one cannot be read."""
    stems = [PurePosixPath(r.file).name.split(".")[0] for r in used(case)]
    runs = CaseRuns([], [], [])
    together = Together()
    for run, stem in zip(used(case), stems, strict=True):
        name = stem if stems.count(stem) == 1 else run.file
        getattr(runs, run.role).append(_run(name, bank.folder / run.file, together))
    return runs


def _run(name: str, path: Path, together: Together) -> GapRun:
    try:
        run = table_run(name, path, together)
    except RunLogError as error:
        raise BankError(f"run file {path} cannot be used: {error}") from error
    absent = [s.name for s in INPUTS if s.name not in run.inputs]
    if not run.outputs:
        absent.append(f"any measured channel ({', '.join(c.name for c in CHANNELS)})")
    if absent:
        raise BankError(
            f"run file {path} lacks a column, or nothing was recorded in it",
            value=", ".join(absent),
            limit=f"columns as in the run log; {_SEE}",
            action="add the column, in the unit its name ends with",
        )
    return run
