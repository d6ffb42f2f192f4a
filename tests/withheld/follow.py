"""Run a recommended experiment on the bench of a case, without telling what is wrong with it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.withheld import files
from tests.withheld.errors import BankError, KeyMismatchError
from tests.withheld.excitation import TICK_s
from tests.withheld.plant.effects import Active
from tests.withheld.plant.parameters import Bench
from tests.withheld.recorder import record_program

Array = NDArray[np.float64]

COLUMNS = ("follow", "reference_mm", "i_x_A", "i_y_A", "duty_x", "duty_y", "cooling")
"""Columns of a program file beside `t_s`; those that are missing are 0."""

LONGEST_s = 600.0
CURRENT_LIMIT_A = 4.0


def read_program(path: Path) -> Array:
    """A program at the recorder's rate from a CSV of `t_s` and any of `COLUMNS`.

    Values hold until the next row. BankError when a column is foreign, a value is not a number,
    time does not rise from 0, or a current, duty or duration is out of its range.
    """
    table = files.read_run(path)
    foreign = sorted(set(table) - set(COLUMNS) - {"t_s"})
    if foreign or "t_s" not in table:
        raise BankError(f"{path.name}: columns are t_s and {', '.join(COLUMNS)}, not {foreign}")
    for name, values in table.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise BankError(
                f"{path.name}: {name} of row {row + 1} is {values[row]:g}, allowed are numbers; "
                "give every row a value"
            )
    t = table["t_s"]
    if len(t) < 2 or t[0] != 0.0 or not (np.diff(t) > 0).all() or t[-1] > LONGEST_s:
        raise BankError(f"{path.name}: t_s must rise from 0 to at most {LONGEST_s:.0f} s")
    for name, high in (("i_x_A", CURRENT_LIMIT_A), ("i_y_A", CURRENT_LIMIT_A), ("duty_x", 1.0),
                       ("duty_y", 1.0)):  # fmt: skip
        values = table.get(name, np.zeros(1))
        if values.min() < 0.0 or values.max() > high:
            raise BankError(
                f"{path.name}: {name} reaches {values.min():g}…{values.max():g}, "
                f"allowed is 0…{high:g}; keep within it"
            )
    grid = np.arange(round(t[-1] / TICK_s)) * TICK_s
    at = np.searchsorted(t, grid + 1e-9, side="right") - 1
    return np.stack([table[c][at] if c in table else np.zeros(len(at)) for c in COLUMNS], axis=1)


def _bench(entry: dict[str, Any]) -> Bench:
    changed = {name: after for name, (_, after) in entry["changed"].items()}
    return replace(Bench(**entry["bench"]), **changed)


def follow(
    folder: Path,
    key_path: Path,
    case: str,
    program_path: Path,
    out: Path | None = None,
    *,
    number: int | None = None,
) -> Path:
    """Record one more run of a case under a given program; the path of the new run file.

    Runs of another `number` have another day and other noise; it is the next one by default. The
    file lies beside the case's other runs, under its number, unless `out` says where.
    """
    manifest = files.read_json(folder / "manifest.json")
    if not manifest.get("key_sha256"):
        raise BankError(
            f"{folder / 'manifest.json'} names no key (key_sha256 is absent or empty): a run can "
            "be recorded on the bench of a bank that `make` made only; give such a bank"
        )
    if files.digest(key_path) != manifest["key_sha256"]:
        raise KeyMismatchError(f"{key_path} is not the key of {folder}: bring the bank's own key")
    entry = files.read_json(key_path)["cases"].get(case)
    if entry is None:
        raise BankError(f"{case} is not in {folder}: its cases are in manifest.json")
    if absent := [n for n in ("bench", "changed", "run_seeds") if n not in entry]:
        raise BankError(
            f"{key_path} does not say what the bench of {case} is (no {', '.join(absent)}): a run "
            "can be recorded on the bench of a bank that `make` made only; give such a bank"
        )
    place = folder / "cases" / case
    if number is None:
        number = 1 + len(list(place.glob("next-*")))
    active = tuple(
        Active(e["name"], e["magnitude"], e["y_share"], e["shape"]) for e in entry["effects"]
    )
    seed = int(entry["run_seeds"][0]) + number
    run = record_program(_bench(entry), active, read_program(program_path), seed, number=number)
    suffix = ".csv.gz" if list(place.glob("*.csv.gz")) else ".parquet"
    path = place / f"next-{number}{suffix}" if out is None else out
    files.write_run(path, run.log)
    return path
