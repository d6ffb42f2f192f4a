"""A programme: open-loop inputs as data, which any bench, simulator or plant can play."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from firmware_protocol.nearest import instead
from smad.checkup.errors import ProgrammeError
from smad.config.toml_file import read_toml
from smad.control.commands import FollowInputs
from smad.control.pieces import rows_in_pieces
from smad.control.plan import Do, Plan, UntilDone
from smad.diagnosis.plant import Array
from smad.diagnosis.runs import GapRun

COLUMNS = ("t_s", "i_x_A", "i_y_A", "duty_x", "duty_y")
INPUTS = ("i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y")
_HIGHEST = (4.0, 4.0, 1.0, 1.0)
SHIPPED = Path(str(files("smad.checkup") / "data" / "spring-pair"))
LONGEST_S = 600.0
_TICK_S = 0.01
"""A control step of a bench at 100 Hz."""
_LATE_S = 5.0
_SAFE_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")


class RunEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One run of `programme.toml`: `quick` runs are the part that separates most."""

    name: str
    title: str
    duration_s: float
    quick: bool = False


class ProgrammeFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`programme.toml`: what the CSV files beside it are."""

    format: Literal["smad-programme-1"]
    name: str
    title: str
    runs: Annotated[list[RunEntry], msgspec.Meta(min_length=1)]


@dataclass(frozen=True, kw_only=True)
class ProgrammeRun:
    """Inputs that change at `t_s` and hold until the next row; shape (rows, 4) as `INPUTS`."""

    name: str
    title: str
    t_s: Array
    inputs: Array
    duration_s: float
    quick: bool = False

    def __post_init__(self) -> None:
        finite = np.isfinite(self.t_s).all() and np.isfinite(self.inputs).all()
        rising = len(self.t_s) > 0 and self.t_s[0] == 0.0 and bool((np.diff(self.t_s) > 0).all())
        if not (finite and rising):
            raise ProgrammeError(
                f"run {self.name}: t_s does not rise from 0 in finite numbers",
                action="give every row a time, the first of them 0",
            )
        if not self.t_s[-1] <= self.duration_s <= LONGEST_S:
            raise ProgrammeError(
                f"run {self.name} lasts too long, or ends before its last row",
                value=f"{self.duration_s:g} s",
                limit=f"{self.t_s[-1]:g} to {LONGEST_S:g} s",
                action="correct duration_s in programme.toml",
            )
        for name, column, high in zip(COLUMNS[1:], self.inputs.T, _HIGHEST, strict=True):
            if column.min() < 0.0 or column.max() > high:
                raise ProgrammeError(
                    f"run {self.name}: {name} leaves its range",
                    value=f"{column.min():g} to {column.max():g}",
                    limit=f"0 to {high:g}",
                    action="correct the file, or design the programme again",
                )

    def as_run(self, inlet_degC: float, ambient_degC: float) -> GapRun:
        """The run as a replay takes it: the inputs in force over each tick, which ends at `t_s`,
        and what water and room show at the start."""
        starts = np.arange(round(self.duration_s / _TICK_S)) * _TICK_S
        row = np.searchsorted(self.t_s, starts + 1e-9, side="right") - 1
        around = {
            "rtd_inlet_degC": np.full(len(starts), inlet_degC),
            "rtd_ambient_degC": np.full(len(starts), ambient_degC),
        }
        inputs = dict(zip(INPUTS, self.inputs[row].T, strict=True))
        t_s = np.asarray(starts + _TICK_S, dtype=np.float64)
        return GapRun(self.name, t_s, inputs, around)

    def plan(self) -> Plan:
        """The run as a bench carries it out from rest; the host's limits apply as in every mode."""
        i_x_A, i_y_A, duty_x, duty_y = (tuple(column.tolist()) for column in self.inputs.T)
        command = FollowInputs(
            t_s=tuple(self.t_s.tolist()),
            end_s=self.duration_s,
            i_x_A=i_x_A,
            i_y_A=i_y_A,
            pump_x_duty=duty_x,
            pump_y_duty=duty_y,
        )
        pieces = [Do(piece) for piece in rows_in_pieces(command)]
        return Plan(self.name, (*pieces, UntilDone(self.duration_s + _LATE_S)))


@dataclass(frozen=True)
class Programme:
    """The runs of a programme, in the order in which they are played."""

    name: str
    title: str
    runs: tuple[ProgrammeRun, ...]

    @property
    def digest(self) -> str:
        """SHA-256 of names, times and inputs, as hexadecimal digits."""
        h = hashlib.sha256()
        for run in self.runs:
            h.update(f"{run.name} {run.duration_s:.6f}".encode())
            h.update(np.ascontiguousarray(np.round(run.t_s, 6)).tobytes())
            h.update(np.ascontiguousarray(np.round(run.inputs, 6)).tobytes())
        return h.hexdigest()

    @property
    def duration_s(self) -> float:
        """Of all runs together, without the rests between them."""
        return sum(run.duration_s for run in self.runs)

    def quick(self) -> Programme:
        """The part that separates most in about three minutes."""
        return Programme(self.name, self.title, tuple(r for r in self.runs if r.quick))

    def run(self, name: str) -> ProgrammeRun:
        """The run of that name. Raises ProgrammeError when there is none."""
        for run in self.runs:
            if run.name == name:
                return run
        raise ProgrammeError(
            f"programme {self.name} has no such run",
            value=name,
            action=instead(name, [r.name for r in self.runs], "its programme.toml has their names"),
        )


def read_programme(folder: Path) -> Programme:
    """The programme of a folder. Raises ProgrammeError."""
    action = "correct it, or design it again with python -m evaluation design"
    path = folder / "programme.toml"
    entry = read_toml(path, ProgrammeFile, "programme", ProgrammeError, action)
    runs = [_read_run(folder, r) for r in entry.runs]
    return Programme(entry.name, entry.title, tuple(runs))


def _read_run(folder: Path, entry: RunEntry) -> ProgrammeRun:
    if not _SAFE_NAME.fullmatch(entry.name):
        raise ProgrammeError(
            "a run's name is a file name: small letters, digits and hyphens",
            value=entry.name,
            action="rename the run and its file",
        )
    path = folder / f"{entry.name}.csv"
    try:
        with path.open(encoding="utf-8") as file:
            header = file.readline().strip().split(",")
            rows = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        raise ProgrammeError(f"cannot read {path}: {error}", action="restore the file") from None
    if tuple(header) != COLUMNS or rows.shape[1:] != (len(COLUMNS),):
        raise ProgrammeError(
            f"{path} has other columns",
            value=",".join(header),
            limit=",".join(COLUMNS),
            action="give it these",
        )
    return ProgrammeRun(t_s=rows[:, 0], inputs=rows[:, 1:], **msgspec.structs.asdict(entry))


def chosen(folder: Path | None, *, quick: bool = False) -> Programme:
    """The programme of a folder, or the shipped one; `quick`: its quick part."""
    programme = shipped() if folder is None else read_programme(folder)
    return programme.quick() if quick else programme


def shipped() -> Programme:
    """The programme of the spring pair, as designed by `python -m evaluation design`."""
    return read_programme(SHIPPED)
