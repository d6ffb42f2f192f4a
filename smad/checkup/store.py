"""A baseline as a folder: the good runs, and what was computed from them.

`baseline.json` names schema, programme and plant, for no other of which the baseline serves;
`reference.npz` holds the arrays. They come from a folder that anybody may have written: a file of a
few megabytes may claim gigabytes of zeros, text in place of numbers, or arrays that do not fit each
other. So they are bounded by what their headers say before one of them is read.
"""

import functools
import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.lib import format as npy

from smad.checkup.errors import BaselineError
from smad.diagnosis.data.played import Played
from smad.diagnosis.data.rows import binned
from smad.diagnosis.paired.floor import Floor
from smad.diagnosis.paired.good import GoodRun, GoodRuns
from smad.diagnosis.places.bare import with_places
from smad.diagnosis.places.responses import responses
from smad.diagnosis.plant import ModelPoint, PlantModel
from smad.diagnosis.rivals.changes import Changes, values_asked
from smad.diagnosis.runs import GapRun
from smad.files import named_output
from smad.runlog.bounds import DAMAGED, MOST_ARRAYS, MOST_ARRAYS_BYTES

SCHEMA = 15
"""Raised when arrays change their meaning: earlier baselines are then computed again."""
_ABOUT, _ARRAYS = "baseline.json", "reference.npz"
_FLOOR = ("sd", "rho", "day_sd", "gauge")
_RUN = ("mean", "valid", "count", "regime", "base", "slopes")
_KINDS = {"floats": "f", "whole numbers": "iu", "yes or no": "b"}
_ANEW = "commission again in the same folder: it is computed anew from the runs that are there"
_BROKEN = (*DAMAGED, ValueError, LookupError, RuntimeError, zipfile.BadZipFile)
"""What unpacking raises of a file that is damaged, encrypted or of another kind."""


class _RunFile(msgspec.Struct, frozen=True):
    name: str
    bins: int
    start_s: float
    around: dict[str, float]
    starts: dict[str, float] = {}


class About(msgspec.Struct, frozen=True, kw_only=True):
    """`baseline.json`: identity, reference model, and the list of runs."""

    schema: int
    bench: str
    programme: str
    plant: str
    repeats: int
    degrees: int
    theta: dict[str, float]
    effects: dict[str, dict[str, float]]
    runs: list[_RunFile]
    arrays: str = ""
    """SHA-256 of `reference.npz`; empty in a baseline written before it was kept."""


@dataclass(frozen=True)
class Baseline:
    """Good runs with what they belong to: bench, hash of the programme."""

    bench: str
    programme: str
    reference: GoodRuns


def identity(plant: PlantModel) -> str:
    """Model, library and places in one string: all that stored responses depend on, but inputs."""
    library = sorted(
        (e.name, [(q.name, q.unit, q.typical, q.low, q.high, q.strength) for q in e.parameters])
        for e in plant.effects
    )
    places = [(p.name, p.scale, p.sides, p.states) for p in with_places(plant).places]
    digest = hashlib.sha256(repr((library, places)).encode()).hexdigest()
    return f"{plant.name}, {plant.version}, library {digest[:8]}"


def save(baseline: Baseline, plant: PlantModel, folder: Path) -> None:
    """Write the baseline, whole or not at all. Raises BaselineError for a full disk."""
    r = baseline.reference
    about = About(
        schema=SCHEMA,
        bench=baseline.bench,
        programme=baseline.programme,
        plant=identity(plant),
        repeats=r.repeats,
        degrees=r.floor.degrees,
        theta=dict(r.point.theta),
        effects={k: dict(v) for k, v in r.point.effects.items()},
        runs=[
            _RunFile(x.name, x.played.bins, x.played.start_s, x.around, dict(x.played.run.starts))
            for x in r.runs
        ],
    )
    arrays = {f"floor.{n}": getattr(r.floor, n) for n in _FLOOR}
    for k, x in enumerate(r.runs):
        arrays |= {f"{k}.{n}": getattr(x, n) for n in _RUN}
        whole = x.played.whole
        arrays[f"{k}.t_s"] = whole.t_s
        arrays |= {f"{k}.input.{n}": v for n, v in whole.inputs.items()}
    for name, stored in (("responses", r.responses), ("changes", r.changes)):
        assert stored is not None
        arrays |= {f"{k}.{name}": array for k, array in enumerate(stored.runs)}
    cause = f"cannot write the baseline {folder}"
    action = "make room; the runs are kept, and the same command continues"
    output = functools.partial(
        named_output, kind=BaselineError, cause=cause, action=action, make_folder=True
    )
    with output(folder / _ABOUT) as text, output(folder / _ARRAYS) as packed:
        with packed.open("wb") as file:
            np.savez_compressed(file, **arrays)
        about = msgspec.structs.replace(about, arrays=_digest(packed))
        text.write_bytes(msgspec.json.format(msgspec.json.encode(about), indent=1))


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
    digest = _digest(folder / _ARRAYS)
    if about.arrays and digest and digest != about.arrays:
        is_whole = zipfile.is_zipfile(folder / _ARRAYS)
        mixed = f"is not that of {folder / _ABOUT}: two baselines are mixed"
        raise BaselineError(
            f"{folder / _ARRAYS} {mixed if is_whole else 'is cut off or damaged'}",
            value=digest[:12],
            limit=about.arrays[:12],
            action=_ANEW,
        )
    try:
        arrays = _read_arrays(folder / _ARRAYS)
        _require_fitting(about, plant, arrays)
        runs = tuple(_run(k, x, arrays, plant) for k, x in enumerate(about.runs))
        floor = Floor(degrees=about.degrees, **{n: arrays[f"floor.{n}"] for n in _FLOOR})
        point = ModelPoint(about.theta, about.effects)
        stored = [arrays[f"{k}.responses"] for k in range(len(runs))]
        played = [run.as_measured(plant) for run in runs]
        of_laws = responses(with_places(plant), point, played, stored=stored)
    except _BROKEN as error:
        why = getattr(error, "strerror", None) or error
        raise BaselineError(f"{folder / _ARRAYS} cannot be read: {why}", action=_ANEW) from error
    reference = GoodRuns(
        runs=runs,
        point=point,
        floor=floor,
        repeats=about.repeats,
        responses=of_laws,
        changes=Changes(
            effects=tuple(plant.effects),
            runs=tuple(arrays[f"{k}.changes"] for k in range(len(runs))),
        ),
    )
    return Baseline(about.bench, about.programme, reference)


def read_about(folder: Path) -> About:
    """What a baseline says of itself. Raises BaselineError."""
    try:
        about = msgspec.json.decode((folder / _ABOUT).read_bytes(), type=About)
    except OSError as error:
        raise BaselineError(
            f"{folder} is not a baseline: {_ABOUT} cannot be read ({error.strerror})",
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


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an `.npz` file by name.

    Raises ValueError for arrays of something else than numbers, and for more or larger ones than a
    baseline has; and what opening and unpacking raise.
    """
    arrays = {}
    bytes_left = MOST_ARRAYS_BYTES
    with zipfile.ZipFile(path) as packed:
        members = packed.namelist()
        if len(members) > MOST_ARRAYS or len(set(members)) < len(members):
            raise ValueError(f"{len(members)} arrays, allowed: {MOST_ARRAYS} of different names")
        for member in members:
            with packed.open(member) as file:
                shape, dtype = _header(member, file)
            bytes_left -= prod(shape) * dtype.itemsize
            if bytes_left < 0:
                raise ValueError(
                    f"its arrays are more than {MOST_ARRAYS_BYTES} bytes, too many for a baseline "
                    f"({member} claims {shape})"
                )
        for member in members:
            with packed.open(member) as file:
                arrays[member.removesuffix(".npy")] = npy.read_array(file, allow_pickle=False)
    return arrays


def _header(member: str, file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    if (version := npy.read_magic(file)) != (1, 0):
        raise ValueError(f"{member} is of an unknown version {version}")
    shape, _, dtype = npy.read_array_header_1_0(file)
    if dtype.kind not in "fiub" or dtype.itemsize > 8 or any(n < 0 for n in shape):
        raise ValueError(f"{member} holds {dtype} of shape {shape}, no numbers")
    return shape, dtype


def _require_fitting(about: About, plant: PlantModel, arrays: Mapping[str, np.ndarray]) -> None:
    """Raise ValueError for arrays that do not fit the baseline, KeyError for an absent one."""
    channels, regimes = len(plant.channels), arrays["floor.sd"].shape[-1]
    if about.degrees < 0 or regimes < 1:
        raise ValueError(f"a floor of {about.degrees} degrees and {regimes} regimes")
    _require(arrays, "floor.sd", (channels, regimes), "floats", above=0.0)
    _require(arrays, "floor.rho", (channels,), "floats", least=0.0, below=1.0)
    _require(arrays, "floor.gauge", (channels,), "floats", above=0.0)
    _require(arrays, "floor.day_sd", (-1,), "floats", above=0.0)
    count = len(values_asked(plant.effects))
    for k, run in enumerate(about.runs):
        grid = (run.bins, channels)
        samples = arrays[f"{k}.t_s"].size
        _require(arrays, f"{k}.t_s", (samples,), "floats")
        if samples < 2 or not (np.diff(arrays[f"{k}.t_s"]) > 0).all():
            raise ValueError(f"{k}.t_s does not increase")
        for signal in plant.inputs:
            _require(arrays, f"{k}.input.{signal.name}", (samples,), "floats")
        _require(arrays, f"{k}.base", grid, "floats")
        _require(arrays, f"{k}.mean", grid, "floats")
        _require(arrays, f"{k}.valid", grid, "yes or no")
        _require(arrays, f"{k}.count", grid, "whole numbers", least=0)
        _require(arrays, f"{k}.regime", grid, "whole numbers", least=0, below=regimes)
        _require(arrays, f"{k}.slopes", (len(plant.parameters), *grid), "floats")
        _require(arrays, f"{k}.responses", (-1, *grid), "floats")
        _require(arrays, f"{k}.changes", (count, *grid), "floats")


def _require(
    arrays: Mapping[str, np.ndarray],
    name: str,
    shape: tuple[int, ...],
    kind: str,
    *,
    least: float = -np.inf,
    above: float = -np.inf,
    below: float = np.inf,
) -> None:
    """Raise ValueError for an array of another shape (−1: any length) or kind, and for a number
    that is not finite or out of range; KeyError for an array that is absent."""
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        want in (-1, n) for n, want in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in _KINDS[kind]:
        raise ValueError(
            f"{name} holds {array.dtype} of shape {array.shape}, allowed: {kind} of {shape}"
        )
    wrong = array[~(np.isfinite(array) & (array >= least) & (array < below))]
    wrong = wrong if len(wrong) else array[array <= above]
    if len(wrong):
        raise ValueError(f"{name} holds {wrong[0]}, which it cannot be")


def _run(k: int, x: _RunFile, arrays: Mapping[str, np.ndarray], plant: PlantModel) -> GoodRun:
    t_s, prefix = arrays[f"{k}.t_s"], f"{k}.input."
    inputs = {name.removeprefix(prefix): v for name, v in arrays.items() if name.startswith(prefix)}
    levels = {c: np.full(len(t_s), v) for c, v in x.around.items()}
    whole = GapRun(x.name, t_s, inputs, levels, starts=x.starts)
    return GoodRun(
        name=x.name,
        played=Played.of(whole, plant.inputs, x.start_s),
        around=x.around,
        inputs=binned(whole, x.bins, plant, x.start_s),
        **{f: arrays[f"{k}.{f}"] for f in _RUN},
    )
