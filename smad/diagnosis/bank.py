"""Banks of recorded runs: every case is diagnosed in a process of its own, and the answers kept.

The form of a bank and of its verdicts is described in docs/guide/check-your-own-bank.md. Nothing
here opens a key, or knows how a bank was made.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import signal
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import active_children, get_context
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import msgspec
import numpy as np

import sim_device.plant
import smad.control
import smad.diagnosis
from sim_device.plant import load_parameters
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.errors import BankError
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.signals import read_gap_run, require_columns
from smad.diagnosis.verdict import Verdict
from smad.errors import SmadError
from smad.runlog.bounds import Together

_MOST_MANIFEST_BYTES = 16_000_000
_GOLDEN = 0.6180339887498949
_SEE = "see “The manifest” in smad docs guide/check-your-own-bank"
_MEMORY = "its worker process ended, as it does when memory runs out: use fewer --jobs"


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

    @property
    def used(self) -> list[BankRun]:
        """The runs that may be used: a case that asks what *differs* has no good ones."""
        return [r for r in self.runs if r.role != "good" or self.question == "changed"]


class Manifest(msgspec.Struct, frozen=True):
    """What `manifest.json` says. A bank without a key has an empty `key_sha256`."""

    format: Literal["smad-bank-1"]
    bank: str
    cases: list[Case]
    key_sha256: str = ""


class VerdictFile(msgspec.Struct, kw_only=True, omit_defaults=True):
    """A verdict file. `notes` says of a case why it has no verdict.

    `made_of` has for each verdict the SHA-256 of all that it depends on (`Check.made_of`).
    """

    format: Literal["smad-verdicts-2"]
    bank: str
    key_sha256: str
    verdicts: dict[str, Verdict] = {}
    tool: dict[str, Any] = {}
    notes: dict[str, str] = {}
    made_of: dict[str, str] = {}


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a bank. Raises BankError where it is absent, broken or contradictory."""
    path = folder / "manifest.json"
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_MANIFEST_BYTES + 1)
        if len(data) > _MOST_MANIFEST_BYTES:
            raise BankError(
                f"{path} is too large", limit=f"{_MOST_MANIFEST_BYTES} bytes", action="split it"
            )
        manifest = msgspec.json.decode(data, type=Manifest)
    except OSError as error:
        raise BankError(
            f"{path} cannot be read",
            value=error.strerror or str(error),
            action=f"give the folder that holds a manifest.json; {_SEE}",
        ) from error
    except msgspec.DecodeError as error:
        raise BankError(
            f"{path} is not the manifest of a bank",
            value=str(error),
            limit="smad-bank-1",
            action=f"correct the manifest; {_SEE}",
        ) from error
    if not manifest.cases:
        raise BankError(f"{path} lists no cases", value=0, limit="at least 1", action=_SEE)
    name, count = Counter(c.id for c in manifest.cases).most_common(1)[0]
    if count > 1:
        raise BankError(f"{path} has two cases of one name", value=name, action="rename one")
    for case in manifest.cases:
        _require_sound(path, case)
    return manifest


def _require_sound(path: Path, case: Case) -> None:
    roles = [r.role for r in case.runs]
    for role, lacks, action in (
        ("fit", "has no run to fit on", "add a run or take the case out"),
        ("good", "asks what has changed, but has no known-good run",
         "add a run from before the trouble, or ask what differs"),
    ):  # fmt: skip
        if role not in roles and (role == "fit" or case.question == "changed"):
            raise BankError(
                f"{path}: {case.id} {lacks}",
                value=", ".join(roles) or "no runs",
                limit=f"at least one of role {role}",
                action=action,
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


def chosen(
    manifest: Manifest, *, count: int | None = None, only: Sequence[str] = (), seed: int = 0
) -> list[Case]:
    """The cases to take, in the manifest's order.

    `only` names them. `count` takes that many, spread evenly over the manifest from a seeded start
    (case i has rank frac(u + i·0.618…), the lowest ranks are taken), so that what a manifest
    groups, by question or by whatever its maker sorted it by, is met in proportion; a larger count
    holds the smaller one. Raises BankError for a name that the bank does not have.
    """
    cases, known = manifest.cases, [c.id for c in manifest.cases]
    for name in only:
        if name not in known:
            raise BankError(
                f"bank {manifest.bank} has no such case",
                value=name,
                limit=f"{known[0]} … {known[-1]}, {len(known)} in all",
                action="name cases as the manifest does",
            )
    if only:
        cases = [c for c in cases if c.id in only]
    if count is None or count >= len(cases):
        return list(cases)
    start = np.random.default_rng(seed).random()
    rank = np.mod(start + _GOLDEN * np.arange(len(cases)), 1.0)
    taken = np.sort(np.argsort(rank, kind="stable")[:count])
    return [cases[i] for i in taken]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Check:
    """A check of a bank: its folder, the cases taken, and how they are diagnosed.

    `params` and `variant` are those of the plant; `effects` may be named, None: all of them.
    """

    folder: Path
    manifest: Manifest
    cases: Sequence[Case]
    params: str = "A"
    variant: str = "extended"
    effects: tuple[str, ...] | None = None

    @property
    def how(self) -> dict[str, Any]:
        """How every case is diagnosed, as the verdict file tells it."""
        return {"params": self.params, "variant": self.variant, "effects": self.effects}

    @functools.cached_property
    def plant(self) -> SmaPlant:
        """The model that the bank is compared with."""
        return SmaPlant(load_parameters(self.params), self.variant)

    def made_of(self, case: Case) -> str:
        """SHA-256 of all that a verdict depends on: runs, code, model, question.

        A whole bank takes seconds. The Python interpreter and the processor, which may turn a last
        digit, do not count. Raises BankError for a run file that is missing.
        """
        files = [(r.file, r.role, self._digest(case, r.file)) for r in case.used]
        said = (case.question, files, source_digest(), self.plant.version, self.how)
        return hashlib.sha256(msgspec.json.encode(said, order="deterministic")).hexdigest()

    def _digest(self, case: Case, file: str) -> str:
        try:
            with (self.folder / file).open("rb") as opened:
                return hashlib.file_digest(opened, "sha256").hexdigest()
        except OSError as error:
            raise BankError(
                f"{case.id}: run file {file} of bank {self.manifest.bank} is missing",
                value=str(self.folder / file),
                action="restore it, or leave the case out with --only",
            ) from error

    def runs(self, case: Case) -> dict[str, list[GapRun]]:
        """The runs of a case by role. Raises BankError, naming the file, for one of no use."""
        stems = [PurePosixPath(r.file).name.split(".")[0] for r in case.used]
        out: dict[str, list[GapRun]] = {"fit": [], "hold_out": [], "good": []}
        together = Together()
        for run, stem in zip(case.used, stems, strict=True):
            path = self.folder / run.file
            try:
                read = read_gap_run(path, together)
                require_columns(path, read)
            except SmadError as error:
                raise BankError(f"run file {path} cannot be used: {error}") from error
            name = stem if stems.count(stem) == 1 else run.file
            out[run.role].append(dataclasses.replace(read, name=name))
        return out


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


@dataclasses.dataclass(frozen=True)
class Judged:
    """What became of one case: a verdict, or the error that prevented one; processor time."""

    case: str
    verdict: Verdict | None = None
    error: str = ""
    cpu_s: float = 0.0


Work = Callable[[Check, Case, str], Judged]


def judge(check: Check, case: Case, made_of: str) -> Judged:
    """The verdict on one case, if it is still of what it was to be `made_of`.

    An error in it becomes part of the answer, and stops nothing else.
    """
    began = time.process_time()
    try:
        if check.made_of(case) != made_of:
            raise BankError("code or runs are other than the check began with: start it again")
        runs = check.runs(case)
        found = diagnose(
            runs["fit"],
            plant=check.plant,
            good=runs["good"],
            hold_out=runs["hold_out"],
            candidates=check.effects,
        )
    except SmadError as error:
        return Judged(case.id, error=str(error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        return Judged(case.id, error=f"internal error: {type(error).__name__}: {error} ({place})")
    return Judged(case.id, found.verdict, cpu_s=round(time.process_time() - began, 2))


def apart(work: Work, check: Check, case: Case, made_of: str) -> Judged:
    """A case in a process of its own, whose end costs this case only.

    It is a fresh interpreter, since a fork would copy threads' locks; interrupts are its parent's.
    """
    ignored = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(1, get_context("spawn"), signal.signal, ignored) as worker:
        try:
            return worker.submit(work, check, case, made_of).result()
        except BrokenExecutor:
            return Judged(case.id, error=_MEMORY)


def answered(
    check: Check,
    file: VerdictFile,
    path: Path,
    *,
    jobs: int,
    report: Callable[[Judged, int], None] = lambda judged, left: None,
    work: Work = judge,
) -> VerdictFile:
    """Diagnose the cases that a verdict file lacks, `jobs` at a time, and return the whole file.

    It is written to `path` after each case: an interruption loses only those under way. `report`
    is told what became of a case and how many are left. A case that fails is named in the notes.
    """
    made_of = {c.id: check.made_of(c) for c in check.cases}
    todo = [c for c in check.cases if c.id not in file.verdicts]
    with ThreadPoolExecutor(jobs) as threads:
        tasks = [threads.submit(apart, work, check, c, made_of[c.id]) for c in todo]
        try:
            for number, task in enumerate(as_completed(tasks), 1):
                judged = task.result()
                if judged.verdict is None:
                    file.notes[judged.case] = judged.error
                else:
                    file.verdicts[judged.case] = judged.verdict
                    file.made_of[judged.case] = made_of[judged.case]
                    file.tool["cpu_s"][judged.case] = judged.cpu_s
                write_verdicts(path, file)
                report(judged, len(todo) - number)
        except BaseException:
            threads.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                process.terminate()
            raise
    order = (c.id for c in check.manifest.cases)
    file.verdicts = {c: file.verdicts[c] for c in order if c in file.verdicts}
    write_verdicts(path, file)
    return file


def begun(check: Check, path: Path) -> VerdictFile:
    """The verdict file of a check as it stands: with the verdicts of `path` that still hold.

    Those of cases that are not taken this time stay in it.
    """
    old = VerdictFile(format="smad-verdicts-2", bank="", key_sha256="")
    with contextlib.suppress(OSError, msgspec.DecodeError):
        old = msgspec.json.decode(path.read_bytes(), type=VerdictFile)
    hold = []
    for case in check.manifest.cases:
        with contextlib.suppress(BankError):
            if case.id in old.verdicts and old.made_of.get(case.id) == check.made_of(case):
                hold.append(case.id)
    return VerdictFile(
        format="smad-verdicts-2",
        bank=check.manifest.bank,
        key_sha256=check.manifest.key_sha256,
        verdicts={c: old.verdicts[c] for c in hold},
        tool={
            "name": "smad",
            "version": version("smad"),
            "source_sha256": source_digest(),
            "how": check.how,
            "cpu_s": {c: old.tool["cpu_s"][c] for c in hold},
        },
        made_of={c: old.made_of[c] for c in hold},
    )


def write_verdicts(path: Path, file: VerdictFile) -> None:
    """Writes a verdict file as indented JSON; a reader never sees half of one."""
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(msgspec.json.format(msgspec.json.encode(file), indent=1) + b"\n")
    partial.replace(path)
