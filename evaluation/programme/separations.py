"""Choosing the runs of a programme: the smallest separation between places with free laws, made
large.

For every candidate run the model gives the responses of the terms of each place and the slopes of
all parameters. Information adds up over runs, so that a choice is judged by sums of small matrices:
d² of a term beside a rival is what is left of it, at the place's scale, when the rival place has a
law of any coefficients and the parameters move within their priors. No law's form is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.errors import WithheldError
from evaluation.programme.segments import candidate, milder
from sim_device.plant.laws import Law
from smad.checkup.programme import Programme, ProgrammeRun
from smad.diagnosis.data.played import Played, predictions, slopes
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Candidate, Responses, candidate_laws, responses
from smad.diagnosis.plant import Array, ModelPoint, PlantModel, nominal_point
from smad.progress import Say, silent

WATER_DEGC = 27.0
_HIGHEST_ORDER = 2
"""Terms of the design: constants, lines and signs. Lags of them go nearly the same way."""
_STRENGTH = 0.1
"""Size of the laws, in scales of their places: so large that a half can just be told from none."""
_ENOUGH = 400.0
_REACH = 2.0
_TIES = 30.0
"""Of so many closest pairs the first counts twice as much as the last."""
_TYPICAL = 12
"""Runs whose states say over what range laws are asked."""


@dataclass(frozen=True)
class Limits:
    """What no reading may exceed, at any parameter within two standard deviations of its prior."""

    temperature_degC: float = 62.0
    displacement_mm: float = 11.5
    force_N: float = 4.0


@dataclass(frozen=True)
class Safe:
    """A safe run, and its information matrix: terms of the laws first, then parameters."""

    run: ProgrammeRun
    gram: Array


@dataclass(frozen=True)
class Rivals:
    """The terms of each law, and the places with free laws that each is held against.

    `columns` are the numbers of the terms of a law; `pairs` those of a law and of the candidate
    that it is held against.
    """

    candidates: tuple[Candidate, ...]
    names: tuple[str, ...]
    columns: tuple[range, ...]
    pairs: tuple[tuple[int, int], ...]

    @staticmethod
    def of(of_laws: Responses) -> Rivals:
        """All pairs of a single law and another place, or another side of its own."""
        candidates = tuple(of_laws.candidates())
        return Rivals(
            candidates,
            tuple(f"{law.place} {law.side}" for law in of_laws.laws),
            of_laws.columns,
            tuple(
                (k, i)
                for k, law in enumerate(of_laws.laws)
                for i, c in enumerate(candidates)
                if (c.place, c.side) != (law.place, law.side)
            ),
        )

    @property
    def terms(self) -> int:
        """How many terms there are."""
        return self.columns[-1].stop


@dataclass(frozen=True)
class Separations:
    """What rivals leave of each law: mean over its terms of log(1 + d²), and of the share of d²."""

    rivals: Rivals
    log_d2: Array
    share: Array

    def worst(self, count: int) -> list[tuple[str, str, float, float]]:
        """The pairs that lie closest: both names, the d² that the mean stands for, the share."""
        out = []
        for n in np.argsort(self.share)[:count]:
            k, i = self.rivals.pairs[n]
            rival = self.rivals.candidates[i]
            rival_name = f"{rival.place} {rival.side}"
            d2 = float(np.expm1(self.log_d2[n]))
            out.append((self.rivals.names[k], rival_name, d2, float(self.share[n])))
        return out


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
    played = Played.of(run.as_run(WATER_DEGC, WATER_DEGC), plant.inputs)
    readings = predictions(plant, point, [played])[0]
    if not np.isfinite(readings).all():
        # A corner of the parameters that cannot be mounted says nothing of the run.
        return bool(point.theta)
    hottest = max(readings[:, names.index(n)].max() for n in ("rtd_x_degC", "rtd_y_degC"))
    travel = np.abs(readings[:, names.index("displacement_mm")]).max()
    pull = readings[:, names.index("force_N")].max()
    return bool(
        hottest <= limits.temperature_degC
        and travel <= limits.displacement_mm
        and pull <= limits.force_N
    )


def gram_of(
    plant: PlacesPlant, run: ProgrammeRun, space: tuple[Law, ...], sd: Array
) -> tuple[Responses, Array]:
    """Responses to the terms of `space`, and the Gram matrix of them and the slopes."""
    played = [Played.of(run.as_run(WATER_DEGC, WATER_DEGC), plant.inputs)]
    point = nominal_point(plant)
    of_laws = responses(plant, point, played, space=space)
    moved = slopes(plant, point, played)[0]
    whole = np.concatenate([_STRENGTH * of_laws.runs[0].astype(np.float64), moved]) / sd
    flat = whole.reshape(len(whole), -1)
    return of_laws, flat @ flat.T


def separations(rivals: Rivals, gram: Array) -> Separations:
    """What rivals leave in a summed Gram matrix; parameters have a prior of variance 1."""
    n = rivals.terms
    A = gram[n:, n:] + np.eye(len(gram) - n)
    G = gram[:n, :n] - gram[:n, n:] @ np.linalg.solve(A, gram[n:, :n])
    alone = np.maximum(np.diag(G), 1e-9)
    rest = np.empty((n, len(rivals.candidates)))
    for i, c in enumerate(rivals.candidates):
        across = G[:, c.groups].sum(axis=2)
        products = across[c.groups].sum(axis=1)
        products += np.diag(1e-6 * np.diag(products) + 1e-9)
        rest[:, i] = alone - np.einsum("nm,nm->n", across, np.linalg.solve(products, across.T).T)
    rest = np.maximum(rest, 0.0)
    logs, shares = np.log1p(rest), rest / alone[:, None]
    rows = [(slice(r.start, r.stop), i) for k, i in rivals.pairs for r in [rivals.columns[k]]]
    return Separations(
        rivals,
        np.array([logs[terms, i].mean() for terms, i in rows]),
        np.array([shares[terms, i].mean() for terms, i in rows]),
    )


def merit(separated: Separations) -> float:
    """What the choice maximises: mean of log(1 + d²) up to enough, the closest counting most."""
    values = np.sort(np.minimum(separated.log_d2, np.log1p(_ENOUGH)))
    weight = 1.0 / (1.0 + np.arange(len(values)) / _TIES)
    return float((weight * values).sum() / weight.sum())


def chosen(runs: Sequence[Safe], rivals: Rivals, count: int) -> list[int]:
    """Indices of the best runs: greedily, then exchanged one by one while that helps."""
    picked: list[int] = []

    def value(indices: Sequence[int]) -> float:
        return merit(separations(rivals, np.sum([runs[i].gram for i in indices], axis=0)))

    while len(picked) < count:
        rest = [i for i in range(len(runs)) if i not in picked]
        picked.append(max(rest, key=lambda i: value([*picked, i])))
    for _ in range(2):
        before = list(picked)
        for place in range(count):
            others = [*picked[:place], *picked[place + 1 :]]
            rest = [i for i in range(len(runs)) if i not in others]
            picked[place] = max(rest, key=lambda i: value([*others, i]))
        if picked == before:
            break
    return picked


def designed_space(plant: PlacesPlant, programme: Sequence[ProgrammeRun]) -> tuple[Law, ...]:
    """The simpler terms of all laws, over the states that some runs go through."""
    played = [Played.of(run.as_run(WATER_DEGC, WATER_DEGC), plant.inputs) for run in programme]
    return tuple(
        replace(law, terms=tuple(t for t in law.terms if t.order <= _HIGHEST_ORDER))
        for law in candidate_laws(plant, nominal_point(plant), played)
    )


def separations_of(
    plant: PlacesPlant, sd: Array, programme: Programme
) -> tuple[Separations, Separations]:
    """The separations of a programme, and those of its quick part."""
    space = designed_space(plant, programme.runs)
    grams = [gram_of(plant, run, space, sd) for run in programme.runs]
    rivals = Rivals.of(grams[0][0])
    quick = [g for (_, g), run in zip(grams, programme.runs, strict=True) if run.quick]
    return (
        separations(rivals, np.sum([g for _, g in grams], axis=0)),
        separations(rivals, np.sum(quick, axis=0)),
    )


def design(
    plant: PlacesPlant,
    sd: Array,
    *,
    runs: int,
    quick: int,
    duration_s: float,
    candidates: int,
    seed: int,
    progress: Say = silent,
) -> tuple[Programme, Separations, Separations]:
    """The programme with its separations, and those of its quick part."""
    safe_runs = []
    for k in range(candidates):
        progress(f"candidate {k + 1} of {candidates}: limits")
        run = safe(plant, candidate(f"c{k}", seed + k, duration_s), Limits())
        if run is not None:
            safe_runs.append(run)
    if len(safe_runs) < runs:
        raise WithheldError(
            f"{len(safe_runs)} of {candidates} candidates are safe, {runs} are wanted: give more"
            " --candidates"
        )
    space = designed_space(plant, safe_runs[:_TYPICAL])
    pool = []
    for k, run in enumerate(safe_runs):
        progress(f"candidate {k + 1} of {len(safe_runs)}: responses")
        of_laws, gram = gram_of(plant, run, space, sd)
        pool.append(Safe(run, gram))
    rivals = Rivals.of(of_laws)
    progress("choosing")
    best = chosen(pool, rivals, runs)
    own_runs = [pool[i] for i in best]
    first = [own_runs[i] for i in chosen(own_runs, rivals, quick)]
    order = [*first, *(c for c in own_runs if c not in first)]
    out = tuple(replace(c.run, name=f"run-{n + 1}", quick=n < quick) for n, c in enumerate(order))
    title = f"{runs} runs of {duration_s:g} s, designed with seed {seed} from {candidates}"
    programme = Programme("spring-pair", title, out)
    return programme, *separations_of(plant, sd, programme)
