"""A baseline as a folder: the good runs, and what was computed of them once.

`baseline.json` says what it is and what it belongs to; `reference.npz` holds the arrays. Both carry
the schema's number, the programme's hash and the plant's version: of another one nothing is judged.
"""

from __future__ import annotations

import hashlib
import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import msgspec
import numpy as np

from smad.checkup.arrays import read_arrays, require_fitting
from smad.checkup.errors import BaselineError
from smad.checkup.paired.floor import Floor
from smad.checkup.paired.reference import Reference, RunReference
from smad.checkup.series import unlink_quietly
from smad.diagnosis.data.played import Atom, Played
from smad.diagnosis.data.rows import Binned
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import ModelPoint, PlantModel
from smad.diagnosis.runs import GapRun

SCHEMA = 4
_ABOUT, _ARRAYS = "baseline.json", "reference.npz"
_FLOOR = ("sd", "rho", "day_sd", "gauge")
_RUN = ("mean", "valid", "count", "regime", "base", "slopes", "signatures")
_ANEW = "commission again in the same folder: it is computed anew from the runs that are there"
_BROKEN = (
    OSError, ValueError, KeyError, IndexError, EOFError, BadZipFile, NotImplementedError,
    RuntimeError, zlib.error,
)  # fmt: skip
"""What unpacking raises of a file that is damaged, encrypted or of another kind."""
_FIRST = ("values", "valid", "inputs", "covered")


class _AtomFile(msgspec.Struct, frozen=True):
    entry: str
    strength: str
    level: float
    variant: str
    values: dict[str, float]


class _RunFile(msgspec.Struct, frozen=True):
    name: str
    bins: int
    start_s: float
    around: dict[str, float]


class About(msgspec.Struct, frozen=True):
    """`baseline.json`: identity, reference model, and the list of runs."""

    schema: int
    bench: str
    programme: str
    plant: str
    repeats: int
    degrees: int
    theta: dict[str, float]
    effects: dict[str, dict[str, float]]
    atoms: list[_AtomFile]
    runs: list[_RunFile]
    arrays: str = ""
    """SHA-256 of `reference.npz`; empty in a baseline written before it was kept."""


@dataclass(frozen=True)
class Baseline:
    """A reference with what it belongs to: bench, hash of the programme."""

    bench: str
    programme: str
    reference: Reference


def identity(plant: PlantModel) -> str:
    """What signatures and responses depend on beside the inputs: model, library and places."""
    library = sorted(
        (e.name, [(q.name, q.unit, q.typical, q.low, q.high, q.strength) for q in e.parameters])
        for e in plant.effects
    )
    places = [(p.name, p.scale, p.sides, p.states) for p in with_places(plant).places]
    digest = hashlib.sha256(repr((library, places)).encode()).hexdigest()
    return f"{plant.name}, {plant.version}, library {digest[:8]}"


def save(baseline: Baseline, plant: PlantModel, folder: Path) -> None:
    """Writes the baseline whole or not at all. Raises BaselineError for a disk that is full."""
    r = baseline.reference
    about = About(
        SCHEMA, baseline.bench, baseline.programme, identity(plant), r.repeats, r.floor.degrees,
        dict(r.point.theta), {k: dict(v) for k, v in r.point.effects.items()},
        [_AtomFile(a.entry, a.strength, a.level, a.variant, a.values) for a in r.atoms],
        [_RunFile(x.name, x.played.bins, x.played.start_s, dict(x.around)) for x in r.runs],
    )  # fmt: skip
    arrays = {f"floor.{n}": getattr(r.floor, n) for n in _FLOOR}
    for k, x in enumerate(r.runs):
        arrays |= {f"{k}.{n}": getattr(x, n) for n in _RUN}
        arrays |= {f"{k}.first.{n}": getattr(x.inputs, n) for n in _FIRST}
        arrays[f"{k}.responses"] = r.responses[k]
        whole = x.played.whole
        arrays[f"{k}.t_s"] = whole.t_s
        arrays |= {f"{k}.input.{n}": v for n, v in whole.inputs.items()}
    partial, text = folder / f"{_ARRAYS}.part", folder / f"{_ABOUT}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez_compressed(file, **arrays)
        about = msgspec.structs.replace(about, arrays=_digest(partial))
        text.write_bytes(msgspec.json.format(msgspec.json.encode(about), indent=1))
        os.replace(partial, folder / _ARRAYS)
        os.replace(text, folder / _ABOUT)
    except OSError as error:
        for left in (partial, text):
            unlink_quietly(left)
        raise BaselineError(
            f"cannot write the baseline {folder}: {error.strerror}",
            action="make room; the runs are kept, and the same command goes on",
        ) from error


def _digest(path: Path) -> str:
    """SHA-256 of a file, empty where there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def load(folder: Path, plant: PlantModel) -> Baseline:
    """The baseline of a folder. Raises BaselineError where it is not whole or not this plant's."""
    about = read_about(folder)
    if about.plant != identity(plant):
        raise BaselineError(
            f"the baseline {folder} was computed with another model or library",
            value=about.plant,
            limit=identity(plant),
            action=_ANEW,
        )
    found = _digest(folder / _ARRAYS)
    if about.arrays and found and found != about.arrays:
        raise BaselineError(
            f"{folder / _ARRAYS} is not that of {folder / _ABOUT}: two baselines are mixed",
            value=found[:12],
            limit=about.arrays[:12],
            action=_ANEW,
        )
    try:
        arrays = read_arrays(folder / _ARRAYS)
        require_fitting(about, plant, arrays)
        runs = tuple(_run(k, x, arrays) for k, x in enumerate(about.runs))
        sd, rho, day_sd, gauge = (arrays[f"floor.{n}"] for n in _FLOOR)
        floor = Floor(sd, rho, day_sd, about.degrees, gauge)
    except _BROKEN as error:
        said = getattr(error, "strerror", None) or error
        raise BaselineError(f"{folder / _ARRAYS} cannot be read: {said}", action=_ANEW) from error
    atoms = tuple(Atom(a.entry, a.strength, a.level, a.variant, a.values) for a in about.atoms)
    point = ModelPoint(about.theta, about.effects)
    placed = _placed(plant, point, runs, arrays, folder)
    reference = Reference(runs, point, floor, atoms, about.repeats, placed)
    return Baseline(about.bench, about.programme, reference)


def read_about(folder: Path) -> About:
    """What a baseline says of itself. Raises BaselineError."""
    try:
        about = msgspec.json.decode((folder / _ABOUT).read_bytes(), type=About)
    except OSError as error:
        raise BaselineError(
            f"{folder} is no baseline: {_ABOUT} cannot be read ({error.strerror})",
            action="make one with smad gap commission",
        ) from error
    except msgspec.MsgspecError as error:
        raise BaselineError(f"{folder / _ABOUT} is not valid: {error}", action=_ANEW) from None
    if about.schema != SCHEMA:
        raise BaselineError(
            f"the baseline {folder} was written by another version",
            value=f"schema {about.schema}",
            limit=f"schema {SCHEMA}",
            action=_ANEW,
        )
    return about


def _placed(
    plant: PlantModel,
    point: ModelPoint,
    runs: Sequence[RunReference],
    arrays: dict[str, np.ndarray],
    folder: Path,
) -> tuple[np.ndarray, ...]:
    """The responses of the places. Raises BaselineError where they are not those of this plant."""
    try:
        known = [arrays[f"{k}.responses"] for k in range(len(runs))]
        return responses(with_places(plant), point, [r.played for r in runs], known=known).runs
    except (KeyError, ValueError) as error:
        raise BaselineError(f"{folder / _ARRAYS} cannot be read: {error}", action=_ANEW) from error


def _run(k: int, x: _RunFile, arrays: dict[str, np.ndarray]) -> RunReference:
    n = len(arrays[f"{k}.t_s"])
    prefix = f"{k}.input."
    inputs = {name.removeprefix(prefix): v for name, v in arrays.items() if name.startswith(prefix)}
    around = {c: np.full(n, v) for c, v in x.around.items()}
    run = GapRun(x.name, arrays[f"{k}.t_s"], inputs, around)
    first = Binned(x.name, *(arrays[f"{k}.first.{f}"] for f in _FIRST))
    own = {f: arrays[f"{k}.{f}"] for f in _RUN}
    return RunReference(
        name=x.name, played=Played.of(run, x.start_s), inputs=first, around=dict(x.around), **own
    )
