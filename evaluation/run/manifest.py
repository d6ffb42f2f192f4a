"""What a bank says of itself: its cases with their runs, of either kind of bank.

A bank of any inputs lists the runs of each case, one of check-ups the bench of each: its runs are
the files of `cases/CASE`, the good ones those of `benches/BENCH/good-1`, `good-2` ….
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path, PurePosixPath
from typing import Literal

import msgspec

from evaluation.errors import BankError
from smad.diagnosis.verdict import CHECK_UP, DIFFERS

CHECK_UPS = "smad-checkup-1"
Role = Literal["fit", "hold_out", "good"]
ROLES: tuple[Role, ...] = ("fit", "hold_out", "good")
_MOST_BYTES = 16_000_000
_SEE = "see “A bank of your own” in evaluation/README.md"


class BankRun(msgspec.Struct, frozen=True):
    """A run file of a case. `file` is relative to the bank's folder, with forward slashes."""

    file: str
    role: Role
    family: str = ""

    @property
    def name(self) -> str:
        """The name of the file without its folder and suffixes."""
        return PurePosixPath(self.file).name.split(".")[0]


class Case(msgspec.Struct, frozen=True):
    """One case. `changed` asks what is new since the good runs, `differs` has none; a `check-up`
    repeats the good runs of its `bench`."""

    id: str
    question: Literal["changed", "differs", "check-up"] = "check-up"
    runs: list[BankRun] = []
    bench: str = ""

    def of(self, role: str) -> list[BankRun]:
        """The runs of a role; a case that asks what *differs* has no good ones."""
        unused = role == "good" and self.question == DIFFERS
        return [] if unused else [r for r in self.runs if r.role == role]


class Manifest(msgspec.Struct, frozen=True):
    """What `manifest.json` says. A bank without a key has an empty `key_sha256`."""

    format: Literal["smad-bank-1", "smad-checkup-1"]
    bank: str
    cases: list[Case]
    key_sha256: str = ""

    @property
    def benches(self) -> dict[str, list[Case]]:
        """The cases of each bench by its name."""
        names = sorted({c.bench for c in self.cases})
        return {name: [c for c in self.cases if c.bench == name] for name in names}


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a bank. Raises BankError where it is absent, broken or contradictory."""
    path = folder / "manifest.json"
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise BankError(f"{path} is too large (allowed: {_MOST_BYTES} bytes): split it")
        manifest = msgspec.json.decode(data, type=Manifest)
    except OSError as error:
        raise BankError(f"{path} cannot be read ({error.strerror}): give a bank's folder") from None
    except msgspec.DecodeError as error:
        raise BankError(f"{path} is not the manifest of a bank ({error}): {_SEE}") from None
    if not manifest.cases:
        raise BankError(f"{path} lists no cases: {_SEE}")
    name, count = Counter(c.id for c in manifest.cases).most_common(1)[0]
    if count > 1:
        raise BankError(f"{path} has two cases called {name}: rename one")
    if manifest.format == CHECK_UPS:
        cases = [_with_files(folder, case) for case in manifest.cases]
        manifest = msgspec.structs.replace(manifest, cases=cases)
    for case in manifest.cases:
        _require_sound(path, manifest.format, case)
    return manifest


def _with_files(folder: Path, case: Case) -> Case:
    """A check-up with its runs, and the good ones repeat by repeat."""
    places: list[tuple[str, Role]] = [
        (f"cases/{case.id}/*", "fit"),
        (f"benches/{case.bench}/*/*", "good"),
    ]
    runs = [
        BankRun(p.relative_to(folder).as_posix(), role)
        for pattern, role in places
        for p in sorted(folder.glob(pattern))
    ]
    return msgspec.structs.replace(case, runs=runs)


def _require_sound(path: Path, form: str, case: Case) -> None:
    if (case.question == CHECK_UP) != (form == CHECK_UPS):
        raise BankError(f"{path}: {case.id} asks {case.question}, which no {form} does: {_SEE}")
    roles = {r.role for r in case.runs}
    if "fit" not in roles:
        raise BankError(f"{path}: {case.id} has no run to fit on: add one or take the case out")
    if "good" not in roles and case.question != DIFFERS:
        raise BankError(
            f"{path}: {case.id} asks what has changed, but has no known-good run: add a run from "
            "before the trouble, or ask what differs"
        )
    for run in case.runs:
        parts = PurePosixPath(run.file)
        if parts.is_absolute() or ".." in parts.parts or not run.file:
            raise BankError(f"{path}: {case.id} has a file outside the bank ({run.file}): move it")
