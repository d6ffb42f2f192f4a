"""One quantity against another: the hysteresis of a run, its cycles coloured by their number.

Pure. Planes are part of a `Panels` block; a zoom of its panels in time shows the same stretch in
them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smad.arrays import Array
from smad.runlog.cycles import TURN_K, TURN_MM, Cycles
from smad.style.decimation import pauses, stride
from smad.style.palette import checked_colour

MOST_POINTS = 12_000
"""Samples of a curve that a page holds; of a longer one every second, third, … stays."""
_T_DIGITS = 2
_MORE_DIGITS = 1


@dataclass(frozen=True)
class Quantity:
    """What an axis shows. A run in which it covers less than `moves` does not move in it."""

    label: str
    unit: str
    digits: int
    moves: float


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve of a plane: `x` and `y` of shape (n,), NaN where nothing was recorded.

    `t` is the time of each point, `cycle` its number from 1 on; either may be missing. `pen` is a
    colour of `smad.style.palette`, for what has no cycles. `group` is the run, where several are
    overlaid; `dash` are the lengths of line and gap in pixels.
    """

    label: str
    x: Array
    y: Array
    pen: str
    t: Array | None = None
    cycle: NDArray[np.int64] | None = None
    group: str = ""
    dash: tuple[int, ...] = ()


@dataclass(frozen=True)
class Plane:
    """Curves over two quantities. Of several the later are drawn over the earlier."""

    title: str
    x: Quantity
    y: Quantity
    curves: Sequence[Curve]


QUANTITIES: Mapping[str, Quantity] = {
    "displacement_mm": Quantity("displacement", "mm", 2, 0.1),
    "force_N": Quantity("tendon force", "N", 2, 0.05),
    "rtd_x_degC": Quantity("temperature of X", "°C", 1, 1.0),
    "rtd_y_degC": Quantity("temperature of Y", "°C", 1, 1.0),
}
"""What can be set against each other, by column of the run log."""
AGAINST = (
    ("displacement_mm", "rtd_x_degC"),
    ("displacement_mm", "rtd_y_degC"),
    ("force_N", "displacement_mm"),
)
"""Pairs (y, x) that a run is shown in."""
BLOCKED = (("force_N", "rtd_x_degC"), ("force_N", "rtd_y_degC"))
"""Pairs of a run whose displacement stays where it is."""
_CYCLED = (("displacement_mm", TURN_MM), ("rtd_x_degC", TURN_K))
"""The first of these signals that moves by its turn defines the cycles of a run."""


def planes_of(runs: Sequence[tuple[str, str, Array, Mapping[str, Any]]]) -> list[Plane]:
    """Return the planes of runs, each given as name, colour, time of shape (n,) and columns.

    A plane of which nothing moves in any run is left out. One run has its cycles coloured by their
    number, several their own colours.
    """
    alone = len(runs) == 1
    cycles = [cycles_of(columns) if alone else None for _, _, _, columns in runs]
    still = not any(_moves(columns, "displacement_mm") for _, _, _, columns in runs)
    planes = []
    for y, x in BLOCKED if still else AGAINST:
        curves = [
            Curve(
                label=name,
                x=_column(columns, x),
                y=_column(columns, y),
                pen=pen,
                t=t_s,
                cycle=cycle,
                group="" if alone else name,
            )
            for (name, pen, t_s, columns), cycle in zip(runs, cycles, strict=True)
            if _moves(columns, x) and _moves(columns, y)
        ]
        if curves:
            above, along = QUANTITIES[y], QUANTITIES[x]
            title = f"{above.label[0].upper()}{above.label[1:]} against {along.label}"
            planes.append(Plane(title, along, above, curves))
    return planes


def cycles_of(columns: Mapping[str, Any]) -> NDArray[np.int64]:
    """Return the number of the cycle that each sample belongs to, shape (n,), from 1 on.

    The rule is that of the live page (`smad.runlog.cycles`), on the displacement or, where that
    does not move, on the temperature of X.
    """
    for name, turn in _CYCLED:
        signal = _column(columns, name)
        finite = signal[np.isfinite(signal)]
        if finite.size and float(np.ptp(finite)) > turn:
            cycles = Cycles(turn)
            return np.array([cycles.add(value) for value in signal.tolist()], np.int64) + 1
    return np.ones(len(columns["t_s"]), np.int64)


def described(planes: Sequence[Plane]) -> tuple[list[dict[str, Any]], list[list[float]]]:
    """Return the planes for a page, and the values that their curves name by place.

    Values are thinned by leaving samples out, so that those of one moment stay together. A pause
    in time breaks the curve.
    """
    values = _Values()
    return [
        {
            "title": plane.title,
            "x": plane.x,
            "y": plane.y,
            "curves": [values.describe(curve, plane) for curve in plane.curves],
        }
        for plane in planes
    ], values.lists


class _Values:
    """The distinct columns of a block: a displacement stands in the page once."""

    def __init__(self) -> None:
        self.lists: list[list[float]] = []
        self._places: dict[int, tuple[int, Any]] = {}

    def describe(self, curve: Curve, plane: Plane) -> dict[str, Any]:
        step = stride(curve.x.size, MOST_POINTS)
        breaks = np.zeros(0, np.int64)
        if curve.t is not None:
            breaks = np.unique(-(-pauses(curve.t) // step))
            breaks = breaks[breaks < -(-curve.x.size // step)]
        return {
            "label": curve.label,
            "pen": checked_colour(curve.pen),
            "group": curve.group,
            "dash": curve.dash,
            "x": self._place(curve.x, step, plane.x.digits + _MORE_DIGITS, breaks),
            "y": self._place(curve.y, step, plane.y.digits + _MORE_DIGITS, breaks),
            "t": self._place(curve.t, step, _T_DIGITS, breaks, broken=False),
            "cycle": self._place(curve.cycle, step, 0, breaks, broken=False),
        }

    def _place(
        self,
        column: Any,
        step: int,
        digits: int,
        breaks: NDArray[np.int64],
        *,
        broken: bool = True,
    ) -> int | None:
        """The place of a column with a point more at each break: NaN, or the value before it."""
        if column is None:
            return None
        if id(column) not in self._places:
            # The column is kept, so that no other gets its id.
            self._places[id(column)] = (len(self.lists), column)
            points = np.round(column[::step], digits)
            at_breaks = np.nan if broken else points[breaks - 1]
            self.lists.append(np.insert(points, breaks, at_breaks).tolist())
        return self._places[id(column)][0]


def _moves(columns: Mapping[str, Any], name: str) -> bool:
    signal = _column(columns, name)
    finite = signal[np.isfinite(signal)]
    return finite.size > 1 and float(np.ptp(finite)) >= QUANTITIES[name].moves


def _column(columns: Mapping[str, Any], name: str) -> Array:
    """The column as float64, the same object for the same column; NaN without one."""
    column = columns.get(name)
    if column is None:
        return np.full(len(columns["t_s"]), np.nan)
    return np.asarray(column, np.float64)
