"""What a recorded run says of the bench: stroke, force, resistances, cooling, gains."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from smad.arrays import Array
from smad.config import bench_in
from smad.experiments.endurance.statistics import LEAST_A, most, stroke
from smad.health.record import Row, Value
from smad.queue.meter import DEAD_BAND_MM
from smad.runlog.cycles import Cycles
from smad.runlog.paths import UNNAMED
from smad.runlog.reader import Run, read_run

LEAST_STROKE_MM = 0.5
LEAST_SAMPLES = 50
FIRST_SAMPLES = 20
"""Of a run that begins cold: their median is where the springs rest. One reading is noise."""
LEAST_EXCESS_K = 3.0
"""Cooling is fitted while a spring is so much warmer than the water."""
COOLED_DUTY = 0.5
_DIGITS = re.compile(r"[-_]?\d+$")
"""At the end of a run's name: of blocks and repeats, which are one group."""


def row_of(path: Path) -> Row | None:
    """Return the row of a run log; None for one that was cut, is written, or shows nothing.

    A run without a name may be of anything: its row has its cycles, and no values to compare.

    Raises RunLogError when it cannot be read.
    """
    run = read_run(path)
    if run.cut_short or run.cut_by or run.being_written or len(run) < LEAST_SAMPLES:
        return None
    unnamed = run.header.name in ("", UNNAMED)
    values = {} if unnamed else dict(_values(run))
    if not (unnamed or values):
        return None
    return Row(
        unix_s=run.header.started_unix_s or path.stat().st_mtime,
        kind="run",
        source=path.name,
        group=_DIGITS.sub("", run.header.name) or UNNAMED,
        bench=bench_in(run.header.configuration),
        cycles=cycles_of(run.columns),
        values=values,
    )


def cycles_of(columns: Mapping[str, NDArray[np.generic]]) -> float:
    """Return the cycles of displacement, counted as a queue's budget counts them."""
    cycles = Cycles(DEAD_BAND_MM)
    for displacement_mm in np.asarray(columns["displacement_mm"], float).tolist():
        cycles.add(displacement_mm)
    return float(cycles.tops)


def _values(run: Run) -> Iterator[tuple[str, Value]]:
    columns = {name: np.asarray(column, float) for name, column in run.columns.items()}
    displacement = columns["displacement_mm"]
    finite = displacement[np.isfinite(displacement)]
    if len(finite):
        if (stroke_mm := stroke(finite)) > LEAST_STROKE_MM:
            yield "stroke_mm", Value(stroke_mm)
        heated = any((columns[f"i_applied_{s}_A"][:FIRST_SAMPLES] > 0.0).any() for s in "xy")
        if run.header.part == 1 and not heated:
            # Where the springs stand before anything was heated.
            yield "rest_mm", Value(float(np.median(finite[:FIRST_SAMPLES])))
    if np.isfinite(columns["force_N"]).any():
        yield "force_max_N", Value(most(columns["force_N"]))
    for spring in ("x", "y"):
        yield from _resistance(columns, spring)
        yield from _cooling(columns, spring)
    yield from ((f"gain_{name}", Value(gain)) for name, gain in run.header.gains.items())


def _resistance(columns: Mapping[str, Array], spring: str) -> Iterator[tuple[str, Value]]:
    current_A, volts = columns[f"i_meas_{spring}_A"], columns[f"v_{spring}_V"]
    heated = (current_A > LEAST_A) & np.isfinite(volts)
    if np.count_nonzero(heated) < LEAST_SAMPLES:
        return
    ratio = volts[heated] / current_A[heated]
    yield f"resistance_{spring}_ohm", Value(float(np.median(ratio)))


def _cooling(columns: Mapping[str, Array], spring: str) -> Iterator[tuple[str, Value]]:
    """Rate constant of a spring under full water, 1/s: the pump and the film together.

    From -d(T − T_water)/dt = c (T − T_water), least squares over all samples that qualify.
    """
    warm, water = columns[f"rtd_{spring}_degC"], columns["rtd_inlet_degC"]
    duty = columns[f"duty_{spring}"]
    off = columns[f"i_meas_{spring}_A"] < 0.5 * LEAST_A
    excess_K = warm - water
    chosen = off & (duty > COOLED_DUTY) & (excess_K > LEAST_EXCESS_K)
    if np.count_nonzero(chosen) < LEAST_SAMPLES:
        return
    width = 25
    t_s = columns["t_s"]
    places = np.flatnonzero(chosen[:-width] & chosen[width:])
    places = places[np.abs(t_s[places + width] - t_s[places] - 0.01 * width) < 0.01 * width]
    if len(places) < LEAST_SAMPLES:
        return
    rate = np.log(excess_K[places] / excess_K[places + width]) / (t_s[places + width] - t_s[places])
    yield f"cooling_{spring}_per_s", Value(float(np.median(rate)))
