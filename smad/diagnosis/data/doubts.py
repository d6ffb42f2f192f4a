"""Columns that look misread: in another unit, of the other sign, or with their names exchanged.

The nominal model predicts swing and level of each signal. A bench and its model differ in both by
tens of percent; a wrong unit, sign or cable makes far larger differences. A misreading is reported
if undoing it brings a signal from far off to near its prediction. The model itself is in question,
so this refuses no run.
"""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sim_device.plant.units import UNITS
from smad.diagnosis.data.opinions import least_move
from smad.diagnosis.plant import Array, Channel, PlantModel, Signal, nominal_replay, traits_of
from smad.diagnosis.runs import GapRun
from smad.records.declared import Declared
from smad.records.units import convert
from smad.units import units_for

_SWING, _LEVEL = 0.3, 0.05
"""Usual difference of bench and model: in the logarithm of a swing; in a level over its range."""
_RELATED = 0.5
"""Correlation with the prediction from which on a swing can be compared."""
_SIGMAS = 2.0
"""Prior standard deviations by which surroundings usually differ from the parameter's value."""
_SURE = 20.0
"""Quanta that a size has at least, for its level to be compared."""
_MOST_PAIRS = 6
"""Most pairs of inputs that are tried as exchanged."""
_HALF = 0.5
"""Largest share of the total misfit that may remain where several columns change together."""
_FAR, _NEAR, _WORST = 9.0, 4.0, 25.0
"""Squares of such differences: far off, near the prediction, and the most that a signal counts."""


@dataclass(frozen=True)
class Misreading:
    """A possible misreading: the columns as without it, its name, and how to mend it."""

    columns: Mapping[str, Array]
    words: str
    remedy: str


def doubted_columns(plant: PlantModel, run: GapRun, predicted: Mapping[str, Array]) -> list[str]:
    """Sentences on columns that look misread; `predicted`: what the model predicts of the run."""
    channels = [c for c in plant.channels if c.name in run.outputs]
    before = {c.name: _off(plant, c, run, predicted) for c in channels}
    far = [c for c in channels if before[c.name] >= _FAR]
    alone: dict[str, list[Misreading]] = {}
    mended = dict(before)
    for c in far:
        column = {c.name: run.outputs[c.name]}
        misread = [*_in_other_units(column, c.unit), _reversed(column)]
        offs = [(m, _off(plant, c, run, predicted, m.columns[c.name])) for m in misread]
        near = [(m, off) for m, off in offs if off <= min(_NEAR, before[c.name] - _FAR)]
        alone[c.name] = [m for m, _ in near]
        mended[c.name] = min((off for _, off in near), default=before[c.name])
    if far and len(far) >= min(2, len(before)):
        tried = [(m, _replayed_off(plant, run, m)) for m in _of_several(plant, run)]
        best, after = min(tried, key=lambda t: sum(t[1].values()), default=(None, before))
        whole = sum(before.values())
        if best and sum(after.values()) <= min(_HALF * whole, whole - _FAR, sum(mended.values())):
            return [_words([best], [n for n in before if after[n] < before[n]])]
    return [_words(misreadings, [name]) for name, misreadings in alone.items() if misreadings]


def _off(
    plant: PlantModel,
    channel: Channel,
    run: GapRun,
    predicted: Mapping[str, Array],
    column: Array | None = None,
) -> float:
    """Squared distance of a reading from its prediction in swing and level, in usual differences.

    `column` replaces the reading. If that swings less than the record, the least size and move that
    count shrink alike, since a channel's range and quantum may have been taken from the record.
    """
    recorded, m = run.outputs[channel.name][run.good], predicted[channel.name][run.good]
    y = recorded if column is None else column[run.good]
    share = min(np.ptp(y) / np.ptp(recorded), 1.0) if np.ptp(recorded) > 0.0 else 1.0
    least = _SURE * channel.quantum * share
    swing = level = 0.0
    if max(np.ptp(y), np.ptp(m)) > least_move(channel) * share:
        related = np.ptp(y) > 0.0 < np.ptp(m) and np.corrcoef(y, m)[0, 1] > _RELATED
        swing = np.log(np.std(y) / np.std(m)) / _SWING if related else np.inf
    if channel.unit in units_for("K"):
        usual = _LEVEL * (channel.high - channel.low)
        expected, usual = _surroundings(plant, channel) or (float(np.median(m)), usual)
        level = (float(np.median(y)) - expected) / usual
    elif min(_size(y), _size(m)) > least:
        level = np.log(_size(y) / _size(m)) / _SWING
        # A gain changes both alike.
        return float(min(max(swing**2, level**2), _WORST))
    return float(min(swing**2 + level**2, _WORST))


def _surroundings(plant: PlantModel, channel: Channel) -> tuple[float, float] | None:
    """Expected level of an environment's channel by its parameter, and the usual difference."""
    measures = traits_of(plant).environment
    q = next((q for q in plant.parameters if measures.get(q.name) == channel.name), None)
    if q is None or q.unit not in UNITS or q.unit not in units_for(channel.unit):
        return None
    low, high = convert(np.array([0.0, _SIGMAS * q.prior_sd]) + q.nominal, q.unit, channel.unit)
    return float(low), float(high - low)


def _size(column: Array) -> float:
    return float(np.sqrt(np.mean(column**2)))


def _replayed_off(plant: PlantModel, run: GapRun, misreading: Misreading) -> dict[str, float]:
    """Distance of each reading without a misreading; `_WORST` where the model fails."""
    columns = misreading.columns
    inputs = {n: c for n, c in columns.items() if n in run.inputs}
    outputs = {n: c for n, c in columns.items() if n in run.outputs}
    mended, predicted = run.with_columns(inputs, outputs), dict[str, Array]()
    with contextlib.suppress(Exception):  # whatever somebody else's plant raises
        predicted = nominal_replay(mended, plant)
    return {
        c.name: _off(plant, c, run, predicted, mended.outputs[c.name]) if predicted else _WORST
        for c in plant.channels
        if c.name in mended.outputs
    }


def _of_several(plant: PlantModel, run: GapRun) -> list[Misreading]:
    """Possible misreadings that change predictions: of inputs, and of readings that a replay starts
    from or that share a unit."""
    begins = set(traits_of(plant).environment.values())
    moved = [s for s in plant.inputs if np.ptp(run.inputs[s.name]) > 0.0]
    ranges = {s.name: Declared(name=s.name, unit=s.unit, low=s.low, high=s.high) for s in moved}
    out: list[Misreading] = []
    for unit, names in _by_unit(moved).items():
        for group in (names, *([n] for n in names if names[1:])):
            columns = {n: run.inputs[n] for n in group}
            out += [*_in_other_units(columns, unit), _reversed(columns)]
    # Inputs beyond their range may make a model fail.
    out = [m for m in out if not any(ranges[n].beyond(c).any() for n, c in m.columns.items())]
    pairs = [pair for names in _by_unit(moved).values() for pair in combinations(names, 2)]
    out += [_exchanged([pair], run) for pair in pairs[:_MOST_PAIRS]]
    if len({n for pair in pairs for n in pair}) == 2 * len(pairs) > 2:
        out.append(_exchanged(pairs, run))
    recorded = [c for c in plant.channels if c.name in run.outputs]
    for unit, names in _by_unit(recorded).items():
        for group in (names, *([n] for n in names if n in begins)):
            out += _in_other_units({n: run.outputs[n] for n in group}, unit)
    return out


def _by_unit(signals: Sequence[Signal] | Sequence[Channel]) -> dict[str, list[str]]:
    """Names of signals by their unit."""
    return {s.unit: [x.name for x in signals if x.unit == s.unit] for s in signals}


def _in_other_units(columns: Mapping[str, Array], unit: str) -> list[Misreading]:
    """The columns as they would be if they were in each other unit of their quantity."""
    # A ratio in another unit is beyond its range.
    convertible = unit in UNITS and UNITS[unit].quantity != "ratio"
    other_units = [u for u in units_for(unit) if u != unit] if convertible else []
    remedy = "say the unit in the name of its column, or by `column_unit` in a map"
    return [
        Misreading({n: convert(c, u, unit) for n, c in columns.items()}, f"in {u}", remedy)
        for u in other_units
    ]


def _reversed(columns: Mapping[str, Array]) -> Misreading:
    remedy = "correct its sign, by `scale = -1` in a map"
    return Misreading({n: -c for n, c in columns.items()}, "of the other sign", remedy)


def _exchanged(pairs: Sequence[tuple[str, str]], run: GapRun) -> Misreading:
    columns = {a: run.inputs[b] for pair in pairs for a, b in (pair, pair[::-1])}
    return Misreading(columns, "exchanged", "correct the wiring or the names of the columns")


def _words(misreadings: Sequence[Misreading], mended: Sequence[str]) -> str:
    """The question about misreadings, each of which would bring some readings near the model."""
    first = misreadings[0]
    names, words = list(first.columns), " or ".join(m.words for m in misreadings)
    return (
        f"{'are' if names[1:] else 'is'} {', '.join(names)} {words}? Only then does the model as "
        f"configured come near what was measured, in {', '.join(mended)}; if so, "
        f"{first.remedy}"
    )
