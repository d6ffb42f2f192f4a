"""Columns that look as if they were in another unit than their name says: an opinion of the model.

The nominal model is in question itself, so that this refuses nothing: it is said in the verdict.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

import numpy as np

from smad.diagnosis.data.opinions import least_move
from smad.diagnosis.plant import Array, PlantModel, nominal_replay
from smad.diagnosis.runs import GapRun
from smad.records.readings import Declared
from smad.records.units import UNITS, convert, units_for

_OFF = 1.0
"""Of a signal, that the nominal model must be off by for its units to be doubted."""
_NEAR, _BETTER = 0.5, 0.2
"""What it may be off by with another unit: of the signal, and of what it was."""


def doubted_units(plant: PlantModel, run: GapRun, shown: Mapping[str, Array]) -> list[str]:
    """Sentences on readings and inputs of a run that another unit would make fit the model.

    `shown` is what the nominal model predicts of it. Only readings that move, or should, count.
    """
    measured = {n: y[run.good] for n, y in run.outputs.items()}
    moving = [
        c
        for c in plant.channels
        if (y := measured.get(c.name)) is not None
        and max(np.ptp(y), np.ptp(shown[c.name][run.good])) > least_move(c)
    ]
    before = {c.name: _off(measured[c.name], shown[c.name][run.good]) for c in moving}
    if max(before.values(), default=0.0) < _OFF:
        return []
    said = []
    for c in (c for c in moving if before[c.name] >= _OFF):
        after = {u: _off(y, shown[c.name][run.good]) for u, y in _others(measured[c.name], c.unit)}
        said += _said(c.name, after, before[c.name])
    worst = max(before.values())
    for s in plant.inputs:
        after = {}
        declared = Declared(name=s.name, unit=s.unit, low=s.low, high=s.high, applied=True)
        for unit, column in _others(run.inputs[s.name], s.unit):
            # A larger one may stop or overflow a model, beyond what its input can be.
            if declared.beyond(column).any():
                continue
            with contextlib.suppress(Exception):  # whatever somebody else's plant raises
                moved = nominal_replay(run.with_columns(inputs={s.name: column}), plant)
                after[unit] = max(_off(measured[n], moved[n][run.good]) for n in before)
        said += _said(s.name, after, worst)
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
    return float(np.nan_to_num(error / spread, nan=np.inf)) if spread > 0.0 else 0.0


def _said(name: str, after: Mapping[str, float], before: float) -> list[str]:
    """What is said of a column whose errors `after` are those with other units."""
    unit = min(after, key=lambda u: after[u], default="")
    if not unit or after[unit] > min(_NEAR, _BETTER * before):
        return []
    return [
        f"is {name} in {unit}? Only then the model as configured follows what was measured; if so, "
        "say it in the name of its column, or by `column_unit` in a map"
    ]
