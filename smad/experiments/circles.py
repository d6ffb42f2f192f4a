"""The experiment six-axes: each segment draws a circle in turn, then all of them together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from smad.arrays import Array
from smad.counted import counted
from smad.errors import RunLogError
from smad.progress import Say
from smad.report.page import Page, Section, Table, Text
from smad.report.panels import Panel, Panels, Trace
from smad.report.planes import Curve, Plane, Quantity
from smad.robot.angles import circle
from smad.robot.kinematics import Robot
from smad.runlog.export import side_by_side
from smad.runlog.reader import Run, read_axes

if TYPE_CHECKING:
    from smad.api import Percentiles
    from smad.client import Client

TOGETHER = "together"
_MARK = "circle of "
_END = "circles end"
_WARM = "warm-up"


@dataclass(frozen=True)
class Tracking:
    """How well the tip of a segment followed its circle: angles over time, and their errors.

    `wanted_deg` and `actual_deg` are pitch and yaw, each of shape (n,), at `t_s`. The error is the
    distance of the two points in the plane of pitch and yaw.
    """

    segment: str
    phase: str
    t_s: Array
    wanted_deg: tuple[Array, Array]
    actual_deg: tuple[Array, Array]

    @property
    def error_deg(self) -> Array:
        """Distance from the wanted point, shape (n,)."""
        (p, y), (a, b) = self.wanted_deg, self.actual_deg
        return np.asarray(np.hypot(a - p, b - y))

    @property
    def rms_deg(self) -> float:
        """Root mean square of the error."""
        return float(np.sqrt(np.mean(self.error_deg**2)))

    @property
    def most_deg(self) -> float:
        """Largest error."""
        return float(np.max(self.error_deg))


def draw(
    bench: Client, robot: Robot, radius_deg: float, period_s: float, progress: Say
) -> tuple[Path, Percentiles]:
    """Carry it out on a bench that is not armed; return the run log and the skew of the begins.

    Arms, and disarms at the end. Raises what the client raises.
    """
    angles = circle(radius_deg, period_s=period_s)
    everybody = dict.fromkeys(robot.segments, angles)
    # The first circle warms the springs; what is compared begins equally warm.
    phases = {_WARM: everybody, **{name: {name: angles} for name in robot.segments}}
    phases[TOGETHER] = everybody
    bench.reset_timing()
    # Disarmed before the log is closed: a slow disk may take its time.
    with bench.record("six-axes") as status, bench.armed():
        for phase, of_segments in phases.items():
            bench.note(f"{_MARK}{phase}")
            bench.move(robot.moves(of_segments))
            bench.wait_until_done(lambda _, phase=phase: progress(f"{_MARK}{phase}"))  # type: ignore[misc]
        bench.note(_END)
        skew = bench.status().skew
    assert skew, "a bench of several axes has a skew"
    return Path(status.path), skew


def trackings(runs: Mapping[str, Run], robot: Robot) -> Iterator[Tracking]:
    """Yield how well each segment followed each of its circles in a log of `draw`.

    Raises RunLogError for a log of something else.
    """
    base = max(runs.values(), key=len)
    notes = [event for event in base.events if event.kind == "note"]
    marks = [e for e in notes if e.text.startswith(_MARK) or e.text == _END]
    if len(marks) < 2:
        raise RunLogError(
            f"{base.path} is not a log of six-axes",
            value=f"{len(marks)} marks",
            action="record one: smad run six-axes",
        )
    columns = side_by_side(runs).columns
    came_s = base.columns["host_time_s"]
    actual_mm = {a: np.asarray(columns[f"{a}.displacement_mm"], np.float64) for a in robot.axes}
    wanted_mm = {a: np.asarray(columns[f"{a}.reference_mm"], np.float64) for a in robot.axes}
    # An axis that follows nothing stands where it stands.
    held_mm = {a: np.where(np.isnan(mm), actual_mm[a], mm) for a, mm in wanted_mm.items()}
    wanted_deg, actual_deg = robot.angles_deg(held_mm), robot.angles_deg(actual_mm)
    for begin, end in pairwise(marks):
        assert begin.host_time_s is not None
        assert end.host_time_s is not None
        phase = begin.text.removeprefix(_MARK)
        inside = (came_s >= begin.host_time_s) & (came_s < end.host_time_s)
        drawn = {TOGETHER: tuple(robot.segments), _WARM: ()}.get(phase, (phase,))
        for segment in drawn:
            joints = robot.segments[segment]
            wanted, actual = wanted_deg[segment], actual_deg[segment]
            followed = np.isfinite(wanted_mm[joints.pitch] + wanted_mm[joints.yaw])
            valid = inside & followed & np.isfinite(actual[0] + actual[1])
            if valid.any():
                yield Tracking(
                    segment,
                    phase,
                    columns["t_s"][valid] - columns["t_s"][valid][0],
                    (wanted[0][valid], wanted[1][valid]),
                    (actual[0][valid], actual[1][valid]),
                )


def table(circles: list[Tracking]) -> Table:
    """Return the errors as a table: a row for each circle."""
    return Table(
        ("segment", "drawn", "error RMS °", "largest °", "samples"),
        [
            (
                t.segment,
                "together" if t.phase == TOGETHER else "alone",
                f"{t.rms_deg:.2f}",
                f"{t.most_deg:.2f}",
                str(len(t.t_s)),
            )
            for t in circles
        ],
        "Distance of the tip from its circle, in the plane of pitch and yaw",
        frozenset({2, 3, 4}),
    )


def page_of(log: Path, robot: Robot, skew: Percentiles) -> Page:
    """Return the page of a log. Raises RunLogError as `trackings` does."""
    circles = list(trackings(read_axes(log), robot))
    begins = (
        f"The boards began {skew.count} circles, each within {skew.max_us / 1000:.2f} ms on the "
        "computer's clock."
    )
    sections = [Section("Tracking", [table(circles), Text(begins)])]
    for tracking in circles:
        name = f"{tracking.segment}, {'together' if tracking.phase == TOGETHER else 'alone'}"
        sections.append(Section(name, [Panels(_panels(tracking), planes=[_plane(tracking)])]))
    return Page(
        "Six axes: circles of the segments",
        sections,
        "Each segment draws a circle with its tip, in turn and then all of them together.",
        (("run log", log.name),),
    )


def skew_in_words(skew: Percentiles) -> str:
    """How far apart the boards began, in one line."""
    return (
        f"{counted(skew.count, 'simultaneous start')}: {skew.p50_us / 1000:.2f} ms apart (median), "
        f"at most {skew.max_us / 1000:.2f} ms"
    )


def _plane(tracking: Tracking) -> Plane:
    """The way of the tip, as one looks at it from the front."""
    (p, y), (a, b) = tracking.wanted_deg, tracking.actual_deg
    across, up = (Quantity(name, "°", 1, 0.1) for name in ("yaw", "pitch"))
    wanted = Curve(label="reference", x=y, y=p, pen="reference", t=tracking.t_s, dash=(6, 4))
    actual = Curve(label="measured", x=b, y=a, pen="main", t=tracking.t_s)
    return Plane("Tip", across, up, [wanted, actual])


def _panels(tracking: Tracking) -> list[Panel]:
    panels = []
    for k, joint in enumerate(("Pitch", "Yaw")):
        wanted = Trace("reference", tracking.t_s, tracking.wanted_deg[k], "reference", dash=(6, 4))
        panels.append(
            Panel(
                joint,
                "°",
                1,
                [wanted, Trace("measured", tracking.t_s, tracking.actual_deg[k], "main")],
            )
        )
    panels.append(
        Panel("Error", "°", 2, [Trace("distance", tracking.t_s, tracking.error_deg, "main")])
    )
    return panels
