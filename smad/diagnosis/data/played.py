"""What the model says of a programme: reference point, slopes of parameters, signatures of entries.

All of it is computed once, at commissioning. A signature is what an entry changes at one level and
shape, for every bin and channel of every run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S, thinned
from smad.diagnosis.data.rows import bin_numbers
from smad.diagnosis.plant import (
    Array,
    Effect,
    Mask,
    ModelPoint,
    PlantModel,
    Signal,
    moved_parameters,
)
from smad.diagnosis.runs import GapRun

LEVELS = (0.3, 1.0, 3.0, 10.0)
_THETA_STEP = 0.1
_ROUNDS = 3
_FORM = 0.02
_PIECES = 5
_COARSE = 2


@dataclass(frozen=True)
class Played:
    """A run of the programme as the model replays it: its inputs and how many bins it has."""

    run: GapRun
    inputs: tuple[Signal, ...]
    bins: int
    start_s: float = 0.0
    period_s: float = PERIOD_S

    @property
    def whole(self) -> GapRun:
        """The run as it was recorded."""
        return self.run if self.run.whole is None else self.run.whole

    @classmethod
    def of(
        cls,
        run: GapRun,
        inputs: Sequence[Signal],
        start_s: float = 0.0,
        period_s: float = PERIOD_S,
        pieces: int = _PIECES,
    ) -> Played:
        """The run on the grid that begins at `start_s` of its clock, thinned for a quick replay.

        A row is replayed in so many `pieces`, and more where an input steps.
        """
        bins = int(np.floor((run.t_s[-1] - start_s) / period_s + 1e-6))
        return cls(
            run=thinned(run, period_s / pieces, inputs), inputs=tuple(inputs), bins=max(bins, 1),
            start_s=start_s, period_s=period_s,
        )  # fmt: skip

    def means(self, series: Array, *, exact: bool = False) -> Array:
        """Means of series over its samples (m, n) in each bin, (m, bins).

        `exact`: the samples are those of the run as it was recorded.
        """
        run = self.whole if exact else self.run
        at = bin_numbers(run, self.start_s, self.period_s)
        inside = (at >= 0) & (at < self.bins)
        size = np.ones(len(at)) if exact else run.pieces
        at, size = at[inside], size[inside]
        count = np.maximum(np.bincount(at, size, minlength=self.bins), 1.0)
        sums = [np.bincount(at, s[inside] * size, minlength=self.bins) for s in series]
        return np.array(sums) / count

    @property
    def coarse(self) -> Played:
        """The same replayed in fewer pieces, for what a small change makes of it.

        Two in place of five leave 2 % of such a change out (median over terms), at half the time.
        """
        return replace(
            Played.of(self.whole, self.inputs, self.start_s, self.period_s, _COARSE), bins=self.bins
        )


@dataclass(frozen=True)
class Atom:
    """One signature: an entry at `values`, its strength `strength` alone at `level` × typical."""

    entry: str
    strength: str
    level: float
    variant: str
    values: dict[str, float]


def predictions(
    plant: PlantModel, point: ModelPoint, runs: Sequence[Played], *, exact: bool = False
) -> list[Array]:
    """Predictions of all runs, each (bins, channels); NaN where the model cannot run.

    `exact` replays the inputs as they were recorded; else averaged ones, which serve for
    differences of two replays only.
    """
    out = []
    for played in runs:
        run = played.whole if exact else played.run
        found = plant.simulate(point, run, fast=not exact)
        series = np.stack([found[c.name] for c in plant.channels])
        out.append(np.ascontiguousarray(played.means(series, exact=exact).T))
    return out


def finite(values: Sequence[Array]) -> bool:
    """Whether the model could simulate every run."""
    return all(bool(np.isfinite(v).all()) for v in values)


def slopes(plant: PlantModel, point: ModelPoint, runs: Sequence[Played]) -> list[Array]:
    """Change of each run for a prior standard deviation of each parameter.

    One array a run, (parameters, bins, channels).
    """
    base = predictions(plant, point, runs)
    out = [np.zeros((len(plant.parameters), *b.shape)) for b in base]
    for i, q in enumerate(plant.parameters):
        at = point.theta.get(q.name, q.nominal)
        step = _THETA_STEP * q.prior_sd
        if at + step > q.high:
            step = -step
        moved = replace(point, theta={**point.theta, q.name: at + step})
        found = predictions(plant, moved, runs)
        if finite(found):
            for j, (new, old) in enumerate(zip(found, base, strict=True)):
                out[j][i] = (new - old) * (q.prior_sd / step)
    return out


def reference_point(
    plant: PlantModel,
    start: ModelPoint,
    runs: Sequence[Played],
    *,
    measured: Sequence[Array],
    valid: Sequence[Mask],
    least: Array,
) -> ModelPoint:
    """Parameters fitted to the mean of the good runs (Gauss-Newton with their priors).

    The model's form is trusted to a fiftieth of each channel's excursion.
    """
    span = np.max([np.ptp(np.where(v, m, m.mean(axis=0)), axis=0)
                   for m, v in zip(measured, valid, strict=True)], axis=0)  # fmt: skip
    sd = np.maximum(least, _FORM * span) * 4.0
    parameters = plant.parameters
    offset = np.zeros(len(parameters))
    best, best_cost = start, np.inf
    for _ in range(_ROUNDS + 1):
        point = ModelPoint(moved_parameters(plant, start, offset), start.effects)
        base = predictions(plant, point, runs)
        if not finite(base):
            break
        r = np.concatenate([(np.where(v, m - b, 0.0) / sd).ravel()
                            for m, v, b in zip(measured, valid, base, strict=True)])  # fmt: skip
        cost = float(r @ r + offset @ offset)
        if cost >= best_cost:
            break
        best, best_cost = point, cost
        J = np.concatenate(
            [(np.where(v, s, 0.0) / sd).reshape(len(parameters), -1)
             for s, v in zip(slopes(plant, point, runs), valid, strict=True)], axis=1)  # fmt: skip
        A = J @ J.T + np.eye(len(parameters))
        offset = offset + np.linalg.solve(A, J @ r - offset)
    return best


def atoms_of(effect: Effect) -> list[Atom]:
    """The signatures of an entry that are worth having: each strength, levels, shapes and signs."""
    strengths = [q for q in effect.parameters if q.strength]
    shapes = [q for q in effect.parameters if not q.strength]
    out: list[Atom] = []
    for q in strengths:
        zero = {s.name: 0.0 for s in strengths}
        typical = {s.name: s.typical for s in shapes}
        signs = (1.0, -1.0) if q.low < 0.0 < q.high else (1.0,)
        for sign in signs:
            for level in LEVELS:
                value = sign * level * q.typical
                if q.low <= value <= q.high:
                    values = {**zero, **typical, q.name: value}
                    out.append(Atom(effect.name, q.name, sign * level, "typical", values))
        for s in shapes:
            for tag, value in (("low", _between(s.typical, s.low)),
                               ("high", _between(s.typical, s.high))):  # fmt: skip
                values = {**zero, **typical, q.name: q.typical, s.name: value}
                out.append(Atom(effect.name, q.name, 1.0, f"{tag} {s.name}", values))
    return out


def _between(typical: float, end: float) -> float:
    """A shape some way towards an end of its range: halfway, or a factor of three."""
    half = 0.5 * (typical + end)
    if typical > 0.0 and end > typical:
        return min(half, 3.0 * typical)
    if typical > 0.0 and end < typical:
        return max(half, typical / 3.0)
    return half


def signatures(
    plant: PlantModel,
    point: ModelPoint,
    runs: Sequence[Played],
    progress: Callable[[str], None] = lambda text: None,
    effects: Sequence[Effect] | None = None,
) -> tuple[list[Atom], list[Array]]:
    """Atoms of the whole library, or of some effects, and their signatures, float32.

    Signatures are (atoms, bins, channels) a run.

    Entries that the model cannot simulate at a level lack that level.
    """
    base = predictions(plant, point, runs)
    atoms: list[Atom] = []
    found: list[list[Array]] = [[] for _ in runs]
    for effect in plant.effects if effects is None else effects:
        progress(f"signatures: {effect.name}")
        for atom in atoms_of(effect):
            at = replace(point, effects={**point.effects, effect.name: atom.values})
            changed = predictions(plant, at, runs)
            if not finite(changed):
                continue
            atoms.append(atom)
            for j, (new, old) in enumerate(zip(changed, base, strict=True)):
                found[j].append((new - old).astype(np.float32))
    return atoms, [np.array(f) for f in found]


def scaled_signatures(
    plant: PlantModel, point: ModelPoint, played: Played, base: Array, atoms: Sequence[Atom]
) -> Array:
    """Signatures of atoms at the inputs of another run, quickly, float32; (atoms, bins, channels).

    One replay tells all atoms of a strength and a sign: it is scaled with the level, and shapes are
    typical. Good enough to choose what is refined by replay.
    """
    out = np.zeros((len(atoms), *base.shape), dtype=np.float32)
    alike: dict[tuple[str, str, float], list[int]] = {}
    for i, a in enumerate(atoms):
        alike.setdefault((a.entry, a.strength, float(np.sign(a.level))), []).append(i)
    for (entry, _, sign), members in alike.items():
        usual = [atoms[i] for i in members if atoms[i].variant == "typical"]
        one = min(usual, key=lambda a: abs(a.level - sign))
        at = replace(point, effects={**point.effects, entry: one.values})
        (changed,) = predictions(plant, at, [played])
        if finite([changed]):
            levels = np.array([atoms[i].level / one.level for i in members])
            out[members] = levels[:, None, None] * (changed - base)
    return out
