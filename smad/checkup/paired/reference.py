"""What good repeats of a programme are worth: means, floor, reference model, signatures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smad.checkup.paired.floor import Deviations, Floor, repeat_floor
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.played import (
    Atom,
    Played,
    predictions,
    reference_point,
    signatures,
    slopes,
)
from smad.diagnosis.data.rows import (
    Binned,
    bin_numbers,
    binned,
    offset_s,
    require_like_inputs,
)
from smad.diagnosis.plant import Array, Mask, ModelPoint, PlantModel, nominal_point, traits_of
from smad.diagnosis.runs import GapRun

_CLOCK_SD_S = 0.004


@dataclass(frozen=True)
class RunReference:
    """One run of a baseline: the mean of its repeats, carried to their mean surroundings.

    `inputs` is its first repeat, `around` what the environment's channels showed at the
    start, `count` how many repeats each bin rests on.
    """

    name: str
    played: Played
    mean: Array
    valid: Mask
    count: Array
    inputs: Binned
    regime: Array
    around: dict[str, float]
    base: Array
    slopes: Array
    signatures: Array


@dataclass(frozen=True)
class Reference:
    """Everything that a check-up needs of the good bench.

    `responses` has those of the plant's places for each run, (terms, bins, channels), as
    `smad.diagnosis.places` makes them; empty where its equations cannot be forced.
    """

    runs: tuple[RunReference, ...]
    point: ModelPoint
    floor: Floor
    atoms: tuple[Atom, ...]
    repeats: int
    responses: tuple[NDArray[np.float32], ...] = ()


def start_values(run: GapRun, channels: Sequence[str]) -> dict[str, float]:
    """What these channels showed in the first second, where they were measured."""
    n = max(1, round(1.0 / max(run.dt_s, 1e-6)))
    shown = {c: run.outputs[c][:n] for c in channels if c in run.outputs}
    return {
        c: float(np.median(v[np.isfinite(v)])) for c, v in shown.items() if np.isfinite(v).any()
    }


def input_spans(plant: PlantModel) -> Array:
    return np.array([s.high - s.low for s in plant.inputs])


def carried(
    plant: PlantModel, J: Array, now: Mapping[str, float], then: Mapping[str, float]
) -> Array:
    """What the model says of the surroundings' difference; shape (bins, channels)."""
    out = np.zeros(J.shape[1:])
    for i, q in enumerate(plant.parameters):
        channel = traits_of(plant).environment.get(q.name)
        if channel is not None and channel in now and channel in then:
            out += J[i] * ((now[channel] - then[channel]) / q.prior_sd)
    return out


def day_directions(plant: PlantModel, J: Array, base: Array) -> Array:
    """Day parameters' slopes and a shift of the run's clock by one second."""
    index = {q.name: i for i, q in enumerate(plant.parameters)}
    clock = np.gradient(base, PERIOD_S, axis=0)
    return np.concatenate([J[[index[n] for n in traits_of(plant).day]], clock[None]])


def usual_day(plant: PlantModel) -> Array:
    """Spread of each day direction before any repeat."""
    return np.array([*traits_of(plant).day.values(), _CLOCK_SD_S])


def regime_numbers(plant: PlantModel, run: GapRun, bins: int, start_s: float) -> tuple[Array, int]:
    """Regime of each bin for each channel, the first that holds; and how many there are."""
    cache: dict[str, NDArray[np.intp]] = {}
    count = 1
    for side in {c.side for c in plant.channels}:
        number = np.zeros(bins, dtype=np.intp)
        masks = list(plant.regimes(run, side).values())
        count = max(count, len(masks) + 1)
        at = np.clip(bin_numbers(run, start_s), 0, bins - 1)
        size = np.maximum(np.bincount(at, minlength=bins), 1)
        for k in range(len(masks), 0, -1):
            inside = np.bincount(at, masks[k - 1].astype(float), minlength=bins) >= 0.5 * size
            number[inside] = k
        cache[side] = number
    return np.column_stack([cache[c.side] for c in plant.channels]), count


def reference_from(
    plant: PlantModel,
    groups: Sequence[Sequence[GapRun]],
    start: ModelPoint | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Reference:
    """The reference that good runs make: `groups` are the repeats of each run of the programme.

    Raises PairingError when the runs of a group do not have the same inputs.
    """
    channels = [c.name for c in plant.channels]
    inputs = [s.name for s in plant.inputs]
    least = np.array([max(c.quantum / 12**0.5, 0.5 * c.noise) for c in plant.channels])
    laid = [_laid_out(plant, group, channels, inputs) for group in groups]
    played = [p for p, _, _ in laid]
    progress("reference model")
    nominal = start or nominal_point(plant)
    means = [_mean(repeats) for _, repeats, _ in laid]
    point = reference_point(
        plant,
        nominal,
        played,
        measured=[m for m, _, _ in means],
        valid=[v for _, v, _ in means],
        least=least,
    )
    progress("slopes of the parameters")
    J = slopes(plant, point, played)
    base = predictions(plant, point, played)
    own, deviations, regimes = [], [], []
    most = 1
    for k, (p, repeats, around) in enumerate(laid):
        middle = _middle(around)
        moved = [
            b.values - carried(plant, J[k], a, middle) for b, a in zip(repeats, around, strict=True)
        ]
        values, valid = np.array(moved), np.array([b.valid for b in repeats])
        count = valid.sum(axis=0)
        mean = (values * valid).sum(axis=0) / np.maximum(count, 1)
        regime, n = regime_numbers(plant, groups[k][0], p.bins, p.start_s)
        most = max(most, n)
        inflate = np.sqrt(count / np.maximum(count - 1, 1))
        deviations.append(
            Deviations(
                (values - mean) * inflate,
                valid & (count > 1),
                regime,
                day_directions(plant, J[k], base[k]),
            )
        )
        regimes.append(regime)
        own.append((mean, count, middle))
    floor = repeat_floor(deviations, most, least, usual_day(plant))
    atoms, found = signatures(plant, point, played, progress)
    runs = tuple(
        RunReference(
            group[0].name, p, mean, count > 0, count, repeats[0], regime, middle,
            base[k], J[k], found[k],
        )
        for k, (group, (p, repeats, _), (mean, count, middle), regime) in enumerate(
            zip(groups, laid, own, regimes, strict=True)
        )
    )  # fmt: skip
    return Reference(runs, point, floor, tuple(atoms), min(len(g) for g in groups))


def _laid_out(
    plant: PlantModel,
    group: Sequence[GapRun],
    channels: Sequence[str],
    inputs: Sequence[str],
) -> tuple[Played, list[Binned], list[dict[str, float]]]:
    first = group[0]
    start_s = float(first.t_s[0] - first.dt_s)
    around = [start_values(r, list(traits_of(plant).environment.values())) for r in group]
    middle = _middle(around)
    shown = {c: np.full(len(first.t_s), v) for c, v in middle.items()}
    replayed = GapRun(first.name, first.t_s, first.inputs, shown)
    played = Played.of(replayed, start_s)
    spans = input_spans(plant)
    out: list[Binned] = []
    for run in group:
        start = start_s + offset_s(run, first)
        b = binned(run, played.bins, channels, inputs, start)
        if out:
            require_like_inputs(b, out[0], spans)
        out.append(b)
    return played, out, around


def _middle(around: Sequence[Mapping[str, float]]) -> dict[str, float]:
    names = set.intersection(*(set(a) for a in around)) if around else set()
    return {n: float(np.mean([a[n] for a in around])) for n in sorted(names)}


def _mean(repeats: Sequence[Binned]) -> tuple[Array, Mask, Array]:
    values, valid = np.array([b.values for b in repeats]), np.array([b.valid for b in repeats])
    count = valid.sum(axis=0)
    return (values * valid).sum(axis=0) / np.maximum(count, 1), count > 0, count
