"""Reading a bank: the manifest, which cases to take, and the runs of a case.

The form is described in docs/withheld.md. Nothing here opens a key.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import msgspec
import numpy as np

from smad.gap.check.bounds import MOST_MANIFEST_BYTES, read_bounded, require_bounded
from smad.gap.check.errors import BankError
from smad.gap.runs import Array, GapRun
from smad.gap.sma.signals import CHANNELS, INPUTS, run_from_columns

FORMAT = "smad-bank-1"
_GOLDEN = 0.6180339887498949
_SEE = "see “A bank” in docs/withheld.md"


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
        for case in self.manifest.cases:
            if case.id == name:
                return case
        known = [c.id for c in self.manifest.cases]
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
        data = read_bounded(path, MOST_MANIFEST_BYTES)
    except OSError as error:
        raise BankError(
            f"{path} cannot be read",
            value=error.strerror or str(error),
            action=f"give the folder that holds a manifest.json; {_SEE}",
        ) from error
    try:
        manifest = msgspec.json.decode(data, type=Manifest)
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
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
    stems = Counter(PurePosixPath(r.file).name.split(".")[0] for r in used(case))
    groups: dict[str, list[GapRun]] = {"fit": [], "hold_out": [], "good": []}
    for run in used(case):
        stem = PurePosixPath(run.file).name.split(".")[0]
        name = stem if stems[stem] == 1 else run.file
        groups[run.role].append(_run(name, bank.folder / run.file))
    return CaseRuns(**groups)


def _run(name: str, path: Path) -> GapRun:
    columns = read_columns(path)
    _require_columns(path, columns)
    flagged = columns.get("valid")
    if flagged is None:
        return run_from_columns(name, columns)
    use = np.nan_to_num(flagged) > 0.5
    # What was read in a flagged row is no more to be fed to a model than to be compared with it. A
    # run that has no other rows is refused at its admission, which wants to see channels.
    measured = {c.name for c in CHANNELS} if use.any() else set()
    kept = {k: np.where(use, v, np.nan) if k in measured else v for k, v in columns.items()}
    run = run_from_columns(name, kept)
    assert run.valid is not None, "a run from columns says which samples are valid"
    return replace(run, valid=run.valid & use)


def _require_columns(path: Path, columns: Mapping[str, Array]) -> None:
    def has(name: str) -> bool:
        return name in columns and bool(np.isfinite(columns[name]).any())

    absent = [] if has("t_s") else ["t_s"]
    absent += [
        s.name for s in INPUTS if not has(s.name) and not has(s.name.replace("applied", "cmd"))
    ]
    if not any(has(c.name) for c in CHANNELS):
        absent.append(f"any measured channel ({', '.join(c.name for c in CHANNELS)})")
    if absent:
        raise BankError(
            f"run file {path} lacks a column, or nothing was recorded in it",
            value=", ".join(absent),
            limit=f"columns as in the run log; {_SEE}",
            action="add the column, in the unit its name ends with",
        )
    t_s = columns["t_s"]
    if not np.isfinite(t_s).all() or np.any(np.diff(t_s) <= 0.0):
        raise BankError(
            f"run file {path}: column t_s is not a rising time",
            value=f"{int(np.sum(~(np.diff(t_s) > 0.0)))} steps that do not rise",
            action="sort the rows by time and take lost rows out",
        )


_READ = {"t_s", "valid", *(c.name for c in CHANNELS)} | {
    n for s in INPUTS for n in (s.name, s.name.replace("applied", "cmd"))
}
"""Columns that a diagnosis reads."""


def read_columns(path: Path) -> dict[str, Array]:
    """Columns of a Parquet, CSV or gzipped CSV file as float64, missing samples as NaN.

    No more is read than a run can hold (`smad.gap.check.bounds`). Columns that no diagnosis reads
    are left out where they hold text or share a name. Raises BankError when one that it
    reads does so, and when the file is missing, of another kind, or too long.
    """
    kinds = (".parquet", ".csv", ".csv.gz")
    if not path.name.endswith(kinds):
        raise BankError(
            f"run file {path} is of another kind",
            value=path.suffix,
            limit=", ".join(kinds),
            action="convert it",
        )
    try:
        require_bounded(path)
        table = _table(path)
        times = Counter(table.column_names)
        usable = [n for n, k in times.items() if k == 1 and not _is_text(table[n])]
        _require_usable(path, table, set(times) - set(usable))
        return {
            name: np.asarray(table[name].to_numpy(zero_copy_only=False), dtype=np.float64)
            for name in usable
        }
    except (OSError, ValueError, TypeError) as error:
        raise BankError(
            f"run file {path} cannot be read",
            value=str(error).splitlines()[0] if str(error) else type(error).__name__,
            action="restore the file, or leave the case out with --only",
        ) from error


def _require_usable(path: Path, table: Any, unusable: Collection[str]) -> None:
    names = [n for n in table.column_names if n in unusable and n in _READ]
    if not names:
        return
    if (count := table.column_names.count(names[0])) > 1:
        raise BankError(
            f"run file {path} has a column more than once",
            value=f"{names[0]}, {count} times",
            limit="once",
            action="keep one of them, or rename the other",
        )
    texts = (v for v in table[names[0]].to_pylist() if v is not None)
    raise BankError(
        f"run file {path}: column {names[0]} holds text",
        value=next((v for v in texts if not _is_number(v)), "numbers as text"),
        limit="numbers; a missing sample is empty or NaN",
        action="replace the text in the column",
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _table(path: Path) -> Any:
    if path.suffix == ".parquet":
        import pyarrow.parquet as pq

        # read_table refuses names that stand twice, even of columns that nobody reads.
        with pq.ParquetFile(path) as file:
            return file.read()
    from pyarrow import csv

    missing = csv.ConvertOptions(null_values=["", "nan", "NaN", "NAN"])
    return csv.read_csv(path, convert_options=missing)


def _is_text(column: Any) -> bool:
    from pyarrow import types

    kind = column.type
    return bool(types.is_string(kind) or types.is_large_string(kind) or types.is_dictionary(kind))
