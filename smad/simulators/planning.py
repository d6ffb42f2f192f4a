"""The rating of a simulator that is not ours, from a file of inputs that were not yet played."""

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from smad.diagnosis.data.columns import filled
from smad.diagnosis.errors import GapError
from smad.diagnosis.plant import ModelPoint, nominal_point
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.signals import read_gap_runs
from smad.progress import Say, silent
from smad.simulators.bind import bind
from smad.simulators.calling import called
from smad.simulators.columns import Table, tables_of
from smad.simulators.declare import Simulator
from smad.simulators.plant import SimulatedPlant
from smad.simulators.rating import LEAST_S, Rating, lines, rate
from smad.simulators.windows import choose_window

_OTHERWISE = 0.5
"""Of its prior deviation each parameter is moved, to see how far a bench may run away."""


@dataclass(frozen=True)
class Plan:
    """What runs would show: ratings, and in words what was assumed. Prints as a table."""

    ratings: list[Rating]
    notes: list[str]

    def __str__(self) -> str:
        return "\n".join([*lines(self.ratings), *self.notes])

    __repr__ = __str__

    def record(self) -> list[dict[str, Any]]:
        """The ratings for JSON, which has no infinite size."""
        rows = [asdict(rating) for rating in self.ratings]
        return [row | {"size": row["size"] if np.isfinite(row["size"]) else None} for row in rows]


def plan(
    inputs: Any,
    simulator: Simulator,
    *,
    window_s: float | None = None,
    within_s: float = 5.0,
    progress: Say = silent,
) -> Plan:
    """Rate what runs with these inputs would show, before any is measured.

    `inputs` are as the runs of `diagnose`, with or without what is measured. A run without begins
    at rest at 0. Readings have the noise that the simulator declares, else a thousandth of what
    they go through. What is not reached `within_s` of processor time, binding and windows included,
    is unknown. Raises SimulatorError.
    """
    began_s = time.process_time()
    tables = [_complete(simulator, t) for t in tables_of(inputs)]
    bound = bind(simulator, tables)
    plain, runs = bound.plant.plain, tuple(filled(r) for r in bound.groups[0])
    plain.window_s, why = choose_window(plain, _other(plain, runs), window_s)
    left_s = within_s - (time.process_time() - began_s)
    left_s = max(left_s, min(LEAST_S, within_s))
    ratings = rate(bound.plant, runs, within_s=left_s, progress=progress)
    read = dict.fromkeys(text for r in runs for text in r.notes)
    return Plan(ratings, [*([why] if why else []), *plain.failures.notes, *read])


def left_of(within_s: float) -> float:
    """What this process has left of a processor time for replays; a little always is."""
    return max(within_s - time.process_time(), LEAST_S)


def plan_pair(
    plant: SmaPlant,
    inputs: Sequence[Path],
    experiments: Sequence[str],
    *,
    within_s: float,
    progress: Say = silent,
) -> Plan:
    """As `plan`, of the spring pair, for files of inputs and experiments of its catalogue.

    `within_s` is that of the whole process. Raises GapError for a file that lacks an input.
    """
    recorded = read_gap_runs(inputs, inputs, progress=progress)
    for run in recorded:
        if lacking := [s.name for s in plant.inputs if s.name not in run.inputs]:
            raise GapError(
                f"{run.name} lacks inputs: {', '.join(lacking)}",
                action="name the columns of the table so",
            )
    performed = [plant.perform(name, nominal_point(plant), 0) for name in experiments]
    runs = [*recorded, *performed]
    return Plan(rate(plant, runs, within_s=left_of(within_s), progress=progress), [])


def _complete(declared: Simulator, table: Table) -> Table:
    """The table with what the simulator as declared would measure, where it has no reading."""
    columns = dict(table.columns)
    zeros = {n: np.zeros(len(table.t_s)) for n in declared.forces}
    # Of its start nothing is known: every reading and rate is 0.
    at_rest = defaultdict[str, float](float)
    try:
        shown = called(declared, table.t_s, {**columns, **zeros}, declared.values({}, {}), at_rest)
    except Exception:  # what is wrong with it is said when it is bound
        return table
    more = {n: y for n, y in shown.items() if n not in columns}
    run = None if more else table.run
    return replace(table, columns={**columns, **more}, run=run)


def _other(plant: SimulatedPlant, runs: tuple[GapRun, ...]) -> list[GapRun]:
    """The runs as a bench with other parameters might give them."""
    nominal = nominal_point(plant)
    moved = {
        q.name: float(np.clip(q.nominal + (-1) ** k * _OTHERWISE * q.prior_sd, q.low, q.high))
        for k, q in enumerate(plant.parameters)
    }
    point = ModelPoint({**nominal.theta, **moved})
    outputs = [plant.simulate(point, r) for r in runs]
    return [
        r.with_columns(outputs=y) if all(np.isfinite(c).all() for c in y.values()) else r
        for r, y in zip(runs, outputs, strict=True)
    ]
