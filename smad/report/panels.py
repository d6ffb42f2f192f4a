"""Plots that answer: panels in a page that zoom and say the values under the pointer.

Pure. A `Panels` block is drawn in the browser by `smad/style/static/panels.js`; all of it stands in
the page, which needs no network.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np

from smad.arrays import Array
from smad.report.planes import Plane, described
from smad.style.decimation import Decimation
from smad.style.palette import checked_colour

MOST_POINTS = 12_000
"""Points of a trace that a page holds; of a longer one each stretch keeps its extremes."""
_X_DIGITS = 4
_MORE_DIGITS = 1


@dataclass(frozen=True)
class Trace:
    """A line of a panel: `x` and `y` of shape (n,), NaN in `y` where nothing was recorded.

    `x` does not decrease. `pen` is a colour of `smad.style.palette`; `group` the run it
    belongs to, where several are overlaid. `dash` are the lengths of line and gap in pixels.
    """

    label: str
    x: Array
    y: Array
    pen: str
    group: str = ""
    dash: tuple[int, ...] = ()


@dataclass(frozen=True)
class Panel:
    """Traces that share an axis of their own. `on_demand`: shown when asked for."""

    title: str
    unit: str
    digits: int
    traces: Sequence[Trace]
    on_demand: bool = False


def followed(t_s: Array, columns: Mapping[str, Array], title: str = "Displacement") -> Panel:
    """The displacement over its reference, both of the run log's columns, of shape (n,)."""
    return Panel(
        title,
        "mm",
        2,
        [
            Trace("reference", t_s, columns["reference_mm"], "reference", dash=(6, 4)),
            Trace("measured", t_s, columns["displacement_mm"], "main"),
        ],
    )


@dataclass(frozen=True)
class Mark:
    """A line across all panels, at `x`, and what happened there."""

    x: float
    text: str


@dataclass(frozen=True)
class Panels:
    """A block of panels over one axis `x_label`; they zoom together, and `planes` with them.

    Of traces in one panel the later are drawn over the earlier.
    """

    panels: Sequence[Panel]
    x_label: str = "time (s)"
    caption: str = ""
    marks: Sequence[Mark] = field(default_factory=tuple)
    planes: Sequence[Plane] = field(default_factory=tuple)

    def as_json(self) -> str:
        """What the page draws, as JSON that may stand in a script element."""
        text: str = msgspec.json.encode(self._described()).decode()
        # "</script>" in a name would end the element; in JSON "<" may be written as a number.
        return text.replace("<", "\\u003c")

    def _described(self) -> dict[str, Any]:
        axes = _Axes()
        planes, values = described(self.planes)
        panels = [
            {
                "title": panel.title,
                "unit": panel.unit,
                "digits": panel.digits,
                "on_demand": panel.on_demand,
                "traces": [axes.describe(trace, panel.digits) for trace in panel.traces],
            }
            for panel in self.panels
        ]
        return {
            "x_label": self.x_label,
            "xs": axes.xs,
            "panels": panels,
            "planes": planes,
            "values": values,
            "marks": [{"x": round(mark.x, _X_DIGITS), "text": mark.text} for mark in self.marks],
        }


class _Axes:
    """The distinct x of a block: traces of one run share theirs, in the page too."""

    def __init__(self) -> None:
        self.xs: list[list[float]] = []
        self._cuts: dict[int, tuple[int, Decimation]] = {}

    def describe(self, trace: Trace, digits: int) -> dict[str, Any]:
        if id(trace.x) not in self._cuts:
            cut = Decimation(trace.x, MOST_POINTS)
            self._cuts[id(trace.x)] = (len(self.xs), cut)
            self.xs.append(np.round(cut.x, _X_DIGITS).tolist())
        place, cut = self._cuts[id(trace.x)]
        return {
            "label": trace.label,
            "group": trace.group,
            "pen": checked_colour(trace.pen),
            "dash": trace.dash,
            "x": place,
            # NaN becomes null.
            "y": np.round(cut.thinned(trace.y), digits + _MORE_DIGITS).tolist(),
        }
