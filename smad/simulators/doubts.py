"""Columns that look as if they were in another unit than their name says: an opinion of the model.

The nominal model is in question itself, so that this refuses nothing: it is said in the verdict.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from smad.diagnosis.data.columns import filled
from smad.diagnosis.plant import Array, nominal_point
from smad.diagnosis.runs import GapRun
from smad.records.units import UNITS, convert, units_for
from smad.simulators.plant import SimulatedPlant

_OFF = 1.0
"""Of a signal, that the nominal model must be off by for its units to be doubted."""
_NEAR, _BETTER = 0.5, 0.2
"""What it may be off by with another unit: of the signal, and of what it was."""


def doubted_units(plant: SimulatedPlant, run: GapRun) -> list[str]:
    """Sentences on readings and inputs of a run that another unit would make fit the model."""
    used = filled(run)
    shown = plant.simulate(nominal_point(plant), used)
    before = {n: _off(y, shown[n]) for n, y in used.outputs.items()}
    if max(before.values(), default=0.0) < _OFF:
        return []
    said = []
    for c in (c for c in plant.channels if before.get(c.name, 0.0) >= _OFF):
        after = {u: _off(y, shown[c.name]) for u, y in _others(used.outputs[c.name], c.unit)}
        said += _said(c.name, after, before[c.name])
    worst = max(before, key=lambda n: before[n])
    for s in plant.inputs:
        after = {}
        for unit, column in _others(used.inputs[s.name], s.unit):
            # Only a smaller input: a larger one may stop or overflow a model.
            if np.max(np.abs(column)) < np.max(np.abs(used.inputs[s.name])):
                other = used.with_columns(inputs={s.name: column})
                moved = plant.simulate(nominal_point(plant), other)
                after[unit] = max(_off(y, moved[n]) for n, y in used.outputs.items())
        said += _said(s.name, after, before[worst])
    return said


def _others(column: Array, unit: str) -> list[tuple[str, Array]]:
    """The column as it would be if it were in each other unit of its quantity."""
    if unit not in UNITS:
        return []
    return [(u, convert(column, u, unit)) for u in units_for(unit) if u != unit]


def _off(y: Array, shown: Array) -> float:
    """What a prediction is off by, root mean square over the signal's standard deviation."""
    spread = float(np.std(y))
    error = float(np.sqrt(np.mean((y - shown) ** 2)))
    return error / spread if spread > 0.0 and np.isfinite(error) else 0.0


def _said(name: str, after: Mapping[str, float], before: float) -> list[str]:
    """What is said of a column whose errors `after` are those with other units."""
    unit = min(after, key=lambda u: after[u], default="")
    if not unit or after[unit] > min(_NEAR, _BETTER * before):
        return []
    return [
        f"is {name} in {unit}? The model as configured would be off by {after[unit]:.2g} of the "
        f"signal in place of {before:.2g}; if so, end the name of its column with {unit}"
    ]
