"""Good recordings of the same inputs: their mean, their model, and how they differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.data.noise import resolution, row_noise
from smad.diagnosis.data.played import Played, predictions, slopes
from smad.diagnosis.data.rows import Binned, bin_numbers, binned, offset_s, require_like_inputs
from smad.diagnosis.data.starts import usual_starts, with_corrected_starts
from smad.diagnosis.numerics.white import RunRows
from smad.diagnosis.paired.floor import Deviation, Floor, repeat_floor
from smad.diagnosis.places.place import PlacesPlant
from smad.diagnosis.places.responses import Responses
from smad.diagnosis.plant import (
    Array,
    Effect,
    Index,
    Mask,
    ModelPoint,
    PlantModel,
    nominal_point,
    traits_of,
)
from smad.diagnosis.rivals.changes import Changes
from smad.diagnosis.rivals.convergence import fit_from_several
from smad.diagnosis.rivals.evidence import CORRELATED, Evidence, Trial, start_directions
from smad.diagnosis.rivals.fit import reference_at
from smad.diagnosis.rivals.rival import question_of, with_tempered_prior
from smad.diagnosis.rivals.search import run_search
from smad.diagnosis.runs import GapRun, bridged
from smad.progress import Say, silent

_CLOCK_SD_S = 0.004
_CARRIED_SD = 0.4
"""Relative error of a difference that the model carries over, before good runs measure it: that of
a day direction (`numerics.white`)."""
_LEAST_SHARE = 1e-6
"""Of a channel's range, where neither noise nor quantum is declared."""


@dataclass(frozen=True, kw_only=True)
class GoodRun:
    """The mean of good recordings of a run, carried to their mean surroundings `around`.

    `inputs` are those of the longest repeat, `count` is the number of repeats in each bin (0: none
    has a reading), `base` and `slopes` are the model's prediction and its derivatives.
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

    def as_measured(self, plant: PlantModel, played: Played | None = None) -> Played:
        """The run, or another one on its bins, with what was measured beyond the model as offsets.

        Sensors of a model are then given what those of the bench were: a lag, for instance, acts on
        the measured course and not on that of a model that is a little early.
        """
        played = played or self.played
        t_s = played.start_s + (np.arange(played.bins) + 0.5) * played.period_s
        beyond = self.mean - self.base
        offsets = {
            channel.name: (t_s[good], beyond[good, c])
            for c, (channel, good) in enumerate(zip(plant.channels, self.valid.T, strict=True))
            if good.any()
        }
        return played.with_fields(offsets=offsets)


@dataclass(frozen=True, kw_only=True)
class GoodRuns:
    """Good runs, the model point fitted to them, and their repeat floor.

    `repeats` is the fewest recordings of a run. `responses` to laws and `changes` by effects are
    given once they are computed.
    """

    runs: tuple[GoodRun, ...]
    point: ModelPoint
    floor: Floor
    repeats: int
    responses: Responses | None = None
    changes: Changes | None = None

    @property
    def names(self) -> set[str]:
        return {run.name for run in self.runs}

    def parameter_covariance(self, plant: PlantModel) -> Array:
        """Covariance (p, p) of the parameters by the good runs, in prior deviations.

        The residual of the model counts as noise.
        """
        runs = self.runs
        off = [np.where(r.valid, r.mean - r.base, 0.0) for r in runs]
        rows = sum(r.valid.sum(axis=0) for r in runs)
        square = sum((x**2).sum(axis=0) for x in off) / np.maximum(rows, 1)
        sd = np.sqrt((square + least_sd(plant) ** 2) * CORRELATED)
        X = np.concatenate(
            [(np.where(r.valid, r.slopes, 0.0) / sd).reshape(len(r.slopes), -1) for r in runs],
            axis=1,
        )
        return np.asarray(np.linalg.inv(X @ X.T + np.eye(len(X))))


def least_sd(plant: PlantModel) -> Array:
    """The smallest standard deviation of a row that is believed, (channels,); never 0."""
    return np.array(
        [
            max(c.quantum / 12**0.5, 0.5 * c.noise) or _LEAST_SHARE * (c.high - c.low)
            for c in plant.channels
        ]
    )


def carried(
    plant: PlantModel, J: Array, now: Mapping[str, float], then: Mapping[str, float]
) -> Array:
    """The model's change for a difference of surroundings, (bins, channels)."""
    out = np.zeros(J.shape[1:])
    for i, q in enumerate(plant.parameters):
        channel = traits_of(plant).environment.get(q.name)
        if channel is not None and channel in now and channel in then:
            out += J[i] * ((now[channel] - then[channel]) / q.prior_sd)
    return out


def day_directions(
    plant: PlantModel, J: Array, base: Array, moved: Array, period_s: float
) -> Array:
    """Directions in which days differ, (directions, bins, channels): slopes of the day's
    parameters, a clock shift by a second, and the carried difference `moved`.
    """
    index = {q.name: i for i, q in enumerate(plant.parameters)}
    clock = np.gradient(base, period_s, axis=0)
    return np.concatenate([J[[index[n] for n in traits_of(plant).day]], clock[None], moved[None]])


def usual_day(plant: PlantModel) -> Array:
    """Prior spread of each day direction, (directions,): in prior deviations, in s, and as a share
    of the carried difference."""
    return np.array([*traits_of(plant).day.values(), _CLOCK_SD_S, _CARRIED_SD])


def _regime_numbers(plant: PlantModel, run: GapRun, played: Played) -> tuple[Array, int]:
    """Number of the first regime that holds, (bins, channels), and the count of regimes."""
    bins, count = played.bins, 1
    bin_of_row = np.clip(bin_numbers(run, played.start_s, played.period_s), 0, bins - 1)
    size = np.maximum(np.bincount(bin_of_row, minlength=bins), 1)
    of_side: dict[str, Index] = {}
    for side in {c.side for c in plant.channels}:
        masks = list(plant.regimes(run, side).values())
        count = max(count, len(masks) + 1)
        of_side[side] = np.zeros(bins, dtype=np.intp)
        for k, mask in reversed([*enumerate(masks, 1)]):
            samples = np.bincount(bin_of_row, mask.astype(float), minlength=bins)
            of_side[side][samples >= 0.5 * size] = k
    return np.column_stack([of_side[c.side] for c in plant.channels]), count


def good_runs(
    plant: PlacesPlant,
    groups: Sequence[Sequence[GapRun]],
    effects: Sequence[Effect],
    period_s: float = PERIOD_S,
    say: Say = silent,
) -> GoodRuns:
    """Good runs from groups of recordings of the same inputs, in rows of `period_s`.

    Their model has what they show of `effects`. Raises PairingError when the recordings of a group
    do not have the same inputs.
    """
    starts = usual_starts(plant, groups)
    repeated = [
        _on_one_grid(plant, group, period_s, start)
        for group, start in zip(groups, starts, strict=True)
    ]
    recordings = [run for group in groups for run in group]
    noise = row_noise(recordings, plant, period_s)
    floors = np.hypot(noise, resolution(recordings, plant))
    point = _good_point(plant, repeated, floors, effects, say)
    played = [with_corrected_starts(plant, point, r.played) for r in repeated]
    J = slopes(plant, point, played)
    base = predictions(plant, point, played, exact=True)
    runs: list[GoodRun] = []
    deviations: list[Deviation] = []
    regimes = 1
    for k, r in enumerate(repeated):
        moved = np.array([carried(plant, J[k], around, r.middle) for around in r.around])
        values = r.values - moved
        mean, count = mean_of(values, r.valid)
        regime, names = _regime_numbers(plant, r.longest, r.played)
        regimes = max(regimes, names)
        single = np.sqrt(count / np.maximum(count - 1, 1))
        # Where a single repeat has a reading, its deviation is interpolated and says nothing.
        several = r.valid.sum(axis=0) > 1
        if len(values) > 1:
            deviations += [
                Deviation(
                    values=(value - mean) * single,
                    valid=valid & several,
                    regime=regime,
                    day=day_directions(plant, J[k], base[k], shift * single, r.played.period_s),
                )
                for value, valid, shift in zip(values, r.valid, moved, strict=True)
            ]
        runs.append(
            GoodRun(
                name=r.name,
                played=played[k],
                mean=mean,
                valid=count > 0,
                count=count,
                inputs=r.first,
                regime=regime,
                around=r.middle,
                base=base[k],
                slopes=J[k],
            )
        )
    counts = [len(r.values) for r in repeated]
    return GoodRuns(
        runs=tuple(runs),
        point=point,
        repeats=min(counts),
        floor=repeat_floor(
            deviations,
            sum(counts) - len(counts),
            regimes,
            least=least_sd(plant),
            noise=noise,
            usual_day=usual_day(plant),
        ),
    )


def _good_point(
    plant: PlacesPlant,
    repeated: Sequence[_Repeats],
    floors: Array,
    effects: Sequence[Effect],
    say: Say,
) -> ModelPoint:
    """The parameters, and the effects of the library, that the means of good runs show.

    An effect that the simulator lacks would distort the changes that it predicts. A law in its
    place would distort others, so none is searched for.
    """
    trials = []
    for r in repeated:
        mean, count = mean_of(r.values, r.valid)
        errors = start_directions(plant, nominal_point(plant), r.played)
        rows = RunRows.of(floors, count > 0, np.array(errors).reshape(-1, *mean.shape))
        trials.append(Trial(played=r.played, target=mean, rows=rows))
    evidence = Evidence(trials=tuple(trials))
    question = question_of(plant, nominal_point(plant), evidence, effects=effects, say=say)
    model = with_tempered_prior(question.model, evidence, question.constants)
    nominal = reference_at(evidence, model, np.zeros(model.parameters))
    fitted = fit_from_several(evidence, nominal) if nominal else None
    if fitted is None:
        return question.model.start
    around = question_of(plant, fitted.point, evidence, effects=effects, say=say)
    return around.point_of(run_search(around, laws=False).final)


@dataclass(frozen=True, kw_only=True)
class _Repeats:
    """Recordings of the same inputs on the grid of the longest, each with its surroundings.

    `name` is that of the first. `values` are readings (repeats, bins, channels), `valid` which of
    them count.
    """

    name: str
    longest: GapRun
    played: Played
    first: Binned
    values: Array
    valid: Mask
    around: list[dict[str, float]]
    middle: dict[str, float]


def mean_of(values: Array, valid: Mask) -> tuple[Array, Array]:
    """Mean of repeats (repeats, bins, channels) where `valid`, and their number, (bins, channels).

    Repeats drift apart, so a mean of those with a reading would jump where one has none. There the
    others are corrected by their deviation from the mean of all, interpolated over the gap. A
    repeat counts from its first reading to its last.
    """
    readings = valid.sum(axis=0)
    divisor = np.maximum(readings, 1)
    plain_mean = (values * valid).sum(axis=0) / divisor
    deviation = _interpolated(values - plain_mean, readings == len(values))
    begun = np.maximum.accumulate(valid, axis=1)
    not_ended = np.maximum.accumulate(valid[:, ::-1], axis=1)[:, ::-1]
    count = np.where(readings > 0, (begun & not_ended).sum(axis=0), 0)
    return ((values - deviation) * valid).sum(axis=0) / divisor, count


def _interpolated(values: Array, known: Mask) -> Array:
    """Values (repeats, bins, channels) that are `known` (bins, channels), the others interpolated
    in time; 0 in a channel in which none is known."""
    out = np.zeros_like(values)
    for c in np.flatnonzero(known.any(axis=0)):
        for repeat, course in zip(out, np.where(known[:, c], values[:, :, c], np.nan), strict=True):
            repeat[:, c] = bridged(course)
    return out


def _longest(group: Sequence[GapRun]) -> GapRun:
    """The first repeat within a row of the longest duration: others may end at a hole."""
    longest_s = max(run.duration_s for run in group)
    return next(run for run in group if run.duration_s > longest_s - PERIOD_S)


def _on_one_grid(
    plant: PlantModel, group: Sequence[GapRun], period_s: float, starts: Mapping[str, float]
) -> _Repeats:
    """The recordings of a group in rows of `period_s`, and where they start."""
    first = _longest(group)
    start_s = first.begins_s
    around = [r.at_start(traits_of(plant).environment.values()) for r in group]
    shared = set.intersection(*(set(a) for a in around))
    middle = {n: float(np.mean([a[n] for a in around])) for n in sorted(shared)}
    levels = {c: np.full(len(first.t_s), v) for c, v in middle.items()}
    whole = GapRun(first.name, first.t_s, first.inputs, levels, starts=starts, starts_read=True)
    played = Played.of(whole, plant.inputs, start_s, period_s)
    repeats = [binned(r, played.bins, plant, start_s + offset_s(r, first), period_s) for r in group]
    reference = binned(first, played.bins, plant, start_s, period_s)
    for other in repeats:
        require_like_inputs(other, reference)
    return _Repeats(
        name=group[0].name,
        longest=first,
        played=played,
        first=reference,
        values=np.array([b.values for b in repeats]),
        valid=np.array([b.valid for b in repeats]),
        around=around,
        middle=middle,
    )
