"""Choosing the runs of a programme: the smallest separation between any two causes, made large.

For every candidate run the model gives the signatures of all entries at their typical strength and
the slopes of all parameters. Information adds up over runs, so that a choice is judged by sums of
small matrices: d²_ij is what is left of entry i when entry j takes any strength and the parameters
move within their priors; d²_i against the parameters alone likewise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.programme.segments import candidate, milder
from smad.checkup.programme import Programme, ProgrammeRun
from smad.diagnosis.data.played import Played, finite, predictions, slopes
from smad.diagnosis.plant import Array, ModelPoint, PlantModel

WATER_DEGC = 27.0
_ENOUGH = 400.0
_REACH = 2.0


@dataclass(frozen=True)
class Limits:
    """What no reading may exceed, at any parameter within two standard deviations of its prior."""

    temperature_degC: float = 62.0
    displacement_mm: float = 11.5
    force_N: float = 4.0


@dataclass(frozen=True)
class Candidate:
    """A safe run, and its information matrix: entries first, then parameters."""

    run: ProgrammeRun
    gram: Array


@dataclass(frozen=True)
class Separations:
    """d² between entries, shape (n, n), the diagonal against the parameters alone."""

    names: tuple[str, ...]
    d2: Array

    def worst(self, count: int) -> list[tuple[str, str, float]]:
        """The pairs that lie closest; the second name is "parameters" on the diagonal."""
        n = len(self.names)
        both = np.minimum(self.d2, self.d2.T)
        pairs = [
            (self.names[i], self.names[j] if i != j else "parameters", float(both[i, j]))
            for i in range(n)
            for j in range(i, n)
        ]
        return sorted(pairs, key=lambda p: p[2])[:count]


def corners(plant: PlantModel) -> list[ModelPoint]:
    """The nominal model, and each parameter two standard deviations of its prior up and down."""
    out = [ModelPoint({})]
    for q in plant.parameters:
        for side in (-_REACH, _REACH):
            value = float(np.clip(q.nominal + side * q.prior_sd, q.low, q.high))
            out.append(ModelPoint({q.name: value}))
    return out


def safe(plant: PlantModel, run: ProgrammeRun, limits: Limits) -> ProgrammeRun | None:
    """The run with its currents made as much milder as the limits ask; None if half is too much."""
    points = corners(plant)
    for factor in (1.0, 0.92, 0.85, 0.78, 0.7, 0.6, 0.5):
        milder_run = milder(run, factor)
        if all(_within(plant, point, milder_run, limits) for point in points):
            return milder_run
    return None


def _within(plant: PlantModel, point: ModelPoint, run: ProgrammeRun, limits: Limits) -> bool:
    names = [c.name for c in plant.channels]
    played = Played.of(run.as_run(WATER_DEGC, WATER_DEGC))
    found = predictions(plant, point, [played])[0]
    if not np.isfinite(found).all():
        # A corner of the parameters that cannot be mounted says nothing of the run.
        return bool(point.theta)
    hottest = max(found[:, names.index(n)].max() for n in ("rtd_x_degC", "rtd_y_degC"))
    travel = np.abs(found[:, names.index("displacement_mm")]).max()
    pull = found[:, names.index("force_N")].max()
    return bool(
        hottest <= limits.temperature_degC
        and travel <= limits.displacement_mm
        and pull <= limits.force_N
    )


def typical_gram(plant: PlantModel, run: ProgrammeRun, sd: Array) -> tuple[tuple[str, ...], Array]:
    """Names of the entries, and the Gram matrix of their typical signatures and the slopes."""
    played = [Played.of(run.as_run(WATER_DEGC, WATER_DEGC))]
    nominal = ModelPoint({q.name: q.nominal for q in plant.parameters})
    base = predictions(plant, nominal, played)
    rows, names = [], []
    for e in plant.effects:
        if not any(q.strength for q in e.parameters):
            continue
        changed = predictions(plant, ModelPoint(nominal.theta, {e.name: e.at()}), played)
        rows.append(changed[0] - base[0] if finite(changed) else np.zeros_like(base[0]))
        names.append(e.name)
    whole = np.concatenate([np.array(rows), slopes(plant, nominal, played)[0]]) / sd
    flat = whole.reshape(len(whole), -1)
    return tuple(names), flat @ flat.T


def separations(names: tuple[str, ...], gram: Array) -> Separations:
    """d² of a summed Gram matrix; parameters have a prior of variance 1."""
    n = len(names)
    A = gram[n:, n:] + np.eye(len(gram) - n)
    G = gram[:n, :n] - gram[:n, n:] @ np.linalg.solve(A, gram[n:, :n])
    own = np.maximum(np.diag(G), 0.0)
    d2 = own[:, None] - G**2 / np.maximum(own[None, :], 1e-9)
    np.fill_diagonal(d2, own)
    return Separations(names, np.maximum(d2, 0.0))


def merit(found: Separations) -> float:
    """What the choice maximises: mean of log d² up to enough, the closest pairs counting most."""
    both = np.minimum(found.d2, found.d2.T)
    flat = np.sort(np.log1p(np.minimum(both[np.triu_indices(len(both))], _ENOUGH)))
    weight = 1.0 / (1.0 + np.arange(len(flat)) / 10.0)
    return float((weight * flat).sum() / weight.sum())


def chosen(candidates: Sequence[Candidate], names: tuple[str, ...], count: int) -> list[int]:
    """Indices of the best runs: greedily, then exchanged one by one while that helps."""
    picked: list[int] = []

    def value(indices: Sequence[int]) -> float:
        return merit(separations(names, np.sum([candidates[i].gram for i in indices], axis=0)))

    while len(picked) < count:
        rest = [i for i in range(len(candidates)) if i not in picked]
        picked.append(max(rest, key=lambda i: value([*picked, i])))
    for _ in range(2):
        before = list(picked)
        for place in range(count):
            others = [*picked[:place], *picked[place + 1 :]]
            rest = [i for i in range(len(candidates)) if i not in others]
            picked[place] = max(rest, key=lambda i: value([*others, i]))
        if picked == before:
            break
    return picked


def design(
    plant: PlantModel,
    sd: Array,
    *,
    runs: int,
    quick: int,
    duration_s: float,
    candidates: int,
    seed: int,
    limits: Limits | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[Programme, Separations, Separations]:
    """The programme with its separations, and those of its quick part."""
    pool: list[Candidate] = []
    names: tuple[str, ...] = ()
    for k in range(candidates):
        progress(f"candidate {k + 1} of {candidates}")
        run = safe(plant, candidate(f"c{k}", seed + k, duration_s), limits or Limits())
        if run is not None:
            names, gram = typical_gram(plant, run, sd)
            pool.append(Candidate(run, gram))
    best = chosen(pool, names, runs)
    own = [pool[i] for i in best]
    first = [own[i] for i in chosen(own, names, quick)]
    order = [*first, *(c for c in own if c not in first)]
    out = tuple(replace(c.run, name=f"run-{n + 1}", quick=n < quick) for n, c in enumerate(order))
    total = separations(names, np.sum([c.gram for c in order], axis=0))
    part = separations(names, np.sum([c.gram for c in first], axis=0))
    title = f"{runs} runs of {duration_s:g} s, designed with seed {seed} from {candidates}"
    return Programme("spring-pair", title, out), total, part
