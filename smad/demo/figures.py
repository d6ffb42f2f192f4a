"""The demo's numbers and pictures, from its run log alone."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from smad.api import Percentiles, Status
from smad.arrays import Array
from smad.control.metrics import StepResponse, peak, step_response, tracking_r2
from smad.demo.job import AMPLITUDE_MM, CYCLES, PERIOD_S, STEP_MM
from smad.report.page import Page, Section, Table, Text, write_page
from smad.report.panels import Panels, followed
from smad.report.runs import panels_of, provenance, run_parts
from smad.runlog.reader import Run

Rows = list[tuple[str, str]]


@dataclass(frozen=True)
class Segment:
    """A part of the run in which the reference stood still at `target_mm`; times in s."""

    start_s: float
    end_s: float
    target_mm: float


def segments(t_s: Array, reference_mm: Array, shortest_s: float = 5.0) -> list[Segment]:
    """Return where the reference stood still for at least `shortest_s`, in order."""
    spans = []
    edges = np.flatnonzero(np.diff(reference_mm) != 0.0) + 1
    bounds = [0, *edges.tolist(), len(t_s)]
    for begin, end in itertools.pairwise(bounds):
        if np.isfinite(reference_mm[begin]) and t_s[end - 1] - t_s[begin] >= shortest_s:
            spans.append(
                Segment(float(t_s[begin]), float(t_s[end - 1]), float(reference_mm[begin]))
            )
    return spans


def column(run: Run, name: str) -> Array:
    """Return a channel as float64."""
    return run.columns[name].astype(np.float64)


def step_of(run: Run, segment: Segment) -> StepResponse:
    """Return how the displacement followed the step that began the segment."""
    t, x = column(run, "t_s"), column(run, "displacement_mm")
    part = (t >= segment.start_s) & (t <= segment.end_s)
    return step_response(t[part], x[part], segment.target_mm)


def sinusoid(run: Run) -> tuple[Array, Array, Array]:
    """Return time, reference and displacement of the sinusoid, its first cycle left out."""
    t, reference = column(run, "t_s"), column(run, "reference_mm")
    still = segments(t, reference)
    end_s = still[-1].start_s
    part = (t >= end_s - PERIOD_S * (CYCLES - 1)) & (t < end_s)
    return t[part], reference[part], column(run, "displacement_mm")[part]


def table(run: Run, paced: Status, real: Status | str) -> Rows:
    """Return the demo's table: what was measured, and its value with unit.

    `real` is the status after the run in real time, or why there was none.
    """
    still = segments(column(run, "t_s"), column(run, "reference_mm"))
    up = step_of(run, next(s for s in still if s.target_mm == STEP_MM))
    down = step_of(run, next(s for s in still if s.target_mm == -STEP_MM))
    _, reference, displacement = sinusoid(run)
    columns = run.columns
    degrees = max(peak(columns["rtd_x_degC"]), peak(columns["rtd_y_degC"]))
    amperes = max(peak(columns["i_meas_x_A"]), peak(columns["i_meas_y_A"]))
    counts = [status.counts for status in (paced, real) if not isinstance(status, str)]
    missed, samples = sum(c.missed for c in counts), sum(c.samples for c in counts)
    if isinstance(real, str):
        age = own_share = f"not measured: {real}"
    else:
        age, own_share = _spread(real.timing.setpoint_age), _spread(real.timing.own_share)
    return [
        (
            f"tracking R², {AMPLITUDE_MM:g} mm sinusoid of {PERIOD_S:g} s",
            f"{tracking_r2(reference, displacement):.4f}",
        ),
        (f"rise time, 0 → +{STEP_MM:g} mm", _seconds(up.rise_time_s)),
        (f"settling time (5 %), 0 → +{STEP_MM:g} mm", _seconds(up.settling_time_s)),
        (f"rise time, +{STEP_MM:g} → −{STEP_MM:g} mm", _seconds(down.rise_time_s)),
        (f"settling time (5 %), +{STEP_MM:g} → −{STEP_MM:g} mm", _seconds(down.settling_time_s)),
        ("peak temperature of a spring", f"{degrees:.1f} °C"),
        ("peak current, measured", f"{amperes:.2f} A"),
        ("setpoint age at the board: p50, p99, p99.9", age),
        ("the daemon's share: p50, p99, p99.9", own_share),
        ("missed samples", f"{missed} of {samples}"),
    ]


def beside(tables: Mapping[str, Rows]) -> Table:
    """Return the tables of several boards, by the board's name, as one."""
    first, *_ = tables.values()
    values = zip(*([value for _, value in rows] for rows in tables.values()), strict=True)
    rows = [(name, *row) for (name, _), row in zip(first, values, strict=True)]
    return Table(("quantity", *tables), rows)


def write(path: Path, run: Run, rows: Rows) -> None:
    """Write the self-contained HTML page."""
    page = Page(
        title="smad demo",
        lead="A simulated bench of antagonistic shape-memory springs, driven by the daemon.",
        facts=provenance(run),
        sections=[
            Section(
                "What was measured",
                [
                    Table(("quantity", "value"), rows),
                    Text(
                        "The cycle runs faster than the wall clock: the simulated board waits, "
                        "within bounds, for the setpoint that answers its last sample. The ages "
                        "were measured in a second run, in real time.",
                        kind="note",
                    ),
                ],
            ),
            Section("The whole run", [panels_of(run_parts([run]))]),
            Section("The sinusoid", [_close_up(run)]),
        ],
    )
    write_page(page, path)


def _close_up(run: Run) -> Panels:
    t, reference, displacement = sinusoid(run)
    columns = {"reference_mm": reference, "displacement_mm": displacement}
    return Panels([followed(t - t[0], columns)])


def _seconds(value: float) -> str:
    return "never" if np.isnan(value) else f"{value:.2f} s"


def _spread(part: Percentiles) -> str:
    return ", ".join(f"{us / 1e3:.2f}" for us in (part.p50_us, part.p99_us, part.p999_us)) + " ms"
